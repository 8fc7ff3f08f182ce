//! `submit`: submits the runs to a cluster.

use super::choice::Chosen;
use crate::commands::BadInput;
use crate::commands::errors::unusable;
use crate::commands::flag;
use crate::exit::Exit;
use crate::suite::worker::ToDo;
use crate::suite::{cluster, slurm};
use clap::{Args, ValueEnum};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::settings::count;

/// A program that distributes tasks among machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClusterEngine {
    /// One job array of Slurm.
    Slurm,
}

/// Options for submitting the runs.
#[derive(Debug, Args)]
pub struct SubmitOptions {
    /// The engine.
    #[arg(long, value_enum)]
    engine: ClusterEngine,
    /// Number of tasks that share the runs; at most one per run.
    #[arg(
        long,
        value_name = "N",
        default_value = "50",
        allow_hyphen_values = true
    )]
    shards: String,
    /// Maximum number of tasks that run at the same time.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    at_once: Option<String>,
    /// Show the job script without submitting it.
    #[arg(long)]
    dry_run: bool,
}

/// Submits the runs, or prints the script.
///
/// # Errors
/// [`BadInput`] if a flag is invalid or disk space is insufficient. Other errors if the cluster's
/// programs fail.
pub(super) fn submit(chosen: &Chosen, options: &SubmitOptions) -> anyhow::Result<Exit> {
    let job = cluster::Job {
        name: &chosen.source.suite.name,
        directory: &std::path::absolute(&chosen.directory)?,
        // A task without a run would only wait in the queue.
        shards: flag("shards", &options.shards, |text| count(text, 100_000))?.min(
            u32::try_from(chosen.plan.runs().number())
                .unwrap_or(u32::MAX)
                .max(1),
        ),
        at_once: match &options.at_once {
            Some(text) => Some(flag("at-once", text, |text| count(text, 100_000))?),
            None => None,
        },
        flags: chosen.choice.flags(),
    };
    if !options.dry_run {
        // Checks only the disk: the tasks use the memory of other machines.
        let to_do = ToDo::read(
            chosen.plan.runs(),
            &chosen.directory,
            1.0,
            &mut DamagedRuns::default(),
        )
        .map_err(unusable)?;
        let needs = to_do.needs.needs();
        needs.check_disk(&chosen.directory).map_err(BadInput::new)?;
    }
    match (options.engine, options.dry_run) {
        (ClusterEngine::Slurm, true) => show!("{}", slurm::script(&job).map_err(unusable)?),
        (ClusterEngine::Slurm, false) => {
            show_line!(
                "{}",
                slurm::submit(&job, &chosen.source.text).map_err(unusable)?
            );
        }
    }
    Ok(Exit::Done)
}
