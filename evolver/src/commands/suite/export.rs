//! `export`: writes the finished runs as tables for other programs.

use super::choice::Chosen;
use crate::commands::errors::{name_damaged, unusable};
use crate::data::{self, ExportedRun, Table};
use crate::exit::Exit;
use clap::Args;
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::text::terminal_path;
use std::path::PathBuf;

/// Directory and tables of the export.
#[derive(Debug, Args)]
pub struct ExportOptions {
    /// Directory to write; must not exist.
    #[arg(long, value_name = "DIR")]
    to: PathBuf,
    /// Tables, as in runs,steps; robots has a row per robot and step and becomes large.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "runs,generations"
    )]
    what: Vec<Table>,
}

/// Writes tables of all finished runs.
///
/// # Errors
/// [`BadInput`](crate::commands::BadInput) if no run is finished or the directory exists; otherwise if a file cannot be
/// written.
pub(super) fn export(chosen: &Chosen, options: &ExportOptions) -> anyhow::Result<Exit> {
    let mut damaged = DamagedRuns::default();
    let mut exported = 0_u64;
    let planned = chosen.plan.experiments.iter().flat_map(|experiment| {
        let runs = experiment
            .settings()
            .flat_map(|settings| settings.runs().collect::<Vec<_>>());
        runs.map(|run| (experiment.name.clone(), run))
    });
    let mut runs = planned
        .filter_map(|(experiment, planned)| {
            let finished = damaged.read(&planned.directory(&chosen.directory))?;
            exported += 1;
            Some(ExportedRun {
                experiment,
                setting: planned.label.clone(),
                id: planned.id.clone(),
                finished,
            })
        })
        .peekable();
    if runs.peek().is_none() {
        drop(runs);
        if damaged.is_empty() {
            return Err(chosen.nothing_finished().into());
        }
        return Ok(name_damaged(&damaged, Some(&chosen.command())));
    }
    data::write(&options.to, &options.what, runs).map_err(unusable)?;
    show_line!("{exported} runs; {}", terminal_path(&options.to));
    Ok(name_damaged(&damaged, Some(&chosen.command())))
}
