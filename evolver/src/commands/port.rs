//! The robot on a serial port, for all commands that use it.

use super::{BadInput, Interrupted, flag};
use crate::report::summary::program;
use crate::robot::{PortName, Problem, Robot, RobotError, standing};
use crate::signals::{ask_then_end, stop};
use clap::Args;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_evolution::text::shell_path;
use std::path::PathBuf;
use std::time::Duration;

/// Default speed of the serial line, in bits per second.
const BAUD: &str = "115200";

/// The robot's port, as flags.
#[derive(Debug, Args)]
pub struct PortArgs {
    /// The robot's serial port, such as /dev/ttyACM0 or COM3.
    #[arg(long, value_name = "PORT")]
    port: PathBuf,
    /// Speed of the serial line, in bits per second.
    #[arg(long, value_name = "N", default_value = BAUD, allow_hyphen_values = true)]
    baud: String,
    /// Time to wait for the robot, in seconds: some boards restart when the port is opened.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value = "2",
        allow_hyphen_values = true
    )]
    wait: String,
}

impl PortArgs {
    /// Returns the port's name.
    pub(super) fn name(&self) -> PortName {
        PortName(self.port.clone())
    }

    /// Checks the flags and connects. After that, the first signal ends the session with the robot
    /// cleanly, and the second exits immediately.
    pub(super) fn connect(&self) -> anyhow::Result<Robot> {
        let baud = flag("baud", &self.baud, |text| count(text, 12_000_000))?;
        let wait = flag("wait", &self.wait, |text| count(text, 3600))?;
        ask_then_end("stopping", || {
            if let Some(words) = standing() {
                tell!("{words}");
            }
        })?;
        let port = self.name();
        let wait = Duration::from_secs(wait.into());
        let robot = Robot::connect(&port, baud, wait, stop()).map_err(failed)?;
        tell!("{port}: {}", robot.identity());
        Ok(robot)
    }

    /// Returns the command line of another command for the same port.
    pub(super) fn command(&self, command: &str) -> String {
        let port = shell_path(&self.port);
        let line = format!("{} {command} --port {port}", program());
        match self.baud.as_str() {
            BAUD => line,
            baud => format!("{line} --baud {baud}"),
        }
    }
}

/// Converts an error of the port or robot to an error of the command.
pub(super) fn failed(error: RobotError) -> anyhow::Error {
    match error.problem {
        Problem::NoSuchPort { .. } | Problem::NotAPort { .. } | Problem::NotUtf8 => {
            BadInput::new(error).into()
        }
        Problem::Interrupted { .. } => Interrupted(error.to_string()).into(),
        _ => error.into(),
    }
}
