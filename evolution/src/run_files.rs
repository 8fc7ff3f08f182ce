//! The files of a run directory: their names, and one type for the contents of each.
//!
//! | file | contents |
//! |---|---|
//! | `config.toml` | [`Settings`], resolved, with the seed |
//! | `meta.json` | [`Meta`]: provenance of the run |
//! | `generations.csv` | one [`GenerationRow`] per generation |
//! | `best.genome` | the last generation's best genome, as a container for robots |
//! | `time.json` | [`TimeSpent`](crate::time_spent::TimeSpent), summed over all processes |
//! | `final.json` | [`FinalFile`]: start, end, fitness and average predictions of the final run |
//! | `DONE` | the run's hash; the run is complete |
//! | `checkpoint` | until the run is complete: the state from which it is resumed |

use crate::experiment::{EvolutionResult, Experiment, GenerationRecord};
use crate::ranges;
use crate::settings::{Settings, model_name, seed_text};
use minimal_surprise_controller::KERNEL_ID;
use minimal_surprise_sim::metrics::Measures;
use minimal_surprise_sim::{Pose, Structure};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::value::to_raw_value;

/// Name of the file with the settings.
pub const CONFIG: &str = "config.toml";
/// Name of the file with the schema version, the seed and the program.
pub const META: &str = "meta.json";
/// Name of the table with one row per generation.
pub const GENERATIONS: &str = "generations.csv";
/// Name of the file with the last generation's best genome.
pub const BEST: &str = "best.genome";
/// Name of the file with the start and end of the final run.
pub const FINAL: &str = "final.json";
/// Name of the file with the time spent on the run.
pub const TIME: &str = "time.json";
/// Name of the file that marks a run as complete and contains the run's hash.
pub const DONE: &str = "DONE";
/// Name of the file with the state from which an incomplete run is resumed.
pub const CHECKPOINT: &str = "checkpoint";

/// Files required in a complete run, in addition to [`DONE`].
pub const OF_COMPLETE: [&str; 5] = [CONFIG, META, BEST, FINAL, GENERATIONS];

/// Version of the layout of `meta.json` and `final.json`.
pub const SCHEMA_VERSION: u32 = 1;

/// The program that produces a run.
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// Source revision.
    pub revision: String,
    /// Compiler.
    pub compiler: String,
    /// Command line.
    pub command_line: Vec<String>,
}

/// `meta.json`: provenance of the run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Meta {
    schema_version: u32,
    seed: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    seed_text: Option<String>,
    program: String,
    program_version: String,
    revision: String,
    compiler: String,
    kernel: String,
    command_line: Vec<String>,
}

impl Meta {
    /// Creates the provenance of a run with these settings.
    #[must_use]
    pub fn new(settings: &Settings, program: &Program) -> Self {
        let program = program.clone();
        Self {
            schema_version: SCHEMA_VERSION,
            seed: settings.seed(),
            seed_text: seed_text(settings.seed()),
            program: program.name,
            program_version: program.version,
            revision: program.revision,
            compiler: program.compiler,
            kernel: KERNEL_ID.to_string(),
            command_line: program.command_line,
        }
    }

    /// Describes the program.
    #[must_use]
    pub fn program(&self) -> String {
        let Self {
            program,
            program_version,
            revision,
            ..
        } = self;
        format!("{program} {program_version}, revision {revision}")
    }
}

/// `final.json`: the run of the last generation's best genome from the start that determined its
/// fitness. Poses are `[x, y, heading]`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct FinalFile {
    pub schema_version: u32,
    #[serde(deserialize_with = "ranges::hash")]
    pub hash: String,
    /// Version 1, in files of older programs.
    #[serde(
        default,
        deserialize_with = "ranges::optional_hash",
        skip_serializing_if = "Option::is_none"
    )]
    pub steps_hash: Option<String>,
    #[serde(
        default,
        deserialize_with = "ranges::optional_hash",
        skip_serializing_if = "Option::is_none"
    )]
    pub steps_hash_v2: Option<String>,
    pub seed: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed_text: Option<String>,
    pub grid: String,
    pub sensor_model: String,
    pub robots: u32,
    pub steps: u32,
    pub generation: u32,
    pub repetition: u32,
    pub fitness: f64,
    pub matches: u64,
    pub scored_bits: u64,
    #[serde(deserialize_with = "ranges::fractions")]
    pub average_prediction: Vec<f64>,
    pub names: Vec<String>,
    pub share: f64,
    pub measures: MeasuresOfRun,
    #[serde(serialize_with = "one_line")]
    pub start: Vec<Pose>,
    #[serde(serialize_with = "one_line")]
    pub r#final: Vec<Pose>,
}

/// Measures of one run of a swarm.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct MeasuresOfRun {
    pub fitness: f64,
    #[serde(deserialize_with = "ranges::fraction")]
    pub intended_movement: f64,
    #[serde(deserialize_with = "ranges::fraction")]
    pub movement: f64,
    pub period_steps: u32,
    pub surprise: Vec<f64>,
    #[serde(deserialize_with = "ranges::fractions")]
    pub temperature: Vec<f64>,
}

impl From<&Measures> for MeasuresOfRun {
    fn from(measures: &Measures) -> Self {
        Self {
            fitness: measures.fitness(),
            intended_movement: measures.intended_movement(),
            movement: measures.movement(),
            period_steps: measures.period(),
            surprise: measures.surprise(),
            temperature: measures.temperature(),
        }
    }
}

impl FinalFile {
    /// Creates the file contents for a result.
    #[must_use]
    pub fn new(settings: &Settings, result: &EvolutionResult) -> Self {
        let scenario = settings.scenario();
        Self {
            schema_version: SCHEMA_VERSION,
            hash: result.hash.to_string(),
            steps_hash: None,
            steps_hash_v2: Some(result.steps_hash.to_string()),
            seed: settings.seed(),
            seed_text: seed_text(settings.seed()),
            grid: scenario.grid().to_string(),
            sensor_model: model_name(settings.topology().model()).to_owned(),
            robots: scenario.robots(),
            steps: scenario.steps(),
            generation: result.provenance.generation,
            repetition: result.repetition,
            fitness: result.outcome.fitness(),
            matches: result.outcome.matches,
            scored_bits: result.outcome.scored_bits,
            average_prediction: result.outcome.average_prediction(),
            names: names(&result.structures.names()),
            share: result.share(),
            measures: (&result.measures).into(),
            start: result.starts.clone(),
            r#final: result.outcome.final_poses.clone(),
        }
    }
}

/// Returns the names of structures.
#[must_use]
pub fn names(structures: &[Structure]) -> Vec<String> {
    structures.iter().map(|s| s.name().to_owned()).collect()
}

/// A row of `generations.csv`. Movement, structure and share are those of the best genome in the
/// repetition that determined its fitness.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct GenerationRow {
    pub generation: u32,
    #[serde(deserialize_with = "ranges::fraction")]
    pub best_fitness: f64,
    pub mean_fitness: f64,
    pub worst_fitness: f64,
    pub best_matches: u64,
    pub total_matches: u64,
    pub best_slot: u32,
    pub worst_repetition: u32,
    pub movement: f64,
    pub intended_movement: f64,
    pub structure: String,
    pub share: f64,
}

impl GenerationRow {
    /// Creates the row of a generation.
    #[must_use]
    pub fn new(settings: &Settings, record: &GenerationRecord) -> Self {
        let scored = settings.scored_bits() as f64;
        Self {
            generation: record.generation,
            best_fitness: record.best_matches as f64 / scored,
            mean_fitness: record.total_matches as f64 / scored / f64::from(settings.population()),
            worst_fitness: record.worst_matches as f64 / scored,
            best_matches: record.best_matches,
            total_matches: record.total_matches,
            best_slot: record.best_slot,
            worst_repetition: record.worst_repetition,
            movement: record.movement,
            intended_movement: record.intended_movement,
            structure: record.structure.clone(),
            share: record.share,
        }
    }
}

/// Formats `generations.csv`.
///
/// # Panics
/// Never: writing rows of numbers to memory cannot fail.
#[must_use]
pub fn generations(experiment: &Experiment) -> String {
    let mut table = csv::Writer::from_writer(Vec::new());
    for record in experiment.history() {
        table
            .serialize(GenerationRow::new(experiment.settings(), record))
            .expect("writing rows of numbers to memory cannot fail");
    }
    let bytes = table
        .into_inner()
        .expect("flushing a buffer in memory cannot fail");
    String::from_utf8(bytes).expect("numbers are ASCII")
}

/// Formats a value as JSON.
///
/// # Panics
/// If the value contains a map whose keys are not text; no value in a run directory does.
#[must_use]
pub fn json(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).expect("plain values");
    text.push('\n');
    text
}

/// Formats poses on one line instead of one line per number.
fn one_line<S: Serializer>(poses: &[Pose], serializer: S) -> Result<S::Ok, S::Error> {
    let poses = to_raw_value(poses).map_err(serde::ser::Error::custom)?;
    poses.serialize(serializer)
}
