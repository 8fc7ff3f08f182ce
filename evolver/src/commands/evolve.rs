//! `evolver evolve`: evolves a swarm, or resumes a run.

use super::errors::{stopped, unusable};
use super::replay::{check_terminal, in_terminal};
use super::setting_flags::SettingFlags;
use super::{BadInput, thread_pool};
use crate::exit::Exit;
use crate::program::this_program;
use crate::report::progress::{Progress, ProgressMode, computing};
use crate::report::summary;
use crate::signals::stop_on_signal;
use clap::{Args, ValueEnum};
use minimal_surprise_evolution::evolving::until_finished;
use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::files;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::new_dir::remove_abandoned;
use minimal_surprise_evolution::run_dir::{Opened, RunDir};
use minimal_surprise_evolution::settings::{
    DRAWN_SEED_MAX, Overrides, SettingError, Settings, add_seed,
};
use minimal_surprise_evolution::text::{shell_path, terminal_path, text_of_path};
use minimal_surprise_replay::recording::Recording;
use minimal_surprise_replay::scene::Colouring;
use minimal_surprise_sim::{Engine, EnginePath};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Settings as flags; a file uses the same names. The defaults are the paper's values.
#[derive(Debug, Default, Args)]
pub struct EvolveArgs {
    /// TOML file with any of the settings below; flags override it.
    config: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingFlags,
    /// Resume an interrupted run, with the settings in its directory.
    #[arg(long, value_name = "DIR", conflicts_with = "config")]
    resume: Option<PathBuf>,
    /// Progress display.
    #[arg(long, value_enum, default_value_t)]
    progress: ProgressMode,
    /// Implementation of the evaluation; the result does not depend on it.
    #[arg(long, value_enum, default_value_t)]
    engine: EngineName,
    /// Replay the run in the terminal as soon as it is finished.
    #[arg(long)]
    open: bool,
}

impl EvolveArgs {
    /// Returns all settings given; flags override the file.
    fn given(&self) -> Result<Overrides, SettingError> {
        let mut given = self.settings.0.clone();
        if let Some(path) = &self.config {
            given.file(path)?;
        }
        Ok(given)
    }
}

/// Implementation of the evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum EngineName {
    /// The straightforward implementation.
    Plain,
    /// The fast engine, with the best instructions that this processor supports; the environment
    /// variable MINIMAL_SURPRISE_PATH forces portable, avx2 or avx512.
    #[default]
    Fast,
}

/// Options that do not affect results.
#[derive(Clone, Copy, Debug)]
struct RunOptions {
    progress: ProgressMode,
    engine: Engine,
    path: EnginePath,
}

/// Evolves a swarm.
///
/// # Errors
/// [`BadInput`] if a setting is invalid, the run cannot be resumed, or memory or disk space is
/// insufficient; in these cases, nothing is written. After other errors, the run can be resumed.
pub fn evolve(arguments: &EvolveArgs) -> anyhow::Result<Exit> {
    let given = arguments.given().map_err(unusable)?;
    let threads = given.threads().map_err(BadInput::new)?;
    if arguments.open {
        check_terminal().map_err(|error| BadInput::new(format!("--open: {error}")))?;
    }
    let options = RunOptions {
        progress: arguments.progress,
        engine: match arguments.engine {
            EngineName::Plain => Engine::Plain,
            EngineName::Fast => Engine::Fast,
        },
        path: EnginePath::from_environment().map_err(BadInput::new)?,
    };
    let stop = stop_on_signal()?;
    let (experiment, run) = match &arguments.resume {
        Some(directory) => {
            match RunDir::open(directory, limits::threads(threads)).map_err(unusable)? {
                Opened::Unfinished(experiment, run) => (*experiment, run),
                Opened::Finished(hash) => {
                    // Check every file, so that a damaged run is not reported as complete.
                    FinishedRun::read_and_check(directory).map_err(unusable)?;
                    if arguments.progress == ProgressMode::Json {
                        let done = serde_json::json!({"event": "done", "hash": hash, "run": text_of_path(directory)});
                        show_line!("{done}");
                    } else {
                        show_line!(
                            "{} is complete; its hash is {hash}",
                            terminal_path(directory)
                        );
                    }
                    return match arguments.open {
                        true => watch(directory, stop),
                        false => Ok(Exit::Done),
                    };
                }
            }
        }
        None => {
            let settings = Settings::resolve(&given, draw_seed).map_err(BadInput::new)?;
            let seed = settings.seed();
            let directory = given
                .out()
                .map_err(BadInput::new)?
                .unwrap_or_else(|| "runs".into());
            let needs = Needs::of_evolution(&settings, limits::threads(threads));
            needs.check_memory().map_err(BadInput::new)?;
            needs.check_disk(&directory).map_err(BadInput::new)?;
            if let Some(said) = needs.announcement()
                && arguments.progress != ProgressMode::None
            {
                tell!("{said}");
            }
            let experiment = Experiment::new(settings);
            let program = this_program();
            let run = match given.out().map_err(BadInput::new)? {
                Some(path) => {
                    remove_abandoned(files::parent(&path));
                    RunDir::create(&path, &experiment, &program)
                }
                None => {
                    remove_abandoned(Path::new("runs"));
                    RunDir::create_named(Path::new("runs"), &experiment, &program)
                }
            }
            .map_err(|error| match given.place("out") {
                Some(place) => unusable(error).context(place.to_string()),
                None => unusable(error),
            })?;
            if given.place("seed").is_none() && arguments.progress != ProgressMode::Json {
                show_event!("seed {seed} (drawn)");
            }
            (experiment, run)
        }
    };
    let finished =
        thread_pool(threads)?.install(|| generations(experiment, &run, options, stop))?;
    if !finished {
        let program = summary::program();
        let directory = shell_path(run.path());
        return stopped(&format!("{program} evolve --resume {directory}"));
    }
    match arguments.open {
        true => watch(run.path(), stop),
        false => Ok(Exit::Done),
    }
}

fn draw_seed() -> u64 {
    rand::random_range(0..=DRAWN_SEED_MAX)
}

/// Replays a finished run in the terminal.
fn watch(directory: &Path, stop: &AtomicBool) -> anyhow::Result<Exit> {
    let finished = FinishedRun::read(directory)?;
    let recording = computing(finished.settings.scenario(), |after_step| {
        Recording::of_run(&terminal_path(directory), &finished, after_step)
    })?;
    in_terminal(&recording, Colouring::default(), stop)
}

/// Evaluates and saves the remaining generations, and reports the result; returns whether all
/// generations were completed.
fn generations(
    mut experiment: Experiment,
    run: &RunDir,
    options: RunOptions,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let done = experiment.history().len() as u32;
    let progress = Progress::start(options.progress, experiment.settings(), done);
    let how = (options.engine, options.path);
    let finished = until_finished(&mut experiment, run, how, stop, |record| {
        progress.generation(record);
    })?;
    progress.end();
    if !finished {
        return Ok(false);
    }
    let result = experiment
        .result()?
        .ok_or_else(|| anyhow::anyhow!("an evolution has at least one generation"))?;
    run.finish(&experiment, &result)?;
    if options.progress == ProgressMode::Json {
        let mut done = serde_json::json!({
            "event": "done",
            "fitness": result.outcome.fitness(),
            "hash": result.hash.to_string(),
            "run": text_of_path(run.path()),
        });
        add_seed(&mut done, experiment.settings().seed());
        show_line!("{done}");
    } else {
        show!("\n{}", summary::evolved(&experiment, &result, run.path()));
    }
    Ok(true)
}
