//! Work: execution of a single run of a plan.
//!
//! The state of a run is determined only by files: a run is done if its directory contains `DONE`
//! and all other files of a completed run. Any number of processes may work on the same plan; each
//! takes only runs that no other process has locked.

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

/// A share of the runs: every *n*-th, starting at run *i*.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Index of the share, counted from 0.
    pub index: u32,
    /// Number of shares.
    pub of: u32,
}

impl Shard {
    /// The share that contains all runs.
    pub const ALL: Self = Self { index: 0, of: 1 };

    /// Parses a shard written as `i/n`, with i counted from 0.
    ///
    /// # Errors
    /// If the text is not a valid shard; the message describes the valid form.
    pub fn parse(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if index < of => Ok(Self { index, of }),
            _ => Err("expected i/n with i from 0 to n − 1, such as 0/8".to_owned()),
        }
    }

    /// Returns the name of the file that contains the hashes of the share's runs.
    #[must_use]
    pub fn hashes_file(self) -> String {
        match self.of {
            1 => "hashes.txt".to_owned(),
            of => format!("hashes-{}-of-{of}.txt", self.index),
        }
    }

    /// Returns the runs of this share.
    #[must_use]
    pub fn of_plan(self, plan: &Plan) -> Runs<'_> {
        plan.share(self.index, self.of)
    }
}

/// Returns the state of a run, determined from its files.
///
/// # Errors
/// [`ReadRunError::Damaged`] if the run is marked complete but is not complete; another
/// [`ReadRunError`] if its files cannot be accessed.
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
    /// The run is complete.
    Completed,
    /// Another process has locked the run; includes the lock's holder, if the lock names it.
    Held(Option<Holder>),
    /// The run was interrupted and can be resumed.
    Interrupted,
}

/// Pauses while waiting for runs that other processes have locked.
#[derive(Debug)]
pub struct Waiting {
    pause: Duration,
    said_of: String,
}

impl Waiting {
    /// The first pause; each further pause is twice as long.
    const PAUSE_MIN: Duration = Duration::from_millis(10);
    /// The longest pause.
    const PAUSE_MAX: Duration = Duration::from_secs(1);
    /// Shortest pause that is reported to the user.
    const PAUSE_SAID: Duration = Duration::from_millis(160);

    /// Creates the state before the first pause.
    #[must_use]
    pub fn new() -> Self {
        Self {
            pause: Self::PAUSE_MIN,
            said_of: String::new(),
        }
    }

    /// Pauses before this run is checked again; calls `say` once per run if the wait is long.
    pub fn wait_for(&mut self, run: &PlannedRun, say: impl FnOnce()) {
        if self.pause >= Self::PAUSE_SAID && self.said_of != run.id {
            say();
            self.said_of.clone_from(&run.id);
        }
        thread::sleep(self.pause);
        self.pause = (self.pause * 2).min(Self::PAUSE_MAX);
    }

    /// Resets the pause after a run has ended, since other runs may end soon.
    pub fn one_ended(&mut self) {
        self.pause = Self::PAUSE_MIN;
    }
}

impl Default for Waiting {
    fn default() -> Self {
        Self::new()
    }
}

/// Executes a run from its last checkpoint; calls `each_generation` with the number of completed
/// generations.
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
        // If locks do not work, another process may have executed the same run unnoticed and
        // removed the temporary files of both processes.
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

/// Opens and locks a run in its current state; `None` if it is complete.
fn open(run: &PlannedRun, directory: &Path) -> Result<Option<(Experiment, RunDir)>, RunDirError> {
    match found(directory) {
        Err(RunDirError::NotARun { .. } | RunDirError::NotThere(_)) => {
            let experiment = Experiment::new(run.settings.clone());
            match RunDir::create(directory, &experiment, &this_program()) {
                Ok(held) => Ok(Some((experiment, held.with_table_last()))),
                // Another process has just created the run.
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
            // The duration is not part of the result.
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
        // The next process creates its own lock, as on machines that do not see each other's locks.
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
            assert_eq!(now, expected, "complete for all readers");
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
