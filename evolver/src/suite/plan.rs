//! Plans: the runs of a suite, each named by a hash of its inputs.
//!
//! A run's ID is a hash of everything that the run's result depends on: the kernel, the version of
//! the evolution, and the resolved settings including the seed. Finished runs are therefore
//! recognised reliably, and experiments that include the same run share it.
//!
//! A plan does not store its runs. It stores the settings in order, each with the seeds that were
//! not already listed for the same settings. Runs are created one at a time on request, so that a
//! plan of a million runs, or a share of it, takes no more memory than a plan of ten.

use super::experiment::ExperimentTable;
use super::file::{Suite, check_combinations, check_seeds};
use minimal_surprise_evolution::run_id::run_id;
use minimal_surprise_evolution::settings::{SettingError, Settings};
use minimal_surprise_evolution::text::hex;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The runs of a suite.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Name of the suite.
    pub suite: String,
    /// The planned experiments.
    pub experiments: Vec<PlannedExperiment>,
    /// Every run once, in order, as ranges of seeds.
    different: Vec<SeedRange>,
}

/// Runs with the same settings and consecutive seeds.
#[derive(Clone, Copy, Debug)]
struct SeedRange {
    experiment: u32,
    /// Index of this combination of settings in the experiment.
    combination: u32,
    /// Index of the first run, counted from the experiment's first seed.
    first: u32,
    runs: u32,
}

/// The runs of an experiment.
#[derive(Clone, Debug)]
pub struct PlannedExperiment {
    /// Name of the experiment.
    pub name: String,
    /// Index of the experiment in the plan.
    index: usize,
    /// The experiment, with the requested number of runs.
    asked: ExperimentTable,
}

/// The runs with the same settings.
#[derive(Clone, Debug)]
pub struct PlannedSettings {
    /// Label of the settings: model, predictions, grid, swarm size, noise.
    pub label: String,
    /// The settings, including the first seed.
    pub settings: Settings,
    /// Number of runs.
    pub number: u32,
    experiment: usize,
    combination: u64,
}

/// One run.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    /// Run ID, also the name of the run's directory.
    pub id: String,
    /// Label of the settings.
    pub label: String,
    /// Seed of the run.
    pub seed: u64,
    /// All settings of the run.
    pub settings: Settings,
    /// Index of the first experiment that includes the run.
    experiment: usize,
    /// Number of the run in that experiment, counted from 1.
    place: u64,
}

/// Runs of a plan, each once: all, or every *n*-th.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    plan: &'a Plan,
    first: u64,
    step: u64,
}

/// Runs of a plan that differ only in their seeds.
#[derive(Clone, Debug)]
pub struct RunsAlike {
    settings: PlannedSettings,
    first: u64,
    step: u64,
    number: u64,
}

impl PlannedExperiment {
    /// Returns every combination of the experiment's settings.
    pub fn settings(&self) -> impl Iterator<Item = PlannedSettings> {
        (0..self.asked.combinations()).map(|combination| self.combination(combination))
    }

    /// Returns the settings of a combination.
    ///
    /// # Panics
    /// If the combination does not exist. All settings were checked when the plan was created.
    fn combination(&self, combination: u64) -> PlannedSettings {
        let settings = self
            .asked
            .settings(combination)
            .expect("settings were checked");
        PlannedSettings {
            label: self.asked.label(&settings),
            settings,
            number: self.asked.runs,
            experiment: self.index,
            combination,
        }
    }

    /// Returns the runs beyond the plan: one run of each combination of settings in turn, with the
    /// seeds that follow the planned ones.
    pub fn further(&self) -> impl Iterator<Item = PlannedRun> {
        (0..u64::from(u32::MAX)).flat_map(|round| {
            self.settings()
                .filter_map(move |settings| settings.run(u64::from(settings.number) + round))
        })
    }
}

impl PlannedSettings {
    /// Returns the runs, by seed.
    pub fn runs(&self) -> impl Iterator<Item = PlannedRun> {
        (0..u64::from(self.number)).filter_map(|number| self.run(number))
    }

    /// Returns a run, planned or beyond the plan; `None` if the seed would exceed the maximum.
    fn run(&self, number: u64) -> Option<PlannedRun> {
        let seed = self.settings.seed().checked_add(number)?;
        let settings = self.settings.clone().with_seed(seed);
        Some(PlannedRun {
            id: hex(&run_id(&settings)),
            label: self.label.clone(),
            seed,
            settings,
            experiment: self.experiment,
            place: self.combination * u64::from(self.number) + number + 1,
        })
    }
}

impl PlannedRun {
    /// Returns the run's directory, given the suite's directory.
    #[must_use]
    pub fn directory(&self, suite: &Path) -> PathBuf {
        suite.join(RUNS).join(&self.id)
    }
}

impl<'a> Runs<'a> {
    /// Returns the number of runs.
    #[must_use]
    pub fn number(self) -> u64 {
        let all: u64 = self.plan.different.iter().map(|r| u64::from(r.runs)).sum();
        all.saturating_sub(self.first).div_ceil(self.step)
    }

    /// Returns the runs, in order.
    pub fn iter(self) -> impl Iterator<Item = PlannedRun> + 'a {
        self.by_settings().flat_map(|alike| alike.runs())
    }

    /// Returns the runs, in order, grouped by settings.
    pub fn by_settings(self) -> impl Iterator<Item = RunsAlike> + 'a {
        let Self { plan, first, step } = self;
        let mut skipped = first;
        plan.different.iter().filter_map(move |range| {
            let runs = u64::from(range.runs);
            let start = skipped.min(runs);
            let number = (runs - start).div_ceil(step);
            skipped = skipped + number * step - runs;
            let experiment = &plan.experiments[range.experiment as usize];
            (number > 0).then(|| RunsAlike {
                settings: experiment.combination(range.combination.into()),
                first: u64::from(range.first) + start,
                step,
                number,
            })
        })
    }
}

impl RunsAlike {
    /// Returns the settings that these runs share, with the experiment's first seed.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings.settings
    }

    /// Returns the number of runs.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Returns the runs, in order.
    pub fn runs(self) -> impl Iterator<Item = PlannedRun> {
        (0..self.number).filter_map(move |n| self.settings.run(self.first + n * self.step))
    }
}

/// Name of the directory of the runs, in the suite's directory.
pub const RUNS: &str = "runs";

/// The reason why a plan cannot be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// No experiment has this name.
    #[error("--only = {name}: expected one of the experiments: {}", names.join(", "))]
    NoSuchExperiment {
        /// The requested name.
        name: String,
        /// The existing names.
        names: Vec<String>,
    },
    /// A seed exceeds the maximum, or there are too many combinations.
    #[error("experiment {experiment:?}: {problem}")]
    Experiment {
        /// The experiment.
        experiment: String,
        /// The problem and the valid values.
        problem: String,
    },
    /// A setting is not valid.
    #[error(transparent)]
    Setting(#[from] SettingError),
}

impl Plan {
    /// Plans the runs of a suite, or only of the experiment named `only`, optionally with a
    /// different number of runs. Optional experiments are included if named or if `with_optional`
    /// is set.
    ///
    /// # Errors
    /// [`PlanError`] if the experiment does not exist, its seeds or combinations exceed the limits,
    /// or a setting is invalid.
    pub fn new(
        suite: &Suite,
        only: Option<&str>,
        runs: Option<u32>,
        with_optional: bool,
    ) -> Result<Self, PlanError> {
        if let Some(name) = only
            && !suite.experiments.iter().any(|e| e.name == name)
        {
            return Err(PlanError::NoSuchExperiment {
                name: name.to_owned(),
                names: suite.experiments.iter().map(|e| e.name.clone()).collect(),
            });
        }
        let wanted = |experiment: &&ExperimentTable| match only {
            Some(name) => experiment.name == name,
            None => with_optional || !experiment.optional,
        };
        let mut experiments = Vec::new();
        for (index, experiment) in suite.experiments.iter().filter(wanted).enumerate() {
            let mut asked = experiment.clone();
            asked.runs = runs.unwrap_or(asked.runs);
            experiments.push(PlannedExperiment {
                name: experiment.name.clone(),
                index,
                asked,
            });
        }
        let about = |experiment: &PlannedExperiment| {
            let experiment = experiment.name.clone();
            move |problem| PlanError::Experiment {
                experiment,
                problem,
            }
        };
        let mut combinations = 0;
        for experiment in &experiments {
            let asked = &experiment.asked;
            check_seeds(asked.first_seed, asked.runs).map_err(about(experiment))?;
            check_combinations(asked, &mut combinations).map_err(about(experiment))?;
        }
        Ok(Self {
            suite: suite.name.clone(),
            different: different(&experiments)?,
            experiments,
        })
    }

    /// Returns every run once, in order.
    #[must_use]
    pub fn runs(&self) -> Runs<'_> {
        self.share(0, 1)
    }

    /// Returns every `of`-th run, starting at `index`.
    #[must_use]
    pub fn share(&self, index: u32, of: u32) -> Runs<'_> {
        Runs {
            plan: self,
            first: index.into(),
            step: u64::from(of).max(1),
        }
    }

    /// Describes a run by its number in the experiment, its settings and its seed.
    #[must_use]
    pub fn title(&self, run: &PlannedRun) -> String {
        let PlannedExperiment { name, asked, .. } = &self.experiments[run.experiment];
        let total = asked.combinations() * u64::from(asked.runs);
        let PlannedRun {
            place, label, seed, ..
        } = run;
        format!("{name} {place}/{total}: {label}, seed {seed}")
    }
}

/// Returns the runs of all experiments in order, without repeated runs.
fn different(experiments: &[PlannedExperiment]) -> Result<Vec<SeedRange>, SettingError> {
    let mut ranges = Vec::new();
    let mut names = Vec::new();
    for experiment in experiments {
        for combination in 0..experiment.asked.combinations() {
            // Compare the settings, ignoring their seeds.
            let settings = experiment.asked.settings(combination)?.with_seed(0);
            names.push((run_id(&settings), ranges.len()));
            ranges.push(SeedRange {
                experiment: experiment.index as u32,
                combination: combination as u32,
                first: 0,
                runs: experiment.asked.runs,
            });
        }
    }
    names.sort_unstable();
    // If settings occur in several ranges, each range keeps only the seeds that no earlier range
    // has.
    let mut cut: BTreeMap<usize, Vec<SeedRange>> = BTreeMap::new();
    for same in names.chunk_by(|one, next| one.0 == next.0) {
        let mut before: Vec<Range<u64>> = Vec::new();
        for &(_, place) in same.iter().filter(|_| same.len() > 1) {
            let range = ranges[place];
            let first_seed = experiments[range.experiment as usize].asked.first_seed;
            let seeds = first_seed..first_seed + u64::from(range.runs);
            let new = without(seeds.clone(), &before).into_iter();
            let new = new.map(|new| SeedRange {
                first: (new.start - first_seed) as u32,
                runs: (new.end - new.start) as u32,
                ..range
            });
            cut.insert(place, new.collect());
            before.push(seeds);
        }
    }
    if cut.is_empty() {
        return Ok(ranges);
    }
    let all = ranges.iter().enumerate();
    let left = all.flat_map(|(place, range)| cut.remove(&place).unwrap_or_else(|| vec![*range]));
    Ok(left.collect())
}

/// Removes the seeds of other ranges from a range; returns the remaining ranges, in order.
fn without(seeds: Range<u64>, others: &[Range<u64>]) -> Vec<Range<u64>> {
    others.iter().fold(vec![seeds], |left, other| {
        left.into_iter()
            .flat_map(|part| {
                [
                    part.start..part.end.min(other.start),
                    part.start.max(other.end)..part.end,
                ]
            })
            .filter(|part| !part.is_empty())
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    const OVERLAPS: &str = "
        name = \"own\"
        [[experiment]]
        name = \"one\"
        runs = 3
        first-seed = 5
        grids = [\"8x8\", \"9x9\"]
        robots = [20]
        [[experiment]]
        name = \"two\"
        runs = 9
        first-seed = 2
        grids = [\"9x9\", \"10x9\", \"9x9\"]
        robots = [20, 30]
        [[experiment]]
        name = \"three\"
        runs = 4
        grids = [\"8x8\", \"9x9\"]
        robots = [30, 20]
    ";

    fn plan() -> Plan {
        let suite = Suite::parse(Path::new("own.toml"), OVERLAPS).unwrap();
        Plan::new(&suite, None, None, false).unwrap()
    }

    #[test]
    fn runs_come_once_in_the_order_in_which_experiments_first_ask_for_them() {
        let plan = plan();
        let mut seen = BTreeSet::new();
        let mut expected: Vec<(String, String)> = Vec::new();
        for experiment in &plan.experiments {
            for run in experiment
                .settings()
                .collect::<Vec<_>>()
                .iter()
                .flat_map(PlannedSettings::runs)
            {
                if seen.insert(run.id.clone()) {
                    expected.push((run.id.clone(), plan.title(&run)));
                }
            }
        }
        let found: Vec<_> = plan
            .runs()
            .iter()
            .map(|run| (run.id.clone(), plan.title(&run)))
            .collect();
        assert_eq!(found, expected);
        assert_eq!(plan.runs().number(), expected.len() as u64);
        let by_settings = plan.runs().by_settings().map(|alike| alike.number());
        assert_eq!(by_settings.sum::<u64>(), expected.len() as u64);
        assert!(
            expected.len() < 3 * 2 + 9 * 6 + 4 * 4,
            "some runs are shared"
        );
    }

    #[test]
    fn shares_of_any_number_have_every_run_once_and_know_their_size() {
        let plan = plan();
        let all: Vec<String> = plan.runs().iter().map(|run| run.id).collect();
        for of in [1, 2, 3, 7, 20, 100] {
            for index in 0..of {
                let share = plan.share(index, of);
                let found: Vec<String> = share.iter().map(|run| run.id).collect();
                let expected = all.iter().skip(index as usize).step_by(of as usize);
                assert!(found.iter().eq(expected), "{index} of {of}");
                assert_eq!(share.number(), found.len() as u64, "{index} of {of}");
            }
        }
    }

    #[test]
    fn seeds_without_others_are_what_is_left_of_them() {
        let others = [3..5, 4..6, 8..9, 20..30];
        assert_eq!(without(0..10, &others), [0..3, 6..8, 9..10]);
        assert_eq!(without(3..6, &others), []);
    }

    #[test]
    fn a_suite_of_more_combinations_than_can_be_held_is_refused_before_any_is_made() {
        let numbers = |count: u32| {
            (1..=count)
                .map(|n| n.to_string())
                .collect::<Vec<_>>()
                .join(",")
        };
        let text = format!(
            "name = \"own\"\n[[experiment]]\nname = \"one\"\nruns = 1\nrobots = [{}]\nnoise = [{}]\n",
            numbers(225),
            "0.1,".repeat(5000)
        );
        let error = Suite::parse(Path::new("own.toml"), &text)
            .unwrap_err()
            .to_string();
        assert!(error.contains("1125000 combinations"), "{error}");
        assert!(error.contains("at most 1000000"), "{error}");
    }
}
