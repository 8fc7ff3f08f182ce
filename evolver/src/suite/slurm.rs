//! Slurm: one job array whose tasks are shares of a suite's runs.
//!
//! Tasks do not talk to each other; one that is requeued, or runs twice, finds by the files what is
//! done.

use super::cluster::{Job, SCRIPT};
use minimal_surprise_evolution::files::FileError;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The output of a task, in the folder that the array is submitted from: Slurm does not accept every
/// path in a script.
const LOG: &str = "log-%a.txt";

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
        /// Maximum number of tasks that this cluster takes, where that is known and less.
        array_max: Option<u32>,
    },
}

fn at_most(shards: u32, array_max: Option<u32>) -> String {
    array_max.map_or(String::new(), |most| {
        format!("\n--shards = {shards}: this cluster takes from 1 to {most} (its MaxArraySize)")
    })
}

/// The job script of the next submission.
///
/// # Errors
/// [`SubmitError::UnusablePath`].
pub fn script(job: &Job<'_>) -> Result<String, SubmitError> {
    check_path(job)?;
    Ok(script_in(job, &job.next_folder()))
}

fn check_path(job: &Job<'_>) -> Result<(), SubmitError> {
    if job.directory.to_string_lossy().contains(['%', '\\']) {
        return Err(SubmitError::UnusablePath(job.directory.to_owned()));
    }
    Ok(())
}

fn script_in(job: &Job<'_>, folder: &Path) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    let at_once = job.at_once.map_or(String::new(), |n| format!("%{n}"));
    format!(
        "#!/bin/sh\n\
         #SBATCH --job-name={name}\n\
         #SBATCH --array=0-{last}{at_once}\n\
         #SBATCH --cpus-per-task=1\n\
         #SBATCH --requeue\n\
         #SBATCH --open-mode=append\n\
         #SBATCH --output={LOG}\n\
         exec {command}\n",
        name = job.name.replace(|c| !plain(c), "-"),
        last = job.shards - 1,
        command = job.command(folder, "$SLURM_ARRAY_TASK_ID"),
    )
}

/// Writes what the tasks need and submits the array; returns what `sbatch` prints.
///
/// # Errors
/// [`SubmitError`] if a file cannot be written or Slurm refuses the job; nothing of it is left then.
pub fn submit(job: &Job<'_>, suite_text: &str) -> Result<String, SubmitError> {
    check_path(job)?;
    let folder = job.write(suite_text, |folder| script_in(job, folder))?;
    let submitted = submit_from(job, &folder);
    if submitted.is_err() {
        // No task reads it; failure to remove it is ignored.
        let _ = fs::remove_dir_all(&folder);
    }
    submitted
}

fn submit_from(job: &Job<'_>, folder: &Path) -> Result<String, SubmitError> {
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
        shards: job.shards,
        array_max: array_max().filter(|&most| job.shards > most),
    })
}

/// Maximum number of tasks of an array on this cluster: Slurm does not report it when it refuses more.
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
        let script = script_in(&job, Path::new("/data/it's here/jobs/1"));
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
