//! Jobs for a cluster. Each submission has a separate folder in the suite's directory, with copies
//! of the program and the suite, so that later edits and submissions do not affect tasks waiting in
//! the queue.

use minimal_surprise_evolution::files::{self, FileError};
use minimal_surprise_evolution::new_dir::{NewDir, remove_abandoned};
use minimal_surprise_evolution::text::{shell_path, shell_word};
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of the numbered submissions, in the suite's directory.
const JOBS: &str = "jobs";
/// File name of the copy of the suite.
const SUITE_FILE: &str = "suite.toml";
/// File name of the program's copy.
const PROGRAM: &str = "evolver";
/// File name of the job script.
pub(super) const SCRIPT: &str = "job.sh";

/// Runs of a suite as tasks of a cluster.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Name of the suite.
    pub name: &'a str,
    /// Absolute path of the suite's directory.
    pub directory: &'a Path,
    /// Number of tasks.
    pub shards: u32,
    /// Maximum number of tasks that run at the same time.
    pub at_once: Option<u32>,
    /// Flags that choose the runs.
    pub flags: Vec<String>,
}

impl Job<'_> {
    /// Returns the folder of the next submission.
    pub(super) fn next_folder(&self) -> PathBuf {
        let jobs = self.directory.join(JOBS);
        let mut next = (1_u32..).map(|number| jobs.join(number.to_string()));
        let free = next.find(|folder| folder.symlink_metadata().is_err());
        free.expect("a free number exists")
    }

    /// Returns the command for one task; `shard` is the task's index in shell syntax.
    pub(super) fn command(&self, folder: &Path, shard: &str) -> String {
        let flags = self
            .flags
            .iter()
            .map(|flag| format!(" {}", shell_word(flag)));
        format!(
            "{program} run-task --shard \"{shard}/{shards}\" --suite {suite} --out {directory} \
             --threads 1 --progress lines{flags}",
            program = shell_path(&folder.join(PROGRAM)),
            suite = shell_path(&folder.join(SUITE_FILE)),
            directory = shell_path(self.directory),
            shards = self.shards,
            flags = flags.collect::<String>(),
        )
    }

    /// Creates the folder of a new submission, and writes to it the files that the tasks need.
    pub(super) fn write(
        &self,
        suite_text: &str,
        script: impl Fn(&Path) -> String,
    ) -> Result<PathBuf, FileError> {
        remove_abandoned(&self.directory.join(JOBS));
        loop {
            let folder = self.next_folder();
            match write(&folder, suite_text, &script(&folder)) {
                // A concurrent submission has taken the number; try the next.
                Err(error) if error.is_exists() => {}
                written => return written.map(|()| folder),
            }
        }
    }
}

fn write(folder: &Path, suite_text: &str, script: &str) -> Result<(), FileError> {
    let new = NewDir::beside(folder)?;
    let program = new.path().join(PROGRAM);
    files::replace(&new.path().join(SUITE_FILE), suite_text.as_bytes())
        .and_then(|()| files::replace(&new.path().join(SCRIPT), script.as_bytes()))
        .and_then(|()| {
            let copied = std::env::current_exe().and_then(|this| fs::copy(this, &program));
            copied.map(drop).map_err(FileError::at(&program))
        })
        .map_err(|error| new.in_place(error))?;
    new.publish()
}
