//! Work: doing the runs of a plan that are not done.
//!
//! Files in the suite's directory are the only truth: a run is done when its directory has `DONE`.
//! Any number of processes may work on the same plan; each takes runs that no other holds.

use super::plan::{Plan, PlannedRun};
use crate::evolving::until_finished;
use crate::experiment::Experiment;
use crate::run_dir::{Found, RunDir, RunDirError};
use minimal_surprise_sim::{Engine, Path as CodePath};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A share of the runs: every n-th from the i-th on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which share, from 0.
    pub index: u32,
    /// Number of shares.
    pub of: u32,
}

impl Shard {
    /// All runs.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// A shard written as `i/n`, i from 0.
    ///
    /// # Errors
    /// What would be valid.
    pub fn parse(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if index < of => Ok(Self { index, of }),
            _ => Err("expected i/n with i from 0 to n − 1, as in 0/8".to_owned()),
        }
    }

    /// Where the hashes of the share's runs are written once all are done.
    #[must_use]
    pub fn hashes_file(self) -> String {
        match self.of {
            1 => "hashes.txt".to_owned(),
            of => format!("hashes-{}-of-{of}.txt", self.index),
        }
    }

    /// The runs of this share.
    #[must_use]
    pub fn of_plan(self, plan: &Plan) -> Vec<&PlannedRun> {
        let runs = plan.runs().into_iter().enumerate();
        runs.filter(|(place, _)| place % self.of as usize == self.index as usize)
            .map(|(_, run)| run)
            .collect()
    }
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Nothing is there.
    Pending,
    /// It has begun.
    Begun,
    /// It is complete.
    Done,
}

/// How far a run is, by its files.
#[must_use]
pub fn progress(run: &PlannedRun, suite: &Path) -> Progress {
    let directory = run.directory(suite);
    if directory.join("DONE").is_file() {
        Progress::Done
    } else if directory.is_dir() {
        Progress::Begun
    } else {
        Progress::Pending
    }
}

/// What became of a run that was to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worked {
    /// It is complete now.
    Completed,
    /// Another process has it.
    Elsewhere,
    /// It was interrupted, and can be gone on with.
    Interrupted,
}

/// Does a run, from where it is. `each_generation` is told the number of generations done.
///
/// # Errors
/// [`RunDirError`] if the directory cannot be used.
pub fn work_on(
    run: &PlannedRun,
    suite: &Path,
    stop: &AtomicBool,
    mut each_generation: impl FnMut(u32),
) -> Result<Worked, RunDirError> {
    let directory = run.directory(suite);
    let (mut experiment, held) = match open(run, &directory) {
        Ok(Some(opened)) => opened,
        Ok(None) => return Ok(Worked::Completed),
        Err(RunDirError::InUse(_)) => return Ok(Worked::Elsewhere),
        Err(error) => return Err(error),
    };
    let path = CodePath::from_environment().unwrap_or_else(|_| CodePath::best());
    let finished = until_finished(
        &mut experiment,
        &held,
        (Engine::Fast, path),
        stop,
        |record| {
            each_generation(record.generation + 1);
        },
    )?;
    if !finished {
        return Ok(Worked::Interrupted);
    }
    let finding = experiment
        .finding()
        .expect("a trial fits its own grid")
        .expect("an evolution has at least one generation");
    held.finish(&experiment, &finding)?;
    Ok(Worked::Completed)
}

/// The run as it stands, held by this process; none if it is complete.
fn open(run: &PlannedRun, directory: &Path) -> Result<Option<(Experiment, RunDir)>, RunDirError> {
    for _ in 0..2 {
        match RunDir::open(directory) {
            Ok(Found::Finished(_)) => return Ok(None),
            Ok(Found::Unfinished(experiment, held)) => return Ok(Some((*experiment, held))),
            Err(RunDirError::NotARun { .. }) => {}
            Err(error) => return Err(error),
        }
        let experiment = Experiment::new(run.settings.clone());
        match RunDir::create(directory, &experiment) {
            Ok(held) => return Ok(Some((experiment, held))),
            // Another process has just made it.
            Err(RunDirError::Exists(_)) => {}
            Err(error) => return Err(error),
        }
    }
    Err(RunDirError::InUse(directory.to_owned()))
}
