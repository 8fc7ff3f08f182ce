//! `run`, and the tasks of a cluster: execute the runs that are not complete.

use super::choice::{Choice, Chosen};
use crate::commands::BadInput;
use crate::commands::errors::{Unfinished, name_damaged, stopped, unusable};
use crate::commands::{flag, thread_pool, threads_flag};
use crate::exit::Exit;
use crate::report::progress::ProgressMode;
use crate::report::suite_progress::{SearchProgress, SuiteProgress};
use crate::signals::stop_on_signal;
use crate::suite::Resilience;
use crate::suite::plan::{RUNS, Runs};
use crate::suite::search::{Search, look};
use crate::suite::status::Hashes;
use crate::suite::work::Shard;
use crate::suite::worker::{Ended, ToDo, Worker};
use clap::Args;
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::{self, FileError};
use minimal_surprise_evolution::limits;
use minimal_surprise_evolution::new_dir::remove_abandoned;
use minimal_surprise_evolution::text::terminal_path;
use minimal_surprise_sim::EnginePath;
use std::fs;
use std::path::PathBuf;

/// Options for executing the runs.
#[derive(Debug, Args)]
pub struct RunOptions {
    /// Threads; no result depends on them [default: one per core].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// Progress display.
    #[arg(long, value_enum, default_value_t)]
    progress: ProgressMode,
}

/// Arguments of one cluster or GNU parallel task.
#[derive(Debug, Args)]
pub struct TaskArgs {
    /// Share of the runs: i/n, with i counted from 0.
    #[arg(long, value_name = "i/n")]
    pub(super) shard: String,
    /// The suite's TOML file.
    #[arg(long, value_name = "FILE")]
    pub(super) suite: PathBuf,
    #[command(flatten)]
    pub(super) choice: Choice,
    #[command(flatten)]
    pub(super) options: RunOptions,
}

/// The share of the chosen runs that this process executes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    /// All runs, then the searches beyond the plan.
    Whole,
    /// One of several shares.
    One(Shard),
}

impl Share {
    /// Parses `i/n`.
    ///
    /// # Errors
    /// [`BadInput`] if the text is not a share.
    pub(super) fn parse(text: &str) -> Result<Self, BadInput> {
        flag("shard", text, Shard::parse).map(Self::One)
    }

    fn shard(self) -> Shard {
        match self {
            Self::Whole => Shard::ALL,
            Self::One(shard) => shard,
        }
    }
}

/// Executes a share of the chosen runs.
///
/// # Errors
/// [`BadInput`] if an argument is invalid, or memory or disk space is insufficient; in these cases,
/// nothing is written. After other errors, unfinished runs can be resumed.
pub(super) fn run(chosen: &Chosen, share: Share, options: &RunOptions) -> anyhow::Result<Exit> {
    let shard = share.shard();
    let runs = shard.of_plan(&chosen.plan);
    let (ended, damaged) = work(chosen, share, options, runs)?;
    if ended == Ended::Interrupted {
        return match share {
            Share::Whole => stopped(&chosen.command()),
            Share::One(_) => stopped("the same command"),
        };
    }
    finish(chosen, share, options, runs, damaged)
}

/// Executes the runs and the searches; returns the outcome of the work and the damaged runs.
fn work(
    chosen: &Chosen,
    share: Share,
    options: &RunOptions,
    runs: Runs<'_>,
) -> anyhow::Result<(Ended, DamagedRuns)> {
    let directory = &chosen.directory;
    let to_search = match share {
        Share::Whole => chosen.searches(),
        Share::One(_) => &[],
    };
    let threads = threads_flag(&options.threads)?;
    // As in `evolve`, an unknown engine is an error before any run is executed.
    EnginePath::from_environment().map_err(BadInput::new)?;
    let mut damaged = DamagedRuns::default();
    let threads_or_cores = limits::threads(threads);
    let to_do = ToDo::read(runs, directory, threads_or_cores, &mut damaged).map_err(unusable)?;
    let needs = to_do.needs.needs();
    needs.check_memory().map_err(BadInput::new)?;
    needs.check_disk(directory).map_err(BadInput::new)?;
    let mut worker = Worker::new(&chosen.plan, directory, stop_on_signal()?, damaged);
    remove_abandoned(&directory.join(RUNS));
    let mode = options.progress;
    let worked = thread_pool(threads)?.install(|| {
        let (number, left) = (to_do.number, to_do.robot_steps);
        let shown = SuiteProgress::start(mode, &chosen.plan, runs.number(), number, left);
        let mut ended = worker.do_all(runs, &to_do, &shown);
        shown.end();
        for asked in to_search {
            if !matches!(ended, Ok(Ended::Whole)) {
                break;
            }
            let shown = SearchProgress::start(mode, &asked.name);
            ended = worker.search(asked, &shown);
            shown.end();
        }
        ended
    });
    let ended = match worked {
        Err(error) if worker.begun => return Err(error.into()),
        worked => worked.map_err(unusable)?,
    };
    Ok((ended, worker.damaged))
}

/// Writes the hashes of finished runs and prints the number of complete runs.
fn finish(
    chosen: &Chosen,
    share: Share,
    options: &RunOptions,
    runs: Runs<'_>,
    mut damaged: DamagedRuns,
) -> anyhow::Result<Exit> {
    let (directory, shard) = (&chosen.directory, share.shard());
    // The count and the hash come from the same read, so that they agree. The file of hashes is
    // written only for the whole suite: the hashes of some runs must not replace the hashes of all
    // runs.
    let is_whole = chosen.choice.is_whole();
    let mut hashes = Hashes::read(runs, directory, is_whole, &mut damaged);
    let done = hashes.done;
    let all_done = done == runs.number();
    if let Some(lines) = hashes.lines.take().filter(|_| all_done) {
        fs::create_dir_all(directory).map_err(FileError::at(directory))?;
        files::replace(&directory.join(shard.hashes_file()), &lines)?;
    }
    // The hash of a share would depend on the number of shares.
    let hash = hashes.of_all(runs).filter(|_| shard == Shard::ALL);
    let search_by = match share {
        Share::Whole => None,
        Share::One(_) => search_by(chosen),
    };
    if options.progress == ProgressMode::Json {
        show_line!(
            "{}",
            serde_json::json!({
                "event": "done",
                "runs_done": done,
                "runs": runs.number(),
                "hash": hash,
                "search_by": search_by,
            })
        );
    } else {
        show_line!(
            "{done} of {} runs done in {}",
            runs.number(),
            terminal_path(directory)
        );
        if let Some(hash) = hash {
            show_line!("hash {hash}");
        }
        if let Some(command) = search_by {
            show_line!("to find a structure that no run formed, once all are done: {command}");
        }
    }
    if !all_done && damaged.is_empty() {
        let gone = runs.number() - done;
        return Err(Unfinished(format!(
            "{gone} runs were removed while others were executed; continue with: the same command"
        ))
        .into());
    }
    Ok(name_damaged(&damaged, Some(&chosen.command())))
}

/// Returns the command that searches for a structure, if a search may be needed.
fn search_by(chosen: &Chosen) -> Option<String> {
    // Damaged runs may belong to a different share; the command reports them.
    let is_needed = |asked: &Resilience| {
        let (plan, directory) = (&chosen.plan, &chosen.directory);
        let looked = look(plan, asked, directory, 0, &mut DamagedRuns::default());
        matches!(looked, Search::Waits | Search::Next(..))
    };
    let needed = chosen.searches().iter().any(is_needed);
    needed.then(|| chosen.command())
}
