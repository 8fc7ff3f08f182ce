//! Run directories: everything that a run writes, in the files of [`run_files`](crate::run_files).
//!
//! No directory is used twice, and no file in it is ever partially written.

use crate::checkpoint::{self, CheckpointError};
use crate::experiment::{EvolutionResult, Experiment};
use crate::files::{self, FileError};
use crate::finished_run::{ReadRunError, complete, settings_and_text_of_run};
use crate::limits::{self, Needs, TooMuch};
use crate::lock::{self, Holder, LOCK, Lock, LockError};
use crate::new_dir::NewDir;
use crate::run_files::{
    BEST, CHECKPOINT, CONFIG, DONE, FINAL, FinalFile, GENERATIONS, META, Meta, Program, TIME,
    generations, json,
};
use crate::settings::Settings;
use crate::time_spent::{TimeSpent, Timer};
use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX};
use minimal_surprise_sim::engine::PathError;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A run directory, locked by this process.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    settings_text: String,
    timer: Timer,
    /// If true, `generations.csv` is written only when the run is complete.
    table_last: bool,
    /// Holds the lock until this value is dropped.
    _lock: Option<Lock>,
}

/// The state of an evolution between two generations, ready to be written.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    state: Vec<u8>,
    generations: String,
    time: String,
}

/// Error: a run directory cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunDirError {
    /// The path already exists; nothing is ever overwritten.
    #[error("{} exists; choose a new directory, or resume the run with --resume", .0.display())]
    Exists(PathBuf),
    /// The directory does not exist.
    #[error(transparent)]
    NotThere(FileError),
    /// The directory contains no run.
    #[error("{} is not a run directory: it has no {missing}", path.display())]
    NotARun {
        /// The directory.
        path: PathBuf,
        /// The missing file.
        missing: &'static str,
    },
    /// A file of the run cannot be read.
    #[error(transparent)]
    Damaged(#[from] ReadRunError),
    /// Another process is working on the run.
    #[error("{} is in use by {}", path.display(), lock::named(holder.as_ref()))]
    InUse {
        /// The directory.
        path: PathBuf,
        /// That process, if the lock file names it.
        holder: Option<Holder>,
    },
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The environment variable names an unknown engine path.
    #[error(transparent)]
    EnginePath(#[from] PathError),
    /// The run needs more than this machine has.
    #[error(transparent)]
    TooMuch(#[from] TooMuch),
    /// The checkpoint cannot be resumed.
    #[error("{}: {error}", path.display())]
    Checkpoint {
        /// The checkpoint.
        path: PathBuf,
        /// The reason.
        error: CheckpointError,
    },
}

impl RunDirError {
    /// Returns the error without advice for the user.
    #[must_use]
    pub fn cause(&self) -> &dyn std::error::Error {
        match self {
            Self::Damaged(error) => error.cause(),
            other => other,
        }
    }

    /// Checks whether the error affects this run only, so that other runs can continue. A full
    /// disk, an unwritable folder or too little memory affects all runs.
    #[must_use]
    pub fn is_of_one_run(&self, run: &Path) -> bool {
        match self {
            Self::File(file) => {
                let inside = file.path.starts_with(run) && file.path != run;
                inside && file.is_bad_path() && file.error.kind() != ErrorKind::ReadOnlyFilesystem
            }
            Self::EnginePath(_) | Self::TooMuch(_) => false,
            _ => true,
        }
    }
}

/// A run opened for `--resume`.
#[derive(Debug)]
pub enum Opened {
    /// A run that can be resumed.
    Unfinished(Box<Experiment>, RunDir),
    /// A run that is complete, with its hash.
    Finished(String),
}

impl RunDir {
    /// Creates the directory with everything needed to resume the run.
    ///
    /// # Errors
    /// [`RunDirError::Exists`] if the path exists; [`RunDirError::File`] if the directory cannot be
    /// written.
    pub fn create(
        path: &Path,
        experiment: &Experiment,
        program: &Program,
    ) -> Result<Self, RunDirError> {
        let new = NewDir::beside(path).map_err(exists_or_file)?;
        let settings_text = experiment.settings().toml();
        let mut run = Self {
            path: new.path().to_owned(),
            settings_text,
            timer: Timer::after(TimeSpent::default()),
            table_last: false,
            _lock: None,
        };
        let meta = json(&Meta::new(experiment.settings(), program));
        run.save(experiment)
            .and_then(|()| files::replace(&run.file(META), meta.as_bytes()))
            .and_then(|()| files::replace(&run.file(CONFIG), run.settings_text.as_bytes()))
            .map_err(|error| new.in_place(error))?;
        // Published complete under its final name: a directory with that name is always a run.
        run._lock = Some(new.publish_locked().map_err(exists_or_file)?);
        run.path = path.to_owned();
        Ok(run)
    }

    /// Like [`RunDir::create`], with a name derived from the settings; a number is appended if the
    /// name is taken.
    ///
    /// # Errors
    /// [`RunDirError`] if the directory cannot be written.
    pub fn create_named(
        parent: &Path,
        experiment: &Experiment,
        program: &Program,
    ) -> Result<Self, RunDirError> {
        let name = experiment.settings().run_name();
        for number in 1_u32.. {
            let name = match number {
                1 => name.clone(),
                _ => format!("{name}-{number}"),
            };
            match Self::create(&parent.join(name), experiment, program) {
                Err(RunDirError::Exists(_)) => {}
                other => return other,
            }
        }
        Err(RunDirError::Exists(parent.join(name)))
    }

    /// Opens a run to resume it with this number of threads.
    ///
    /// # Errors
    /// [`RunDirError`] if the run is missing, in use, changed or damaged, cannot be accessed, or
    /// needs more memory than this machine has.
    pub fn open(path: &Path, threads: f64) -> Result<Opened, RunDirError> {
        let missing = |missing| RunDirError::NotARun {
            path: path.to_owned(),
            missing,
        };
        if let Some(hash) = finished(path)? {
            return Ok(Opened::Finished(hash));
        }
        let config = path.join(CONFIG);
        if !files::exists(&config)? {
            fs::metadata(path)
                .map_err(|error| RunDirError::NotThere(FileError::at(path)(error)))?;
            return Err(missing(CONFIG));
        }
        let lock = lock(path)?;
        // Check again: the previous holder of the lock may have completed the run.
        if let Some(hash) = finished(path)? {
            return Ok(Opened::Finished(hash));
        }
        let (settings, settings_text) = settings_of_unfinished(path)?;
        Needs::of_evolution(&settings, threads).check_memory()?;
        let (experiment, spent) = unfinished(path, settings, &settings_text)?;
        let run = Self {
            path: path.to_owned(),
            settings_text,
            timer: Timer::after(spent),
            table_last: false,
            _lock: Some(lock),
        };
        Ok(Opened::Unfinished(Box::new(experiment), run))
    }

    /// Checks whether an incomplete run can be resumed. Skips runs that do not fit into memory.
    ///
    /// # Errors
    /// [`RunDirError`] if a file of the run is missing, invalid or unreadable.
    pub fn check_unfinished(path: &Path) -> Result<(), RunDirError> {
        let (settings, text) = settings_of_unfinished(path)?;
        if Needs::of_evolution(&settings, 1.0).check_memory().is_err() {
            // Too little memory does not mean that the run is damaged.
            return Ok(());
        }
        unfinished(path, settings, &text).map(drop)
    }

    /// Delays writing `generations.csv` until the run is complete. Used if other processes may be
    /// executing the same run unnoticed, because the file system has no locks: a slower process
    /// could otherwise replace the complete table with its shorter one. All other files written
    /// before the end are checkpoints, each of which is valid.
    #[must_use]
    pub fn with_table_last(mut self) -> Self {
        self.table_last = true;
        self
    }

    /// Saves an evolution between two generations.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written; the last checkpoint is kept.
    pub fn save(&self, experiment: &Experiment) -> Result<(), FileError> {
        self.write(&self.checkpoint(experiment))
    }

    /// Returns the checkpoint that [`RunDir::save`] writes.
    #[must_use]
    pub fn checkpoint(&self, experiment: &Experiment) -> Checkpoint {
        Checkpoint {
            state: checkpoint::encode(experiment, &self.settings_text),
            generations: generations(experiment),
            time: self.timer.spent().json(),
        }
    }

    /// Writes a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written; the last checkpoint is kept.
    pub fn write(&self, checkpoint: &Checkpoint) -> Result<(), FileError> {
        files::replace(&self.file(CHECKPOINT), &checkpoint.state)?;
        files::replace(&self.file(TIME), checkpoint.time.as_bytes())?;
        if self.table_last {
            return Ok(());
        }
        files::replace(&self.file(GENERATIONS), checkpoint.generations.as_bytes())
    }

    /// Saves the result and marks the run complete.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written or removed. Until the run is marked complete, it
    /// can be resumed.
    pub fn finish(
        &self,
        experiment: &Experiment,
        result: &EvolutionResult,
    ) -> Result<(), FileError> {
        let mut buffer = [0; CONTAINER_BYTES_MAX];
        let genome = codec::encode(&result.genome, result.provenance, &mut buffer)
            .expect("the buffer holds any genome");
        // Written again: another process, which has since been killed, may have written the last
        // checkpoint.
        let table = generations(experiment);
        files::replace(&self.file(GENERATIONS), table.as_bytes())?;
        files::replace(&self.file(BEST), genome)?;
        let final_state = json(&FinalFile::new(experiment.settings(), result));
        files::replace(&self.file(FINAL), final_state.as_bytes())?;
        let time = self.timer.spent().json();
        files::replace(&self.file(TIME), time.as_bytes())?;
        files::replace(&self.file(DONE), format!("{}\n", result.hash).as_bytes())?;
        tidy(&self.path)
    }

    /// Returns the directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

/// Reads the settings of an incomplete run, and their text.
fn settings_of_unfinished(path: &Path) -> Result<(Settings, String), RunDirError> {
    if !files::exists(&path.join(CHECKPOINT))? {
        return Err(RunDirError::NotARun {
            path: path.to_owned(),
            missing: CHECKPOINT,
        });
    }
    Ok(settings_and_text_of_run(path)?)
}

/// Returns the state from which an incomplete run is resumed.
fn unfinished(
    path: &Path,
    settings: Settings,
    text: &str,
) -> Result<(Experiment, TimeSpent), RunDirError> {
    let checkpoint = path.join(CHECKPOINT);
    let most = limits::most(limits::checkpoint_bytes(&settings));
    let bytes = files::read(&checkpoint, most).map_err(ReadRunError::from)?;
    let experiment =
        checkpoint::decode(&bytes, settings, text).map_err(|error| RunDirError::Checkpoint {
            path: checkpoint,
            error,
        })?;
    let spent = TimeSpent::read(path).map_err(ReadRunError::from)?;
    Ok((experiment, spent))
}

/// Returns the hash of a complete run, after removing files that are no longer needed.
fn finished(directory: &Path) -> Result<Option<String>, RunDirError> {
    let Some(hash) = complete(directory)? else {
        return Ok(None);
    };
    // Cosmetic: failure to remove files is ignored; the directory may belong to another user.
    let _ = tidy(directory);
    Ok(Some(hash))
}

/// Removes the files that a complete run does not need: checkpoint, lock, and partially written
/// files. Another process may be removing them at the same time.
///
/// # Errors
/// [`FileError`] if the directory cannot be read or a file cannot be removed.
pub fn tidy(directory: &Path) -> Result<(), FileError> {
    let entries = fs::read_dir(directory).map_err(FileError::at(directory))?;
    for entry in entries.flatten() {
        let name = entry.file_name();
        if name == CHECKPOINT || name == LOCK || files::is_part(&name) {
            match fs::remove_file(entry.path()) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    return Err(FileError::at(&entry.path())(error));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Locks the directory for this process.
fn lock(directory: &Path) -> Result<Lock, RunDirError> {
    Lock::take(directory).map_err(|error| match error {
        LockError::Held(holder) => RunDirError::InUse {
            path: directory.to_owned(),
            holder,
        },
        LockError::File(error) => error.into(),
    })
}

fn exists_or_file(error: FileError) -> RunDirError {
    if error.is_exists() {
        RunDirError::Exists(error.path)
    } else {
        error.into()
    }
}
