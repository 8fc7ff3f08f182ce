//! `evolver export`: runs in the formats of other programs.

use super::BadInput;
use crate::finished_run::FinishedRun;
use clap::{Args, ValueEnum};
use minimal_surprise_sim::exchange::Trajectory;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;

/// What to export, and how.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The run directory.
    run: PathBuf,
    /// The format.
    #[arg(long, value_enum)]
    format: Format,
    /// The file to write; must not exist [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Formats of other programs.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Format {
    /// `agent_trajectory` of the authors' program: poses of every step.
    Trajectory,
}

/// Exports a run.
///
/// # Errors
/// [`BadInput`] if the run cannot be read or the file exists.
pub fn export(arguments: &ExportArgs) -> anyhow::Result<()> {
    let finished = FinishedRun::read(&arguments.run).map_err(BadInput::new)?;
    let text = match arguments.format {
        Format::Trajectory => {
            let trace = finished.trace()?;
            let grid = finished.settings.scenario.grid();
            let mut text = Vec::new();
            Trajectory::of_trace(finished.provenance.generation, grid, &trace).write(&mut text)?;
            text
        }
    };
    match &arguments.out {
        None => show!("{}", String::from_utf8_lossy(&text)),
        Some(path) => {
            let mut file = OpenOptions::new()
                .write(true)
                .create_new(true)
                .open(path)
                .map_err(|error| BadInput::new(format!("--out = {}: {error}", path.display())))?;
            file.write_all(&text)?;
        }
    }
    Ok(())
}
