//! Suites: many evolutions described as data, the paper's among them.
//!
//! A suite is a TOML file. Each experiment is the product of its lists: every sensor model on every
//! grid, and so on, so many runs each. [`plan`] turns it into runs with names, [`work`] says which
//! are done and does the others, [`search`] evolves on where a structure is wanted that none has.
//!
//! ```toml
//! name = "densities"
//!
//! [[experiment]]
//! name = "sparse-and-dense"
//! runs = 5
//! grids = ["15x15", "20x20"]
//! robots = [50, 100]
//! ```

pub mod plan;
pub mod report;
pub mod search;
pub mod slurm;
pub mod work;

use minimal_surprise_sim::Structure;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The suite of the paper's experimental section.
pub const PAPER: &str = include_str!("paper.toml");

/// A suite as it is written.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Suite {
    /// Its name.
    pub name: String,
    /// Its evolutions.
    #[serde(default, rename = "experiment")]
    pub experiments: Vec<Experiment>,
    /// Its best genomes, run again from new starts.
    #[serde(default, rename = "re-evaluation")]
    pub reevaluations: Vec<Reevaluation>,
    /// Its structures, damaged.
    #[serde(default, rename = "resilience")]
    pub resiliences: Vec<Resilience>,
}

/// Evolutions under every combination of the listed settings.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Experiment {
    /// Its name.
    pub name: String,
    /// Runs of every combination, seeds from [`Experiment::first_seed`] on.
    pub runs: u32,
    /// Grids, as in `15x15`.
    #[serde(default = "default_grids")]
    pub grids: Vec<String>,
    /// Swarm sizes.
    #[serde(default = "default_robots")]
    pub robots: Vec<u32>,
    /// Sensor models.
    #[serde(default = "default_models")]
    pub sensor_models: Vec<String>,
    /// Noise levels.
    #[serde(default = "default_noise")]
    pub noise: Vec<f64>,
    /// Predictions: `free`, the name of a template, or `partly-line`.
    #[serde(default = "default_predictions")]
    pub predictions: Vec<String>,
    /// Genomes of a generation.
    pub population: Option<u32>,
    /// Generations.
    pub generations: Option<u32>,
    /// Repetitions of an evaluation.
    pub repetitions: Option<u32>,
    /// Steps of a repetition.
    pub steps: Option<u32>,
    /// Probability that a weight mutates.
    pub mutation: Option<f64>,
    /// Seed of the first run.
    #[serde(default = "default_first_seed")]
    pub first_seed: u64,
    /// Whether it is left out unless it is asked for by name.
    #[serde(default)]
    pub optional: bool,
}

/// Best genomes of some experiments, from new starts.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Reevaluation {
    /// Its name.
    pub name: String,
    /// The experiments.
    pub of: Vec<String>,
    /// New starts of each genome.
    pub starts: u32,
}

/// A structure that evolved in an experiment, damaged.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Resilience {
    /// Its name.
    pub name: String,
    /// The experiment.
    pub of: String,
    /// The structure, by its name in tables, or with dashes.
    pub structure: String,
    /// Robots in each of the areas.
    pub robots_in_areas: Vec<u32>,
    /// Runs of what is drawn at random.
    pub repeat: u32,
    /// If no run of the experiment has the structure: so many runs more at most, until one has.
    #[serde(default)]
    pub further_runs: u32,
}

fn default_grids() -> Vec<String> {
    vec!["15x15".to_owned()]
}

fn default_robots() -> Vec<u32> {
    vec![100]
}

fn default_models() -> Vec<String> {
    vec!["c".to_owned()]
}

fn default_noise() -> Vec<f64> {
    vec![0.0]
}

fn default_predictions() -> Vec<String> {
    vec!["free".to_owned()]
}

fn default_first_seed() -> u64 {
    1
}

/// A suite cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SuiteError {
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// It is not a suite; the message has the place.
    #[error("{}: {error}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: Box<toml::de::Error>,
    },
    /// A value is not valid.
    #[error("{}: experiment {experiment:?}: {problem}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The experiment.
        experiment: String,
        /// What is wrong and what would be valid.
        problem: String,
    },
}

impl Resilience {
    /// The structure; none if there is none of that name.
    #[must_use]
    pub fn structure(&self) -> Option<Structure> {
        let spaced = self.structure.replace('-', " ");
        Structure::ALL.into_iter().find(|s| s.name() == spaced)
    }
}

impl Suite {
    /// The paper's suite.
    ///
    /// # Errors
    /// None: a test holds it to be well-formed.
    pub fn paper() -> Result<Self, SuiteError> {
        Self::parse(Path::new("paper.toml"), PAPER)
    }

    /// Reads a suite.
    ///
    /// # Errors
    /// [`SuiteError`] names the file and the place in it.
    pub fn read(path: &Path) -> Result<Self, SuiteError> {
        let text = std::fs::read_to_string(path).map_err(|error| SuiteError::Unreadable {
            path: path.to_owned(),
            error,
        })?;
        Self::parse(path, &text)
    }

    /// Reads a suite's text; the path is for errors.
    ///
    /// # Errors
    /// [`SuiteError`] names the file and the place in it.
    pub fn parse(path: &Path, text: &str) -> Result<Self, SuiteError> {
        let suite: Self = toml::from_str(text).map_err(|error| SuiteError::Toml {
            path: path.to_owned(),
            error: Box::new(error),
        })?;
        let invalid = |experiment: &str, problem: String| SuiteError::Invalid {
            path: path.to_owned(),
            experiment: experiment.to_owned(),
            problem,
        };
        let names: Vec<&str> = suite.experiments.iter().map(|e| e.name.as_str()).collect();
        for (index, experiment) in suite.experiments.iter().enumerate() {
            if experiment.runs == 0 {
                return Err(invalid(
                    &experiment.name,
                    "runs = 0: expected at least 1".into(),
                ));
            }
            if names[..index].contains(&experiment.name.as_str()) {
                return Err(invalid(
                    &experiment.name,
                    "two experiments have this name".into(),
                ));
            }
            plan::settings_of(experiment)
                .map_err(|error| invalid(&experiment.name, error.to_string()))?;
        }
        let referring = suite
            .reevaluations
            .iter()
            .flat_map(|r| r.of.iter().map(|of| (r.name.as_str(), of.as_str())))
            .chain(
                suite
                    .resiliences
                    .iter()
                    .map(|r| (r.name.as_str(), r.of.as_str())),
            );
        for (name, of) in referring {
            if !names.contains(&of) {
                let problem = format!("of = {of:?}: experiments are {}", names.join(", "));
                return Err(invalid(name, problem));
            }
        }
        for asked in &suite.resiliences {
            if asked.structure().is_none() {
                let names = Structure::ALL.map(Structure::name).join(", ");
                let problem = format!("structure = {:?}: structures are {names}", asked.structure);
                return Err(invalid(&asked.name, problem));
            }
        }
        Ok(suite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_suite_has_its_experiments_and_runs() {
        let suite = Suite::paper().unwrap();
        let plan = plan::Plan::new(&suite, None, None, true).unwrap();
        let runs = |name: &str| {
            let experiment = plan.experiments.iter().find(|e| e.name == name).unwrap();
            experiment
                .settings
                .iter()
                .map(|s| s.runs.len())
                .sum::<usize>()
        };
        let names = [
            "sensor-models",
            "densities",
            "partly-predefined",
            "predefined",
            "geometry",
            "noise",
        ];
        assert_eq!(names.map(runs), [120, 100, 100, 100, 100, 120]);
    }

    #[test]
    fn errors_name_the_place_and_what_is_valid() {
        let error = |text: &str| {
            let path = Path::new("own.toml");
            Suite::parse(path, text).unwrap_err().to_string()
        };
        let head = "name = \"own\"\n[[experiment]]\nname = \"one\"\nruns = 2\n";
        assert!(error(&format!("{head}gridds = []\n")).contains("line 5"));
        let grid = error(&format!("{head}grids = [\"2x2\"]\n"));
        assert!(grid.contains("one") && grid.contains("2x2") && grid.contains("from 3"));
        let none = error("name = \"own\"\n[[experiment]]\nname = \"one\"\nruns = 0\n");
        assert!(none.contains("runs = 0"), "{none}");
        let twice = error(&format!("{head}[[experiment]]\nname = \"one\"\nruns = 2\n"));
        assert!(twice.contains("two experiments"), "{twice}");
        let damage = "[[resilience]]\nname = \"damage\"\nof = \"one\"\nstructure = \"hexagon\"\nrobots-in-areas = [3]\nrepeat = 2\n";
        let hexagon = error(&format!("{head}{damage}"));
        assert!(
            hexagon.contains("hexagon") && hexagon.contains("triangular lattice"),
            "{hexagon}"
        );
        let of = "[[re-evaluation]]\nname = \"again\"\nof = [\"two\"]\nstarts = 3\n";
        assert!(error(&format!("{head}{of}")).contains("experiments are one"));
    }
}
