//! The table of settings, which defines each setting in one entry.
//!
//! The table generates the flags, their help, configuration keys, suite lists, documents and error
//! messages.

use super::values::{
    COUNT_MAX, THREADS_MAX, count, grid, model, model_name, probability, seed, template,
};
use crate::selection::Selection;
use crate::text::{path_of_text, text_of_path};
use minimal_surprise_controller::{SensorModel, Template};
use minimal_surprise_sim::Grid;
use serde::{Serialize, Serializer};
use std::path::PathBuf;

/// A setting of an evolution.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Setting {
    /// Name in files, and as a flag with `--` before it.
    pub name: &'static str,
    /// Name of the value in help texts.
    pub value_name: &'static str,
    /// True if a value is the path of a file or directory.
    pub is_path: bool,
    /// Default, as typed on the command line or described in words; empty if the setting has none.
    pub default: &'static str,
    /// Description of valid values.
    pub valid: &'static str,
    /// Type of the values in files.
    pub kind: ScalarKind,
    /// Key of the setting's list of values in a suite; empty if a suite has no such list.
    pub list: &'static str,
    meaning: &'static str,
    pub(super) set: fn(&mut Values, &str) -> Result<(), String>,
    pub(super) get: fn(&Values) -> Option<Scalar>,
}

impl Setting {
    /// Returns the meaning of the setting, as a sentence without its full stop.
    #[must_use]
    pub fn meaning(&self) -> &'static str {
        self.meaning.trim().trim_end_matches('.')
    }
}

/// Returns the setting with this name.
#[must_use]
pub fn setting(name: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|setting| setting.name == name)
}

/// A value in the form stored in files.
#[derive(Clone, Debug, PartialEq)]
pub enum Scalar {
    /// Text.
    Text(String),
    /// A whole number.
    Integer(u64),
    /// A number with a fraction.
    Float(f64),
}

/// Type of a [`Scalar`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScalarKind {
    /// [`Scalar::Text`].
    Text,
    /// [`Scalar::Integer`].
    Integer,
    /// [`Scalar::Float`].
    Float,
}

/// A type of setting, with the type of its values in files.
trait Value {
    const KIND: ScalarKind = ScalarKind::Text;
}

impl Value for u32 {
    const KIND: ScalarKind = ScalarKind::Integer;
}

impl Value for u64 {
    const KIND: ScalarKind = ScalarKind::Integer;
}

impl Value for f64 {
    const KIND: ScalarKind = ScalarKind::Float;
}

impl Value for Grid {}
impl Value for PathBuf {}
impl Value for Selection {}
impl Value for SensorModel {}
impl Value for Template {}

impl Serialize for Scalar {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Integer(integer) => serializer.serialize_u64(*integer),
            Self::Float(float) => serializer.serialize_f64(*float),
        }
    }
}

impl From<u32> for Scalar {
    fn from(value: u32) -> Self {
        Self::Integer(value.into())
    }
}

impl From<u64> for Scalar {
    fn from(value: u64) -> Self {
        Self::Integer(value)
    }
}

impl From<f64> for Scalar {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}

impl From<String> for Scalar {
    fn from(value: String) -> Self {
        Self::Text(value)
    }
}

impl From<&str> for Scalar {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

impl std::fmt::Display for Scalar {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Text(text) => text.fmt(f),
            Self::Integer(integer) => integer.fmt(f),
            Self::Float(float) => float.fmt(f),
        }
    }
}

/// Generates, for each entry, a field of [`Values`], a method of [`SettingsBuilder`] and a row of
/// [`SETTINGS`].
macro_rules! settings {
    ($(
        $(#[doc = $meaning:literal])+
        $field:ident($given:ty): $type:ty = $initial:expr,
        $name:literal, $value_name:literal, default $default:literal,
        valid $valid:expr, list $list:literal,
        parse $parse:expr,
        write $write:expr;
    )+) => {
        /// The values of all settings.
        #[derive(Clone, Debug, PartialEq)]
        pub(super) struct Values {
            $(pub(super) $field: $type,)+
        }

        impl Default for Values {
            fn default() -> Self {
                Self { $($field: $initial,)+ }
            }
        }

        /// Settings defined in a program. Unset values default to those of the paper; the seed
        /// defaults to 0.
        ///
        /// ```
        /// use minimal_surprise_evolution::settings::Settings;
        ///
        /// let settings = Settings::builder().robots(50).seed(7).build()?;
        /// assert_eq!(settings.scenario().robots(), 50);
        /// # Ok::<(), minimal_surprise_evolution::settings::SettingError>(())
        /// ```
        #[derive(Clone, Debug, Default)]
        pub struct SettingsBuilder(pub(super) Values);

        impl SettingsBuilder {
            $(
                $(#[doc = $meaning])+
                #[must_use]
                pub fn $field(mut self, $field: $given) -> Self {
                    self.0.$field = $field.into();
                    self
                }
            )+
        }

        /// All settings, in the order of files and help texts.
        pub const SETTINGS: &[Setting] = &[$(
            Setting {
                name: $name,
                value_name: $value_name,
                is_path: matches!($value_name.as_bytes(), b"GENOME" | b"DIR"),
                default: $default,
                valid: $valid,
                kind: <$given as Value>::KIND,
                list: $list,
                meaning: concat!($($meaning),+),
                set: |values, text| {
                    values.$field = ($parse)(text, values)?;
                    Ok(())
                },
                get: |values| ($write)(&values.$field),
            },
        )+];
    };
}

settings! {
    /// Width and height of the torus, in cells.
    grid(Grid): Grid = Grid::new(15, 15).expect("a valid grid"),
    "grid", "WxH", default "15x15",
    valid "width and height from 3 to 16384", list "grids",
    parse |text, _: &Values| grid(text),
    write |grid: &Grid| Some(grid.to_string().into());

    /// Swarm size.
    robots(u32): u32 = 100,
    "robots", "N", default "100",
    valid "from 1 to the number of cells of the grid", list "robots",
    parse |text, values: &Values| count(text, values.grid.cells()),
    write |&robots: &u32| Some(robots.into());

    /// Sensor model: a, b or c.
    sensor_model(SensorModel): SensorModel = SensorModel::C,
    "sensor-model", "MODEL", default "c",
    valid "`a`, `b` or `c`", list "sensor-models",
    parse |text, _: &Values| model(text),
    write |&model: &SensorModel| Some(model_name(model).into());

    /// Probability that a sensor bit is flipped.
    noise(f64): f64 = 0.0,
    "noise", "P", default "0",
    valid "from 0 to 1", list "noise",
    parse |text, _: &Values| probability(text),
    write |&noise: &f64| Some(noise.into());

    /// Fix all predictions to a template: line, pair, square or triangular-lattice.
    predefine(Template): Option<Template> = None,
    "predefine", "TEMPLATE", default "",
    valid "`line`, `pair`; with sensor model c also `square`, `triangular-lattice`", list "",
    parse |text, _: &Values| template(text).map(Some),
    write |template: &Option<Template>| template.map(|template| template.name().into());

    /// Fix only the predictions that the template sets: line (sensor model c).
    predefine_partly(Template): Option<Template> = None,
    "predefine-partly", "TEMPLATE", default "",
    valid "`line`, with sensor model c", list "",
    parse |text, _: &Values| template(text).map(Some),
    write |template: &Option<Template>| template.map(|template| template.name().into());

    /// Genomes per generation.
    population(u32): u32 = 50,
    "population", "N", default "50",
    valid "from 1 to 1000000", list "population",
    parse |text, _: &Values| count(text, COUNT_MAX),
    write |&population: &u32| Some(population.into());

    /// Generations.
    generations(u32): u32 = 100,
    "generations", "N", default "100",
    valid "from 1 to 1000000", list "generations",
    parse |text, _: &Values| count(text, COUNT_MAX),
    write |&generations: &u32| Some(generations.into());

    /// Repetitions per evaluation; the worst counts.
    repetitions(u32): u32 = 10,
    "repetitions", "N", default "10",
    valid "from 1 to 1000000", list "repetitions",
    parse |text, _: &Values| count(text, COUNT_MAX),
    write |&repetitions: &u32| Some(repetitions.into());

    /// Steps per repetition.
    steps(u32): u32 = 500,
    "steps", "N", default "500",
    valid "from 1 to 4294967295", list "steps",
    parse |text, _: &Values| count(text, u32::MAX),
    write |&steps: &u32| Some(steps.into());

    /// Probability that a weight mutates.
    mutation(f64): Option<f64> = None,
    "mutation", "P", default "0.1; 0.3 for the partly predefined line on 20x20",
    valid "from 0 to 1", list "mutation",
    parse |text, _: &Values| probability(text).map(Some),
    write |mutation: &Option<f64>| mutation.map(Scalar::from);

    /// Selection of parents: roulette, or tournament:K for the best of K genomes drawn.
    selection(Selection): Selection = Selection::Roulette,
    "selection", "METHOD", default "roulette",
    valid "`roulette`, or `tournament:K` with K from 1 to 1000000", list "selection",
    parse |text, _: &Values| Selection::parse(text),
    write |&selection: &Selection| {
        // Added later: left out if it has the default, so that existing runs keep their IDs.
        (selection != Selection::Roulette).then(|| selection.to_string().into())
    };

    /// Probability that a child has two parents and takes each weight from either.
    crossover(f64): f64 = 0.0,
    "crossover", "P", default "0",
    valid "from 0 to 1", list "crossover",
    parse |text, _: &Values| probability(text),
    write |&crossover: &f64| (crossover != 0.0).then(|| crossover.into());

    /// Start from a genome and its mutants.
    from(PathBuf): Option<PathBuf> = None,
    "from", "GENOME", default "",
    valid "a genome file of the same sensor model and predictions", list "",
    parse |text, _: &Values| Ok::<_, String>(Some(path_of_text(text))),
    write |path: &Option<PathBuf>| path.as_deref().map(|path| text_of_path(path).into());

    /// Root of all random numbers; drawn and printed if not given.
    seed(u64): Option<u64> = None,
    "seed", "N", default "",
    valid "from 0 to 18446744073709551615", list "",
    parse |text, _: &Values| seed(text).map(Some),
    write |seed: &Option<u64>| seed.map(Scalar::from);

    /// Threads; the result does not depend on them.
    threads(u32): Option<u32> = None,
    "threads", "N", default "one per core",
    valid "from 1 to 1024", list "",
    parse |text, _: &Values| count(text, THREADS_MAX).map(Some),
    write |_: &Option<u32>| None;

    /// Directory of the run; must not exist.
    out(PathBuf): Option<PathBuf> = None,
    "out", "DIR", default "a new one in runs/",
    valid "a directory that does not exist", list "",
    parse |text, _: &Values| Ok::<_, String>(Some(path_of_text(text))),
    write |_: &Option<PathBuf>| None;
}
