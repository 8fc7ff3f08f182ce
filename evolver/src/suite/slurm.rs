//! Slurm: one job array whose tasks are shares of a suite's runs.
//!
//! Every submission has a folder of its own in the suite's directory, with copies of the program
//! and the suite: a task that waits in the queue meets neither edited ones nor those of a later
//! submission. Tasks tell each other nothing; one that is requeued, or runs twice, finds what is
//! done by its files.

use minimal_surprise_evolution::files::{self, FileError};
use minimal_surprise_evolution::new_dir::{NewDir, remove_abandoned};
use minimal_surprise_evolution::text::{shell_path, shell_word};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folder of the submissions, in the suite's directory; each has a number.
const JOBS: &str = "jobs";
/// The suite's copy.
const SUITE_FILE: &str = "suite.toml";
/// The program's copy.
const PROGRAM: &str = "evolver";
/// The job script.
const SCRIPT: &str = "job.sh";
/// What a task says, in the folder that the array is submitted from: Slurm would not take every
/// path in a script.
const LOG: &str = "log-%a.txt";

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
#[non_exhaustive]
pub enum SubmitError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Slurm takes these characters for its own in the path of a log.
    #[error("{}: Slurm writes no logs below a directory with % or \\ in its path; name another with --out", .0.display())]
    UnusablePath(PathBuf),
    /// There is no `sbatch`.
    #[error("sbatch cannot be started ({0}); is this a login node of a Slurm cluster?")]
    NoSbatch(io::Error),
    /// Slurm refused the job.
    #[error("sbatch refused the job: {said}{}", at_most(*.shards, *.array_max))]
    Refused {
        /// What it said.
        said: String,
        /// Tasks asked for.
        shards: u32,
        /// Most tasks that this cluster takes, where that is known and less.
        array_max: Option<u32>,
    },
}

fn at_most(shards: u32, array_max: Option<u32>) -> String {
    array_max.map_or(String::new(), |most| {
        format!("\n--shards = {shards}: this cluster takes from 1 to {most} (its MaxArraySize)")
    })
}

impl Job<'_> {
    /// The job script of the next submission.
    ///
    /// # Errors
    /// [`SubmitError::UnusablePath`].
    pub fn script(&self) -> Result<String, SubmitError> {
        self.check_path()?;
        Ok(self.script_in(&self.next_folder()))
    }

    /// The folder of the next submission.
    fn next_folder(&self) -> PathBuf {
        let jobs = self.directory.join(JOBS);
        let mut next = (1_u32..).map(|number| jobs.join(number.to_string()));
        let free = next.find(|folder| folder.symlink_metadata().is_err());
        free.expect("there are more numbers than folders")
    }

    fn check_path(&self) -> Result<(), SubmitError> {
        if self.directory.to_string_lossy().contains(['%', '\\']) {
            return Err(SubmitError::UnusablePath(self.directory.to_owned()));
        }
        Ok(())
    }

    fn script_in(&self, folder: &Path) -> String {
        let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        let at_once = self.at_once.map_or(String::new(), |n| format!("%{n}"));
        let flags: String = self
            .flags
            .iter()
            .map(|flag| format!(" {}", shell_word(flag)))
            .collect();
        format!(
            "#!/bin/sh\n\
             #SBATCH --job-name={name}\n\
             #SBATCH --array=0-{last}{at_once}\n\
             #SBATCH --cpus-per-task=1\n\
             #SBATCH --requeue\n\
             #SBATCH --open-mode=append\n\
             #SBATCH --output={LOG}\n\
             exec {program} run-task --shard \"$SLURM_ARRAY_TASK_ID/{shards}\" \
             --suite {suite} --out {directory} --threads 1 --progress lines{flags}\n",
            name = self.name.replace(|c| !plain(c), "-"),
            last = self.shards - 1,
            program = shell_path(&folder.join(PROGRAM)),
            suite = shell_path(&folder.join(SUITE_FILE)),
            directory = shell_path(self.directory),
            shards = self.shards,
        )
    }

    /// Writes what the tasks need and submits the array; what `sbatch` says comes back.
    ///
    /// # Errors
    /// [`SubmitError`] if a file cannot be written or Slurm does not take the job; nothing of it is
    /// left then.
    pub fn submit(&self, suite_text: &str) -> Result<String, SubmitError> {
        self.check_path()?;
        remove_abandoned(&self.directory.join(JOBS));
        let folder = loop {
            let folder = self.next_folder();
            match self.write(&folder, suite_text) {
                // Another submission has taken the number meanwhile.
                Err(error) if error.is_exists() => {}
                written => break written.map(|()| folder)?,
            }
        };
        let submitted = self.submit_from(&folder);
        if submitted.is_err() {
            // No task reads it; failure to remove it is ignored.
            let _ = fs::remove_dir_all(&folder);
        }
        submitted
    }

    /// Writes what the tasks need into a new folder.
    fn write(&self, folder: &Path, suite_text: &str) -> Result<(), FileError> {
        let new = NewDir::beside(folder)?;
        let program = new.path().join(PROGRAM);
        let script = self.script_in(folder);
        files::replace(&new.path().join(SUITE_FILE), suite_text.as_bytes())
            .and_then(|()| files::replace(&new.path().join(SCRIPT), script.as_bytes()))
            .and_then(|()| {
                let copied = std::env::current_exe().and_then(|this| fs::copy(this, &program));
                copied.map(drop).map_err(FileError::at(&program))
            })
            .map_err(|error| new.in_place(error))?;
        new.publish()
    }

    fn submit_from(&self, folder: &Path) -> Result<String, SubmitError> {
        let output = Command::new("sbatch")
            .arg(SCRIPT)
            .current_dir(folder)
            .output()
            .map_err(SubmitError::NoSbatch)?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned());
        }
        Err(SubmitError::Refused {
            said: String::from_utf8_lossy(&output.stderr).trim().to_owned(),
            shards: self.shards,
            array_max: array_max().filter(|&most| self.shards > most),
        })
    }
}

/// Most tasks of an array on this cluster: Slurm does not say so when it refuses more.
fn array_max() -> Option<u32> {
    let output = Command::new("scontrol").args(["show", "config"]).output();
    let config = String::from_utf8_lossy(&output.ok()?.stdout).into_owned();
    let line = config.lines().find(|line| line.starts_with("MaxArraySize"));
    line?.split('=').nth(1)?.trim().parse().ok()
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
        let script = job.script_in(Path::new("/data/it's here/jobs/1"));
        assert!(script.contains("#SBATCH --array=0-7%3\n"), "{script}");
        assert!(
            script.contains("#SBATCH --job-name=own-suite\n"),
            "{script}"
        );
        assert!(
            script.contains("exec '/data/it'\\''s here/jobs/1/evolver' run-task"),
            "{script}"
        );
        assert!(
            script.contains("--shard \"$SLURM_ARRAY_TASK_ID/8\""),
            "{script}"
        );
        assert!(script.ends_with("--runs 2\n"), "{script}");
    }
}
