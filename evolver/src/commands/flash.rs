//! `evolver flash`: writes a genome to a robot.

use super::port::{PortArgs, failed};
use super::read_genome;
use crate::report::progress::bar;
use crate::robot::Afterwards;
use clap::Args;
use indicatif::ProgressBar;
use std::path::PathBuf;

/// Arguments of `evolver flash`.
#[derive(Debug, Args)]
pub struct FlashArgs {
    /// A genome file or a run directory.
    #[arg(value_name = "GENOME|RUN")]
    genome: PathBuf,
    #[command(flatten)]
    port: PortArgs,
}

/// Writes a genome to the robot on a port and starts the robot.
///
/// # Errors
/// If the genome is invalid, the robot cannot be reached, or the robot fails. The robot switches to
/// the new genome only after receiving all of it.
pub fn flash(arguments: &FlashArgs) -> anyhow::Result<()> {
    let genome = read_genome(&arguments.genome)?;
    let container = genome.bytes();
    let port = &arguments.port;
    let mut robot = port.connect()?;
    robot.check_kernel().map_err(failed)?;
    let bar = bar(
        ProgressBar::new(container.len() as u64),
        "{pos}/{len} bytes",
    );
    let written = robot.while_stopped(Afterwards::Runs, &port.command("start"), |robot| {
        robot.write(container, |bytes| bar.set_position(bytes as u64))
    });
    bar.finish_and_clear();
    written.map_err(failed)?;
    let identity = robot.identify().map_err(failed)?;
    show_line!("{}: {identity}", port.name());
    Ok(())
}
