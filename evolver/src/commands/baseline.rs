//! `evolver baseline`: the fitness and the structures that chance gives under a setting.

use super::setting_flags::BaselineFlags;
use super::{BadInput, flag, thread_pool, threads_flag};
use crate::report::baseline::{Baselines, json, text};
use clap::Args;
use minimal_surprise_evolution::baseline::{Chance, GENOMES, PLACEMENTS};
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::settings::count;
use minimal_surprise_sim::SeedTree;

/// The setting, and the numbers of draws.
#[derive(Debug, Args)]
pub struct BaselineArgs {
    #[command(flatten)]
    setting: BaselineFlags,
    /// Number of random placements [default: 1000].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    placements: Option<String>,
    /// Number of random genomes [default: 200].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    genomes: Option<String>,
    /// Threads; the result does not depend on them [default: one per core].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Computes and prints the baselines of a setting.
///
/// # Errors
/// [`BadInput`] if a flag is invalid or the draws do not fit in memory.
pub fn baseline(arguments: &BaselineArgs) -> anyhow::Result<()> {
    let number = |name: &str, text: &Option<String>, default: u32| match text {
        None => Ok(default),
        Some(text) => flag(name, text, |text| count(text, 1_000_000)),
    };
    let placements = number("placements", &arguments.placements, PLACEMENTS)?;
    let genomes = number("genomes", &arguments.genomes, GENOMES)?;
    let threads = threads_flag(&arguments.threads)?;
    let settings = arguments.setting.settings()?;
    let scenario = settings.scenario();
    let draws = match placements > genomes {
        true => ("placements", placements),
        false => ("genomes", genomes),
    };
    Needs::of_starts(&[(*scenario, ())], draws, limits::threads(threads))
        .check_memory()
        .map_err(BadInput::new)?;
    let seeds = SeedTree::new(settings.seed());
    let (placements, genomes) = thread_pool(threads)?.install(|| {
        anyhow::Ok((
            Chance::of_placements(scenario.grid(), scenario.robots(), seeds, placements)?,
            Chance::of_genomes(
                settings.topology(),
                scenario,
                settings.repetitions(),
                seeds,
                genomes,
            )?,
        ))
    })?;
    let baselines = Baselines {
        settings: &settings,
        placements: &placements,
        genomes: &genomes,
    };
    if arguments.json {
        show_line!("{}", json(&baselines));
    } else {
        show_line!("{}", text(&baselines));
    }
    Ok(())
}
