//! A worker: executes the runs of a suite that are not complete, one at a time, and waits for runs
//! that other processes execute.

use super::file::Resilience;
use super::plan::{Plan, PlannedRun, RUNS, Runs};
use super::search::{Search, look};
use super::work::{Outcome, Waiting, progress, work_on};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::FileError;
use minimal_surprise_evolution::finished_run::Progress;
use minimal_surprise_evolution::limits::{NeedsOfRuns, TooMuch};
use minimal_surprise_evolution::lock::Holder;
use minimal_surprise_evolution::run_dir::RunDirError;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Receiver of progress events.
pub trait Watch {
    /// Handles the start or resumption of a run; `further` is the number of a run beyond the plan,
    /// counted from 1.
    fn begins(&self, run: &PlannedRun, further: Option<u32>);

    /// Handles a change in the number of completed generations of a run.
    fn generation(&self, _run: &PlannedRun, _generations: u32) {}

    /// Handles the completion of a run.
    fn completed(&self, _run: &PlannedRun) {}

    /// Handles a wait for a run that another process has locked.
    fn waits(&self, run: &PlannedRun, directory: &Path, holder: Option<&Holder>);
}

/// The runs that are still to be executed, determined from their files.
#[derive(Clone, Debug)]
pub struct ToDo {
    /// For each run, true if the run is to be executed.
    each: Vec<bool>,
    /// Number of runs to be executed.
    pub number: u64,
    /// Number of robot-steps of these runs.
    pub robot_steps: u64,
    /// Memory and disk that these runs need.
    pub needs: NeedsOfRuns,
}

/// The reason why the runs to be executed are unknown or cannot be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ToDoError {
    /// The folder of the runs cannot be read.
    #[error(transparent)]
    Folder(#[from] FileError),
    /// The disk is too small for the runs.
    #[error(transparent)]
    TooMuch(#[from] TooMuch),
}

impl ToDo {
    /// Determines from the files which runs are to be executed; damaged runs are not included.
    ///
    /// # Errors
    /// [`ToDoError`] if the folder cannot be read or the disk is far too small. Disk space is
    /// checked first, since there may be billions of runs.
    pub fn read(
        runs: Runs<'_>,
        suite: &Path,
        threads: f64,
        damaged: &mut DamagedRuns,
    ) -> Result<Self, ToDoError> {
        let mut all = NeedsOfRuns::default();
        for alike in runs.by_settings() {
            all.add(alike.settings(), alike.number(), threads);
        }
        let folder = suite.join(RUNS);
        let there = match fs::read_dir(&folder) {
            Ok(there) => there.count() as u64,
            Err(error) if error.kind() == ErrorKind::NotFound => 0,
            Err(error) => return Err(FileError::at(&folder)(error).into()),
        };
        all.at_least_without(there).check_disk(suite)?;
        let mut to_do = Self {
            each: Vec::new(),
            number: 0,
            robot_steps: 0,
            needs: NeedsOfRuns::default(),
        };
        for alike in runs.by_settings() {
            let before = to_do.number;
            let settings = alike.settings().clone();
            let robot_steps = settings.robot_steps();
            for run in alike.runs() {
                let looked = damaged.take(&run.directory(suite), progress(&run, suite));
                let waits = looked.is_some_and(|progress| progress != Progress::Done);
                to_do.each.push(waits);
                if waits {
                    to_do.number += 1;
                    to_do.robot_steps = to_do.robot_steps.saturating_add(robot_steps);
                }
            }
            to_do.needs.add(&settings, to_do.number - before, threads);
        }
        Ok(to_do)
    }
}

/// Result of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All possible work is complete.
    Whole,
    /// A stop was requested.
    Interrupted,
}

/// A worker that executes runs one at a time.
#[derive(Debug)]
pub struct Worker<'a> {
    plan: &'a Plan,
    directory: &'a Path,
    stop: &'a AtomicBool,
    /// Damaged runs.
    pub damaged: DamagedRuns,
    /// True if any work was done.
    pub begun: bool,
}

/// Runs that other processes have locked.
type Held = Vec<(PlannedRun, Option<Holder>)>;

impl<'a> Worker<'a> {
    /// Creates a worker.
    #[must_use]
    pub fn new(
        plan: &'a Plan,
        directory: &'a Path,
        stop: &'a AtomicBool,
        damaged: DamagedRuns,
    ) -> Self {
        Self {
            plan,
            directory,
            stop,
            damaged,
            begun: false,
        }
    }

    /// Executes a run. If an error affects only this run, adds the run to the damaged runs and
    /// returns `None`.
    fn work_on(
        &mut self,
        run: &PlannedRun,
        mut each_generation: impl FnMut(u32),
    ) -> Result<Option<Outcome>, RunDirError> {
        let directory = run.directory(self.directory);
        let worked = work_on(run, self.directory, self.stop, |generation| {
            self.begun = true;
            each_generation(generation);
        });
        match worked {
            Ok(outcome) => {
                self.begun |= outcome == Outcome::Completed;
                Ok(Some(outcome))
            }
            Err(error) if error.is_of_one_run(&directory) => {
                self.damaged.add(&directory, error.cause());
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    fn do_one(
        &mut self,
        run: PlannedRun,
        watch: &dyn Watch,
        held: &mut Held,
    ) -> Result<Ended, RunDirError> {
        watch.begins(&run, None);
        match self.work_on(&run, |generation| watch.generation(&run, generation))? {
            Some(Outcome::Completed) => watch.completed(&run),
            Some(Outcome::Held(holder)) => held.push((run, holder)),
            Some(Outcome::Interrupted) => return Ok(Ended::Interrupted),
            None => {}
        }
        Ok(Ended::Whole)
    }

    /// Executes these runs, and waits for runs that other processes execute.
    ///
    /// # Errors
    /// [`RunDirError`] if an error affects more than a single run.
    pub fn do_all(
        &mut self,
        runs: Runs<'_>,
        to_do: &ToDo,
        watch: &dyn Watch,
    ) -> Result<Ended, RunDirError> {
        let mut held = Held::new();
        for (run, _) in runs.iter().zip(&to_do.each).filter(|(_, waits)| **waits) {
            if self.do_one(run, watch, &mut held)? == Ended::Interrupted {
                return Ok(Ended::Interrupted);
            }
        }
        let mut waiting = Waiting::new();
        while let Some((run, holder)) = held.first() {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(Ended::Interrupted);
            }
            waiting.wait_for(run, || {
                watch.waits(run, &run.directory(self.directory), holder.as_ref());
            });
            let number = held.len();
            for (run, _) in std::mem::take(&mut held) {
                if self.do_one(run, watch, &mut held)? == Ended::Interrupted {
                    return Ok(Ended::Interrupted);
                }
            }
            if held.len() < number {
                waiting.one_ended();
            }
        }
        Ok(Ended::Whole)
    }

    /// Evolves further seeds until a run has the structure that a damage experiment needs.
    ///
    /// # Errors
    /// [`RunDirError`] if an error affects more than a single run.
    pub fn search(&mut self, asked: &Resilience, watch: &dyn Watch) -> Result<Ended, RunDirError> {
        let (mut after, mut begun) = (0, 0);
        let mut waiting = Waiting::new();
        loop {
            let next = look(self.plan, asked, self.directory, after, &mut self.damaged);
            let Search::Next(run, number) = next else {
                return Ok(Ended::Whole);
            };
            let directory = run.directory(self.directory);
            if self.damaged.contains(&directory) {
                return Ok(Ended::Whole);
            }
            if begun != number {
                watch.begins(&run, Some(number));
                begun = number;
            }
            match self.work_on(&run, |_| {})? {
                Some(Outcome::Completed) => after = number - 1,
                // Another process is also searching, and the result of its run determines whether
                // more runs are needed.
                Some(Outcome::Held(_)) if self.stop.load(Ordering::Relaxed) => {
                    return Ok(Ended::Interrupted);
                }
                Some(Outcome::Held(holder)) => waiting.wait_for(&run, || {
                    watch.waits(&run, &directory, holder.as_ref());
                }),
                Some(Outcome::Interrupted) => return Ok(Ended::Interrupted),
                // If a run is damaged, it is unknown whether more runs are needed.
                None => return Ok(Ended::Whole),
            }
        }
    }
}
