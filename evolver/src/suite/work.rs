//! Work: doing the runs of a plan that are not done.
//!
//! Files in the suite's directory are the only truth: a run is done when its directory has `DONE`
//! and what belongs to it.
//! Any number of processes may work on the same plan; each takes runs that no other holds.

use super::plan::{Plan, PlannedRun, Runs};
use crate::program::this_program;
use minimal_surprise_evolution::evolving::until_finished;
use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::files;
use minimal_surprise_evolution::finished_run::{Progress, ReadRunError, complete};
use minimal_surprise_evolution::lock::Holder;
use minimal_surprise_evolution::run_dir::{Opened, RunDir, RunDirError};
use minimal_surprise_sim::{Engine, EnginePath};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::Duration;

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

    /// Returns where the hashes of the share's runs are written once all are done.
    #[must_use]
    pub fn hashes_file(self) -> String {
        match self.of {
            1 => "hashes.txt".to_owned(),
            of => format!("hashes-{}-of-{of}.txt", self.index),
        }
    }

    /// The runs of this share.
    #[must_use]
    pub fn of_plan(self, plan: &Plan) -> Runs<'_> {
        plan.share(self.index, self.of)
    }
}

/// Returns how far a run is, by its files.
///
/// # Errors
/// [`ReadRunError::Damaged`] if it is marked complete, and is not.
pub fn progress(run: &PlannedRun, suite: &Path) -> Result<Progress, ReadRunError> {
    let directory = run.directory(suite);
    Ok(if complete(&directory)?.is_some() {
        Progress::Done
    } else if files::exists(&directory)? {
        Progress::Begun
    } else {
        Progress::Pending
    })
}

/// The result of work on a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It is complete now.
    Completed,
    /// Another process has it; its lock may say which.
    Held(Option<Holder>),
    /// It was interrupted, and can be resumed.
    Interrupted,
}

/// Waiting for runs that other processes have, or for the end of those processes.
#[derive(Debug)]
pub struct Waiting {
    pause: Duration,
    said_of: String,
}

impl Waiting {
    /// The first pause; each is twice as long as the one before.
    const PAUSE_MIN: Duration = Duration::from_millis(10);
    /// The longest pause.
    const PAUSE_MAX: Duration = Duration::from_secs(1);
    /// Waiting is reported from a pause of this length.
    const PAUSE_SAID: Duration = Duration::from_millis(160);

    /// Has not waited yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            pause: Self::PAUSE_MIN,
            said_of: String::new(),
        }
    }

    /// Waits before this run is checked again. The wait is reported once per run.
    pub fn wait_for(&mut self, run: &PlannedRun, say: impl FnOnce()) {
        if self.pause >= Self::PAUSE_SAID && self.said_of != run.id {
            say();
            self.said_of.clone_from(&run.id);
        }
        thread::sleep(self.pause);
        self.pause = (self.pause * 2).min(Self::PAUSE_MAX);
    }

    /// A run has ended, so others may end soon.
    pub fn one_ended(&mut self) {
        self.pause = Self::PAUSE_MIN;
    }
}

impl Default for Waiting {
    fn default() -> Self {
        Self::new()
    }
}

/// Does a run, from its last checkpoint. `each_generation` receives the number of generations done.
///
/// # Errors
/// [`RunDirError`] if the directory cannot be used.
pub fn work_on(
    run: &PlannedRun,
    suite: &Path,
    stop: &AtomicBool,
    each_generation: impl FnMut(u32),
) -> Result<Outcome, RunDirError> {
    match begin_or_resume(run, suite, stop, each_generation) {
        // Another process did the same run, unseen for lack of locks, and tidied up after both.
        Err(_) if matches!(progress(run, suite), Ok(Progress::Done)) => Ok(Outcome::Completed),
        worked => worked,
    }
}

fn begin_or_resume(
    run: &PlannedRun,
    suite: &Path,
    stop: &AtomicBool,
    mut each_generation: impl FnMut(u32),
) -> Result<Outcome, RunDirError> {
    let directory = run.directory(suite);
    let (mut experiment, held) = match open(run, &directory) {
        Ok(Some(opened)) => opened,
        Ok(None) => return Ok(Outcome::Completed),
        Err(RunDirError::InUse { holder, .. }) => return Ok(Outcome::Held(holder)),
        Err(error) => return Err(error),
    };
    let path = EnginePath::from_environment()?;
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
        return Ok(Outcome::Interrupted);
    }
    let result = experiment
        .result()
        .expect("a trial fits its own grid")
        .expect("an evolution has at least one generation");
    held.finish(&experiment, &result)?;
    Ok(Outcome::Completed)
}

/// The run as it stands, held by this process; none if it is complete.
fn open(run: &PlannedRun, directory: &Path) -> Result<Option<(Experiment, RunDir)>, RunDirError> {
    match found(directory) {
        Err(RunDirError::NotARun { .. } | RunDirError::NotThere(_)) => {
            let experiment = Experiment::new(run.settings.clone());
            match RunDir::create(directory, &experiment, &this_program()) {
                Ok(held) => Ok(Some((experiment, held.with_table_last()))),
                // Another process has just made it.
                Err(RunDirError::Exists(_)) => found(directory),
                Err(error) => Err(error),
            }
        }
        found => found,
    }
}

fn found(directory: &Path) -> Result<Option<(Experiment, RunDir)>, RunDirError> {
    Ok(
        match RunDir::open(directory, rayon::current_num_threads() as f64)? {
            Opened::Finished(_) => None,
            Opened::Unfinished(experiment, held) => Some((*experiment, held.with_table_last())),
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::Suite;
    use std::collections::BTreeMap;
    use std::fs;

    const SUITE: &str = "
        name = \"own\"
        [[experiment]]
        name = \"one\"
        runs = 1
        grids = [\"8x8\"]
        robots = [20]
        population = 6
        generations = 6
        repetitions = 2
        steps = 30
    ";

    fn planned(scratch: &Path) -> PlannedRun {
        let file = scratch.join("own.toml");
        fs::write(&file, SUITE).unwrap();
        let plan = Plan::new(&Suite::read(&file).unwrap(), None, None, false).unwrap();
        plan.runs().iter().next().unwrap()
    }

    fn contents(directory: &Path) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(directory).unwrap().map(Result::unwrap);
        entries
            .map(|entry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                (name, fs::read(entry.path()).unwrap())
            })
            // How long it took is no result.
            .filter(|(name, _)| name != "time.json")
            .collect()
    }

    #[test]
    fn of_duplicates_without_locks_the_slower_one_changes_nothing() {
        let scratch = tempfile::tempdir().unwrap();
        let (run, stop) = (planned(scratch.path()), AtomicBool::new(false));
        let (expected, suite) = (
            scratch.path().join("expected"),
            scratch.path().join("suite"),
        );
        work_on(&run, &expected, &stop, |_| {}).unwrap();
        let expected = contents(&run.directory(&expected));
        let directory = run.directory(&suite);

        let (mut slower, held) = open(&run, &directory).unwrap().unwrap();
        // The next process makes its own lock, as on machines that do not see each other's locks.
        fs::remove_file(directory.join(".lock")).unwrap();
        assert_eq!(
            work_on(&run, &suite, &stop, |_| {}).unwrap(),
            Outcome::Completed
        );
        while !slower.is_finished() {
            slower
                .advance(Engine::Fast, EnginePath::best(), &stop)
                .unwrap();
            held.save(&slower).unwrap();
            let mut now = contents(&directory);
            assert!(now.remove("checkpoint").is_some());
            assert_eq!(now, expected, "complete for all who look");
        }
        let result = slower.result().unwrap().unwrap();
        held.finish(&slower, &result).unwrap();
        assert_eq!(contents(&directory), expected);
    }

    #[test]
    fn what_is_in_the_way_of_a_run_is_an_error_that_names_it() {
        let scratch = tempfile::tempdir().unwrap();
        let run = planned(scratch.path());
        let directory = run.directory(scratch.path());
        fs::create_dir_all(&directory).unwrap();
        fs::write(directory.join("a file"), "of someone else").unwrap();
        let error = work_on(&run, scratch.path(), &AtomicBool::new(false), |_| {}).unwrap_err();
        assert!(error.to_string().contains(&run.id), "{error}");
        assert!(error.to_string().contains("config.toml"), "{error}");
    }
}
