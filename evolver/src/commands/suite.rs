//! `evolver paper` and `evolver suite FILE`: many evolutions, on one machine or many.

use super::errors::{Unfinished, name_damaged, stopped, unusable};
use super::{BadInput, flag, thread_pool, threads_flag};
use crate::exit::Exit;
use crate::report::progress::ProgressMode;
use crate::report::suite_progress::{SearchProgress, SuiteProgress};
use crate::signals::stop_on_signal;
use crate::suite::plan::{Plan, RUNS};
use crate::suite::report;
use crate::suite::report::gather::Gathered;
use crate::suite::search::{Search, look};
use crate::suite::status::{Counts, Hashes, Status};
use crate::suite::work::Shard;
use crate::suite::worker::{Ended, ToDo, Worker};
use crate::suite::{PAPER, Resilience, Suite, cluster, slurm};
use clap::{Args, Subcommand, ValueEnum};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::{self, Existing, FileError, TEXT_BYTES_MAX};
use minimal_surprise_evolution::finished_run::ReadRunError;
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::new_dir::remove_abandoned;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_evolution::text::{file_name_except, shell_path, shell_word, terminal_path};
use minimal_surprise_replay::gallery;
use minimal_surprise_sim::EnginePath;
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the directory of the paper's suite.
const BUILT_IN: &str = "paper";

/// A suite in a file.
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
        options: RunOptions,
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
    /// Submit the runs to a cluster.
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
        /// Maximum number of tasks at once.
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
    /// Returns whether it is the suite as it is written.
    fn is_whole(&self) -> bool {
        flags(self).is_empty()
    }
}

/// How to work.
#[derive(Debug, Args)]
pub struct RunOptions {
    /// Threads; no result depends on them [default: one per core].
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

/// Arguments of one cluster or GNU parallel task.
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
    options: RunOptions,
}

/// A suite as it was read.
struct Read {
    suite: Suite,
    /// Whether it is the built-in one.
    built_in: bool,
    text: String,
    /// The command that read it.
    called: String,
}

/// `evolver paper …`
///
/// # Errors
/// [`BadInput`] before anything is written; other errors leave runs that can be resumed.
pub fn paper(verb: &Verb) -> anyhow::Result<Exit> {
    let suite = Suite::paper().map_err(BadInput::new)?;
    let text = PAPER.to_owned();
    let called = "evolver paper".to_owned();
    act(
        &Read {
            suite,
            built_in: true,
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
    let directory = directory(&read, &arguments.choice);
    run(&Work {
        read: &read,
        choice: &arguments.choice,
        plan: &plan,
        directory: &directory,
        options: &arguments.options,
        share: Share::One(shard),
    })
}

fn read(file: &Path) -> Result<Read, BadInput> {
    let text = files::read_text(file, TEXT_BYTES_MAX).map_err(BadInput::new)?;
    let suite = Suite::parse(file, &text).map_err(BadInput::new)?;
    let called = format!("evolver suite {}", shell_path(file));
    Ok(Read {
        suite,
        built_in: false,
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
    let directory = directory(read, choice);
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
            if !report::may_be_written(&out).map_err(unusable)? {
                return Err(BadInput::new(format!(
                    "{}: it is not marked as a report that may be replaced (an earlier version set \
                     no mark); name a new directory with --to",
                    out.display()
                ))
                .into());
            }
            let needs = needs_of_report(&plan, &read.suite);
            needs.check_memory().map_err(BadInput::new)?;
            let again = command(read, choice, &directory);
            let gathered = Gathered::read(&plan, &read.suite, &directory).map_err(unusable)?;
            let finished = gathered.directories(&directory);
            if finished.is_empty() && !gathered.damaged.is_empty() {
                return Ok(name_damaged(&gathered.damaged, Some(&again)));
            }
            if finished.is_empty() {
                return Err(BadInput::new(format!(
                    "{}: no run of this suite is done there; --out names the directory that its \
                     runs are in",
                    directory.display()
                ))
                .into());
            }
            let mut damaged = gathered.damaged.clone();
            if *gallery {
                damaged.extend(write_gallery(&finished, &out.join(report::GALLERY))?);
            }
            let written =
                report::write(&gathered, &read.suite, &out, &read.called).map_err(unusable)?;
            show_line!(
                "{} of {} runs; {}",
                written.finished,
                written.planned,
                terminal_path(&written.html)
            );
            return Ok(name_damaged(&damaged, Some(&again)));
        }
        Verb::Run { options, .. } => {
            return run(&Work {
                read,
                choice,
                plan: &plan,
                directory: &directory,
                options,
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
            let job = cluster::Job {
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
            if !*dry_run {
                // Memory is that of the machines that the tasks run on.
                let to_do = ToDo::read(plan.runs(), &directory, 1.0, &mut DamagedRuns::default())
                    .map_err(unusable)?;
                let needs = to_do.needs.needs();
                needs.check_disk(&directory).map_err(BadInput::new)?;
            }
            if *dry_run {
                show!("{}", slurm::script(&job).map_err(unusable)?);
            } else {
                show_line!("{}", slurm::submit(&job, &read.text).map_err(unusable)?);
            }
        }
    }
    Ok(Exit::Done)
}

/// The most that anything takes that a report runs again.
fn needs_of_report(plan: &Plan, suite: &Suite) -> Needs {
    let mut most = Needs::default();
    for experiment in &plan.experiments {
        let of_it = |of: &String| *of == experiment.name;
        let again = suite.reevaluations.iter();
        let again = again.filter(|asked| asked.of.iter().any(of_it));
        let damage = suite.resiliences.iter().filter(|asked| of_it(&asked.of));
        let starts = again.map(|asked| ("starts", asked.starts));
        let starts: Vec<_> = starts
            .chain(damage.map(|asked| ("repeat", asked.repeat)))
            .collect();
        for settings in experiment.settings().filter(|_| !starts.is_empty()) {
            let scenario = [(*settings.settings.scenario(), ())];
            for &starts in &starts {
                let needs = Needs::of_starts(&scenario, starts, limits::threads(None));
                if needs.memory() > most.memory() {
                    most = needs;
                }
            }
        }
    }
    most
}

/// The gallery of a plan's finished runs; an earlier one is replaced.
fn write_gallery(finished: &[PathBuf], out: &Path) -> anyhow::Result<DamagedRuns> {
    let written = gallery::write(finished, out, Existing::Replace).map_err(unusable)?;
    show_line!(
        "{} runs, {:.1} MB; {}",
        written.runs,
        written.bytes as f64 / 1e6,
        terminal_path(&written.index)
    );
    Ok(written.damaged)
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

fn directory(read: &Read, choice: &Choice) -> PathBuf {
    let suite = &read.suite;
    choice.out.clone().unwrap_or_else(|| {
        let runs = Path::new("runs");
        let taken = if read.built_in { "" } else { BUILT_IN };
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
        .runs()
        .by_settings()
        .map(|alike| {
            let settings = alike.settings();
            let generations = f64::from(settings.generations()) * alike.number() as f64;
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

/// Shows how many runs are done, and returns the damaged ones.
fn print_status(plan: &Plan, directory: &Path) -> Result<DamagedRuns, ReadRunError> {
    let status = Status::read(plan, directory)?;
    for (experiment, settings) in &status.experiments {
        show_line!("{experiment}");
        for counts in settings {
            let damaged = match counts.damaged {
                0 => String::new(),
                number => format!(", {number} damaged"),
            };
            let Counts {
                label,
                number,
                done,
                begun,
                ..
            } = counts;
            show_line!("  {label:<40} {done:>4} of {number} done, {begun} begun{damaged}");
        }
    }
    let number = plan.runs().number();
    show_line!("\n{} of {number} different runs done", status.done);
    if let Some(hash) = &status.hash {
        show_line!("hash {hash}");
    }
    Ok(status.damaged)
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
                "waits for the runs that it searches through; then, if none has a {}, continue with: \
                 {command}",
                asked.structure
            ),
            Search::Next(_, number) => format!(
                "no {} yet; {} runs beyond the plan done; continue with: {command}",
                asked.structure,
                number - 1
            ),
            Search::Found(run, number) => format!(
                "{} in run {number} beyond the plan, seed {}",
                asked.structure, run.seed
            ),
            Search::NotFound(number) => {
                format!("no {} in {number} runs beyond the plan", asked.structure)
            }
        };
        show_line!("{}\n  {said}", asked.name);
    }
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
    options: &'a RunOptions,
    share: Share,
}

fn run(work: &Work) -> anyhow::Result<Exit> {
    let Work {
        plan,
        directory,
        options,
        ..
    } = *work;
    let (shard, to_search) = match work.share {
        Share::Whole => (Shard::ALL, searches(&work.read.suite, work.choice)),
        Share::One(shard) => (shard, [].as_slice()),
    };
    let threads = threads_flag(&options.threads)?;
    // What `evolve` refuses, too, before anything is done.
    EnginePath::from_environment().map_err(BadInput::new)?;
    let runs = shard.of_plan(plan);
    let mut damaged = DamagedRuns::default();
    let threads_or_cores = limits::threads(threads);
    let to_do = ToDo::read(runs, directory, threads_or_cores, &mut damaged).map_err(unusable)?;
    let needs = to_do.needs.needs();
    needs.check_memory().map_err(BadInput::new)?;
    needs.check_disk(directory).map_err(BadInput::new)?;
    let mut worker = Worker::new(plan, directory, stop_on_signal()?, damaged);
    remove_abandoned(&directory.join(RUNS));
    let mode = options.progress;
    let worked = thread_pool(threads)?.install(|| {
        let (number, left) = (to_do.number, to_do.robot_steps);
        let shown = SuiteProgress::start(mode, plan, runs.number(), number, left);
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
    let mut damaged = worker.damaged;
    if ended == Ended::Interrupted {
        return match work.share {
            Share::Whole => stopped(&command(work.read, work.choice, directory)),
            Share::One(_) => stopped("the same command"),
        };
    }
    // Read at one moment, so that number and hash agree. A part's lines would replace the whole's.
    let is_whole = work.choice.is_whole();
    let mut hashes = Hashes::read(runs, directory, is_whole, &mut damaged);
    let done = hashes.done;
    let all_done = done == runs.number();
    if let Some(lines) = hashes.lines.take().filter(|_| all_done) {
        fs::create_dir_all(directory).map_err(FileError::at(directory))?;
        files::replace(&directory.join(shard.hashes_file()), &lines)?;
    }
    // A share's would be one that no other number of shares gives.
    let hash = hashes.of_all(runs).filter(|_| shard == Shard::ALL);
    let search_by = match work.share {
        Share::Whole => None,
        Share::One(_) => search_by(work),
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
            show_line!("for a structure that no run formed, once all are done: {command}");
        }
    }
    if !all_done && damaged.is_empty() {
        let gone = runs.number() - done;
        return Err(Unfinished(format!(
            "{gone} runs were removed while others were done; continue with: the same command"
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
    // Damaged runs may be in another share; the command reports them.
    let is_needed = |asked: &Resilience| {
        let looked = look(plan, asked, directory, 0, &mut DamagedRuns::default());
        matches!(looked, Search::Waits | Search::Next(..))
    };
    let needed = searches(&read.suite, choice).iter().any(is_needed);
    needed.then(|| command(read, choice, directory))
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
