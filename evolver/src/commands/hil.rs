//! `evolver hil`: simulates a swarm that includes the robot on a serial line.

use super::errors::unusable;
use super::port::{PortArgs, failed};
use super::setting_flags::GenomeConditions;
use super::{BadInput, read_genome};
use crate::exit::Exit;
use crate::hil::{HilError, HilRun, HilTrial};
use crate::report::progress;
use crate::robot::{Afterwards, Robot, RobotError, describe, is_in_use};
use clap::Args;
use indicatif::ProgressBar;
use minimal_surprise_controller::Controller;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::limits::Needs;
use minimal_surprise_evolution::run_files::BEST;
use minimal_surprise_evolution::text::{shell_path, terminal_path};
use minimal_surprise_sim::SeedTree;
use std::path::{Path, PathBuf};

/// Arguments of `evolver hil`.
#[derive(Debug, Args)]
#[command(override_usage = "evolver hil [OPTIONS] <--port <PORT>|--simulate> <RUN>")]
pub struct HilArgs {
    /// A run directory, which records all conditions; or a genome file.
    run: PathBuf,
    #[command(flatten)]
    port: Option<PortArgs>,
    /// Only simulate, without a robot.
    #[arg(long, required_unless_present = "port", conflicts_with = "port")]
    simulate: bool,
    #[command(flatten)]
    conditions: GenomeConditions,
}

/// Runs a swarm whose robot 0 is on the line, and compares the result with the simulation.
///
/// # Errors
/// [`BadInput`] if the run cannot be read, memory is insufficient, the robot cannot be reached, or
/// the robot runs a different genome. Other errors if the robot has a different kernel or fails
/// during the run.
pub fn hil(arguments: &HilArgs) -> anyhow::Result<Exit> {
    let (course, genome) = if arguments.run.is_dir() {
        of_run(arguments)?
    } else {
        of_genome(arguments)?
    };
    Needs::of_hil(&course.scenario)
        .check_memory()
        .map_err(BadInput::new)?;
    let simulated = course.simulate().map_err(BadInput::new)?;
    let Some(port) = &arguments.port else {
        show_line!("hash        {}", simulated.hash);
        return Ok(Exit::Done);
    };
    let mut robot = port.connect()?;
    robot.check_kernel().map_err(failed)?;
    let file = read_genome(&genome)?;
    if !is_in_use(robot.identity().genome, file.bytes()) {
        return Err(BadInput::new(format!(
            "--port = {}: the robot runs {}, not {}; write that genome to it with: {}",
            port.name(),
            describe(robot.identity().genome),
            terminal_path(&genome),
            port.command(&format!("flash {}", shell_path(&genome))),
        ))
        .into());
    }
    let ran = robot.while_stopped(
        Afterwards::StartsAnew,
        &port.command("start"),
        |robot| match run(&course, robot) {
            Ok(ran) => Ok(Ok(ran)),
            Err(HilError::World(error)) => Ok(Err(error)),
            Err(HilError::Robot(error)) => Err(error),
        },
    );
    let ran = ran.map_err(failed)?.map_err(BadInput::new)?;
    show_line!("hash        {}", ran.hash);
    if ran == simulated {
        show_line!("simulation  {}, equal", simulated.hash);
        Ok(Exit::Done)
    } else {
        show_line!("simulation  {}, different", simulated.hash);
        tell!("error: {}", difference(&ran, &simulated));
        Ok(Exit::Failure)
    }
}

/// Reads the run recorded in a directory; returns its trial and its genome file.
fn of_run(arguments: &HilArgs) -> anyhow::Result<(HilTrial, PathBuf)> {
    let directory = &arguments.run;
    arguments
        .conditions
        .refuse_beside("a run directory", directory)?;
    let finished = FinishedRun::read_and_check(directory).map_err(unusable)?;
    let course = HilTrial {
        controller: Controller::new(&finished.genome),
        scenario: *finished.settings.scenario(),
        trial: finished.trial(),
    };
    Ok((course, directory.join(BEST)))
}

/// Creates the trial defined by the flags: the first trial of the seed.
fn of_genome(arguments: &HilArgs) -> anyhow::Result<(HilTrial, PathBuf)> {
    let genome = read_genome(&arguments.run)?;
    let settings = arguments.conditions.settings(&genome)?;
    let course = HilTrial {
        controller: Controller::new(genome.genome()),
        scenario: *settings.scenario(),
        trial: settings
            .scenario()
            .trial(SeedTree::new(settings.seed()), 0, 0),
    };
    Ok((course, Path::new(&arguments.run).to_owned()))
}

/// Runs the swarm with the robot, after a reset of the robot's controller.
fn run(course: &HilTrial, robot: &mut Robot) -> Result<HilRun, HilError<RobotError>> {
    robot.reset().map_err(HilError::Robot)?;
    let bar = ProgressBar::new(course.scenario.steps().into());
    let bar = progress::bar(bar, "{pos}/{len} steps  {per_sec}");
    let ran = course.with_robot(|reading| {
        bar.inc(1);
        robot.step(reading)
    });
    bar.finish_and_clear();
    ran
}

/// Describes the first difference between robot and simulation.
fn difference(ran: &HilRun, simulated: &HilRun) -> String {
    match ran.first_difference(simulated) {
        Some(step) => {
            let (robot, here) = (ran.decisions[step - 1], simulated.decisions[step - 1]);
            format!(
                "in step {step} the robot decided {:?} {:?}, predicting {:#06x}; the simulation \
                 {:?} {:?}, predicting {:#06x}",
                robot.action,
                robot.turn,
                robot.prediction.bits(),
                here.action,
                here.turn,
                here.prediction.bits()
            )
        }
        None => format!(
            "the robot counts {} of {} bits mispredicted, the simulation {} of {}",
            ran.surprise.mispredicted_bits,
            ran.surprise.seen_bits,
            simulated.surprise.mispredicted_bits,
            simulated.surprise.seen_bits
        ),
    }
}
