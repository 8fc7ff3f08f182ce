//! A suite, and the runs chosen from it by flags.

use crate::commands::{BadInput, flag};
use crate::suite::plan::Plan;
use crate::suite::{Resilience, Suite};
use clap::Args;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_evolution::text::{file_name_except, shell_path, shell_word};
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the directory of the paper's suite.
const BUILT_IN: &str = "paper";

/// Selection of runs.
#[derive(Debug, Args)]
pub struct Choice {
    /// Only this experiment.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    only: Option<String>,
    /// Runs of every combination, instead of the suite's number.
    #[arg(
        long,
        value_name = "N",
        allow_hyphen_values = true,
        conflicts_with = "runs_times"
    )]
    runs: Option<String>,
    /// N times the suite's number of runs.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    runs_times: Option<String>,
    /// Also the experiments beyond the paper.
    #[arg(long)]
    all: bool,
    /// Directory of the suite [default: runs/ and the suite's name as a file name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Choice {
    /// Returns true if the choice is exactly all runs of the suite.
    pub fn is_whole(&self) -> bool {
        self.flags().is_empty()
    }

    /// Returns the flags of this choice.
    pub fn flags(&self) -> Vec<String> {
        let valued = [
            ("--only", &self.only),
            ("--runs", &self.runs),
            ("--runs-times", &self.runs_times),
        ];
        let mut flags: Vec<String> = valued
            .into_iter()
            .filter_map(|(name, value)| {
                value.as_ref().map(|value| [name.to_owned(), value.clone()])
            })
            .flatten()
            .collect();
        if self.all {
            flags.push("--all".to_owned());
        }
        flags
    }
}

/// A suite and the command that names it.
pub(super) struct Source {
    /// The suite.
    pub suite: Suite,
    /// True if the suite is built in.
    pub built_in: bool,
    /// Text of the suite's file.
    pub text: String,
    /// The command that named the suite.
    pub called: String,
}

/// The runs chosen from a suite, and their location.
pub(super) struct Chosen<'a> {
    /// The suite.
    pub source: &'a Source,
    /// The choice.
    pub choice: &'a Choice,
    /// The chosen runs.
    pub plan: Plan,
    /// Directory of the suite.
    pub directory: PathBuf,
}

impl<'a> Chosen<'a> {
    /// Plans the chosen runs.
    ///
    /// # Errors
    /// [`BadInput`] if a flag is invalid or no run is chosen.
    pub(super) fn new(source: &'a Source, choice: &'a Choice) -> Result<Self, BadInput> {
        Ok(Self {
            source,
            choice,
            plan: plan(&source.suite, choice)?,
            directory: directory(source, choice),
        })
    }

    /// Returns the structures to search for beyond the plan.
    pub(super) fn searches(&self) -> &'a [Resilience] {
        match self.choice.runs {
            None => &self.source.suite.resiliences,
            // With a different number of runs, it is a different experiment.
            Some(_) => &[],
        }
    }

    /// Returns the error for a directory without a finished run.
    pub(super) fn nothing_finished(&self) -> BadInput {
        BadInput::new(format!(
            "{}: no run of this suite is finished there; execute the runs with: {}; or name their \
             directory with --out",
            self.directory.display(),
            self.command()
        ))
    }

    /// Returns the command that executes the runs and the searches.
    pub(super) fn command(&self) -> String {
        let mut words = vec![self.source.called.clone(), "run".to_owned()];
        let flags = self.choice.flags();
        words.extend(flags.iter().map(shell_word));
        words.extend(["--out".to_owned(), shell_path(&self.directory)]);
        words.join(" ")
    }
}

fn plan(suite: &Suite, choice: &Choice) -> Result<Plan, BadInput> {
    let number = |name: &str, text: &Option<String>| {
        text.as_ref()
            .map(|text| flag(name, text, |text| count(text, 1_000_000)))
            .transpose()
    };
    let mut suite = suite.clone();
    if let Some(times) = number("runs-times", &choice.runs_times)? {
        for experiment in &mut suite.experiments {
            experiment.runs = experiment.runs.saturating_mul(times);
        }
    }
    let runs = number("runs", &choice.runs)?;
    Plan::new(&suite, choice.only.as_deref(), runs, choice.all).map_err(BadInput::new)
}

fn directory(source: &Source, choice: &Choice) -> PathBuf {
    let suite = &source.suite;
    choice.out.clone().unwrap_or_else(|| {
        let runs = Path::new("runs");
        let taken = if source.built_in { "" } else { BUILT_IN };
        // If an earlier version created a directory with this name, that directory is still used.
        let mut there = fs::read_dir(runs).into_iter().flatten().flatten();
        if suite.name != taken && there.any(|entry| entry.file_name() == *suite.name) {
            return runs.join(&suite.name);
        }
        runs.join(file_name_except(&suite.name, taken))
    })
}
