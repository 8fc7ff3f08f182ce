//! Plans: the runs of a suite, each under a name that says what it computes.
//!
//! A run's name is a hash of everything that its result depends on: the kernel, the version of
//! what is computed with it, and the resolved settings with the seed. So finished work is found
//! again and never mixed up, and experiments that ask for the same run share it.

use super::{Experiment, Suite, check_seeds};
use crate::settings::{Given, SettingError, Settings};
use minimal_surprise_controller::KERNEL_ID;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Version of what a run computes from its settings; changes with every change of results.
const RESULTS_VERSION: &str = "1";

/// The runs of a suite.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// Name of the suite.
    pub suite: String,
    /// Its experiments.
    pub experiments: Vec<PlannedExperiment>,
}

/// The runs of an experiment.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedExperiment {
    /// Its name.
    pub name: String,
    /// Every combination of its settings.
    pub settings: Vec<PlannedSettings>,
}

/// The runs under the same settings.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedSettings {
    /// What distinguishes them: model, predictions, grid, swarm size, noise.
    pub label: String,
    /// The runs.
    pub runs: Vec<PlannedRun>,
}

/// One run.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedRun {
    /// Its name, and that of its directory.
    pub id: String,
    /// Its seed.
    pub seed: u64,
    /// Everything else.
    #[serde(skip)]
    pub settings: Settings,
}

impl PlannedExperiment {
    /// The runs after the planned ones: of all settings in turn, with the seeds that follow.
    pub fn further(&self) -> impl Iterator<Item = PlannedRun> {
        let rounds = if self.settings.is_empty() {
            0
        } else {
            u32::MAX
        };
        (0..rounds).flat_map(|round| {
            let settings = self.settings.iter();
            settings.filter_map(move |settings| {
                let last = settings.runs.last()?;
                let seed = last.seed.checked_add(1)?.checked_add(round.into())?;
                Some(PlannedRun::new(&last.settings, seed))
            })
        })
    }
}

impl PlannedRun {
    /// The run of some settings with another seed.
    fn new(settings: &Settings, seed: u64) -> Self {
        let mut settings = settings.clone();
        settings.seed = seed;
        settings.written.seed = seed;
        Self {
            id: id(&settings),
            seed,
            settings,
        }
    }

    /// Its directory below that of the suite.
    #[must_use]
    pub fn directory(&self, suite: &Path) -> PathBuf {
        suite.join("runs").join(&self.id)
    }
}

/// The plan cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// No experiment has this name.
    #[error("--only = {name}: experiments are {}", names.join(", "))]
    NoSuchExperiment {
        /// The name asked for.
        name: String,
        /// The names there are.
        names: Vec<String>,
    },
    /// There are not so many seeds.
    #[error("experiment {experiment:?}: {problem}")]
    Seeds {
        /// The experiment.
        experiment: String,
        /// What is wrong and what would be valid.
        problem: String,
    },
    /// A setting is not valid.
    #[error(transparent)]
    Setting(#[from] SettingError),
}

impl Plan {
    /// The runs of a suite, or of one of its experiments, with another number of runs or times as
    /// many if asked for. Optional experiments are in only if they are named or all are wanted.
    ///
    /// # Errors
    /// [`PlanError`] if there is no such experiment, or not so many seeds.
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
        let wanted = |experiment: &&Experiment| match only {
            Some(name) => experiment.name == name,
            None => with_optional || !experiment.optional,
        };
        let experiments = suite.experiments.iter().filter(wanted).map(|experiment| {
            let runs_of_each = runs.unwrap_or(experiment.runs);
            check_seeds(experiment.first_seed, runs_of_each).map_err(|problem| {
                PlanError::Seeds {
                    experiment: experiment.name.clone(),
                    problem,
                }
            })?;
            Ok(PlannedExperiment {
                name: experiment.name.clone(),
                settings: settings_of(experiment)?
                    .into_iter()
                    .map(|settings| planned(&settings, experiment.first_seed, runs_of_each))
                    .collect(),
            })
        });
        Ok(Self {
            suite: suite.name.clone(),
            experiments: experiments.collect::<Result<_, PlanError>>()?,
        })
    }

    /// Every run once, in order.
    #[must_use]
    pub fn runs(&self) -> Vec<&PlannedRun> {
        let mut seen = BTreeSet::new();
        self.experiments
            .iter()
            .flat_map(|experiment| &experiment.settings)
            .flat_map(|settings| &settings.runs)
            .filter(|run| seen.insert(run.id.clone()))
            .collect()
    }
}

fn planned(settings: &Settings, first_seed: u64, runs: u32) -> PlannedSettings {
    let runs = (0..runs).map(|run| PlannedRun::new(settings, first_seed + u64::from(run)));
    PlannedSettings {
        label: label(settings),
        runs: runs.collect(),
    }
}

/// The name of a run.
fn id(settings: &Settings) -> String {
    let written = toml::to_string(&settings.written).expect("plain numbers and strings");
    let text = format!("{KERNEL_ID}\n{RESULTS_VERSION}\n{written}");
    let hash = Sha256::digest(text.as_bytes());
    hash[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What distinguishes settings, in words.
#[must_use]
pub fn label(settings: &Settings) -> String {
    let written = &settings.written;
    let mut label = format!("{}, {}", written.sensor_model.to_uppercase(), written.grid);
    if let Some(template) = &written.predefine {
        label += &format!(", {template} predefined");
    }
    if let Some(template) = &written.predefine_partly {
        label += &format!(", {template} partly predefined");
    }
    if written.robots != 100 {
        label += &format!(", {} robots", written.robots);
    }
    if written.noise != 0.0 {
        label += &format!(", {} % noise", 100.0 * written.noise);
    }
    label
}

/// Every combination of an experiment's settings, with its first seed.
///
/// # Errors
/// [`SettingError`] names the value and what would be valid.
pub fn settings_of(experiment: &Experiment) -> Result<Vec<Settings>, SettingError> {
    let mut all = Vec::new();
    for model in &experiment.sensor_models {
        for prediction in &experiment.predictions {
            for grid in &experiment.grids {
                for robots in &experiment.robots {
                    for noise in &experiment.noise {
                        let mut given = Given::default();
                        given.flag("sensor-model", Some(model));
                        match prediction.strip_prefix("partly-") {
                            Some(template) => given.flag("predefine-partly", Some(template)),
                            None if prediction == "free" => {}
                            None => given.flag("predefine", Some(prediction)),
                        }
                        given.flag("grid", Some(grid));
                        given.flag("robots", Some(&robots.to_string()));
                        given.flag("noise", Some(&noise.to_string()));
                        let numbers = [
                            ("population", experiment.population),
                            ("generations", experiment.generations),
                            ("repetitions", experiment.repetitions),
                            ("steps", experiment.steps),
                        ];
                        for (key, number) in numbers {
                            given.flag(key, number.map(|n| n.to_string()).as_deref());
                        }
                        let mutation = experiment.mutation.map(|rate| rate.to_string());
                        given.flag("mutation", mutation.as_deref());
                        all.push(Settings::resolve(&given, || experiment.first_seed)?);
                    }
                }
            }
        }
    }
    Ok(all)
}
