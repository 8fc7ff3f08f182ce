//! Summaries of a run and of a genome.

use super::structures::{self, Classified};
use crate::output::stdout_is_ascii;
use minimal_surprise_controller::KERNEL_ID;
use minimal_surprise_controller::codec::FORMAT_VERSION;
use minimal_surprise_controller::network::Shape;
use minimal_surprise_evolution::experiment::{EvolutionResult, Experiment};
use minimal_surprise_evolution::genome_file::GenomeFile;
use minimal_surprise_evolution::run_files::{BEST, CONFIG};
use minimal_surprise_evolution::settings::{describe, model_name};
use minimal_surprise_evolution::text::shell_path;
use std::fmt::Write;
use std::path::Path;

/// Returns the command that starts this program, for commands that users can copy.
#[must_use]
pub fn program() -> &'static str {
    if std::env::var_os("CARGO").is_some() {
        "cargo run --release --"
    } else {
        "evolver"
    }
}

/// Formats the result of an evolution, and commands to run next.
#[must_use]
pub fn evolved(experiment: &Experiment, result: &EvolutionResult, directory: &Path) -> String {
    let settings = experiment.settings();
    let classified = Classified {
        grid: settings.scenario().grid(),
        poses: &result.outcome.final_poses,
        found: &result.structures,
        measures: Some(&result.measures),
        baselines: None,
        chance: None,
    };
    let program = program();
    let at = |file: &str| shell_path(&directory.join(file));
    let (genome, config) = (at(BEST), at(CONFIG));
    let directory = shell_path(directory);
    format!(
        "{picture}\n\n\
         structure     {structure}: {share:.0} % of the robots ({members})\n\
         best fitness  {fitness:.4}  (generation {generation}, worst of {repetitions} repetitions)\n\
         seed          {seed}\n\
         hash          {hash}\n\
         run           {directory}\n\n\
         next:\n  \
         replay the run         {program} replay {directory}\n  \
         measure the run        {program} classify {directory}\n  \
         re-evaluate it         {program} evaluate {directory}\n  \
         inspect the genome     {program} inspect {genome}\n  \
         evolve it further      {program} evolve --from {genome}\n  \
         repeat the run         {program} evolve {config}\n",
        members = if stdout_is_ascii() {
            "starred"
        } else {
            "filled arrows"
        },
        picture = structures::highlighted(&classified),
        structure = structures::name(&result.structures),
        share = 100.0 * result.share(),
        fitness = result.outcome.fitness(),
        generation = result.provenance.generation,
        repetitions = settings.repetitions(),
        seed = settings.seed(),
        hash = result.hash,
    )
}

/// Formats the contents of a genome file.
#[must_use]
pub fn genome(file: &GenomeFile) -> String {
    let (topology, provenance) = (file.topology(), file.provenance());
    let (genome, file_bytes) = (file.genome(), file.bytes().len());
    let (action, prediction) = (genome.action_weights(), genome.prediction_weights());
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<19} {value}");
    };
    line(
        "format",
        format!("version {FORMAT_VERSION}, {file_bytes} bytes, CRC-32C correct"),
    );
    line("kernel", format!("{KERNEL_ID} (this program's)"));
    line("sensor model", model_name(topology.model()).to_uppercase());
    line("topology", describe(topology));
    let fixed: Vec<String> = (0..topology.sensors())
        .filter(|&sensor| !topology.predicted().get(sensor))
        .map(|sensor| format!("{sensor}={}", u8::from(topology.fixed().get(sensor))))
        .collect();
    if !fixed.is_empty() {
        line("fixed predictions", fixed.join(" "));
    }
    line(
        "evolved with",
        provenance
            .seed
            .map_or("an unknown seed".to_owned(), |seed| format!("seed {seed}")),
    );
    line("generation", provenance.generation.to_string());
    line(
        "fitness",
        match provenance.scored_bits {
            0 => "unknown".to_owned(),
            bits if provenance.matched_bits > bits => {
                format!("impossible ({} of {bits} bits)", provenance.matched_bits)
            }
            bits => format!(
                "{:.4} ({} of {bits} bits)",
                provenance.matched_bits as f64 / bits as f64,
                provenance.matched_bits
            ),
        },
    );
    network(&mut text, "action network", topology.action_shape(), action);
    match topology.prediction_shape() {
        Some(shape) => network(&mut text, "prediction network", shape, prediction),
        None => {
            let _ = writeln!(
                text,
                "\nprediction network  none: all predictions are fixed"
            );
        }
    }
    text
}

/// Writes a table of a network's weights.
fn network(text: &mut String, name: &str, shape: Shape, weights: &[i16]) {
    let sizes = format!("{}-{}-{}", shape.inputs(), shape.hidden(), shape.outputs());
    let _ = writeln!(text, "\n{name:<19} {sizes}, {} weights", weights.len());
    let _ = writeln!(
        text,
        "  layer     weights      min     mean      max   mean |w|  at the limit"
    );
    let (input, rest) = weights.split_at(2 * shape.inputs());
    let (hidden, output) = rest.split_at(shape.hidden() * shape.hidden_row());
    for (layer, weights) in [("input", input), ("hidden", hidden), ("output", output)] {
        let value = |weight: i16| f64::from(weight) / 4096.0;
        let count = weights.len() as f64;
        let mean = weights.iter().map(|&w| value(w)).sum::<f64>() / count;
        let mean_size = weights.iter().map(|&w| value(w).abs()).sum::<f64>() / count;
        let min = weights.iter().copied().min().map_or(0.0, value);
        let max = weights.iter().copied().max().map_or(0.0, value);
        let limit = weights.iter().filter(|w| w.unsigned_abs() == 32767).count();
        let _ = writeln!(
            text,
            "  {layer:<8} {:>8} {min:>8.3} {mean:>8.3} {max:>8.3} {mean_size:>10.3} {limit:>13}",
            weights.len()
        );
    }
}
