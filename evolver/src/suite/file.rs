//! The file of a suite: experiments, re-evaluations and damage experiments.

use super::experiment::ExperimentTable;
use minimal_surprise_evolution::files::{self, FileError, TEXT_BYTES_MAX};
use minimal_surprise_evolution::text::{self, is_hidden};
use minimal_surprise_sim::Structure;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The suite of the paper's experimental section.
pub const PAPER: &str = include_str!("paper.toml");

/// A suite, as written in its file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Suite {
    /// Name of the suite.
    pub name: String,
    /// Source of the numbers that the report compares its results with.
    pub compare_with: Option<Reference>,
    /// Evolutions.
    #[serde(default, rename = "experiment")]
    pub experiments: Vec<ExperimentTable>,
    /// Re-evaluations of the best genomes from new starts.
    #[serde(default, rename = "re-evaluation")]
    pub reevaluations: Vec<Reevaluation>,
    /// Damage experiments on the suite's structures.
    #[serde(default, rename = "resilience")]
    pub resiliences: Vec<Resilience>,
}

/// Source of the numbers that the report compares its results with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reference {
    /// The paper's tables and text.
    Paper,
}

/// Re-evaluation of the best genomes of some experiments from new starts.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Reevaluation {
    /// Name of the re-evaluation.
    pub name: String,
    /// The experiments.
    pub of: Vec<String>,
    /// Number of new starts per genome.
    pub starts: u32,
}

/// A damage experiment on a structure that another experiment evolved.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Resilience {
    /// Name of the damage experiment.
    pub name: String,
    /// Name of the experiment that evolved the structure.
    pub of: String,
    /// Name of the structure, with spaces or dashes.
    pub structure: String,
    /// Number of robots in each area.
    pub robots_in_areas: Vec<u32>,
    /// Number of runs for each row that involves random draws.
    pub repeat: u32,
    /// Maximum number of further runs: if no planned run has the structure, more runs are evolved
    /// until one has it.
    #[serde(default)]
    pub further_runs: u32,
}

/// Maximum number of areas in a damage experiment, since areas are named A to Z.
const AREAS_MAX: usize = 26;

/// Maximum value of every count in a suite, the same as on the command line.
const COUNT_MAX: u32 = 1_000_000;

fn check_count(key: &str, value: u32) -> Result<(), String> {
    if (1..=COUNT_MAX).contains(&value) {
        return Ok(());
    }
    Err(format!(
        "{key} = {value}: expected at least 1, at most {COUNT_MAX}"
    ))
}

/// Checks a name: it must have visible characters, since it is printed, typed, and converted to
/// file names.
fn check_name(name: &str) -> Result<(), String> {
    if let Some(hidden) = name.chars().find(|&c| is_hidden(c)) {
        return Err(format!(
            "name = {name:?}: expected visible characters, not {}",
            text::terminal(&hidden.to_string())
        ));
    }
    if name.chars().all(|c| c == '.' || c.is_whitespace()) {
        return Err(format!("name = {name:?}: expected a name"));
    }
    Ok(())
}

fn check_list<T>(key: &str, list: &[T]) -> Result<(), String> {
    if list.is_empty() {
        return Err(format!("{key} = []: expected at least one"));
    }
    Ok(())
}

fn check_of(of: &str, names: &[&str]) -> Result<(), String> {
    if names.contains(&of) {
        return Ok(());
    }
    Err(format!(
        "of = {of:?}: expected one of the experiments: {}",
        names.join(", ")
    ))
}

/// Maximum number of combinations of settings in a suite; each may have many runs.
const COMBINATIONS_MAX: u64 = 1_000_000;

/// Adds the number of an experiment's combinations to the sum, and checks the sum.
pub(super) fn check_combinations(
    experiment: &ExperimentTable,
    sum: &mut u64,
) -> Result<(), String> {
    *sum = sum.saturating_add(experiment.combinations());
    if *sum <= COMBINATIONS_MAX {
        return Ok(());
    }
    Err(format!(
        "the experiments up to this one have {sum} combinations of listed values; expected at \
         most {COMBINATIONS_MAX} in a suite"
    ))
}

/// Checks that no seed of the runs exceeds the maximum.
pub(super) fn check_seeds(first_seed: u64, runs: u32) -> Result<(), String> {
    match first_seed.checked_add(u64::from(runs)) {
        Some(_) => Ok(()),
        None => Err(format!(
            "first-seed = {first_seed}: expected at most {} with {runs} runs",
            u64::MAX - u64::from(runs)
        )),
    }
}

/// Checks an experiment, and adds the number of its combinations to the sum.
fn check_experiment(experiment: &ExperimentTable, combinations: &mut u64) -> Result<(), String> {
    check_name(&experiment.name)?;
    check_count("runs", experiment.runs)?;
    for (setting, values) in experiment.lists() {
        check_list(setting.list, values)?;
    }
    check_list("predictions", &experiment.predictions)?;
    check_seeds(experiment.first_seed, experiment.runs)?;
    check_combinations(experiment, combinations)?;
    (0..experiment.combinations()).try_for_each(|combination| {
        let settings = experiment.settings(combination);
        settings.map(|_| ()).map_err(|error| error.to_string())
    })
}

impl Reevaluation {
    fn check(&self, names: &[&str]) -> Result<(), String> {
        check_name(&self.name)?;
        check_list("of", &self.of)?;
        self.of.iter().try_for_each(|of| check_of(of, names))?;
        check_count("starts", self.starts)
    }
}

/// The reason why a suite cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SuiteError {
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] FileError),
    /// The file is not a valid suite; the message contains the line and column.
    #[error("{}: {error}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// The problem.
        error: Box<toml::de::Error>,
    },
    /// The suite has no experiments.
    #[error("{}: no [[experiment]]: expected at least one", path.display())]
    NoExperiment {
        /// The file.
        path: PathBuf,
    },
    /// The suite's name is not valid.
    #[error("{}: {problem}", path.display())]
    Name {
        /// The file.
        path: PathBuf,
        /// The problem and the valid values.
        problem: String,
    },
    /// A value is not valid.
    #[error("{}: experiment {experiment:?}: {problem}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The experiment.
        experiment: String,
        /// The problem and the valid values.
        problem: String,
    },
}

impl Resilience {
    /// Returns the structure; `None` if the name is unknown.
    #[must_use]
    pub fn structure(&self) -> Option<Structure> {
        let spaced = self.structure.replace('-', " ");
        Structure::ALL.into_iter().find(|s| s.name() == spaced)
    }

    fn check(&self, experiments: &[ExperimentTable]) -> Result<(), String> {
        check_name(&self.name)?;
        let names: Vec<&str> = experiments.iter().map(|e| e.name.as_str()).collect();
        check_of(&self.of, &names)?;
        if self.structure().is_none() {
            let names = Structure::ALL.map(Structure::name).join(", ");
            return Err(format!(
                "structure = {:?}: expected one of: {names}",
                self.structure
            ));
        }
        check_list("robots-in-areas", &self.robots_in_areas)?;
        if self.robots_in_areas.len() > AREAS_MAX {
            let found = self.robots_in_areas.len();
            return Err(format!(
                "robots-in-areas: {found} areas: expected at most {AREAS_MAX}"
            ));
        }
        let of = experiments.iter().filter(|e| e.name == self.of);
        // At least one robot must remain.
        let smallest = of.filter_map(ExperimentTable::smallest_swarm).min();
        let most = smallest.map_or(0, |robots| robots - 1);
        for &robots in &self.robots_in_areas {
            if !(1..=most).contains(&robots) {
                return Err(format!(
                    "robots-in-areas = {:?}: {robots}: expected from 1 to {most}, less than the \
                     smallest swarm size of {:?}",
                    self.robots_in_areas, self.of
                ));
            }
        }
        check_count("repeat", self.repeat)
    }
}

impl Suite {
    /// Parses the paper's suite.
    ///
    /// # Errors
    /// Never; a test checks that the suite is valid.
    pub fn paper() -> Result<Self, SuiteError> {
        Self::parse(Path::new("paper.toml"), PAPER)
    }

    /// Reads a suite file.
    ///
    /// # Errors
    /// [`SuiteError`] if the file cannot be read or is invalid; the message contains the position.
    pub fn read(path: &Path) -> Result<Self, SuiteError> {
        Self::parse(path, &files::read_text(path, TEXT_BYTES_MAX)?)
    }

    /// Parses a suite's text; `path` is used only in errors.
    ///
    /// # Errors
    /// [`SuiteError`] if the file cannot be read or is invalid; the message contains the position.
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
        check_name(&suite.name).map_err(|problem| SuiteError::Name {
            path: path.to_owned(),
            problem,
        })?;
        let names: Vec<&str> = suite.experiments.iter().map(|e| e.name.as_str()).collect();
        if names.is_empty() {
            return Err(SuiteError::NoExperiment {
                path: path.to_owned(),
            });
        }
        let mut combinations = 0;
        for (index, experiment) in suite.experiments.iter().enumerate() {
            let problem = if names[..index].contains(&experiment.name.as_str()) {
                Err("two experiments have this name".to_owned())
            } else {
                check_experiment(experiment, &mut combinations)
            };
            problem.map_err(|problem| invalid(&experiment.name, problem))?;
        }
        for again in &suite.reevaluations {
            let problem = again.check(&names);
            problem.map_err(|problem| invalid(&again.name, problem))?;
        }
        for damage in &suite.resiliences {
            let problem = damage.check(&suite.experiments);
            problem.map_err(|problem| invalid(&damage.name, problem))?;
        }
        Ok(suite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::plan::Plan;

    #[test]
    fn the_papers_suite_has_its_experiments_and_runs() {
        let suite = Suite::paper().unwrap();
        let plan = Plan::new(&suite, None, None, true).unwrap();
        let runs = |name: &str| {
            let experiment = plan.experiments.iter().find(|e| e.name == name).unwrap();
            experiment.settings().map(|s| s.number).sum::<u32>()
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
        assert!(error(&format!("{head}{of}")).contains("expected one of the experiments: one"));
    }

    #[test]
    fn a_value_that_nothing_could_be_made_of_is_named_with_what_is_valid() {
        let head = "name = \"own\"\n";
        let experiment = "[[experiment]]\nname = \"one\"\nruns = 2\n";
        let again = "[[re-evaluation]]\nname = \"again\"\nof = [\"one\"]\nstarts = 3\n";
        let damage = "[[resilience]]\nname = \"damage\"\nof = \"one\"\nstructure = \"line\"\n\
                      robots-in-areas = [3, 4]\nrepeat = 2\n";
        let parse = |text: &str| Suite::parse(Path::new("own.toml"), text);
        let whole = format!("{head}{experiment}{again}{damage}");
        parse(&whole).unwrap();
        let robots = |list: &str| format!("runs = 2\nrobots = {list}\n");
        for (from, to, words) in [
            (
                "runs = 2\n",
                robots("[]"),
                ["one", "robots = []", "at least one"],
            ),
            (
                "runs = 2\n",
                "runs = 2\ngrids = []\n".into(),
                ["one", "grids = []", "at least one"],
            ),
            (
                "runs = 2\n",
                "runs = 2\nnoise = []\n".into(),
                ["one", "noise = []", "at least one"],
            ),
            (
                "runs = 2\n",
                "runs = 2\nsensor-models = []\n".into(),
                ["one", "sensor-models = []", "at least one"],
            ),
            (
                "runs = 2\n",
                "runs = 2\npredictions = []\n".into(),
                ["one", "predictions = []", "at least one"],
            ),
            (
                "runs = 2\n",
                "runs = 1000001\n".into(),
                ["one", "runs = 1000001", "at most 1000000"],
            ),
            (
                "starts = 3",
                "starts = 0".into(),
                ["again", "starts = 0", "at least 1"],
            ),
            (
                "of = [\"one\"]",
                "of = []".into(),
                ["again", "of = []", "at least one"],
            ),
            (
                "repeat = 2",
                "repeat = 0".into(),
                ["damage", "repeat = 0", "at least 1"],
            ),
            (
                "[3, 4]",
                "[]".into(),
                ["damage", "robots-in-areas = []", "at least one"],
            ),
            (
                "[3, 4]",
                "[3, 0]".into(),
                ["damage", "robots-in-areas = [3, 0]", "from 1 to 99"],
            ),
            (
                "[3, 4]",
                "[100, 3]".into(),
                ["damage", "robots-in-areas = [100, 3]", "from 1 to 99"],
            ),
            (
                "runs = 2\n",
                robots("[4, 50]"),
                ["damage", "[3, 4]: 4", "from 1 to 3"],
            ),
            (
                "[3, 4]",
                format!("[{}]", "3, ".repeat(27)),
                ["damage", "27 areas", "at most 26"],
            ),
        ] {
            let error = parse(&whole.replacen(from, &to, 1))
                .unwrap_err()
                .to_string();
            for word in words {
                assert!(error.contains(word), "no {word:?} in {error}");
            }
        }
        let none = parse(head).unwrap_err().to_string();
        assert!(none.contains("no [[experiment]]"), "{none}");
    }

    #[test]
    fn seeds_that_there_are_not_are_refused_before_any_run() {
        let error = check_seeds(u64::MAX - 1, 2).unwrap_err();
        assert!(
            error.contains("first-seed = 18446744073709551614"),
            "{error}"
        );
        assert!(error.contains("at most 18446744073709551613"), "{error}");
        let mut suite = Suite::paper().unwrap();
        suite.experiments[0].first_seed = u64::MAX - 50;
        assert!(Plan::new(&suite, None, Some(50), false).is_ok());
        let error = Plan::new(&suite, None, Some(51), false).unwrap_err();
        assert!(error.to_string().contains("with 51 runs"), "{error}");
    }
}
