//! Run directories: everything a run leaves behind, in the files of [`run_files`](crate::run_files).
//!
//! No directory is used twice, and no file in it is ever half-written.

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

/// A run directory, held by this process alone.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    settings_text: String,
    timer: Timer,
    /// Whether the table is kept until the run is complete.
    table_last: bool,
    /// Holds the lock for as long as it lives.
    _lock: Option<Lock>,
}

/// An evolution between two generations, ready to be written.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    state: Vec<u8>,
    generations: String,
    time: String,
}

/// A run directory cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunDirError {
    /// There is something already; nothing is ever overwritten.
    #[error("{} exists; name a directory that does not, or continue with --resume", .0.display())]
    Exists(PathBuf),
    /// There is no such directory.
    #[error(transparent)]
    NotThere(FileError),
    /// The directory holds no run.
    #[error("{} is not a run directory: it has no {missing}", path.display())]
    NotARun {
        /// The directory.
        path: PathBuf,
        /// The file that it should have.
        missing: &'static str,
    },
    /// A file of it cannot be read back.
    #[error(transparent)]
    Damaged(#[from] ReadRunError),
    /// Another process works on the run.
    #[error("{} is in use by {}", path.display(), lock::named(holder.as_ref()))]
    InUse {
        /// The directory.
        path: PathBuf,
        /// Who it is, if its lock says so.
        holder: Option<Holder>,
    },
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The environment asks for an unknown path of the engine.
    #[error(transparent)]
    EnginePath(#[from] PathError),
    /// It takes more than this machine has.
    #[error(transparent)]
    TooMuch(#[from] TooMuch),
    /// The checkpoint in it cannot be continued from.
    #[error("{}: {error}", path.display())]
    Checkpoint {
        /// The checkpoint.
        path: PathBuf,
        /// Why.
        error: CheckpointError,
    },
}

impl RunDirError {
    /// Returns what is wrong, without what to do about it.
    #[must_use]
    pub fn cause(&self) -> &dyn std::error::Error {
        match self {
            Self::Damaged(error) => error.cause(),
            other => other,
        }
    }

    /// Whether it is about this run alone, so that others can be done all the same: not a disk that
    /// is full, a folder that no run can be made in, or what this machine has not.
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

/// What `--resume` finds.
#[derive(Debug)]
pub enum Opened {
    /// A run that can be resumed.
    Unfinished(Box<Experiment>, RunDir),
    /// A run that is complete, with its hash.
    Finished(String),
}

impl RunDir {
    /// Makes the directory and everything that a run needs to be continued.
    ///
    /// # Errors
    /// [`RunDirError::Exists`], or a file that cannot be written.
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
        // Under its own name from here on, complete: a directory of that name is always a run.
        run._lock = Some(new.publish_locked().map_err(exists_or_file)?);
        run.path = path.to_owned();
        Ok(run)
    }

    /// [`RunDir::create`] under a name made of the settings; a number is added if there is one
    /// already.
    ///
    /// # Errors
    /// [`RunDirError`] if nothing can be written.
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

    /// Opens a run to resume it with this many threads.
    ///
    /// # Errors
    /// [`RunDirError`] if there is no run, it is in use, it was changed or damaged, or it takes more
    /// than this machine has.
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
        // Check again: the previous holder of the lock may have completed it.
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

    /// Checks whether an incomplete run can be resumed, if there is enough memory to read it.
    ///
    /// # Errors
    /// [`RunDirError`] if it cannot.
    pub fn check_unfinished(path: &Path) -> Result<(), RunDirError> {
        let (settings, text) = settings_of_unfinished(path)?;
        if Needs::of_evolution(&settings, 1.0).check_memory().is_err() {
            // It is not damaged only because it cannot be held here.
            return Ok(());
        }
        unfinished(path, settings, &text).map(drop)
    }

    /// For a run that others may be doing at the same time, unseen where the file system knows no
    /// locks: the table appears when the run is complete. A slower process would otherwise put its
    /// shorter table in the place of the complete one. Everything else that is written before the
    /// end is a checkpoint, and any of them will do.
    #[must_use]
    pub fn with_table_last(mut self) -> Self {
        self.table_last = true;
        self
    }

    /// Saves an evolution between two generations.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written; the last checkpoint is then still there.
    pub fn save(&self, experiment: &Experiment) -> Result<(), FileError> {
        self.write(&self.checkpoint(experiment))
    }

    /// Returns what [`RunDir::save`] writes.
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
    /// [`FileError`] if a file cannot be written; the last checkpoint is then still there.
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
    /// [`FileError`] if a file cannot be written; the run can then be resumed.
    pub fn finish(
        &self,
        experiment: &Experiment,
        result: &EvolutionResult,
    ) -> Result<(), FileError> {
        let mut buffer = [0; CONTAINER_BYTES_MAX];
        let genome = codec::encode(&result.genome, result.provenance, &mut buffer)
            .expect("the buffer holds any genome");
        // Once more: the last checkpoint may have been written by a process that got no further.
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

    /// The directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

/// The settings of a run that is not complete, and their text.
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

/// The hash of a complete run; what is not needed any more is removed.
fn finished(directory: &Path) -> Result<Option<String>, RunDirError> {
    let Some(hash) = complete(directory)? else {
        return Ok(None);
    };
    // Cosmetic: failure to remove files is ignored; the directory may belong to another user.
    let _ = tidy(directory);
    Ok(Some(hash))
}

/// Removes what a complete run does not need: checkpoint, lock, and files whose writing was cut
/// short. Another process may be removing them, too.
///
/// # Errors
/// [`FileError`] if something cannot be removed.
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

/// Takes the directory for this process.
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
