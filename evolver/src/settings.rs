//! Settings of an evolution: from a TOML file and flags of the same names, checked, and written
//! back in full.
//!
//! Every value remembers where it was given, so that an error can name the place.

use crate::files::{self, FileError, TEXT_BYTES_MAX};
use crate::text::path_of_text;
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;
use minimal_surprise_controller::{
    DecodeError, EncodedGenome, Genome, MutationRate, Prediction, SensorModel, Template, Topology,
};
use minimal_surprise_sim::{Grid, NoiseRate, Scenario};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// Names of all settings, in files as here, as flags with `--` before them.
pub const KEYS: [&str; 15] = [
    "grid",
    "robots",
    "sensor-model",
    "noise",
    "predefine",
    "predefine-partly",
    "population",
    "generations",
    "repetitions",
    "steps",
    "mutation",
    "from",
    "seed",
    "threads",
    "out",
];

/// Most generations of a run, genomes of a population and repetitions of an evaluation.
const COUNT_MAX: u32 = 1_000_000;

/// Most threads of a command.
const THREADS_MAX: u32 = 1024;

/// Where a setting was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// On the command line.
    Flag(&'static str),
    /// In a file.
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The setting.
        key: String,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(key) => write!(f, "--{key}"),
            Self::Line { path, line, key } => {
                write!(f, "{}, line {line}: {key}", path.display())
            }
        }
    }
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingError {
    /// The value is not valid.
    #[error("{place} = {value}: {problem}")]
    Invalid {
        /// Where it was given.
        place: Place,
        /// What was given.
        value: String,
        /// What is wrong and what would be valid.
        problem: String,
    },
    /// Two settings exclude each other.
    #[error("{first} and {second} exclude each other")]
    Conflict {
        /// Where the one was given.
        first: Place,
        /// Where the other was given.
        second: Place,
    },
    /// No setting has this name.
    #[error("{place} is not a setting; settings are {}", KEYS.join(", "))]
    UnknownKey {
        /// Where it was given.
        place: Place,
    },
    /// The file is not TOML.
    #[error("{}: {error}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its place.
        error: Box<toml::de::Error>,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] FileError),
}

/// Values as they were given, by name.
#[derive(Clone, Debug, Default)]
pub struct Given {
    values: BTreeMap<&'static str, (String, Place)>,
}

impl Given {
    /// Adds a flag's value, if it was given; it goes before a file's.
    pub fn flag(&mut self, key: &'static str, value: Option<&str>) {
        if let Some(value) = value {
            let place = Place::Flag(key);
            self.values.insert(key, (value.to_owned(), place));
        }
    }

    /// Adds a value that a flag would have had, unless one was given.
    pub fn flag_if_missing(&mut self, key: &'static str, value: &str) {
        if self.place(key).is_none() {
            self.flag(key, Some(value));
        }
    }

    /// Adds the values of a TOML file, except those already given.
    ///
    /// # Errors
    /// [`SettingError`] if the file cannot be read, is not TOML, or has unknown keys.
    pub fn file(&mut self, path: &Path) -> Result<(), SettingError> {
        self.text(path, &files::read_text(path, TEXT_BYTES_MAX)?)
    }

    /// Adds the values of a TOML text, likewise; the path is for errors.
    ///
    /// # Errors
    /// [`SettingError`] if it is not TOML, or has unknown keys.
    pub fn text(&mut self, path: &Path, text: &str) -> Result<(), SettingError> {
        let table = toml::de::DeTable::parse(text).map_err(|error| SettingError::Toml {
            path: path.to_owned(),
            error: Box::new(error),
        })?;
        for (name, value) in table.get_ref() {
            let line = 1 + text[..name.span().start].matches('\n').count();
            let place = Place::Line {
                path: path.to_owned(),
                line,
                key: name.get_ref().clone().into_owned(),
            };
            let Some(key) = KEYS.into_iter().find(|key| key == name.get_ref()) else {
                return Err(SettingError::UnknownKey { place });
            };
            let value = value.get_ref();
            let scalar = scalar_text(value).map_err(|problem| SettingError::Invalid {
                place: place.clone(),
                value: format!("({})", value.type_str()),
                problem: problem.to_owned(),
            })?;
            self.values.entry(key).or_insert((scalar, place));
        }
        Ok(())
    }

    /// The first setting that every `config.toml` of a run holds and that was not given.
    #[must_use]
    pub fn missing(&self) -> Option<String> {
        let defaults = Settings::resolve(&Self::default(), || 0).ok()?;
        let always = toml::Table::try_from(&defaults.written).ok()?;
        always
            .into_iter()
            .map(|(key, _)| key)
            .find(|key| self.place(key).is_none())
    }

    /// Takes a setting back.
    pub fn forget(&mut self, key: &str) {
        self.values.remove(key);
    }

    /// Whether a setting was given, and where.
    #[must_use]
    pub fn place(&self, key: &str) -> Option<&Place> {
        self.values.get(key).map(|(_, place)| place)
    }

    /// The value of a setting, turned into what it stands for, or the default.
    fn value<T>(
        &self,
        key: &str,
        default: T,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<T, SettingError> {
        match self.values.get(key) {
            None => Ok(default),
            Some((value, _)) => parse(value).map_err(|problem| self.invalid(key, problem)),
        }
    }

    /// An error about a setting; if it was not given, about its default.
    fn invalid(&self, key: &str, problem: String) -> SettingError {
        let given = self.values.get(key).cloned();
        let (value, place) = given.unwrap_or_else(|| {
            let key = KEYS.into_iter().find(|k| *k == key).unwrap_or("grid");
            ("(default)".to_owned(), Place::Flag(key))
        });
        SettingError::Invalid {
            place,
            value,
            problem,
        }
    }
}

/// Largest seed that is drawn: whole numbers up to here are exact in programs that compute JSON's
/// numbers in floating point.
pub const DRAWN_SEED_MAX: u64 = 1 << 53;

/// A seed as text, for JSON, if other programs would read another number.
#[must_use]
pub fn seed_text(seed: u64) -> Option<String> {
    (seed > DRAWN_SEED_MAX).then(|| seed.to_string())
}

/// Adds a seed to an object of JSON, and as `seed_text` if need be.
pub fn add_seed(object: &mut serde_json::Value, seed: u64) {
    object["seed"] = seed.into();
    if let Some(text) = seed_text(seed) {
        object["seed_text"] = text.into();
    }
}

/// Checked settings of an evolution: all that its result depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Sensor model and predictions.
    pub topology: Topology,
    /// Grid, swarm size, evaluation length, noise.
    pub scenario: Scenario,
    /// Genomes of a generation.
    pub population: u32,
    /// Generations.
    pub generations: u32,
    /// Repetitions of an evaluation.
    pub repetitions: u32,
    /// Probability that a weight mutates.
    pub mutation: MutationRate,
    /// Root of all random streams.
    pub seed: u64,
    /// A genome whose mutants are the first population.
    pub from: Option<Genome>,
    /// The same as they are written.
    pub written: Written,
}

/// Resolved settings as `config.toml` holds them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub struct Written {
    pub grid: String,
    pub robots: u32,
    pub sensor_model: String,
    pub noise: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predefine: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predefine_partly: Option<String>,
    pub population: u32,
    pub generations: u32,
    pub repetitions: u32,
    pub steps: u32,
    pub mutation: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    pub seed: u64,
}

impl Settings {
    /// Checks everything that was given and fills in the paper's defaults (Tab. 3).
    ///
    /// # Errors
    /// [`SettingError`] names the place, the value and what would be valid.
    pub fn resolve(given: &Given, draw_seed: impl FnOnce() -> u64) -> Result<Self, SettingError> {
        let default_grid = Grid::new(15, 15).map_err(|e| given.invalid("grid", e.to_string()))?;
        let grid = given.value("grid", default_grid, parse_grid)?;
        let robots = given.value("robots", 100, |text| count(text, grid.cells()))?;
        let steps = given.value("steps", 500, |text| count(text, u32::MAX))?;
        let noise = given.value("noise", 0.0, probability)?;
        let topology = resolve_topology(given)?;
        let partly_20x20 = matches!(topology.prediction(), Prediction::PartlyPredefined(_))
            && (grid.width(), grid.height()) == (20, 20);
        let default_mutation = if partly_20x20 { 0.3 } else { 0.1 };
        let mutation = given.value("mutation", default_mutation, probability)?;
        let noise_rate =
            NoiseRate::new(noise).ok_or_else(|| given.invalid("noise", PROBABILITY.to_owned()))?;
        let mutation_rate =
            MutationRate::from_per_2_32((mutation * 4_294_967_296.0).round() as u64)
                .ok_or_else(|| given.invalid("mutation", PROBABILITY.to_owned()))?;
        let scenario = Scenario::new(grid, robots, steps, noise_rate)
            .map_err(|error| given.invalid("robots", error.to_string()))?;
        let population = given.value("population", 50, |text| count(text, COUNT_MAX))?;
        let matches_max = scenario.scored_bits(topology.sensors());
        if matches_max.checked_mul(population.into()).is_none() {
            let problem = format!(
                "{robots} robots and {steps} steps: the matches of a generation would not fit 64 \
                 bits; lower one of them or the population"
            );
            let keys = ["population", "robots", "steps"];
            let named = keys.into_iter().find(|key| given.place(key).is_some());
            return Err(given.invalid(named.unwrap_or(keys[0]), problem));
        }
        let generations = given.value("generations", 100, |text| count(text, COUNT_MAX))?;
        let repetitions = given.value("repetitions", 10, |text| count(text, COUNT_MAX))?;
        let from = given.value("from", None, |text| {
            read_genome_for(&path_of_text(text), topology).map(Some)
        })?;
        let from_path = given.value("from", None, |text| Ok(Some(text.to_owned())))?;
        let seed = match given.place("seed") {
            Some(_) => given.value("seed", 0, seed)?,
            None => draw_seed(),
        };
        let template_name = |partly: bool| match topology.prediction() {
            Prediction::Predefined(template) if !partly => Some(template.name().to_owned()),
            Prediction::PartlyPredefined(template) if partly => Some(template.name().to_owned()),
            _ => None,
        };
        Ok(Self {
            topology,
            scenario,
            population,
            generations,
            repetitions,
            mutation: mutation_rate,
            seed,
            from,
            written: Written {
                grid: grid.to_string(),
                robots,
                sensor_model: model_name(topology.model()).to_owned(),
                noise,
                predefine: template_name(false),
                predefine_partly: template_name(true),
                population,
                generations,
                repetitions,
                steps,
                mutation,
                from: from_path,
                seed,
            },
        })
    }

    /// A name for the run: model, predictions, grid, seed.
    #[must_use]
    pub fn run_name(&self) -> String {
        let predictions = match self.topology.prediction() {
            Prediction::Free => "free".to_owned(),
            Prediction::PartlyPredefined(template) => format!("partly-{}", template.name()),
            Prediction::Predefined(template) => template.name().to_owned(),
        };
        let Written {
            grid,
            sensor_model,
            seed,
            ..
        } = &self.written;
        format!("{sensor_model}-{predictions}-{grid}-seed-{seed}")
    }

    /// Robot-steps of one generation.
    #[must_use]
    pub fn robot_steps_per_generation(&self) -> u64 {
        u64::from(self.population)
            .saturating_mul(self.repetitions.into())
            .saturating_mul(self.scenario.steps().into())
            .saturating_mul(self.scenario.robots().into())
    }

    /// Bits scored in one repetition: a fitness is a number of matches over this.
    #[must_use]
    pub fn scored_bits(&self) -> u64 {
        self.scenario.scored_bits(self.topology.sensors())
    }
}

/// Number of threads, if one was given.
///
/// # Errors
/// [`SettingError`] unless it is a whole number from 1.
pub fn threads(given: &Given) -> Result<Option<u32>, SettingError> {
    given.value("threads", None, |text| thread_count(text).map(Some))
}

/// The run directory, if one was given.
#[must_use]
pub fn out(given: &Given) -> Option<PathBuf> {
    given
        .values
        .get("out")
        .map(|(value, _)| path_of_text(value))
}

/// A string as it stands; a number without its underscores.
fn scalar_text(value: &toml::de::DeValue<'_>) -> Result<String, &'static str> {
    if let Some(text) = value.as_str() {
        Ok(text.to_owned())
    } else if let Some(integer) = value.as_integer() {
        if integer.radix() == 10 {
            Ok(integer.as_str().replace('_', ""))
        } else {
            Err("expected a decimal number")
        }
    } else if let Some(float) = value.as_float() {
        Ok(float.as_str().replace('_', ""))
    } else {
        Err("expected a number or a string")
    }
}

const PROBABILITY: &str = "expected a probability from 0 to 1";

/// A probability.
///
/// # Errors
/// What would be valid.
pub fn probability(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err(PROBABILITY.to_owned()),
    }
}

/// A whole number from 1 to `most`.
///
/// # Errors
/// What would be valid.
pub fn count(text: &str, most: u32) -> Result<u32, String> {
    match text.parse() {
        Ok(value) if (1..=most).contains(&value) => Ok(value),
        _ => Err(format!("expected a whole number from 1 to {most}")),
    }
}

/// A number of threads.
///
/// # Errors
/// What would be valid.
pub fn thread_count(text: &str) -> Result<u32, String> {
    count(text, THREADS_MAX)
}

/// A grid written as `15x15`.
///
/// # Errors
/// What would be valid.
pub fn parse_grid(text: &str) -> Result<Grid, String> {
    let sides = text
        .split_once('x')
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let (width, height) =
        sides.ok_or_else(|| "expected width and height in cells, as in 15x15".to_owned())?;
    Grid::new(width, height).map_err(|error| error.to_string())
}

/// A seed.
///
/// # Errors
/// What would be valid.
pub fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("expected a whole number from 0 to {}", u64::MAX))
}

fn parse_model(text: &str) -> Result<SensorModel, String> {
    SensorModel::ALL
        .into_iter()
        .find(|&model| model_name(model).eq_ignore_ascii_case(text))
        .ok_or_else(|| "sensor models are a, b and c".to_owned())
}

/// The name of a sensor model in files and flags.
#[must_use]
pub fn model_name(model: SensorModel) -> &'static str {
    match model {
        SensorModel::A => "a",
        SensorModel::B => "b",
        SensorModel::C => "c",
    }
}

fn parse_template(text: &str) -> Result<Template, String> {
    Template::ALL
        .into_iter()
        .find(|template| template.name() == text)
        .ok_or_else(|| {
            let names = Template::ALL.map(Template::name);
            format!("templates are {}", names.join(", "))
        })
}

/// The topology that the settings ask for.
///
/// # Errors
/// [`SettingError`] if it does not exist.
pub fn resolve_topology(given: &Given) -> Result<Topology, SettingError> {
    let model = given.value("sensor-model", SensorModel::C, parse_model)?;
    let prediction = match (given.place("predefine"), given.place("predefine-partly")) {
        (Some(first), Some(second)) => {
            return Err(SettingError::Conflict {
                first: first.clone(),
                second: second.clone(),
            });
        }
        (Some(_), None) => {
            let template = given.value("predefine", Template::Line, parse_template)?;
            Prediction::Predefined(template)
        }
        (None, Some(_)) => {
            let template = given.value("predefine-partly", Template::Line, parse_template)?;
            Prediction::PartlyPredefined(template)
        }
        (None, None) => Prediction::Free,
    };
    Topology::new(model, prediction).map_err(|error| {
        let key = match prediction {
            Prediction::PartlyPredefined(_) => "predefine-partly",
            _ => "predefine",
        };
        given.invalid(key, error.to_string())
    })
}

/// A genome file for a topology.
fn read_genome_for(path: &Path, topology: Topology) -> Result<Genome, String> {
    let bytes = files::read(path, CONTAINER_BYTES_MAX as u64).map_err(|e| e.error.to_string())?;
    let encoded = EncodedGenome::decode(&bytes).map_err(|error: DecodeError| error.to_string())?;
    if encoded.topology() == topology {
        Ok(encoded.to_genome())
    } else {
        Err(format!(
            "the genome is for {}, the run is for {}",
            describe(encoded.topology()),
            describe(topology)
        ))
    }
}

/// A topology in words.
#[must_use]
pub fn describe(topology: Topology) -> String {
    let model = model_name(topology.model()).to_uppercase();
    match topology.prediction() {
        Prediction::Free => format!("sensor model {model}, predictions free"),
        Prediction::PartlyPredefined(template) => {
            format!(
                "sensor model {model}, {} partly predefined",
                template.name()
            )
        }
        Prediction::Predefined(template) => {
            format!("sensor model {model}, {} predefined", template.name())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(flags: &[(&'static str, &str)]) -> Given {
        let mut given = Given::default();
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
        let settings = Settings::resolve(&Given::default(), || 42).unwrap();
        let written = toml::to_string(&settings.written).unwrap();
        let expected = "grid = \"15x15\"\nrobots = 100\nsensor-model = \"c\"\nnoise = 0.0\n\
            population = 50\ngenerations = 100\nrepetitions = 10\nsteps = 500\nmutation = 0.1\n\
            seed = 42\n";
        assert_eq!(written, expected);
    }

    #[test]
    fn mutation_defaults_to_0_3_for_the_partly_predefined_line_on_20x20_only() {
        let mutation = |grid: &str| {
            let given = given(&[("grid", grid), ("predefine-partly", "line")]);
            Settings::resolve(&given, || 1).unwrap().written.mutation
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
