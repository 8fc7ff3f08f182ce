//! `evolver evaluate`: a genome from new starts, under the conditions it evolved in or others.

use super::{BadInput, thread_pool};
use crate::files;
use crate::reevaluation::rerun;
use crate::report::reevaluation::{Condition, conditions_json, conditions_text};
use crate::settings::{count, parse_grid, probability};
use clap::Args;
use minimal_surprise_controller::EncodedGenome;
use minimal_surprise_sim::{NoiseRate, Scenario, SeedTree};
use std::path::PathBuf;

/// Conditions as flags; lists give a table of all combinations.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// The genome file.
    genome: PathBuf,
    /// New starts under each of the conditions.
    #[arg(
        long,
        value_name = "N",
        default_value = "20",
        allow_hyphen_values = true
    )]
    starts: String,
    /// Grids, as in 15x15,20x20.
    #[arg(
        long,
        value_name = "WxH,…",
        default_value = "15x15",
        allow_hyphen_values = true
    )]
    grid: String,
    /// Noise levels, as in 0,0.05.
    #[arg(
        long,
        value_name = "P,…",
        default_value = "0",
        allow_hyphen_values = true
    )]
    noise: String,
    /// Swarm sizes, as in 50,100.
    #[arg(
        long,
        value_name = "N,…",
        default_value = "100",
        allow_hyphen_values = true
    )]
    robots: String,
    /// Steps of a run.
    #[arg(
        long,
        value_name = "N",
        default_value = "500",
        allow_hyphen_values = true
    )]
    steps: String,
    /// Root of all random numbers [default: the seed that the genome evolved with, else 0].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Threads [default: one a core]; the result does not depend on them.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Evaluates a genome.
///
/// # Errors
/// [`BadInput`] names the flag, the value and what would be valid.
pub fn evaluate(arguments: &EvaluateArgs) -> anyhow::Result<()> {
    let path = arguments.genome.display();
    let bytes = files::read(&arguments.genome).map_err(BadInput::new)?;
    let encoded =
        EncodedGenome::decode(&bytes).map_err(|error| BadInput::new(format!("{path}: {error}")))?;
    let starts = flag("starts", &arguments.starts, |text| count(text, 1_000_000))?;
    let steps = flag("steps", &arguments.steps, |text| count(text, u32::MAX))?;
    let grids = list("grid", &arguments.grid, parse_grid)?;
    let noises = list("noise", &arguments.noise, probability)?;
    let swarms = list("robots", &arguments.robots, |text| count(text, u32::MAX))?;
    let threads = match &arguments.threads {
        Some(text) => Some(flag("threads", text, |text| count(text, 1024))?),
        None => None,
    };
    let seed = match &arguments.seed {
        Some(text) => flag("seed", text, crate::settings::seed)?,
        None => encoded.provenance().seed.unwrap_or(0),
    };
    let mut scenarios = Vec::new();
    for &grid in &grids {
        for &robots in &swarms {
            for &noise in &noises {
                let rate = NoiseRate::new(noise)
                    .ok_or_else(|| BadInput::new(format!("--noise = {noise}")))?;
                let scenario = Scenario::new(grid, robots, steps, rate)
                    .map_err(|error| BadInput::new(format!("--robots = {robots}: {error}")))?;
                scenarios.push((scenario, noise));
            }
        }
    }
    let genome = encoded.to_genome();
    let seeds = SeedTree::new(seed);
    let conditions = thread_pool(threads)?.install(|| {
        scenarios
            .into_iter()
            .map(|(scenario, noise)| {
                Ok(Condition {
                    reruns: rerun(&genome, &scenario, seeds, starts)?,
                    scenario,
                    noise,
                })
            })
            .collect::<anyhow::Result<Vec<_>>>()
    })?;
    if arguments.json {
        show_line!("{}", conditions_json(&conditions, seed));
    } else {
        show_line!(
            "{path}: {starts} new starts of {steps} steps each, seed {seed}\n\n{}",
            conditions_text(&conditions)
        );
    }
    Ok(())
}

/// A flag's value, or an error that names the flag.
pub(super) fn flag<T>(
    name: &str,
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<T, BadInput> {
    parse(text).map_err(|problem| BadInput::new(format!("--{name} = {text}: {problem}")))
}

/// Values between commas.
fn list<T>(
    name: &str,
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, BadInput> {
    text.split(',')
        .map(|part| flag(name, part.trim(), &parse))
        .collect()
}
