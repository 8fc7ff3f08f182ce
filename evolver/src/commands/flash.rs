//! `evolver flash`: a genome onto a robot.

use super::{BadInput, PortArgs, read_genome};
use crate::robot::Robot;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;

/// Which genome, and where the robot is.
#[derive(Debug, Args)]
pub struct FlashArgs {
    /// The genome file, or a run directory.
    #[arg(value_name = "GENOME|RUN")]
    genome: PathBuf,
    #[command(flatten)]
    port: PortArgs,
}

/// Writes a genome to the robot on a port and starts it.
///
/// # Errors
/// [`BadInput`] if the genome cannot be used, there is no such robot, or the robot fails; what a
/// robot runs changes only when all of the new genome is there.
pub fn flash(arguments: &FlashArgs) -> anyhow::Result<()> {
    let container = read_genome(&arguments.genome)?;
    let (port, baud) = arguments.port.checked()?;
    let mut robot = Robot::connect(&port, baud).map_err(BadInput::new)?;
    tell!("{port}: {}", robot.identity());
    robot.check_kernel().map_err(BadInput::new)?;
    let was_running = robot.identity().running;
    robot.stop().map_err(BadInput::new)?;
    let bar = bar(container.len());
    let result = robot.write(&container, |bytes| bar.set_position(bytes as u64));
    bar.finish_and_clear();
    if let Err(error) = result {
        if was_running && error.is_refusal() {
            // It has a genome to run, the old one; the error is what the user has to know.
            let _ = robot.start();
        }
        return Err(BadInput::new(error).into());
    }
    robot.start().map_err(BadInput::new)?;
    let identity = robot.identify().map_err(BadInput::new)?;
    show_line!("{port}: {identity}");
    Ok(())
}

fn bar(bytes: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} bytes")
        .expect("the template is well-formed");
    ProgressBar::new(bytes as u64).with_style(style)
}
