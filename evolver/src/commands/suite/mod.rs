//! `evolver paper` and `evolver suite FILE`: many evolutions, on one machine or many.

mod choice;
mod export;
mod plan;
mod report;
mod run;
mod status;
mod submit;

use crate::commands::BadInput;
use crate::exit::Exit;
use crate::suite::{PAPER, Suite};
use choice::{Choice, Chosen, Source};
use clap::{Args, Subcommand};
use minimal_surprise_evolution::files::{self, TEXT_BYTES_MAX};
use minimal_surprise_evolution::text::shell_path;
use run::{RunOptions, Share};
use std::path::{Path, PathBuf};

pub use run::TaskArgs;
pub use submit::ClusterEngine;

/// A suite in a file.
#[derive(Debug, Args)]
pub struct SuiteArgs {
    /// The suite's TOML file.
    file: PathBuf,
    #[command(subcommand)]
    verb: Verb,
}

/// Actions on a suite.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// List the runs without executing any.
    Plan(Choice),
    /// Execute the runs that are not complete; can be interrupted at any moment and called again.
    Run {
        /// Selection of runs.
        #[command(flatten)]
        choice: Choice,
        /// Options for the work.
        #[command(flatten)]
        options: RunOptions,
    },
    /// Show the number of complete runs; once all are complete, also one hash for all.
    Status(Choice),
    /// Write the report: tables, figures and findings, from the complete runs.
    Report {
        /// Selection of runs.
        #[command(flatten)]
        choice: Choice,
        /// Location of the report.
        #[command(flatten)]
        options: report::ReportOptions,
    },
    /// Export the finished runs as tables for other programs: CSV files with their description.
    Export {
        /// The chosen runs.
        #[command(flatten)]
        choice: Choice,
        /// Directory and tables of the export.
        #[command(flatten)]
        options: export::ExportOptions,
    },
    /// Submit the runs to a cluster.
    Submit {
        /// Selection of runs.
        #[command(flatten)]
        choice: Choice,
        /// Options for the submission.
        #[command(flatten)]
        options: submit::SubmitOptions,
    },
}

/// Runs `evolver paper …`.
///
/// # Errors
/// [`BadInput`] if an argument or the suite is invalid, or memory or disk space is insufficient; in
/// these cases, nothing is written. After other errors, unfinished runs can be resumed.
pub fn paper(verb: &Verb) -> anyhow::Result<Exit> {
    let paper = Source {
        suite: Suite::paper().map_err(BadInput::new)?,
        built_in: true,
        text: PAPER.to_owned(),
        called: "evolver paper".to_owned(),
    };
    act(&paper, verb)
}

/// Runs `evolver suite FILE …`.
///
/// # Errors
/// See [`paper`].
pub fn suite(arguments: &SuiteArgs) -> anyhow::Result<Exit> {
    act(&read(&arguments.file)?, &arguments.verb)
}

/// Runs `evolver run-task …`.
///
/// # Errors
/// See [`paper`].
pub fn run_task(arguments: &TaskArgs) -> anyhow::Result<Exit> {
    let share = Share::parse(&arguments.shard)?;
    let source = read(&arguments.suite)?;
    let chosen = Chosen::new(&source, &arguments.choice)?;
    run::run(&chosen, share, &arguments.options)
}

fn read(file: &Path) -> Result<Source, BadInput> {
    let text = files::read_text(file, TEXT_BYTES_MAX).map_err(BadInput::new)?;
    let suite = Suite::parse(file, &text).map_err(BadInput::new)?;
    let called = format!("evolver suite {}", shell_path(file));
    Ok(Source {
        suite,
        built_in: false,
        text,
        called,
    })
}

fn act(source: &Source, verb: &Verb) -> anyhow::Result<Exit> {
    let (Verb::Plan(choice)
    | Verb::Run { choice, .. }
    | Verb::Status(choice)
    | Verb::Report { choice, .. }
    | Verb::Export { choice, .. }
    | Verb::Submit { choice, .. }) = verb;
    let chosen = Chosen::new(source, choice)?;
    match verb {
        Verb::Plan(_) => Ok(plan::print(&chosen)),
        Verb::Status(_) => status::print(&chosen),
        Verb::Report { options, .. } => report::write(&chosen, options),
        Verb::Run { options, .. } => run::run(&chosen, Share::Whole, options),
        Verb::Export { options, .. } => export::export(&chosen, options),
        Verb::Submit { options, .. } => submit::submit(&chosen, options),
    }
}
