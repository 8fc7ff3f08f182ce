//! Settings of an evolution. They come from a TOML file, from flags of the same names or from a
//! program, and are checked and written back in full.

mod overrides;
mod table;
mod values;

pub use overrides::{Overrides, Place};
pub use table::{SETTINGS, Scalar, ScalarKind, Setting, SettingsBuilder, setting};
pub use values::{
    COUNT_MAX, DRAWN_SEED_MAX, THREADS_MAX, add_seed, count, describe, grid, model_name,
    probability, seed, seed_text,
};

use crate::files::FileError;
use crate::genome_file::GenomeFile;
use crate::variation::Variation;
use minimal_surprise_controller::{Genome, MutationRate, Prediction, Topology};
use minimal_surprise_sim::{NoiseRate, Scenario};
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use table::Values;

/// Error: a setting cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// The value is not valid.
    #[error("{place} = {value}: {problem}")]
    Invalid {
        /// Place where the value was given.
        place: Place,
        /// The given value.
        value: String,
        /// Description of the problem and of valid values.
        problem: String,
    },
    /// Two settings exclude each other.
    #[error("{first} and {second} exclude each other")]
    Conflict {
        /// Place of one setting.
        first: Place,
        /// Place of the other setting.
        second: Place,
    },
    /// No setting has this name.
    #[error("{place} is not a setting; settings are {}", names())]
    UnknownKey {
        /// Place where the name was given.
        place: Place,
    },
    /// The file is not valid TOML.
    #[error("{}: {error}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// The error, with its position.
        error: Box<toml::de::Error>,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] FileError),
}

/// Returns the names of all settings.
fn names() -> String {
    let names: Vec<&str> = SETTINGS.iter().map(|setting| setting.name).collect();
    names.join(", ")
}

/// Checked settings of an evolution: everything that its result depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    values: Values,
    topology: Topology,
    scenario: Scenario,
    variation: Variation,
    ancestor: Option<Genome>,
}

/// A problem with one of these settings. It is attributed to the first that was given, or to the
/// first in the list if none was.
type Problem = (&'static [&'static str], String);

impl SettingsBuilder {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`SettingError`] if a setting is invalid; the message names the setting, its value and the
    /// valid values.
    pub fn build(self) -> Result<Settings, SettingError> {
        let mut values = self.0;
        let seed = values.seed.unwrap_or(0);
        values.seed = Some(seed);
        checked(values.clone()).map_err(|(keys, problem)| SettingError::Invalid {
            place: Place::Builder(keys[0]),
            value: setting(keys[0])
                .and_then(|setting| (setting.get)(&values))
                .map_or_else(|| "(default)".to_owned(), |value| value.to_string()),
            problem,
        })
    }
}

impl Settings {
    /// Returns a builder for settings defined in a program.
    #[must_use]
    pub fn builder() -> SettingsBuilder {
        SettingsBuilder::default()
    }

    /// Checks all given values and fills in the paper's defaults (Tab. 3).
    ///
    /// # Errors
    /// [`SettingError`] if a setting is invalid; the message names the place, the value and the
    /// valid values.
    pub fn resolve(
        overrides: &Overrides,
        draw_seed: impl FnOnce() -> u64,
    ) -> Result<Self, SettingError> {
        let mut values = overrides.values()?;
        values.seed.get_or_insert_with(draw_seed);
        (values.threads, values.out) = (None, None);
        checked(values).map_err(|(keys, problem)| overrides.invalid(keys, problem))
    }

    /// Returns the sensor model and the predictions.
    #[must_use]
    pub fn topology(&self) -> Topology {
        self.topology
    }

    /// Returns the grid, swarm size, evaluation length and noise.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Returns the number of genomes per generation.
    #[must_use]
    pub fn population(&self) -> u32 {
        self.values.population
    }

    /// Returns the number of generations.
    #[must_use]
    pub fn generations(&self) -> u32 {
        self.values.generations
    }

    /// Returns the number of repetitions per evaluation.
    #[must_use]
    pub fn repetitions(&self) -> u32 {
        self.values.repetitions
    }

    /// Returns the given probability that a sensor bit is flipped.
    #[must_use]
    pub fn noise(&self) -> f64 {
        self.values.noise
    }

    /// Returns the given probability that a weight mutates.
    #[must_use]
    pub fn mutation(&self) -> f64 {
        self.values.mutation.unwrap_or(DEFAULT_MUTATION)
    }

    /// Returns the rules for creating the next generation.
    #[must_use]
    pub fn variation(&self) -> Variation {
        self.variation
    }

    /// Returns the root of all random streams.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.values.seed.unwrap_or(0)
    }

    /// Returns these settings with a different seed.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.values.seed = Some(seed);
        self
    }

    /// Returns the genome whose mutants form the first population.
    #[must_use]
    pub fn ancestor(&self) -> Option<&Genome> {
        self.ancestor.as_ref()
    }

    /// Returns the settings in `config.toml`, by name: everything that the result depends on.
    pub fn config(&self) -> impl Iterator<Item = (&'static str, Scalar)> {
        let values = |setting: &Setting| Some((setting.name, (setting.get)(&self.values)?));
        SETTINGS.iter().filter_map(values)
    }

    /// Returns the value of a setting in `config.toml`.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<Scalar> {
        (setting(name)?.get)(&self.values)
    }

    /// Formats the settings as `config.toml`.
    ///
    /// # Panics
    /// Never: TOML can represent any number and text.
    #[must_use]
    pub fn toml(&self) -> String {
        toml::to_string(&Config(self)).expect("plain numbers and strings")
    }

    /// Returns a name for the run: model, predictions, grid, seed.
    #[must_use]
    pub fn run_name(&self) -> String {
        let predictions = match self.topology.prediction() {
            Prediction::Free => "free".to_owned(),
            Prediction::PartlyPredefined(template) => format!("partly-{}", template.name()),
            Prediction::Predefined(template) => template.name().to_owned(),
        };
        let model = model_name(self.topology.model());
        let (grid, seed) = (self.scenario.grid(), self.seed());
        format!("{model}-{predictions}-{grid}-seed-{seed}")
    }

    /// Returns the number of robot-steps per generation.
    #[must_use]
    pub fn robot_steps_per_generation(&self) -> u64 {
        u64::from(self.population())
            .saturating_mul(self.repetitions().into())
            .saturating_mul(self.scenario.steps().into())
            .saturating_mul(self.scenario.robots().into())
    }

    /// Returns the number of robot-steps of the whole evolution.
    #[must_use]
    pub fn robot_steps(&self) -> u64 {
        let generations = u64::from(self.generations());
        self.robot_steps_per_generation()
            .saturating_mul(generations)
    }

    /// Returns the number of bits scored in one repetition, by which the matches are divided to
    /// compute the fitness.
    #[must_use]
    pub fn scored_bits(&self) -> u64 {
        self.scenario.scored_bits(self.topology.sensors())
    }
}

/// The contents of `config.toml`.
struct Config<'a>(&'a Settings);

impl Serialize for Config<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.config())
    }
}

const DEFAULT_MUTATION: f64 = 0.1;

/// Checks individually valid values for consistency with each other.
fn checked(mut values: Values) -> Result<Settings, Problem> {
    let topology = topology(&values)?;
    let noise = NoiseRate::new(values.noise)
        .ok_or_else(|| (&["noise"][..], values::PROBABILITY.to_owned()))?;
    let scenario = Scenario::new(values.grid, values.robots, values.steps, noise)
        .map_err(|error| (&["robots"][..], error.to_string()))?;
    let partly_20x20 = matches!(topology.prediction(), Prediction::PartlyPredefined(_))
        && (values.grid.width(), values.grid.height()) == (20, 20);
    let default_mutation = if partly_20x20 { 0.3 } else { DEFAULT_MUTATION };
    let mutation = *values.mutation.get_or_insert(default_mutation);
    let per_2_32 = |probability: f64| (probability * 4_294_967_296.0).round() as u64;
    let variation = Variation {
        selection: values.selection,
        crossover_per_2_32: per_2_32(values.crossover),
        mutation: MutationRate::from_per_2_32(per_2_32(mutation))
            .ok_or_else(|| (&["mutation"][..], values::PROBABILITY.to_owned()))?,
    };
    let matches_max = scenario.scored_bits(topology.sensors());
    if matches_max.checked_mul(values.population.into()).is_none() {
        let Values { robots, steps, .. } = values;
        return Err((
            &["population", "robots", "steps"],
            format!(
                "{robots} robots and {steps} steps: the matches of a generation would not fit 64 \
                 bits; lower one of them or the population"
            ),
        ));
    }
    let ancestor = match &values.from {
        None => None,
        Some(path) => {
            Some(read_genome_for(path, topology).map_err(|problem| (&["from"][..], problem))?)
        }
    };
    Ok(Settings {
        topology,
        scenario,
        variation,
        ancestor,
        values,
    })
}

/// Returns the topology selected by the settings.
fn topology(values: &Values) -> Result<Topology, Problem> {
    let (key, prediction): (&[_], _) = match (values.predefine, values.predefine_partly) {
        (None, None) => (&["predefine"], Prediction::Free),
        (Some(template), None) => (&["predefine"], Prediction::Predefined(template)),
        (None, Some(template)) => (
            &["predefine-partly"],
            Prediction::PartlyPredefined(template),
        ),
        (Some(_), Some(_)) => {
            return Err((
                &["predefine"],
                "predefine and predefine-partly exclude each other".to_owned(),
            ));
        }
    };
    Topology::new(values.sensor_model, prediction).map_err(|error| (key, error.to_string()))
}

/// Reads a genome file and checks its topology.
fn read_genome_for(path: &Path, topology: Topology) -> Result<Genome, String> {
    let file = GenomeFile::read(path).map_err(|error| error.problem())?;
    if file.topology() == topology {
        Ok(file.genome().clone())
    } else {
        Err(format!(
            "the genome is for {}, but the run is for {}",
            describe(file.topology()),
            describe(topology)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(flags: &[(&'static str, &str)]) -> Overrides {
        let mut given = Overrides::default();
        for (key, value) in flags {
            given.flag(key, Some(value));
        }
        given
    }

    fn error(flags: &[(&'static str, &str)]) -> String {
        Settings::resolve(&given(flags), || 1)
            .expect_err("these settings are wrong")
            .to_string()
    }

    #[test]
    fn without_settings_the_papers_defaults_hold() {
        let settings = Settings::resolve(&Overrides::default(), || 42).unwrap();
        let written = settings.toml();
        let expected = "grid = \"15x15\"\nrobots = 100\nsensor-model = \"c\"\nnoise = 0.0\n\
            population = 50\ngenerations = 100\nrepetitions = 10\nsteps = 500\nmutation = 0.1\n\
            seed = 42\n";
        assert_eq!(written, expected);
    }

    #[test]
    fn mutation_defaults_to_0_3_for_the_partly_predefined_line_on_20x20_only() {
        let mutation = |grid: &str| {
            let given = given(&[("grid", grid), ("predefine-partly", "line")]);
            Settings::resolve(&given, || 1).unwrap().mutation()
        };
        assert_eq!(mutation("20x20"), 0.3);
        assert_eq!(mutation("15x15"), 0.1);
    }

    #[test]
    fn errors_name_the_flag_the_value_and_what_is_valid() {
        assert_eq!(
            error(&[("grid", "2x15")]),
            "--grid = 2x15: a grid of 2x15; each side must be from 3 to 16384 cells"
        );
        assert_eq!(
            error(&[("robots", "226")]),
            "--robots = 226: expected a whole number from 1 to 225"
        );
        assert_eq!(
            error(&[("noise", "NaN")]),
            "--noise = NaN: expected a probability from 0 to 1"
        );
        assert_eq!(
            error(&[("predefine", "square"), ("sensor-model", "a")]),
            "--predefine = square: the template square does not exist for sensor model A, only for C"
        );
        assert_eq!(
            error(&[("predefine", "line"), ("predefine-partly", "line")]),
            "--predefine and --predefine-partly exclude each other"
        );
        assert_eq!(
            error(&[("grid", "9x9")]),
            "--robots = (default): 100 robots on a 9x9 grid; from 1 to 81 fit"
        );
    }
}
