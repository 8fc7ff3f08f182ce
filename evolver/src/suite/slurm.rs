//! Slurm: one job array whose tasks are shares of a suite's runs.
//!
//! The program and the suite are copied into the suite's directory at submission, so that a task
//! that waits in the queue does not meet edited ones. Tasks tell each other nothing; one that is
//! requeued, or runs twice, finds what is done by its files.

use crate::files::{self, FileError};
use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;

/// The suite's copy in its directory.
pub const SUITE_FILE: &str = "suite.toml";
/// The program's copy.
const PROGRAM: &str = "evolver";
/// The job script.
const SCRIPT: &str = "job.sh";

/// A job array.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Name of the suite.
    pub name: &'a str,
    /// The suite's directory, absolute.
    pub directory: &'a Path,
    /// Tasks.
    pub shards: u32,
    /// Most tasks at once.
    pub at_once: Option<u32>,
    /// Flags that choose the runs.
    pub flags: Vec<String>,
}

/// The job could not be submitted.
#[derive(Debug, thiserror::Error)]
pub enum SubmitError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// There is no `sbatch`.
    #[error("sbatch cannot be started ({0}); is this a login node of a Slurm cluster?")]
    NoSbatch(io::Error),
    /// Slurm refused the job.
    #[error("sbatch refused the job: {0}")]
    Refused(String),
}

impl Job<'_> {
    /// The job script.
    #[must_use]
    pub fn script(&self) -> String {
        let directory = quoted(&self.directory.to_string_lossy());
        let at_once = self.at_once.map_or(String::new(), |n| format!("%{n}"));
        let flags: Vec<String> = self.flags.iter().map(|flag| quoted(flag)).collect();
        format!(
            "#!/bin/sh\n\
             #SBATCH --job-name={name}\n\
             #SBATCH --array=0-{last}{at_once}\n\
             #SBATCH --cpus-per-task=1\n\
             #SBATCH --requeue\n\
             #SBATCH --open-mode=append\n\
             #SBATCH --output={output}/log-%a.txt\n\
             exec {directory}/{PROGRAM} run-task --shard \"$SLURM_ARRAY_TASK_ID/{shards}\" \
             --out {directory} --threads 1 --progress lines {flags}\n",
            name = self.name.replace(char::is_whitespace, "-"),
            last = self.shards - 1,
            output = self.directory.to_string_lossy().replace(' ', "\\ "),
            shards = self.shards,
            flags = flags.join(" "),
        )
    }

    /// Writes what the tasks need and submits the array; what `sbatch` says comes back.
    ///
    /// # Errors
    /// [`SubmitError`] if a file cannot be written or Slurm does not take the job.
    pub fn submit(&self, suite_text: &str) -> Result<String, SubmitError> {
        fs::create_dir_all(self.directory).map_err(FileError::at(self.directory))?;
        files::replace(&self.directory.join(SUITE_FILE), suite_text.as_bytes())?;
        let program = self.directory.join(PROGRAM);
        // Beside and renamed: an earlier submission's tasks may be running the copy.
        let beside = self.directory.join(format!(".{PROGRAM}.part"));
        std::env::current_exe()
            .and_then(|this| fs::copy(this, &beside))
            .and_then(|_| fs::rename(&beside, &program))
            .map_err(FileError::at(&program))?;
        let script = self.directory.join(SCRIPT);
        files::replace(&script, self.script().as_bytes())?;
        let output = Command::new("sbatch")
            .arg(&script)
            .output()
            .map_err(SubmitError::NoSbatch)?;
        if output.status.success() {
            Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
        } else {
            let said = String::from_utf8_lossy(&output.stderr);
            Err(SubmitError::Refused(said.trim().to_owned()))
        }
    }
}

/// A word for the shell.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_script_runs_the_copied_program_on_its_share() {
        let job = Job {
            name: "own suite",
            directory: Path::new("/data/it's here"),
            shards: 8,
            at_once: Some(3),
            flags: vec!["--runs".to_owned(), "2".to_owned()],
        };
        let script = job.script();
        assert!(script.contains("#SBATCH --array=0-7%3\n"), "{script}");
        assert!(
            script.contains("#SBATCH --job-name=own-suite\n"),
            "{script}"
        );
        assert!(
            script.contains("'/data/it'\\''s here'/evolver run-task"),
            "{script}"
        );
        assert!(
            script.contains("--shard \"$SLURM_ARRAY_TASK_ID/8\""),
            "{script}"
        );
        assert!(script.ends_with("'--runs' '2'\n"), "{script}");
    }
}
