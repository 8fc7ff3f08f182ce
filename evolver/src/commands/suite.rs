//! `evolver paper` and `evolver suite FILE`: many evolutions, on one machine or many.

use super::errors::{Unfinished, name_damaged, stopped};
use super::{BadInput, flag, thread_pool, threads_flag};
use crate::damaged_runs::DamagedRuns;
use crate::exit::Exit;
use crate::files::{self, Existing, TEXT_BYTES_MAX};
use crate::finished_run::Progress;
use crate::limits::{self, Needs};
use crate::new_dir::remove_abandoned;
use crate::replay::gallery;
use crate::report::progress::ProgressMode;
use crate::report::suite_progress::{SearchProgress, SuiteProgress, robot_steps};
use crate::run_dir::{Found, RunDir, RunDirError};
use crate::settings::count;
use crate::signals::stop_on_signal;
use crate::suite::plan::{Plan, PlannedRun, RUNS, Runs};
use crate::suite::report;
use crate::suite::search::{Search, look};
use crate::suite::work::{Shard, Waiting, Worked, progress, work_on};
use crate::suite::{PAPER, Resilience, Suite, slurm};
use crate::text::{file_name_except, hex, shell_path, shell_word, terminal_path};
use clap::{Args, Subcommand, ValueEnum};
use minimal_surprise_sim::Path as CodePath;
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Name of the directory of the paper's suite.
const BUILT_IN: &str = "paper";

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
    /// Say how many runs are done; once all are, one hash for all.
    Status(Choice),
    /// Write the report: tables, figures and findings, from the runs that are done.
    Report {
        /// Which runs.
        #[command(flatten)]
        choice: Choice,
        /// Where it is written [default: report/ in the directory of the suite].
        #[arg(long, value_name = "DIR")]
        to: Option<PathBuf>,
        /// Also write a page with every run's final state, from which its replay opens: gallery/ in
        /// the report.
        #[arg(long)]
        gallery: bool,
    },
    /// Hand the runs to a cluster.
    Submit {
        /// Which runs.
        #[command(flatten)]
        choice: Choice,
        /// The engine.
        #[arg(long, value_enum)]
        engine: ClusterEngine,
        /// Tasks that the runs are dealt to; no more than there are runs.
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
    /// So many times the suite's number of runs.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    runs_times: Option<String>,
    /// Also what goes beyond the paper.
    #[arg(long)]
    all: bool,
    /// Directory of the suite [default: runs/ and the suite's name as a file name].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Choice {
    /// Whether it is the suite as it is written.
    fn is_whole(&self) -> bool {
        flags(self).is_empty()
    }
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
    /// The suite's TOML file.
    #[arg(long, value_name = "FILE")]
    suite: PathBuf,
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
pub fn paper(verb: &Verb) -> anyhow::Result<Exit> {
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
pub fn suite(arguments: &SuiteArgs) -> anyhow::Result<Exit> {
    act(&read(&arguments.file)?, &arguments.verb)
}

/// `evolver run-task`
///
/// # Errors
/// As [`paper`].
pub fn run_task(arguments: &TaskArgs) -> anyhow::Result<Exit> {
    let shard = flag("shard", &arguments.shard, Shard::parse)?;
    let read = read(&arguments.suite)?;
    let plan = plan(&read.suite, &arguments.choice)?;
    let directory = directory(&read.suite, &arguments.choice);
    run(&Work {
        read: &read,
        choice: &arguments.choice,
        plan: &plan,
        directory: &directory,
        manner: &arguments.manner,
        share: Share::One(shard),
    })
}

fn read(file: &Path) -> Result<Read, BadInput> {
    let text = files::read_text(file, TEXT_BYTES_MAX).map_err(BadInput::new)?;
    let suite = Suite::parse(file, &text).map_err(BadInput::new)?;
    let called = format!("evolver suite {}", shell_path(file));
    Ok(Read {
        suite,
        text,
        called,
    })
}

fn act(read: &Read, verb: &Verb) -> anyhow::Result<Exit> {
    let (Verb::Plan(choice)
    | Verb::Run { choice, .. }
    | Verb::Status(choice)
    | Verb::Report { choice, .. }
    | Verb::Submit { choice, .. }) = verb;
    let plan = plan(&read.suite, choice)?;
    let directory = directory(&read.suite, choice);
    match verb {
        Verb::Plan(_) => print_plan(&plan, &read.suite, searches(&read.suite, choice)),
        Verb::Status(_) => {
            let mut damaged = print_status(&plan, &directory)?;
            print_searches(read, choice, &plan, &directory, &mut damaged);
            return Ok(name_damaged(
                &damaged,
                Some(&command(read, choice, &directory)),
            ));
        }
        Verb::Report { to, gallery, .. } => {
            let out = to.clone().unwrap_or_else(|| directory.join("report"));
            if !report::may_be_written(&out)? {
                return Err(BadInput::new(format!(
                    "{}: it is not marked as a report that may be replaced (an earlier version set \
                     no mark); name a new directory with --to",
                    out.display()
                ))
                .into());
            }
            let (finished, mut damaged) = finished(plan.runs(), &directory);
            let again = command(read, choice, &directory);
            if finished.is_empty() && !damaged.is_empty() {
                return Ok(name_damaged(&damaged, Some(&again)));
            }
            if finished.is_empty() {
                return Err(BadInput::new(format!(
                    "{}: no run of this suite is done there; --out names the directory that its \
                     runs are in",
                    directory.display()
                ))
                .into());
            }
            if *gallery {
                damaged.extend(write_gallery(&finished, &out.join(report::GALLERY))?);
            }
            let written = report::write(&plan, &read.suite, &directory, &out, &read.called)?;
            damaged.extend(written.damaged);
            show_line!(
                "{} of {} runs; {}",
                written.finished,
                written.planned,
                terminal_path(&written.html)
            );
            return Ok(name_damaged(&damaged, Some(&again)));
        }
        Verb::Run { manner, .. } => {
            return run(&Work {
                read,
                choice,
                plan: &plan,
                directory: &directory,
                manner,
                share: Share::Whole,
            });
        }
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
                // A task without a run would only wait in the queue.
                shards: flag("shards", shards, |text| count(text, 100_000))?.min(
                    u32::try_from(plan.runs().number())
                        .unwrap_or(u32::MAX)
                        .max(1),
                ),
                at_once: match at_once {
                    Some(text) => Some(flag("at-once", text, |text| count(text, 100_000))?),
                    None => None,
                },
                flags: flags(choice),
            };
            let unusable = |error| match error {
                slurm::SubmitError::UnusablePath(_) => BadInput::new(error).into(),
                other => anyhow::Error::from(other),
            };
            if !*dry_run {
                // Memory is that of the machines that the tasks run on.
                let needs = needs(&plan, plan.runs(), &directory, 1.0);
                needs.check_disk(&directory).map_err(BadInput::new)?;
            }
            if *dry_run {
                show!("{}", job.script().map_err(unusable)?);
            } else {
                show_line!("{}", job.submit(&read.text).map_err(unusable)?);
            }
        }
    }
    Ok(Exit::Done)
}

/// The gallery of a plan's finished runs; an earlier one is replaced.
fn write_gallery(finished: &[PathBuf], out: &Path) -> anyhow::Result<DamagedRuns> {
    if let Some(parent) = out.parent() {
        fs::create_dir_all(parent).map_err(files::FileError::at(parent))?;
    }
    let written = gallery::write(finished, out, Existing::Replace)?;
    show_line!(
        "{} runs, {:.1} MB; {}",
        written.runs,
        written.bytes as f64 / 1e6,
        terminal_path(&written.index)
    );
    Ok(written.damaged)
}

/// The directories of the runs that are done, and the damaged ones.
fn finished(runs: Runs<'_>, directory: &Path) -> (Vec<PathBuf>, DamagedRuns) {
    let mut damaged = DamagedRuns::default();
    let directories = runs.iter().map(|run| run.directory(directory));
    let finished = directories
        .filter(|run| damaged.read(run).is_some())
        .collect();
    (finished, damaged)
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
    choice.out.clone().unwrap_or_else(|| {
        let runs = Path::new("runs");
        let taken = if suite.built_in { "" } else { BUILT_IN };
        // What an earlier version called so is continued.
        let mut there = fs::read_dir(runs).into_iter().flatten().flatten();
        if suite.name != taken && there.any(|entry| entry.file_name() == *suite.name) {
            return runs.join(&suite.name);
        }
        runs.join(file_name_except(&suite.name, taken))
    })
}

fn print_plan(plan: &Plan, suite: &Suite, searches: &[Resilience]) {
    for experiment in &plan.experiments {
        show_line!("{}", experiment.name);
        for settings in experiment.settings() {
            show_line!("  {:<40} {:>4} runs", settings.label, settings.number);
        }
    }
    let is_planned = |of: &str| plan.experiments.iter().any(|e| e.name == of);
    for again in &suite.reevaluations {
        let of: Vec<&str> = again.of.iter().map(String::as_str).collect();
        let of: Vec<&str> = of.into_iter().filter(|of| is_planned(of)).collect();
        if !of.is_empty() {
            show_line!("{}", again.name);
            show_line!("  {:<40} {:>4} new starts", of.join(", "), again.starts);
        }
    }
    let resiliences = suite.resiliences.iter();
    for damage in resiliences.filter(|damage| is_planned(&damage.of)) {
        let Resilience { of, structure, .. } = damage;
        show_line!("{}", damage.name);
        show_line!(
            "  {:<40} {:>4} areas, {} times",
            format!("{of}, {structure}"),
            damage.robots_in_areas.len(),
            damage.repeat
        );
        if damage.further_runs > 0 && searches.contains(damage) {
            show_line!(
                "  if no run of {of} has a {structure}: up to {} runs more",
                damage.further_runs
            );
        }
    }
    let robot_steps: f64 = plan
        .by_settings()
        .map(|(settings, runs)| {
            let generations = f64::from(settings.generations) * f64::from(runs);
            settings.robot_steps_per_generation() as f64 * generations
        })
        .sum();
    show_line!(
        "\n{} different runs, {} robot-steps",
        plan.runs().number(),
        in_words(robot_steps)
    );
}

/// A large number.
fn in_words(number: f64) -> String {
    match number {
        1e9.. => format!("{:.1} billion", number / 1e9),
        1e6.. => format!("{:.1} million", number / 1e6),
        _ => format!("{number}"),
    }
}

/// Looks whether a run that is not complete can be gone on with.
fn check_begun(run: &PlannedRun, suite: &Path, damaged: &mut DamagedRuns) {
    let is_begun = || matches!(progress(run, suite), Ok(Progress::Begun));
    let directory = run.directory(suite);
    // Another process may have completed it meanwhile.
    if is_begun()
        && let Err(error) = RunDir::check_unfinished(&directory)
        && is_begun()
    {
        damaged.add(&directory, error.cause());
    }
}

/// Shows how many runs are done, and gives the damaged ones back.
fn print_status(plan: &Plan, directory: &Path) -> Result<DamagedRuns, RunDirError> {
    let mut damaged = DamagedRuns::default();
    let (runs, mut hash, mut done) = (plan.runs(), Sha256::new(), 0);
    each_hash(runs, directory, &mut damaged, |line| {
        hash.update(line);
        done += 1;
    })?;
    for experiment in &plan.experiments {
        show_line!("{}", experiment.name);
        for settings in experiment.settings() {
            let (mut done, mut begun, mut spoilt) = (0, 0, 0);
            for run in settings.runs() {
                check_begun(&run, directory, &mut damaged);
                if damaged.contains(&run.directory(directory)) {
                    spoilt += 1;
                    continue;
                }
                match progress(&run, directory)? {
                    Progress::Done => done += 1,
                    Progress::Begun => begun += 1,
                    Progress::Pending => {}
                }
            }
            let spoilt = match spoilt {
                0 => String::new(),
                number => format!(", {number} damaged"),
            };
            show_line!(
                "  {:<40} {done:>4} of {} done, {begun} begun{spoilt}",
                settings.label,
                settings.number
            );
        }
    }
    show_line!("\n{done} of {} different runs done", runs.number());
    if done == runs.number() {
        show_line!("hash {}", hex(&hash.finalize()));
    }
    Ok(damaged)
}

/// The structures that are searched for.
fn searches<'a>(suite: &'a Suite, choice: &Choice) -> &'a [Resilience] {
    match choice.runs {
        None => &suite.resiliences,
        // With another number of runs it is another experiment.
        Some(_) => &[],
    }
}

/// The command that does the runs, and searches.
fn command(read: &Read, choice: &Choice, directory: &Path) -> String {
    let mut words = vec![read.called.clone(), "run".to_owned()];
    let flags = flags(choice);
    words.extend(flags.iter().map(shell_word));
    words.extend(["--out".to_owned(), shell_path(directory)]);
    words.join(" ")
}

fn print_searches(
    read: &Read,
    choice: &Choice,
    plan: &Plan,
    directory: &Path,
    damaged: &mut DamagedRuns,
) {
    let command = command(read, choice, directory);
    for asked in searches(&read.suite, choice) {
        let said = match look(plan, asked, directory, 0, damaged) {
            Search::NotNeeded => continue,
            Search::Waits => format!(
                "waits for the runs that it searches through; then, if none has a {}, on with: \
                 {command}",
                asked.structure
            ),
            Search::Next(_, number) => format!(
                "no {} yet; {} runs beyond the plan done; on with: {command}",
                asked.structure,
                number - 1
            ),
            Search::Found(run, number) => format!(
                "{} in run {number} beyond the plan, seed {}",
                asked.structure, run.seed
            ),
            Search::InVain(number) => {
                format!("no {} in {number} runs beyond the plan", asked.structure)
            }
        };
        show_line!("{}\n  {said}", asked.name);
    }
}

/// What some runs of a plan take, less those whose directories are there.
fn needs(plan: &Plan, runs: Runs<'_>, directory: &Path, threads: f64) -> Needs {
    let all = plan.runs().number().max(1) as f64;
    let there = fs::read_dir(directory.join("runs")).map_or(0, Iterator::count) as f64;
    let left = (1.0 - there / all).max(0.0);
    Needs::of_runs(
        plan.by_settings(),
        left * runs.number() as f64 / all,
        threads,
    )
}

/// Which of the runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Share {
    /// All, then those beyond the plan that experiments search through.
    Whole,
    /// One of several.
    One(Shard),
}

/// What is to be done.
struct Work<'a> {
    read: &'a Read,
    choice: &'a Choice,
    plan: &'a Plan,
    directory: &'a Path,
    manner: &'a Manner,
    share: Share,
}

fn run(work: &Work) -> anyhow::Result<Exit> {
    let Work {
        plan,
        directory,
        manner,
        ..
    } = *work;
    let (shard, to_search) = match work.share {
        Share::Whole => (Shard::ALL, searches(&work.read.suite, work.choice)),
        Share::One(shard) => (shard, [].as_slice()),
    };
    let threads = threads_flag(&manner.threads)?;
    // What `evolve` refuses, too, before anything is done.
    CodePath::from_environment().map_err(BadInput::new)?;
    let runs = shard.of_plan(plan);
    let needs = needs(plan, runs, directory, limits::threads(threads));
    needs.check_memory().map_err(BadInput::new)?;
    needs.check_disk(directory).map_err(BadInput::new)?;
    let stop = stop_on_signal()?;
    let pool = thread_pool(threads)?;
    let mut damaged = DamagedRuns::default();
    remove_abandoned(&directory.join(RUNS));
    let mut worked =
        pool.install(|| do_all(plan, runs, directory, manner.progress, stop, &mut damaged))?;
    for asked in to_search {
        worked = worked
            && pool
                .install(|| search(plan, asked, directory, manner.progress, stop, &mut damaged))?;
    }
    if !worked {
        return match work.share {
            Share::Whole => stopped(&command(work.read, work.choice, directory)),
            Share::One(_) => stopped("the same command"),
        };
    }
    // Looked at once, so that number and hash are of one moment.
    let mut hash = Sha256::new();
    let mut hashes = Vec::new();
    let mut done = 0;
    each_hash(runs, directory, &mut damaged, |line| {
        hash.update(line);
        // A part's would take the place of the whole's.
        if work.choice.is_whole() {
            hashes.extend(line.as_bytes());
        }
        done += 1;
    })?;
    let all_done = done == runs.number();
    if all_done && work.choice.is_whole() {
        fs::create_dir_all(directory).map_err(files::FileError::at(directory))?;
        files::replace(&directory.join(shard.hashes_file()), &hashes)?;
    }
    // A share's would be one that no other number of shares gives.
    let hash = (all_done && shard == Shard::ALL).then(|| hex(&hash.finalize()));
    let search_by = match work.share {
        Share::Whole => None,
        Share::One(_) => search_by(work),
    };
    if manner.progress == ProgressMode::Json {
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
            show_line!("for a structure that no run formed, once all are done: {command}");
        }
    }
    if !all_done && damaged.is_empty() {
        let gone = runs.number() - done;
        return Err(Unfinished(format!(
            "{gone} runs were removed while others were done; go on with: the same command"
        ))
        .into());
    }
    Ok(name_damaged(
        &damaged,
        Some(&command(work.read, work.choice, directory)),
    ))
}

/// The command that searches for a structure, if one may have to be searched for.
fn search_by(work: &Work) -> Option<String> {
    let Work {
        read,
        choice,
        plan,
        directory,
        ..
    } = *work;
    // What is damaged may be in another share, and is said by the command.
    let is_needed = |asked: &Resilience| {
        let looked = look(plan, asked, directory, 0, &mut DamagedRuns::default());
        matches!(looked, Search::Waits | Search::Next(..))
    };
    let needed = searches(&read.suite, choice).iter().any(is_needed);
    needed.then(|| command(read, choice, directory))
}

/// Whether a run is still to be done; a damaged one is not.
fn waits(run: &PlannedRun, suite: &Path, damaged: &mut DamagedRuns) -> bool {
    let looked = damaged.take(&run.directory(suite), progress(run, suite));
    looked.is_some_and(|progress| progress != Progress::Done)
}

/// Does what is not done, and waits for what other processes do; false if interrupted.
fn do_all(
    plan: &Plan,
    runs: Runs<'_>,
    directory: &Path,
    mode: ProgressMode,
    stop: &AtomicBool,
    damaged: &mut DamagedRuns,
) -> anyhow::Result<bool> {
    let (mut to_do, mut to_work) = (Vec::new(), 0_u64);
    for run in runs.iter() {
        let waits = waits(&run, directory, damaged);
        to_do.push(waits);
        if waits {
            to_work = to_work.saturating_add(robot_steps(&run));
        }
    }
    let left = to_do.iter().filter(|waits| **waits).count();
    let shown = SuiteProgress::start(mode, plan, runs.number(), left as u64, to_work);
    let mut all = || -> anyhow::Result<bool> {
        let mut waiting = Waiting::new();
        let mut work = |run: PlannedRun, held: &mut Vec<_>| -> anyhow::Result<bool> {
            shown.begins(&run);
            let each_generation = |generation| shown.generation(&run, generation);
            match work_on(&run, directory, stop, each_generation) {
                Ok(Worked::Completed) => shown.completed(&run),
                Ok(Worked::Held(holder)) => held.push((run, holder)),
                Ok(Worked::Interrupted) => return Ok(false),
                // A disk that is full is not the fault of one run.
                Err(error) if !matches!(error, RunDirError::File(_)) => {
                    damaged.add(&run.directory(directory), error.cause());
                }
                Err(error) => return Err(error.into()),
            }
            Ok(true)
        };
        let mut held = Vec::new();
        for (run, _) in runs.iter().zip(&to_do).filter(|(_, waits)| **waits) {
            if !work(run, &mut held)? {
                return Ok(false);
            }
        }
        while let Some((run, holder)) = held.first() {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            waiting.wait_for(run, || {
                shown.waits(run, &run.directory(directory), holder.as_ref());
            });
            let number = held.len();
            for (run, _) in std::mem::take(&mut held) {
                if !work(run, &mut held)? {
                    return Ok(false);
                }
            }
            if held.len() < number {
                waiting.one_ended();
            }
        }
        Ok(true)
    };
    let ended = all();
    shown.end();
    ended
}

/// Evolves on until a run has the structure that an experiment is about; false if interrupted.
fn search(
    plan: &Plan,
    asked: &Resilience,
    directory: &Path,
    mode: ProgressMode,
    stop: &AtomicBool,
    damaged: &mut DamagedRuns,
) -> anyhow::Result<bool> {
    let shown = SearchProgress::start(mode, &asked.name);
    let (mut after, mut begun) = (0, 0);
    let mut waiting = Waiting::new();
    let ended = loop {
        let Search::Next(run, number) = look(plan, asked, directory, after, damaged) else {
            break true;
        };
        if damaged.contains(&run.directory(directory)) {
            break true;
        }
        if begun != number {
            shown.begins(&run, number, &asked.name);
            begun = number;
        }
        match work_on(&run, directory, stop, |_| {})? {
            Worked::Completed => after = number - 1,
            // Another process searches, too, and its run decides whether more are needed.
            Worked::Held(_) if stop.load(Ordering::Relaxed) => break false,
            Worked::Held(holder) => waiting.wait_for(&run, || {
                shown.waits(&run, &run.directory(directory), holder.as_ref());
            }),
            Worked::Interrupted => break false,
        }
    };
    shown.end();
    Ok(ended)
}

/// The lines of `hashes.txt`, one a run that is done: its name and its hash. The SHA-256 of all
/// lines is the hash of the suite.
fn each_hash(
    runs: Runs<'_>,
    directory: &Path,
    damaged: &mut DamagedRuns,
    mut take: impl FnMut(&str),
) -> Result<(), RunDirError> {
    for run in runs.iter() {
        if damaged.read(&run.directory(directory)).is_none() {
            continue;
        }
        // Opened, not only read: what a process left that was killed at the very end goes.
        if let Found::Finished(hash) = RunDir::open(&run.directory(directory))? {
            take(&format!("{} {hash}\n", run.id));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::in_words;

    #[test]
    fn a_small_plan_is_not_said_to_be_nothing() {
        assert_eq!(in_words(450e9), "450.0 billion");
        assert_eq!(in_words(14.4e6), "14.4 million");
        assert_eq!(in_words(72_000.0), "72000");
    }
}
