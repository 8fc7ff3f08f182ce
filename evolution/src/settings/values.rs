//! Text form of settings values: one parser and one name per value, for files, flags and suites.

use minimal_surprise_controller::{Prediction, SensorModel, Template, Topology};
use minimal_surprise_sim::Grid;

/// Maximum number of generations of a run, genomes of a population and repetitions of an
/// evaluation.
pub const COUNT_MAX: u32 = 1_000_000;

/// Maximum number of threads of a command.
pub const THREADS_MAX: u32 = 1024;

pub(super) const PROBABILITY: &str = "expected a probability from 0 to 1";

/// Parses a probability.
///
/// # Errors
/// A description of the valid probabilities if `text` is invalid.
pub fn probability(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err(PROBABILITY.to_owned()),
    }
}

/// Parses a whole number from 1 to `most`.
///
/// # Errors
/// A description of the valid numbers if `text` is invalid.
pub fn count(text: &str, most: u32) -> Result<u32, String> {
    match text.parse() {
        Ok(value) if (1..=most).contains(&value) => Ok(value),
        _ => Err(format!("expected a whole number from 1 to {most}")),
    }
}

/// Parses a grid written as `15x15`.
///
/// # Errors
/// A description of the valid grids if `text` is invalid.
pub fn grid(text: &str) -> Result<Grid, String> {
    let sides = text
        .split_once('x')
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let (width, height) =
        sides.ok_or_else(|| "expected width and height in cells, as in 15x15".to_owned())?;
    Grid::new(width, height).map_err(|error| error.to_string())
}

/// Parses a seed.
///
/// # Errors
/// A description of the valid seeds if `text` is invalid.
pub fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("expected a whole number from 0 to {}", u64::MAX))
}

/// Parses a sensor model.
///
/// # Errors
/// A description of the valid sensor models if `text` is invalid.
pub(super) fn model(text: &str) -> Result<SensorModel, String> {
    SensorModel::ALL
        .into_iter()
        .find(|&model| model_name(model).eq_ignore_ascii_case(text))
        .ok_or_else(|| "sensor models are a, b and c".to_owned())
}

/// Returns the name of a sensor model in files and flags.
#[must_use]
pub fn model_name(model: SensorModel) -> &'static str {
    match model {
        SensorModel::A => "a",
        SensorModel::B => "b",
        SensorModel::C => "c",
    }
}

/// Parses a template of predictions.
///
/// # Errors
/// A description of the valid templates if `text` is invalid.
pub(super) fn template(text: &str) -> Result<Template, String> {
    Template::ALL
        .into_iter()
        .find(|template| template.name() == text)
        .ok_or_else(|| {
            let names = Template::ALL.map(Template::name);
            format!("templates are {}", names.join(", "))
        })
}

/// Describes a topology.
#[must_use]
pub fn describe(topology: Topology) -> String {
    let model = model_name(topology.model()).to_uppercase();
    match topology.prediction() {
        Prediction::Free => format!("sensor model {model}, predictions free"),
        Prediction::PartlyPredefined(template) => {
            let template = template.name();
            format!("sensor model {model}, {template} partly predefined")
        }
        Prediction::Predefined(template) => {
            format!("sensor model {model}, {} predefined", template.name())
        }
    }
}

/// Largest seed that is drawn: whole numbers up to this one are exact in programs that read JSON
/// numbers as floating point.
pub const DRAWN_SEED_MAX: u64 = 1 << 53;

/// Returns a seed as text, for JSON, if other programs would read it inexactly as a number.
#[must_use]
pub fn seed_text(seed: u64) -> Option<String> {
    (seed > DRAWN_SEED_MAX).then(|| seed.to_string())
}

/// Adds a seed to a JSON object and, if needed, also as text in `seed_text`.
pub fn add_seed(object: &mut serde_json::Value, seed: u64) {
    object["seed"] = seed.into();
    if let Some(text) = seed_text(seed) {
        object["seed_text"] = text.into();
    }
}
