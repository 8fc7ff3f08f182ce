//! `evolver start` and `evolver stop`: start and stop a robot's control loop.

use super::port::{PortArgs, failed};

/// Starts the robot.
///
/// # Errors
/// If the robot cannot be reached or rejects the request.
pub fn start(arguments: &PortArgs) -> anyhow::Result<()> {
    switch(arguments, true)
}

/// Stops the robot.
///
/// # Errors
/// If the robot cannot be reached or rejects the request.
pub fn stop(arguments: &PortArgs) -> anyhow::Result<()> {
    switch(arguments, false)
}

fn switch(arguments: &PortArgs, runs: bool) -> anyhow::Result<()> {
    let mut robot = arguments.connect()?;
    let switched = match runs {
        true => robot.start(),
        false => robot.stop(),
    };
    switched.map_err(failed)?;
    let identity = robot.identify().map_err(failed)?;
    show_line!("{}: {identity}", arguments.name());
    Ok(())
}
