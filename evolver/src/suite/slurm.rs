//! Slurm: a job array whose tasks are shares of a suite's runs.
//!
//! Tasks do not communicate; a task that is requeued or runs twice determines from the files which
//! runs are complete.

use super::cluster::{Job, SCRIPT};
use minimal_surprise_evolution::files::FileError;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Log file of a task, relative to the folder from which the array is submitted: Slurm does not
/// accept every path in a script.
const LOG: &str = "log-%a.txt";

/// The reason why a job could not be submitted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The path contains characters that have a special meaning for Slurm in the path of a log.
    #[error("{}: Slurm cannot write logs below a directory with % or \\ in its path; choose a different directory with --out", .0.display())]
    UnusablePath(PathBuf),
    /// `sbatch` is not installed or cannot be started.
    #[error("sbatch cannot be started ({0}); is this a login node of a Slurm cluster?")]
    NoSbatch(io::Error),
    /// Slurm rejected the job.
    #[error("sbatch rejected the job: {said}{}", at_most(*.shards, *.array_max))]
    Refused {
        /// The message from `sbatch`.
        said: String,
        /// Number of requested tasks.
        shards: u32,
        /// Maximum number of tasks that this cluster accepts, if known and smaller than `shards`.
        array_max: Option<u32>,
    },
}

fn at_most(shards: u32, array_max: Option<u32>) -> String {
    array_max.map_or(String::new(), |most| {
        format!(
            "\n--shards = {shards}: this cluster accepts 1 to {most} ({most} is its MaxArraySize)"
        )
    })
}

/// Returns the job script of the next submission.
///
/// # Errors
/// [`SubmitError::UnusablePath`] if Slurm cannot use the directory's path for logs.
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

/// Writes the files that the tasks need and submits the array; returns the output of `sbatch`.
///
/// # Errors
/// [`SubmitError`] if Slurm cannot use the path, a file cannot be written, `sbatch` cannot be
/// started, or Slurm rejects the job. In the last two cases, the submission's folder is removed.
pub fn submit(job: &Job<'_>, suite_text: &str) -> Result<String, SubmitError> {
    check_path(job)?;
    let folder = job.write(suite_text, |folder| script_in(job, folder))?;
    let submitted = submit_from(job, &folder);
    if submitted.is_err() {
        // The folder is no longer needed; failure to remove it is ignored.
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

/// Queries the maximum number of tasks in an array, since `sbatch` does not report it when it
/// rejects a larger array.
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
