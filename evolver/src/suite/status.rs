//! The status of a suite: the number of completed runs, determined from their files.

use super::plan::{Plan, PlannedRun, Runs};
use super::work::progress;
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::finished_run::{Progress, ReadRunError};
use minimal_surprise_evolution::run_dir::{RunDir, tidy};
use minimal_surprise_evolution::text::hex;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

/// The hashes of completed runs.
#[derive(Clone, Debug, Default)]
pub struct Hashes {
    sum: Sha256,
    /// Number of completed runs.
    pub done: u64,
    /// The lines of `hashes.txt`, one per run: run ID and hash. Stored only on request, since there
    /// may be millions of runs.
    pub lines: Option<Vec<u8>>,
}

impl Hashes {
    /// Reads the hash of each of these runs once.
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

    /// Reads a run; returns true if it is complete.
    fn add(&mut self, run: &PlannedRun, suite: &Path, damaged: &mut DamagedRuns) -> bool {
        let directory = run.directory(suite);
        let Some(finished) = damaged.read(&directory) else {
            return false;
        };
        // A process that was killed in its last step has left temporary files; failure to remove
        // them is ignored.
        let _ = tidy(&directory);
        let line = format!("{} {}\n", run.id, finished.hash);
        self.sum.update(&line);
        self.done += 1;
        if let Some(lines) = &mut self.lines {
            lines.extend(line.as_bytes());
        }
        true
    }

    /// Returns the hash of the suite, the SHA-256 of all lines, if all runs are complete.
    #[must_use]
    pub fn of_all(self, runs: Runs<'_>) -> Option<String> {
        (self.done == runs.number()).then(|| hex(&self.sum.finalize()))
    }
}

/// Numbers of runs with the same settings, by state.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Label of the settings.
    pub label: String,
    /// Number of planned runs.
    pub number: u32,
    /// Number of completed runs.
    pub done: u32,
    /// Number of runs that have begun but are not complete.
    pub begun: u32,
    /// Number of damaged runs.
    pub damaged: u32,
}

/// The status of a suite.
#[derive(Clone, Debug, Default)]
pub struct Status {
    /// The experiments by name, with the counts of their settings.
    pub experiments: Vec<(String, Vec<Counts>)>,
    /// Number of different runs that are complete.
    pub done: u64,
    /// The hash of all runs, if all are complete.
    pub hash: Option<String>,
    /// Damaged runs.
    pub damaged: DamagedRuns,
}

impl Status {
    /// Reads every run of a suite once.
    ///
    /// # Errors
    /// [`ReadRunError`] if the files cannot be accessed.
    pub fn read(plan: &Plan, suite: &Path) -> Result<Self, ReadRunError> {
        let mut damaged = DamagedRuns::default();
        let mut hashes = Hashes::default();
        // Experiments may share runs, so the states of runs are stored. Pending runs, of which
        // there may be a million, are not stored.
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

/// Checks that an incomplete run can be resumed; otherwise adds it to the damaged runs.
fn check_begun(run: &PlannedRun, suite: &Path, damaged: &mut DamagedRuns) {
    let is_begun = || matches!(progress(run, suite), Ok(Progress::Begun));
    let directory = run.directory(suite);
    // Another process may have completed the run in the meantime.
    if let Err(error) = RunDir::check_unfinished(&directory)
        && is_begun()
    {
        damaged.add(&directory, error.cause());
    }
}
