//! `evolver damage`: removes or repositions robots of a structure, and measures the recovery.

use super::errors::unusable;
use super::{BadInput, flag, thread_pool, threads_flag};
use crate::report::reevaluation::{resilience_json, resilience_text};
use clap::Args;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::reevaluation::resilience;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_sim::damage::{Area, Damage};
use minimal_surprise_sim::structures::{Structure, classify};
use std::path::PathBuf;

/// Arguments of `evolver damage`.
#[derive(Debug, Args)]
pub struct DamageArgs {
    /// The run directory.
    run: PathBuf,
    /// Corners of the rectangle, inclusive; it wraps around the edge if x0 > x1 or y0 > y1.
    #[arg(long, value_name = "x0,y0,x1,y1", allow_hyphen_values = true)]
    area: String,
    /// Remove the robots in the area.
    #[arg(
        long,
        required_unless_present = "reposition",
        conflicts_with = "reposition"
    )]
    remove: bool,
    /// Reposition the robots in the area at random.
    #[arg(long)]
    reposition: bool,
    /// Runs per row.
    #[arg(
        long,
        value_name = "N",
        default_value = "20",
        allow_hyphen_values = true
    )]
    repeat: String,
    /// The structure to follow [default: the run's dominant structure].
    #[arg(long, value_name = "NAME")]
    structure: Option<String>,
    /// Threads [default: one per core]; the result does not depend on them.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Damages the final state of a run.
///
/// # Errors
/// [`BadInput`] if the run or a flag is invalid, or memory is insufficient; the message describes
/// the valid values.
pub fn damage(arguments: &DamageArgs) -> anyhow::Result<()> {
    let finished = FinishedRun::read_and_check(&arguments.run).map_err(unusable)?;
    let grid = finished.settings.scenario().grid();
    let [x0, y0, x1, y1] = flag("area", &arguments.area, corners)?;
    let about_area = |error: &dyn std::fmt::Display| {
        BadInput::new(format!("--area = {}: {error}", arguments.area))
    };
    let area = Area::new(grid, x0, y0, x1, y1).map_err(|error| about_area(&error))?;
    let damage = if arguments.remove {
        Damage::Remove(area)
    } else {
        Damage::Reposition(area)
    };
    let repeat = flag("repeat", &arguments.repeat, |text| count(text, 1_000_000))?;
    let threads = threads_flag(&arguments.threads)?;
    let structure = match &arguments.structure {
        Some(text) => flag("structure", text, structure_named)?,
        None => {
            let found = classify(grid, &finished.final_poses).map_err(BadInput::new)?;
            *found.names().first().ok_or_else(|| {
                BadInput::new(format!(
                    "{}: the swarm formed no structure; choose a structure with --structure",
                    arguments.run.display()
                ))
            })?
        }
    };
    let scenario = finished.settings.scenario();
    Needs::of_starts(
        &[(*scenario, ())],
        ("repeat", repeat),
        limits::threads(threads),
    )
    .check_memory()
    .map_err(BadInput::new)?;
    let rows = thread_pool(threads)?
        .install(|| resilience(&finished, structure, damage, repeat))
        .map_err(|error| about_area(&error))?;
    if arguments.json {
        show_line!("{}", resilience_json(structure, &rows));
    } else {
        show_line!("{}", resilience_text(structure, &rows));
    }
    Ok(())
}

/// Parses the corners of an area.
pub(super) fn corners(text: &str) -> Result<[u32; 4], String> {
    let numbers: Option<Vec<u32>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| {
            "expected four coordinates from the south-west cell, such as 2,3,6,7".to_owned()
        })
}

fn structure_named(text: &str) -> Result<Structure, String> {
    let spaced = text.replace('-', " ");
    Structure::ALL
        .into_iter()
        .find(|structure| structure.name() == spaced)
        .ok_or_else(|| {
            let names = Structure::ALL.map(Structure::name);
            format!("expected one of: {}", names.join(", "))
        })
}
