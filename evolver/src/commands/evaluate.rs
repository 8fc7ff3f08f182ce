//! `evolver evaluate`: re-evaluates a genome from new starts, under its own or different
//! conditions.

use super::errors::unusable;
use super::{BadInput, flag, genome_file, read_genome, thread_pool, threads_flag};
use crate::report::reevaluation::{Condition, conditions_json, conditions_text};
use clap::Args;
use minimal_surprise_evolution::files;
use minimal_surprise_evolution::finished_run::settings_of_run;
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::reevaluation::rerun;
use minimal_surprise_evolution::run_files::CONFIG;
use minimal_surprise_evolution::settings::{self, Settings, count, probability, setting};
use minimal_surprise_evolution::text::terminal_path;
use minimal_surprise_sim::{NoiseRate, Scenario, SeedTree};
use std::path::{Path, PathBuf};

/// Conditions as flags; all combinations of listed values are evaluated.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// A genome file or a run directory; the conditions in the run's config.toml are the defaults.
    genome: PathBuf,
    /// New starts per combination of conditions.
    #[arg(
        long,
        value_name = "N",
        default_value = "20",
        allow_hyphen_values = true
    )]
    starts: String,
    /// Grids, such as 15x15,20x20 [default: the run's, else 15x15].
    #[arg(long, value_name = "WxH,…", allow_hyphen_values = true)]
    grid: Option<String>,
    /// Noise levels, such as 0,0.05 [default: the run's, else 0].
    #[arg(long, value_name = "P,…", allow_hyphen_values = true)]
    noise: Option<String>,
    /// Swarm sizes, such as 50,100 [default: the run's, else 100].
    #[arg(long, value_name = "N,…", allow_hyphen_values = true)]
    robots: Option<String>,
    /// Steps per run [default: the run's, else 500].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    steps: Option<String>,
    /// Root of all random numbers [default: the seed that the genome evolved with, else 0].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Threads; the result does not depend on them [default: one per core].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Evaluates a genome.
///
/// # Errors
/// [`BadInput`] if the genome or a flag is invalid, or memory is insufficient; the message
/// describes the valid values.
pub fn evaluate(arguments: &EvaluateArgs) -> anyhow::Result<()> {
    let file = genome_file(&arguments.genome);
    let genome = read_genome(&arguments.genome)?;
    let run = conditions_beside(&file)?;
    let value = |name: &str, given: &Option<String>| {
        let of_run = || run.as_ref()?.value(name).map(|value| value.to_string());
        let default = || {
            setting(name)
                .map_or("", |setting| setting.default)
                .to_owned()
        };
        given.clone().or_else(of_run).unwrap_or_else(default)
    };
    let grid = value("grid", &arguments.grid);
    let noise = value("noise", &arguments.noise);
    let robots = value("robots", &arguments.robots);
    let steps = value("steps", &arguments.steps);
    let starts = flag("starts", &arguments.starts, |text| count(text, 1_000_000))?;
    let steps = flag("steps", &steps, |text| count(text, u32::MAX))?;
    let grids = list("grid", &grid, settings::grid)?;
    let noises = list("noise", &noise, probability)?;
    let swarms = list("robots", &robots, |text| count(text, u32::MAX))?;
    let threads = threads_flag(&arguments.threads)?;
    let seed = match &arguments.seed {
        Some(text) => flag("seed", text, settings::seed)?,
        None => genome.provenance().seed.unwrap_or(0),
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
    Needs::of_starts(&scenarios, ("starts", starts), limits::threads(threads))
        .check_memory()
        .map_err(BadInput::new)?;
    let seeds = SeedTree::new(seed);
    let conditions = thread_pool(threads)?.install(|| {
        scenarios
            .into_iter()
            .map(|(scenario, noise)| {
                Ok(Condition {
                    reruns: rerun(genome.genome(), &scenario, seeds, starts)?,
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
            "{}: {starts} new starts of {steps} steps each, seed {seed}\n\n{}",
            terminal_path(&file),
            conditions_text(&conditions)
        );
    }
    Ok(())
}

/// Returns the settings of the run that produced the genome, if the genome is in a run directory.
fn conditions_beside(genome: &Path) -> anyhow::Result<Option<Settings>> {
    let config = genome.with_file_name(CONFIG);
    if !files::exists(&config).map_err(unusable)? {
        return Ok(None);
    }
    Ok(Some(settings_of_run(files::parent(genome))?))
}

/// Parses values separated by commas.
fn list<T>(
    name: &str,
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, BadInput> {
    text.split(',')
        .map(|part| flag(name, part.trim(), &parse))
        .collect()
}
