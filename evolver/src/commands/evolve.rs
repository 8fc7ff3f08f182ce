//! `evolver evolve`: evolve a swarm, or go on with a run.

use super::errors::{stopped, unusable};
use super::replay::in_terminal;
use super::{BadInput, thread_pool};
use crate::evolving::until_finished;
use crate::exit::Exit;
use crate::experiment::Experiment;
use crate::files;
use crate::finished_run::FinishedRun;
use crate::limits::{self, Needs};
use crate::new_dir::remove_abandoned;
use crate::replay::recording::Recording;
use crate::replay::scene::Colouring;
use crate::replay::terminal;
use crate::report::progress::{Progress, ProgressMode};
use crate::report::summary;
use crate::run_dir::{Found, RunDir};
use crate::settings::{self, Given, SettingError, Settings};
use crate::signals::stop_on_signal;
use crate::text::{shell_path, terminal_path, text_of_path};
use clap::{Args, ValueEnum};
use minimal_surprise_sim::{Engine, Path as CodePath};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Settings as flags; a file has the same names. Defaults are the paper's.
#[derive(Debug, Default, Args)]
pub struct EvolveArgs {
    /// TOML file with any of the settings below; flags go before it.
    config: Option<PathBuf>,
    /// Width and height of the torus, in cells [default: 15x15].
    #[arg(long, value_name = "WxH", allow_hyphen_values = true)]
    grid: Option<String>,
    /// Swarm size [default: 100].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    robots: Option<String>,
    /// Sensor model: a, b or c [default: c].
    #[arg(long, value_name = "MODEL", allow_hyphen_values = true)]
    sensor_model: Option<String>,
    /// Probability that a sensor bit is flipped [default: 0].
    #[arg(long, value_name = "P", allow_hyphen_values = true)]
    noise: Option<String>,
    /// Fix all predictions to a template: line, pair, square or triangular-lattice.
    #[arg(long, value_name = "TEMPLATE", allow_hyphen_values = true)]
    predefine: Option<String>,
    /// Fix only the predictions that the template sets: line (sensor model c).
    #[arg(long, value_name = "TEMPLATE", allow_hyphen_values = true)]
    predefine_partly: Option<String>,
    /// Genomes of a generation [default: 50].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    population: Option<String>,
    /// Generations [default: 100].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    generations: Option<String>,
    /// Repetitions of an evaluation; the worst counts [default: 10].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    repetitions: Option<String>,
    /// Steps of a repetition [default: 500].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    steps: Option<String>,
    /// Probability that a weight mutates [default: 0.1; 0.3 for the partly predefined line on
    /// 20x20].
    #[arg(long, value_name = "P", allow_hyphen_values = true)]
    mutation: Option<String>,
    /// Start from a genome and its mutants.
    #[arg(long, value_name = "GENOME")]
    from: Option<PathBuf>,
    /// Root of all random numbers; drawn and printed if not given.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
    /// Threads [default: one a core]; the result does not depend on them.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
    /// Directory of the run; must not exist [default: a new one in runs/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with a run that was interrupted, under the settings in its directory.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["config", "grid", "robots",
        "sensor_model", "noise", "predefine", "predefine_partly", "population", "generations",
        "repetitions", "steps", "mutation", "from", "seed", "out"])]
    resume: Option<PathBuf>,
    /// How progress is shown.
    #[arg(long, value_enum, default_value_t)]
    progress: ProgressMode,
    /// What evaluates; the result does not depend on it.
    #[arg(long, value_enum, default_value_t)]
    engine: EngineName,
    /// Watch the run in the terminal as soon as it has ended.
    #[arg(long)]
    open: bool,
}

impl EvolveArgs {
    /// All settings given, flags before the file.
    fn given(&self) -> Result<Given, SettingError> {
        let mut given = Given::default();
        let flags = [
            ("grid", &self.grid),
            ("robots", &self.robots),
            ("sensor-model", &self.sensor_model),
            ("noise", &self.noise),
            ("predefine", &self.predefine),
            ("predefine-partly", &self.predefine_partly),
            ("population", &self.population),
            ("generations", &self.generations),
            ("repetitions", &self.repetitions),
            ("steps", &self.steps),
            ("mutation", &self.mutation),
            ("seed", &self.seed),
            ("threads", &self.threads),
        ];
        for (key, value) in flags {
            given.flag(key, value.as_deref());
        }
        for (key, path) in [("from", &self.from), ("out", &self.out)] {
            given.flag(key, path.as_deref().map(text_of_path).as_deref());
        }
        if let Some(path) = &self.config {
            given.file(path)?;
        }
        Ok(given)
    }
}

/// What evaluates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum EngineName {
    /// The straight program.
    Plain,
    /// The fast one, by the best instructions that this processor has; the environment variable
    /// MINIMAL_SURPRISE_PATH forces portable, avx2 or avx512.
    #[default]
    Fast,
}

/// How to run, whatever is run; no result depends on it.
#[derive(Clone, Copy, Debug)]
struct Manner {
    progress: ProgressMode,
    engine: Engine,
    path: CodePath,
}

/// Evolves a swarm.
///
/// # Errors
/// [`BadInput`] before anything is written; other errors leave a run that can be resumed.
pub fn evolve(arguments: &EvolveArgs) -> anyhow::Result<Exit> {
    let given = arguments.given().map_err(unusable)?;
    let threads = settings::threads(&given).map_err(BadInput::new)?;
    if arguments.open {
        terminal::check().map_err(|error| BadInput::new(format!("--open: {error}")))?;
    }
    let manner = Manner {
        progress: arguments.progress,
        engine: match arguments.engine {
            EngineName::Plain => Engine::Plain,
            EngineName::Fast => Engine::Fast,
        },
        path: CodePath::from_environment().map_err(BadInput::new)?,
    };
    let stop = stop_on_signal()?;
    let (experiment, run) = match &arguments.resume {
        Some(directory) => {
            match RunDir::open(directory, limits::threads(threads)).map_err(unusable)? {
                Found::Unfinished(experiment, run) => (*experiment, run),
                Found::Finished(hash) => {
                    // All of it, or a damaged one would be called complete.
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
            let seed = settings.seed;
            let directory = settings::out(&given).unwrap_or_else(|| "runs".into());
            let needs = Needs::of_evolution(&settings, limits::threads(threads));
            needs.check_memory().map_err(BadInput::new)?;
            needs.check_disk(&directory).map_err(BadInput::new)?;
            if let Some(said) = needs.announcement()
                && arguments.progress != ProgressMode::None
            {
                tell!("{said}");
            }
            let experiment = Experiment::new(settings);
            let run = match settings::out(&given) {
                Some(path) => {
                    remove_abandoned(files::parent(&path));
                    RunDir::create(&path, &experiment)
                }
                None => {
                    remove_abandoned(Path::new("runs"));
                    RunDir::create_named(Path::new("runs"), &experiment)
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
    let finished = thread_pool(threads)?.install(|| generations(experiment, &run, manner, stop))?;
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
    rand::random_range(0..=settings::DRAWN_SEED_MAX)
}

/// Plays a run that has ended.
fn watch(directory: &Path, stop: &AtomicBool) -> anyhow::Result<Exit> {
    let recording = Recording::of_run(&terminal_path(directory), &FinishedRun::read(directory)?)?;
    in_terminal(&recording, Colouring::default(), stop)
}

/// Evaluates the generations that are left, saving each, and reports; says whether it came to the
/// end.
fn generations(
    mut experiment: Experiment,
    run: &RunDir,
    manner: Manner,
    stop: &AtomicBool,
) -> anyhow::Result<bool> {
    let done = experiment.history().len() as u32;
    let progress = Progress::start(manner.progress, experiment.settings(), done);
    let how = (manner.engine, manner.path);
    let finished = until_finished(&mut experiment, run, how, stop, |record| {
        progress.generation(record);
    })?;
    progress.end();
    if !finished {
        return Ok(false);
    }
    let finding = experiment
        .finding()?
        .ok_or_else(|| anyhow::anyhow!("an evolution has at least one generation"))?;
    run.finish(&experiment, &finding)?;
    if manner.progress == ProgressMode::Json {
        let mut done = serde_json::json!({
            "event": "done",
            "fitness": finding.outcome.fitness(),
            "hash": finding.hash.to_string(),
            "run": text_of_path(run.path()),
        });
        settings::add_seed(&mut done, experiment.settings().seed);
        show_line!("{done}");
    } else {
        show!("\n{}", summary::evolved(&experiment, &finding, run.path()));
    }
    Ok(true)
}
