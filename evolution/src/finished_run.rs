//! Reading of complete run directories: the genome, its start and its final state.

use crate::files::{self, FileError, TEXT_BYTES_MAX};
use crate::genome_file::{GenomeFile, GenomeFileError};
use crate::limits;
use crate::ranges;
use crate::run_files::{
    BEST, CONFIG, DONE, FINAL, FinalFile, GENERATIONS, GenerationRow, META, Meta, OF_COMPLETE,
    SCHEMA_VERSION,
};
use crate::settings::{Overrides, SettingError, Settings};
use crate::steps_hash::{RecordedHash, StepsHash, Version};
use crate::time_spent::TimeSpent;
use minimal_surprise_controller::{Controller, Genome, Provenance};
use minimal_surprise_sim::evaluation::run;
use minimal_surprise_sim::metrics::Measures;
use minimal_surprise_sim::world::check_poses;
use minimal_surprise_sim::{Grid, Pose, SeedTree, Trace, Trial, World, WorldError};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A complete run.
#[derive(Clone, Debug)]
pub struct FinishedRun {
    /// Settings of the run.
    pub settings: Settings,
    /// The last generation's best genome.
    pub genome: Genome,
    /// Provenance of the genome.
    pub provenance: Provenance,
    /// The repetition that determined the genome's fitness.
    pub repetition: u32,
    /// Starting poses of the swarm in that repetition.
    pub starts: Vec<Pose>,
    /// Final poses of the swarm.
    pub final_poses: Vec<Pose>,
    /// The run's hash.
    pub hash: String,
    /// The hash of the run's steps; `None` for a run of an older program.
    pub steps_hash: Option<RecordedHash>,
    /// Best fitness of every generation.
    pub best_fitness: Vec<f64>,
    /// Movement M of the final run.
    pub movement: f64,
    /// Intended movement I.
    pub intended_movement: f64,
    /// Temperature of every step.
    pub temperature: Vec<f64>,
    /// Average prediction of every sensor.
    pub average_prediction: Vec<f64>,
    /// Name, version and revision of the program that executed the run.
    pub program: String,
    /// Time spent on the run.
    pub time: TimeSpent,
}

/// Error: a run directory cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadRunError {
    /// The run is incomplete or does not exist.
    #[error("{} holds no complete run: it has no {missing}", path.display())]
    NotComplete {
        /// The directory.
        path: PathBuf,
        /// The file that is missing.
        missing: &'static str,
    },
    /// The run is marked complete, but a file is missing or invalid.
    #[error(
        "{error}\nthe run is marked complete, so it was damaged, or written by a different \
         version: delete {} and repeat the command that made it",
        path.display()
    )]
    Damaged {
        /// The directory.
        path: PathBuf,
        /// The error.
        error: Box<ReadRunError>,
    },
    /// The directory does not exist or cannot be entered.
    #[error(transparent)]
    NotThere(FileError),
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The settings are invalid.
    #[error(transparent)]
    Settings(#[from] SettingError),
    /// The genome file is not valid for this program.
    #[error(transparent)]
    Genome(#[from] GenomeFileError),
    /// The final state is invalid.
    #[error(transparent)]
    State(#[from] StateError),
    /// A file does not contain the expected JSON.
    #[error("{}: {error}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The error, with line and column.
        error: serde_json::Error,
    },
    /// The generation table is malformed.
    #[error("{}: {error}", path.display())]
    Generations {
        /// The file.
        path: PathBuf,
        /// The error and its position.
        error: csv::Error,
    },
    /// A value in a file is impossible.
    #[error("{}: {problem}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The value and the valid values.
        problem: String,
    },
    /// The files in the directory are inconsistent.
    #[error("{}: {problem}", path.display())]
    Inconsistent {
        /// The directory.
        path: PathBuf,
        /// The inconsistency.
        problem: &'static str,
    },
}

/// Error: a file holds no valid final state.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The file does not contain the expected JSON.
    #[error("{}: {error}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The error, with line and column.
        error: serde_json::Error,
    },
    /// The file has a different layout.
    #[error("{}: schema version {found}; this program reads version {}", path.display(), SCHEMA_VERSION)]
    OtherSchema {
        /// The file.
        path: PathBuf,
        /// The version found.
        found: u32,
    },
    /// The grid is invalid.
    #[error("{}: grid = {value}: {problem}", path.display())]
    Grid {
        /// The file.
        path: PathBuf,
        /// The value.
        value: String,
        /// Description of the problem and of valid values.
        problem: String,
    },
    /// The numbers of starting and final poses differ.
    #[error("{}: {found} final poses for {start} starting poses", path.display())]
    Count {
        /// The file.
        path: PathBuf,
        /// Number of starting poses.
        start: usize,
        /// Number of final poses.
        found: usize,
    },
    /// The robots do not fit the grid.
    #[error("{}: {error}", path.display())]
    Poses {
        /// The file.
        path: PathBuf,
        /// The error, which names the robots.
        error: WorldError,
    },
}

impl ReadRunError {
    /// Returns the error without advice for the user.
    #[must_use]
    pub fn cause(&self) -> &Self {
        match self {
            Self::Damaged { error, .. } => error,
            other => other,
        }
    }
}

/// The part of a `final.json` that is read.
#[derive(Clone, Debug)]
pub struct FinalState {
    /// The grid.
    pub grid: Grid,
    /// Starting poses of the swarm.
    pub starts: Vec<Pose>,
    /// Final poses of the swarm.
    pub final_poses: Vec<Pose>,
    /// The repetition whose start was used.
    pub repetition: u32,
    /// The run's hash.
    pub hash: String,
    /// The hash of the run's steps, if the file contains one.
    pub steps_hash: Option<RecordedHash>,
    /// Movement M.
    pub movement: f64,
    /// Intended movement I.
    pub intended_movement: f64,
    /// Temperature of every step.
    pub temperature: Vec<f64>,
    /// Average prediction of every sensor.
    pub average_prediction: Vec<f64>,
}

#[derive(Deserialize)]
struct VersionOnly {
    schema_version: u32,
}

fn check_version(path: &Path, bytes: &[u8]) -> Result<(), StateError> {
    let read = serde_json::from_slice(bytes);
    let version: VersionOnly = read.map_err(|error| StateError::Json {
        path: path.to_owned(),
        error,
    })?;
    if version.schema_version != SCHEMA_VERSION {
        return Err(StateError::OtherSchema {
            path: path.to_owned(),
            found: version.schema_version,
        });
    }
    Ok(())
}

/// Reads a `final.json`.
///
/// # Errors
/// [`StateError`] if the contents are invalid; the message names the file and the position.
pub fn parse_final_state(path: &Path, bytes: &[u8]) -> Result<FinalState, StateError> {
    let json = |error| StateError::Json {
        path: path.to_owned(),
        error,
    };
    check_version(path, bytes)?;
    let file: FinalFile = serde_json::from_slice(bytes).map_err(json)?;
    let grid = crate::settings::grid(&file.grid).map_err(|problem| StateError::Grid {
        path: path.to_owned(),
        value: file.grid.clone(),
        problem,
    })?;
    if file.start.len() != file.r#final.len() {
        return Err(StateError::Count {
            path: path.to_owned(),
            start: file.start.len(),
            found: file.r#final.len(),
        });
    }
    for poses in [&file.start, &file.r#final] {
        check_poses(grid, poses).map_err(|error| StateError::Poses {
            path: path.to_owned(),
            error,
        })?;
    }
    let recorded = |hash: Option<String>, version| hash.map(|hash| RecordedHash { version, hash });
    Ok(FinalState {
        grid,
        starts: file.start,
        final_poses: file.r#final,
        repetition: file.repetition,
        steps_hash: recorded(file.steps_hash_v2, Version::V2)
            .or_else(|| recorded(file.steps_hash, Version::V1)),
        hash: file.hash,
        movement: file.measures.movement,
        intended_movement: file.measures.intended_movement,
        temperature: file.measures.temperature,
        average_prediction: file.average_prediction,
    })
}

fn best_fitness(path: &Path, most: u64) -> Result<Vec<f64>, ReadRunError> {
    let bytes = files::read(path, most)?;
    let mut table = csv::Reader::from_reader(bytes.as_slice());
    let mut values = Vec::new();
    for (expected, line) in (0..).zip(table.deserialize()) {
        let line: GenerationRow = line.map_err(|error| ReadRunError::Generations {
            path: path.to_owned(),
            error,
        })?;
        if line.generation != expected {
            return Err(ReadRunError::Value {
                path: path.to_owned(),
                problem: format!("generation {} where {expected} should be", line.generation),
            });
        }
        values.push(line.best_fitness);
    }
    Ok(values)
}

/// Checks that a file of a run directory exists and is not a pipe or a device.
///
/// # Errors
/// [`ReadRunError`] if the file is missing or cannot be accessed, or is a pipe or a device.
pub fn require(run: &Path, file: &'static str) -> Result<(), ReadRunError> {
    let path = run.join(file);
    if files::exists(&path)? {
        let kind = std::fs::metadata(&path).map_err(FileError::at(&path))?;
        if kind.is_file() || kind.is_dir() {
            return Ok(());
        }
        // Reading a pipe could block, and a device may have no end.
        let error = std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a plain file");
        return Err(FileError::at(&path)(error).into());
    }
    // If the directory is missing, report that instead of a missing file.
    std::fs::metadata(run).map_err(|error| ReadRunError::NotThere(FileError::at(run)(error)))?;
    Err(ReadRunError::NotComplete {
        path: run.to_owned(),
        missing: file,
    })
}

/// Reads the settings in a run directory. The first population already exists, so the ancestor's
/// file is not needed.
///
/// # Errors
/// [`ReadRunError`] if the settings cannot be read, or a setting is missing or invalid.
pub fn settings_of_run(run: &Path) -> Result<Settings, ReadRunError> {
    settings_and_text_of_run(run).map(|(settings, _)| settings)
}

/// Reads the settings in a run directory and their text, with lines ending in `\n`.
pub(crate) fn settings_and_text_of_run(run: &Path) -> Result<(Settings, String), ReadRunError> {
    require(run, CONFIG)?;
    let config = run.join(CONFIG);
    let text = files::read_text(&config, TEXT_BYTES_MAX)?;
    let mut given = Overrides::default();
    given.text(&config, &text)?;
    if let Some(missing) = given.missing() {
        return Err(ReadRunError::Value {
            path: config,
            problem: format!("no {missing}, which every run records"),
        });
    }
    given.remove("from");
    Ok((Settings::resolve(&given, || 0)?, text))
}

fn read_final_state(path: &Path, settings: &Settings) -> Result<Vec<u8>, FileError> {
    files::read(path, limits::most(limits::final_state_bytes(settings)))
}

fn recorded_hash(run: &Path) -> Result<String, ReadRunError> {
    let path = run.join(DONE);
    let bytes = files::read(&path, TEXT_BYTES_MAX)?;
    ranges::hash_of(&String::from_utf8_lossy(&bytes))
        .map_err(|problem| ReadRunError::Value { path, problem })
}

/// State of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The run does not exist.
    Pending,
    /// The run has been started.
    Begun,
    /// The run is complete.
    Done,
}

/// Returns the hash of a run if it is complete, after a quick check of its directory.
///
/// # Errors
/// [`ReadRunError::Damaged`] if the run is marked complete, but a file is missing or has a
/// different layout, a setting is invalid, or the completion mark does not contain the hash of the
/// run. [`ReadRunError::File`] if the directory cannot be accessed.
pub fn complete(path: &Path) -> Result<Option<String>, ReadRunError> {
    if !files::exists(&path.join(DONE))? {
        return Ok(None);
    }
    let look = || {
        require(path, DONE)?;
        OF_COMPLETE
            .into_iter()
            .try_for_each(|file| require(path, file))?;
        let state = path.join(FINAL);
        let bytes = read_final_state(&state, &settings_of_run(path)?)?;
        check_version(&state, &bytes)?;
        recorded_hash(path)
    };
    look().map(Some).map_err(|error| ReadRunError::Damaged {
        path: path.to_owned(),
        error: Box::new(error),
    })
}

impl FinishedRun {
    /// Reads a run directory and repeats its final run, to detect a genome or state that was
    /// changed or belongs to a different run. Commands that show or continue a run use this.
    ///
    /// # Errors
    /// [`ReadRunError`] if [`read`](Self::read) fails, or if the repeated steps or final poses
    /// differ from the recorded ones.
    pub fn read_and_check(path: &Path) -> Result<Self, ReadRunError> {
        let finished = Self::read(path)?;
        let recorded = finished.steps_hash.as_ref();
        let mut hash = StepsHash::new(
            recorded.map_or_else(Version::default, |recorded| recorded.version),
            &finished.trial(),
            finished.settings.topology().model(),
        );
        let mut ends = finished.starts.clone();
        finished
            .replay(|world| {
                hash.observe(world);
                ends.copy_from_slice(world.poses());
            })
            .map_err(|error| StateError::Poses {
                path: path.join(FINAL),
                error,
            })?;
        let other_steps = recorded.is_some_and(|recorded| recorded.hash != hash.to_string());
        if other_steps || ends != finished.final_poses {
            return Err(ReadRunError::Inconsistent {
                path: path.to_owned(),
                problem: "best.genome does not repeat the steps recorded in final.json; one of the \
                          files was changed or belongs to another run",
            });
        }
        Ok(finished)
    }

    /// Reads a run directory if it exists and its run is complete.
    ///
    /// # Errors
    /// See [`read`](Self::read).
    pub fn read_if_complete(path: &Path) -> Result<Option<Self>, ReadRunError> {
        if !files::exists(&path.join(DONE))? {
            return Ok(None);
        }
        Self::read(path).map(Some)
    }

    /// Reads a run directory.
    ///
    /// # Errors
    /// [`ReadRunError`] if the run is not complete, or a file in it is unreadable, invalid or
    /// inconsistent with the others.
    pub fn read(path: &Path) -> Result<Self, ReadRunError> {
        require(path, DONE)?;
        OF_COMPLETE
            .into_iter()
            .try_for_each(|file| require(path, file))?;
        let settings = settings_of_run(path)?;
        let genome = GenomeFile::read(&path.join(BEST))?;
        let state_path = path.join(FINAL);
        let state = parse_final_state(&state_path, &read_final_state(&state_path, &settings)?)?;
        let inconsistent = |problem| {
            Err(ReadRunError::Inconsistent {
                path: path.to_owned(),
                problem,
            })
        };
        if genome.topology() != settings.topology() {
            return inconsistent("best.genome has a different topology from config.toml");
        }
        if state.grid != settings.scenario().grid()
            || state.starts.len() != settings.scenario().robots() as usize
        {
            return inconsistent("final.json has a different grid or swarm size from config.toml");
        }
        if state.repetition >= settings.repetitions() {
            return inconsistent("final.json names a repetition beyond those in config.toml");
        }
        if state.temperature.len() != settings.scenario().steps() as usize
            || state.average_prediction.len() != settings.topology().sensors()
        {
            return inconsistent(
                "final.json has a different number of steps or sensors from config.toml",
            );
        }
        let hash = recorded_hash(path)?;
        if state.hash != hash {
            return inconsistent("final.json has a different hash from DONE");
        }
        let table_bytes = limits::most(limits::table_bytes(&settings));
        let best_fitness = best_fitness(&path.join(GENERATIONS), table_bytes)?;
        if best_fitness.len() != settings.generations() as usize {
            return inconsistent(
                "generations.csv has a different number of lines from the generations in config.toml",
            );
        }
        let provenance = genome.provenance();
        if provenance.generation != settings.generations() - 1 {
            return inconsistent("best.genome is not from the last generation set in config.toml");
        }
        if provenance.matched_bits > provenance.scored_bits {
            return inconsistent("best.genome has more matched bits than scored ones");
        }
        let meta_path = path.join(META);
        let meta = serde_json::from_slice(&files::read(&meta_path, TEXT_BYTES_MAX)?);
        let meta: Meta = meta.map_err(|error| ReadRunError::Json {
            path: meta_path,
            error,
        })?;
        Ok(Self {
            genome: genome.genome().clone(),
            provenance,
            repetition: state.repetition,
            starts: state.starts,
            final_poses: state.final_poses,
            hash,
            steps_hash: state.steps_hash,
            best_fitness,
            movement: state.movement,
            intended_movement: state.intended_movement,
            temperature: state.temperature,
            average_prediction: state.average_prediction,
            program: meta.program(),
            time: TimeSpent::read(path)?,
            settings,
        })
    }

    /// Returns the trial of the final state: its start and its noise.
    #[must_use]
    pub fn trial(&self) -> Trial {
        let seeds = SeedTree::new(self.settings.seed());
        let generation = self.provenance.generation;
        let drawn = self
            .settings
            .scenario()
            .trial(seeds, generation, self.repetition);
        Trial {
            starts: self.starts.clone(),
            noise: drawn.noise,
        }
    }

    /// Repeats the run of the genome from its start and passes every step to `observe`.
    ///
    /// # Errors
    /// [`WorldError`] if the starting poses do not fit the grid.
    pub fn replay(&self, observe: impl FnMut(&World)) -> Result<(), WorldError> {
        let controller = Controller::new(&self.genome);
        run(
            &controller,
            self.settings.scenario(),
            &self.trial(),
            observe,
        )
        .map(|_| ())
    }

    /// Computes the measures of the run.
    ///
    /// # Errors
    /// [`WorldError`] if the starting poses do not fit the grid.
    pub fn measures(&self) -> Result<Measures, WorldError> {
        let grid = self.settings.scenario().grid();
        let mut measures = Measures::starting_from(grid, self.settings.topology(), &self.starts);
        self.replay(|world| measures.observe(world))?;
        Ok(measures)
    }

    /// Repeats the run and records everything that happens.
    ///
    /// # Errors
    /// [`WorldError`] if the starting poses do not fit the grid.
    pub fn trace(&self) -> Result<Trace, WorldError> {
        let mut trace = Trace {
            steps: Vec::new(),
            final_poses: self.starts.clone(),
        };
        self.replay(|world| trace.record(world))?;
        Ok(trace)
    }
}
