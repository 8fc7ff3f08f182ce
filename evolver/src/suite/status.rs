//! The status of a suite: how many of its runs are done, by their files.

use super::plan::{Plan, PlannedRun, Runs};
use super::work::progress;
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::finished_run::{Progress, ReadRunError};
use minimal_surprise_evolution::run_dir::{RunDir, tidy};
use minimal_surprise_evolution::text::hex;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

/// The hashes of the runs that are done.
#[derive(Clone, Debug, Default)]
pub struct Hashes {
    sum: Sha256,
    /// Number of runs.
    pub done: u64,
    /// The lines of `hashes.txt`, one per run: its name and its hash. Only on request: there may be
    /// millions.
    pub lines: Option<Vec<u8>>,
}

impl Hashes {
    /// Those of some runs, each read once.
    #[must_use]
    pub fn read(runs: Runs<'_>, suite: &Path, lines: bool, damaged: &mut DamagedRuns) -> Self {
        let mut hashes = Self {
            lines: lines.then(Vec::new),
            ..Self::default()
        };
        for run in runs.iter() {
            hashes.add(&run, suite, damaged);
        }
        hashes
    }

    /// Reads a run; whether it is done.
    fn add(&mut self, run: &PlannedRun, suite: &Path, damaged: &mut DamagedRuns) -> bool {
        let directory = run.directory(suite);
        let Some(finished) = damaged.read(&directory) else {
            return false;
        };
        // A process killed at the very end leaves temporary files; failure to remove them is ignored.
        let _ = tidy(&directory);
        let line = format!("{} {}\n", run.id, finished.hash);
        self.sum.update(&line);
        self.done += 1;
        if let Some(lines) = &mut self.lines {
            lines.extend(line.as_bytes());
        }
        true
    }

    /// The hash of the suite, if all of its runs are done: the SHA-256 of all lines.
    #[must_use]
    pub fn of_all(self, runs: Runs<'_>) -> Option<String> {
        (self.done == runs.number()).then(|| hex(&self.sum.finalize()))
    }
}

/// How many runs with the same settings are done.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// What distinguishes the settings.
    pub label: String,
    /// Planned.
    pub number: u32,
    /// Complete.
    pub done: u32,
    /// Begun, and not complete.
    pub begun: u32,
    /// Damaged.
    pub damaged: u32,
}

/// The status of a suite.
#[derive(Clone, Debug, Default)]
pub struct Status {
    /// The experiments by name, with the counts of their settings.
    pub experiments: Vec<(String, Vec<Counts>)>,
    /// Different runs that are done.
    pub done: u64,
    /// The hash of all runs, if all are done.
    pub hash: Option<String>,
    /// Runs that are damaged.
    pub damaged: DamagedRuns,
}

impl Status {
    /// Reads every run of a suite once.
    ///
    /// # Errors
    /// [`ReadRunError`] if the files cannot be looked at.
    pub fn read(plan: &Plan, suite: &Path) -> Result<Self, ReadRunError> {
        let mut damaged = DamagedRuns::default();
        let mut hashes = Hashes::default();
        // Experiments share runs; of a million pending ones none is kept.
        let mut known: BTreeMap<String, Progress> = BTreeMap::new();
        for run in plan.runs().iter() {
            if hashes.add(&run, suite, &mut damaged) {
                known.insert(run.id, Progress::Done);
            } else if !damaged.contains(&run.directory(suite))
                && progress(&run, suite)? == Progress::Begun
            {
                check_begun(&run, suite, &mut damaged);
                known.insert(run.id, Progress::Begun);
            }
        }
        let mut experiments = Vec::new();
        for experiment in &plan.experiments {
            let counts = experiment.settings().map(|settings| {
                let mut counts = Counts {
                    label: settings.label.clone(),
                    number: settings.number,
                    ..Counts::default()
                };
                for run in settings.runs() {
                    if damaged.contains(&run.directory(suite)) {
                        counts.damaged += 1;
                        continue;
                    }
                    match known.get(&run.id) {
                        Some(Progress::Done) => counts.done += 1,
                        Some(Progress::Begun) => counts.begun += 1,
                        _ => {}
                    }
                }
                counts
            });
            experiments.push((experiment.name.clone(), counts.collect()));
        }
        Ok(Self {
            experiments,
            done: hashes.done,
            hash: hashes.of_all(plan.runs()),
            damaged,
        })
    }
}

/// Checks whether a run that is not complete can be resumed.
fn check_begun(run: &PlannedRun, suite: &Path, damaged: &mut DamagedRuns) {
    let is_begun = || matches!(progress(run, suite), Ok(Progress::Begun));
    let directory = run.directory(suite);
    // Another process may have completed it meanwhile.
    if let Err(error) = RunDir::check_unfinished(&directory)
        && is_begun()
    {
        damaged.add(&directory, error.cause());
    }
}
