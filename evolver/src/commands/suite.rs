//! `evolver paper` and `evolver suite FILE`: many evolutions, on one machine or many.

use super::evaluate::flag;
use super::evolve::stop_on_ctrl_c;
use super::{BadInput, thread_pool};
use crate::files;
use crate::report::progress::ProgressMode;
use crate::report::suite_progress::SuiteProgress;
use crate::report::summary::shell_word;
use crate::settings::count;
use crate::suite::plan::{Plan, PlannedRun};
use crate::suite::work::{Progress, Shard, Worked, progress, work_on};
use crate::suite::{PAPER, Suite, report, slurm};
use clap::{Args, Subcommand, ValueEnum};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Exit code after Ctrl-C.
const EXIT_INTERRUPTED: u8 = 130;

/// A suite of one's own.
#[derive(Debug, Args)]
pub struct SuiteArgs {
    /// The suite's TOML file.
    file: PathBuf,
    #[command(subcommand)]
    verb: Verb,
}

/// What to do with a suite.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// List the runs, without doing any.
    Plan(Choice),
    /// Do the runs that are not done; may be interrupted at any moment and called again.
    Run {
        /// Which runs.
        #[command(flatten)]
        choice: Choice,
        /// How to work.
        #[command(flatten)]
        manner: Manner,
    },
    /// Say how many runs are done.
    Status(Choice),
    /// Write the report: tables, figures and findings, from the runs that are done.
    Report(Choice),
    /// Hand the runs to a cluster.
    Submit {
        /// Which runs.
        #[command(flatten)]
        choice: Choice,
        /// The engine.
        #[arg(long, value_enum)]
        engine: ClusterEngine,
        /// Tasks that the runs are dealt to.
        #[arg(
            long,
            value_name = "N",
            default_value = "50",
            allow_hyphen_values = true
        )]
        shards: String,
        /// Most tasks at once.
        #[arg(long, value_name = "N", allow_hyphen_values = true)]
        at_once: Option<String>,
        /// Only show what would be submitted.
        #[arg(long)]
        dry_run: bool,
    },
}

/// Which runs.
#[derive(Debug, Args)]
pub struct Choice {
    /// Only this experiment.
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Runs of every combination, instead of the suite's number.
    #[arg(
        long,
        value_name = "N",
        allow_hyphen_values = true,
        conflicts_with = "runs_times"
    )]
    runs: Option<String>,
    /// So many times the suite's number of runs.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    runs_times: Option<String>,
    /// Also what goes beyond the paper.
    #[arg(long)]
    all: bool,
    /// Directory of the suite [default: runs/ and the suite's name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// How to work.
#[derive(Debug, Args)]
pub struct Manner {
    /// Threads [default: one a core]; no result depends on them.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// How progress is shown.
    #[arg(long, value_enum, default_value_t)]
    progress: ProgressMode,
}

/// What spreads runs over machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClusterEngine {
    /// One job array of Slurm.
    Slurm,
}

/// What one task of a cluster, or of GNU parallel, does.
#[derive(Debug, Args)]
pub struct TaskArgs {
    /// Which share of the runs: i/n, i from 0.
    #[arg(long, value_name = "i/n")]
    shard: String,
    /// The suite's TOML file [default: suite.toml in the directory of the suite].
    #[arg(long, value_name = "FILE")]
    suite: Option<PathBuf>,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    manner: Manner,
}

/// A suite as it was read.
struct Read {
    suite: Suite,
    text: String,
    /// The command that it was read by.
    called: String,
}

/// `evolver paper …`
///
/// # Errors
/// [`BadInput`] before anything is written; other errors leave runs that can be gone on with.
pub fn paper(verb: &Verb) -> anyhow::Result<ExitCode> {
    let suite = Suite::paper().map_err(BadInput::new)?;
    let text = PAPER.to_owned();
    let called = "evolver paper".to_owned();
    act(
        &Read {
            suite,
            text,
            called,
        },
        verb,
    )
}

/// `evolver suite FILE …`
///
/// # Errors
/// As [`paper`].
pub fn suite(arguments: &SuiteArgs) -> anyhow::Result<ExitCode> {
    act(&read(&arguments.file)?, &arguments.verb)
}

/// `evolver run-task`
///
/// # Errors
/// As [`paper`].
pub fn run_task(arguments: &TaskArgs) -> anyhow::Result<ExitCode> {
    let shard = flag("shard", &arguments.shard, Shard::parse)?;
    let file = match (&arguments.suite, &arguments.choice.out) {
        (Some(file), _) => file.clone(),
        (None, Some(directory)) => directory.join(slurm::SUITE_FILE),
        (None, None) => {
            return Err(BadInput::new("--suite or --out is missing: which suite is it?").into());
        }
    };
    let read = read(&file)?;
    let plan = plan(&read.suite, &arguments.choice)?;
    let directory = directory(&read.suite, &arguments.choice);
    run(&plan, shard, &directory, &arguments.manner)
}

fn read(file: &Path) -> Result<Read, BadInput> {
    let text = fs::read_to_string(file)
        .map_err(|error| BadInput::new(format!("{}: {error}", file.display())))?;
    let suite = Suite::parse(file, &text).map_err(BadInput::new)?;
    let called = format!("evolver suite {}", shell_word(file));
    Ok(Read {
        suite,
        text,
        called,
    })
}

fn act(read: &Read, verb: &Verb) -> anyhow::Result<ExitCode> {
    let (Verb::Plan(choice)
    | Verb::Run { choice, .. }
    | Verb::Status(choice)
    | Verb::Report(choice)
    | Verb::Submit { choice, .. }) = verb;
    let plan = plan(&read.suite, choice)?;
    let directory = directory(&read.suite, choice);
    match verb {
        Verb::Plan(_) => print_plan(&plan),
        Verb::Status(_) => print_status(&plan, &directory),
        Verb::Report(_) => {
            let written = report::write(
                &plan,
                &read.suite,
                &directory,
                &directory.join("report"),
                &read.called,
            )?;
            show_line!(
                "{} of {} runs; {}",
                written.finished,
                written.planned,
                written.html.display()
            );
        }
        Verb::Run { manner, .. } => return run(&plan, Shard::ALL, &directory, manner),
        Verb::Submit {
            engine: ClusterEngine::Slurm,
            shards,
            at_once,
            dry_run,
            ..
        } => {
            let job = slurm::Job {
                name: &read.suite.name,
                directory: &std::path::absolute(&directory)?,
                shards: flag("shards", shards, |text| count(text, 100_000))?,
                at_once: match at_once {
                    Some(text) => Some(flag("at-once", text, |text| count(text, 100_000))?),
                    None => None,
                },
                flags: flags(choice),
            };
            if *dry_run {
                show!("{}", job.script());
            } else {
                show_line!("{}", job.submit(&read.text)?);
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The choice of runs as flags, for tasks.
fn flags(choice: &Choice) -> Vec<String> {
    let valued = [
        ("--only", &choice.only),
        ("--runs", &choice.runs),
        ("--runs-times", &choice.runs_times),
    ];
    let mut flags: Vec<String> = valued
        .into_iter()
        .filter_map(|(name, value)| value.as_ref().map(|value| [name.to_owned(), value.clone()]))
        .flatten()
        .collect();
    if choice.all {
        flags.push("--all".to_owned());
    }
    flags
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

fn directory(suite: &Suite, choice: &Choice) -> PathBuf {
    let named = || Path::new("runs").join(&suite.name);
    choice.out.clone().unwrap_or_else(named)
}

fn print_plan(plan: &Plan) {
    for experiment in &plan.experiments {
        show_line!("{}", experiment.name);
        for settings in &experiment.settings {
            show_line!("  {:<40} {:>4} runs", settings.label, settings.runs.len());
        }
    }
    let runs = plan.runs();
    let robot_steps: u64 = runs
        .iter()
        .map(|run| run.settings.robot_steps_per_generation() * u64::from(run.settings.generations))
        .sum();
    show_line!(
        "\n{} different runs, {:.1} billion robot-steps",
        runs.len(),
        robot_steps as f64 / 1e9
    );
}

fn print_status(plan: &Plan, directory: &Path) {
    for experiment in &plan.experiments {
        show_line!("{}", experiment.name);
        for settings in &experiment.settings {
            let of = |state| {
                let runs = settings.runs.iter();
                runs.filter(|run| progress(run, directory) == state).count()
            };
            let (done, begun) = (of(Progress::Done), of(Progress::Begun));
            show_line!(
                "  {:<40} {done:>4} of {} done, {begun} begun",
                settings.label,
                settings.runs.len()
            );
        }
    }
}

fn run(plan: &Plan, shard: Shard, directory: &Path, manner: &Manner) -> anyhow::Result<ExitCode> {
    let threads = match &manner.threads {
        Some(text) => Some(flag("threads", text, |text| count(text, 1024))?),
        None => None,
    };
    let runs = shard.of_plan(plan);
    let stop = stop_on_ctrl_c()?;
    let worked =
        thread_pool(threads)?.install(|| work(plan, &runs, directory, manner.progress, &stop))?;
    let Some(elsewhere) = worked else {
        eprintln!("interrupted; the same command goes on");
        return Ok(ExitCode::from(EXIT_INTERRUPTED));
    };
    let done = runs.len() - waiting(&runs, directory).len();
    if manner.progress == ProgressMode::Json {
        show_line!(
            "{}",
            serde_json::json!({"event": "done", "runs_done": done, "runs": runs.len()})
        );
    } else {
        let others = match elsewhere {
            0 => String::new(),
            n => format!("; {n} are being worked on by another process"),
        };
        show_line!(
            "{done} of {} runs done in {}{others}",
            runs.len(),
            directory.display()
        );
    }
    if done == runs.len() {
        let hashes = hashes(&runs, directory)?;
        files::replace(&directory.join(shard.hashes_file()), hashes.as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn waiting<'a>(runs: &[&'a PlannedRun], directory: &Path) -> Vec<&'a PlannedRun> {
    let runs = runs.iter().copied();
    runs.filter(|run| progress(run, directory) != Progress::Done)
        .collect()
}

/// Does what is not done; the number of runs that others hold comes back, nothing if interrupted.
fn work(
    plan: &Plan,
    runs: &[&PlannedRun],
    directory: &Path,
    mode: ProgressMode,
    stop: &AtomicBool,
) -> anyhow::Result<Option<usize>> {
    let waiting = waiting(runs, directory);
    let shown = SuiteProgress::start(mode, plan, runs, waiting.len());
    let mut elsewhere = 0;
    for run in waiting {
        shown.begins(run);
        let worked = work_on(run, directory, stop, |generation| {
            shown.generation(run, generation);
        });
        match worked {
            Ok(Worked::Completed) => shown.completed(run),
            Ok(Worked::Elsewhere) => elsewhere += 1,
            Ok(Worked::Interrupted) => {
                shown.end();
                return Ok(None);
            }
            Err(error) => {
                shown.end();
                return Err(error.into());
            }
        }
    }
    shown.end();
    Ok(Some(elsewhere))
}

/// A line a run: its name and its hash.
fn hashes(runs: &[&PlannedRun], directory: &Path) -> Result<String, files::FileError> {
    let mut text = String::new();
    for run in runs {
        let hash = files::read(&run.directory(directory).join("DONE"))?;
        text += &format!("{} {}", run.id, String::from_utf8_lossy(&hash));
    }
    Ok(text)
}
