//! The command line: parses the arguments and calls a command.

use crate::commands::baseline::{BaselineArgs, baseline};
use crate::commands::bench::bench;
use crate::commands::classify::classify;
use crate::commands::damage::{DamageArgs, damage};
use crate::commands::evaluate::{EvaluateArgs, evaluate};
use crate::commands::evolve::{EvolveArgs, evolve};
use crate::commands::exit_of;
use crate::commands::export::{ExportArgs, export};
use crate::commands::flash::{FlashArgs, flash};
use crate::commands::gallery::{GalleryArgs, gallery};
use crate::commands::hil::{HilArgs, hil};
use crate::commands::import::{ImportArgs, import};
use crate::commands::inspect::inspect;
use crate::commands::monitor::{MonitorArgs, monitor};
use crate::commands::port::PortArgs;
use crate::commands::replay::{ReplayArgs, replay};
use crate::commands::start::{start, stop};
use crate::commands::suite::{SuiteArgs, TaskArgs, Verb, paper, run_task, suite};
use crate::exit::Exit;
use crate::output;
use clap::{ColorChoice, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

/// Evolves swarms of robots that minimise surprise, with exactly the robots' integer arithmetic.
///
/// Without a command: `evolve` with the paper's parameters.
#[derive(Debug, Parser)]
#[command(name = "evolver", version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Evolve a swarm; write its genome and the record of the run to a directory.
    Evolve(Box<EvolveArgs>),
    /// Measure the speed of this program on this machine; takes less than a minute.
    Bench {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Classify the structure that a swarm formed, show its robots, and measure the run.
    Classify {
        /// A run directory, a final.json, an agent_trajectory, or a drawing of ▶ ▲ ◀ ▼ and ·.
        state: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Replay a run in the terminal, or write it as a page or pictures.
    Replay(Box<ReplayArgs>),
    /// Write a page with the final state of every run, linked to their replays.
    Gallery(GalleryArgs),
    /// Re-evaluate a genome from new starts, optionally with different grids, noise and swarm
    /// sizes.
    Evaluate(EvaluateArgs),
    /// Show the fitness and structures expected by chance: from a constant prediction, random
    /// placements and random genomes.
    Baseline(BaselineArgs),
    /// Remove or reposition robots of a structure, and measure the swarm's recovery.
    Damage(DamageArgs),
    /// Export a run or a genome to the format of another program.
    Export(ExportArgs),
    /// Write a genome to the robot on a serial port, and start the robot.
    Flash(FlashArgs),
    /// Show the motion and surprise of the robot on a serial port until Ctrl-C.
    Monitor(MonitorArgs),
    /// Start the robot on a serial port with its current genome.
    Start(PortArgs),
    /// Stop the robot on a serial port.
    Stop(PortArgs),
    /// Hardware in the loop: simulate a swarm whose robot 0 is on a serial port, and compare the
    /// result with a simulation.
    Hil(HilArgs),
    /// Import genomes from text files written by the paper authors' program.
    Import(ImportArgs),
    /// Show the contents of a genome file.
    Inspect {
        /// A genome file or a run directory.
        #[arg(value_name = "GENOME|RUN")]
        genome: PathBuf,
    },
    /// Run the paper's experiments: all its evolutions, one after another or on a cluster.
    Paper {
        #[command(subcommand)]
        verb: Verb,
    },
    /// Run your own suite of experiments, described in a TOML file.
    Suite(SuiteArgs),
    /// Execute part of a suite's runs, as one cluster or GNU parallel task.
    RunTask(TaskArgs),
    /// Print a completion script for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    output::start();
    let exit = run(arguments()).unwrap_or_else(|error| {
        tell!("error: {error:#}");
        exit_of(&error)
    });
    exit.into()
}

/// Parses the arguments; exits if they are invalid or request help.
fn arguments() -> Cli {
    let colours = match output::terminal_has_codes() {
        true => ColorChoice::Auto,
        false => ColorChoice::Never,
    };
    let matches = Cli::command().color(colours).try_get_matches();
    let parsed = matches.and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.unwrap_or_else(|error| {
        if error.use_stderr() {
            tell!("{}", error.render().to_string().trim_end());
            Exit::BadInput.now();
        }
        let printed = match output::stdout_is_ascii() {
            true => output::try_write(format_args!("{}", error.render())),
            false => error.print(),
        };
        output::check(printed);
        Exit::Done.now()
    })
}

fn run(arguments: Cli) -> anyhow::Result<Exit> {
    let done = |()| Exit::Done;
    match arguments.command {
        None => evolve(&EvolveArgs::default()),
        Some(Command::Evolve(arguments)) => evolve(&arguments),
        Some(Command::Bench { json }) => bench(json).map(done),
        Some(Command::Classify { state, json }) => classify(&state, json).map(done),
        Some(Command::Replay(arguments)) => replay(&arguments),
        Some(Command::Gallery(arguments)) => gallery(&arguments),
        Some(Command::Evaluate(arguments)) => evaluate(&arguments).map(done),
        Some(Command::Baseline(arguments)) => baseline(&arguments).map(done),
        Some(Command::Damage(arguments)) => damage(&arguments).map(done),
        Some(Command::Export(arguments)) => export(&arguments).map(done),
        Some(Command::Flash(arguments)) => flash(&arguments).map(done),
        Some(Command::Monitor(arguments)) => monitor(&arguments),
        Some(Command::Start(arguments)) => start(&arguments).map(done),
        Some(Command::Stop(arguments)) => stop(&arguments).map(done),
        Some(Command::Hil(arguments)) => hil(&arguments),
        Some(Command::Import(arguments)) => import(&arguments).map(done),
        Some(Command::Inspect { genome }) => inspect(&genome).map(done),
        Some(Command::Paper { verb }) => paper(&verb),
        Some(Command::Suite(arguments)) => suite(&arguments),
        Some(Command::RunTask(arguments)) => run_task(&arguments),
        Some(Command::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "evolver", &mut script);
            output::write_bytes(&script);
            Ok(Exit::Done)
        }
    }
}
