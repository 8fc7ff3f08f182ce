//! Contents of the files in a run directory that others read.

use super::structures;
use crate::experiment::{Experiment, Finding};
use crate::settings::{Settings, seed_text};
use minimal_surprise_controller::KERNEL_ID;
use minimal_surprise_sim::Pose;
use serde::Serialize;
use serde_json::Value;
use serde_json::value::{RawValue, to_raw_value};

/// Version of the layout of `meta.json` and `final.json`.
pub const SCHEMA_VERSION: u32 = 1;

#[derive(Serialize)]
struct Meta<'a> {
    schema_version: u32,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed_text: Option<String>,
    program: &'a str,
    program_version: &'a str,
    revision: &'a str,
    compiler: &'a str,
    kernel: String,
    command_line: Vec<String>,
}

/// `meta.json`: how the run was made.
#[must_use]
pub fn meta(settings: &Settings) -> String {
    let arguments = std::env::args_os().map(|argument| argument.to_string_lossy().into_owned());
    pretty(&Meta {
        schema_version: SCHEMA_VERSION,
        seed: settings.seed,
        seed_text: seed_text(settings.seed),
        program: env!("CARGO_PKG_NAME"),
        program_version: env!("CARGO_PKG_VERSION"),
        revision: env!("BUILD_REVISION"),
        compiler: env!("BUILD_COMPILER"),
        kernel: KERNEL_ID.to_string(),
        command_line: arguments.collect(),
    })
}

#[derive(Serialize)]
struct FinalState<'a> {
    schema_version: u32,
    hash: String,
    steps_hash_v2: String,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed_text: Option<String>,
    grid: &'a str,
    sensor_model: &'a str,
    robots: u32,
    steps: u32,
    generation: u32,
    repetition: u32,
    fitness: f64,
    matches: u64,
    scored_bits: u64,
    average_prediction: Vec<f64>,
    names: Value,
    share: f64,
    measures: Value,
    start: Box<RawValue>,
    r#final: Box<RawValue>,
}

/// `final.json`: the run of the last generation's best genome, from the start that gave it its
/// fitness. Poses are `[x, y, heading]`.
#[must_use]
pub fn final_state(settings: &Settings, finding: &Finding) -> String {
    let written = &settings.written;
    pretty(&FinalState {
        schema_version: SCHEMA_VERSION,
        hash: finding.hash.to_string(),
        steps_hash_v2: finding.steps_hash.to_string(),
        seed: settings.seed,
        seed_text: seed_text(settings.seed),
        grid: &written.grid,
        sensor_model: &written.sensor_model,
        robots: written.robots,
        steps: written.steps,
        generation: finding.provenance.generation,
        repetition: finding.repetition,
        fitness: finding.outcome.fitness(),
        matches: finding.outcome.matches,
        scored_bits: finding.outcome.scored_bits,
        average_prediction: finding.outcome.average_prediction(),
        names: structures::name_list(&finding.structures.names()),
        share: finding.share(),
        measures: structures::measures_json(&finding.measures),
        start: one_line(&finding.starts),
        r#final: one_line(&finding.outcome.final_poses),
    })
}

#[derive(Serialize)]
struct GenerationRow<'a> {
    generation: u32,
    best_fitness: f64,
    mean_fitness: f64,
    worst_fitness: f64,
    best_matches: u64,
    total_matches: u64,
    best_slot: u32,
    worst_repetition: u32,
    movement: f64,
    intended_movement: f64,
    structure: &'a str,
    share: f64,
}

/// `generations.csv`: a line a generation. Movement, structure and share are those of the best
/// genome in the repetition that gave it its fitness.
#[must_use]
pub fn generations(experiment: &Experiment) -> String {
    let settings = experiment.settings();
    let scored = settings.scored_bits() as f64;
    let mut table = csv::Writer::from_writer(Vec::new());
    for record in experiment.history() {
        let row = GenerationRow {
            generation: record.generation,
            best_fitness: record.best_matches as f64 / scored,
            mean_fitness: record.total_matches as f64 / scored / f64::from(settings.population),
            worst_fitness: record.worst_matches as f64 / scored,
            best_matches: record.best_matches,
            total_matches: record.total_matches,
            best_slot: record.best_slot,
            worst_repetition: record.worst_repetition,
            movement: record.movement,
            intended_movement: record.intended_movement,
            structure: &record.structure,
            share: record.share,
        };
        table
            .serialize(row)
            .expect("rows of numbers are written to memory");
    }
    let bytes = table.into_inner().expect("memory needs no flushing");
    String::from_utf8(bytes).expect("numbers are ASCII")
}

/// Poses without a line break for every number.
fn one_line(poses: &[Pose]) -> Box<RawValue> {
    to_raw_value(poses).expect("plain values")
}

fn pretty(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string_pretty(value).expect("plain values");
    text.push('\n');
    text
}
