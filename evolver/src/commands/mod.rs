//! One file a command: check what was given, do it, show it.

pub mod bench;
pub mod classify;
pub mod conditions;
pub mod damage;
pub mod evaluate;
pub mod evolve;
pub mod export;
pub mod flash;
pub mod gallery;
pub mod hil;
pub mod import;
pub mod inspect;
pub mod monitor;
pub mod pictures;
pub mod port;
pub mod replay;
pub mod start;
pub mod suite;

use crate::damaged_runs::DamagedRuns;
use crate::exit::Exit;
use crate::files;
use crate::output;
use crate::run_dir::RunDirError;
use crate::text::shell_path;
use minimal_surprise_controller::EncodedGenome;
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;
use std::path::{Path, PathBuf};

/// Input that cannot be used, in one message.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BadInput(String);

impl BadInput {
    /// With whatever message says what is wrong.
    pub fn new(message: impl ToString) -> Self {
        Self(message.to_string())
    }
}

/// Not all that was asked for is done; the message says how to go on.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unfinished(String);

/// A signal has ended what was done with a robot; the message says what that leaves.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Interrupted(String);

/// How the program ends after an error.
#[must_use]
pub fn exit_of(error: &anyhow::Error) -> Exit {
    let run_dir = error.downcast_ref::<RunDirError>();
    if error.is::<BadInput>() || run_dir.is_some_and(RunDirError::is_bad_input) {
        Exit::BadInput
    } else if error.is::<Unfinished>() {
        Exit::Unfinished
    } else if error.is::<Interrupted>() {
        Exit::Interrupted
    } else {
        Exit::Failure
    }
}

/// Work has stopped before it was done. Says why and how to go on.
fn stopped(go_on: &str) -> anyhow::Result<Exit> {
    match output::lost() {
        None => {
            tell!("interrupted; go on with: {go_on}");
            Ok(Exit::Interrupted)
        }
        Some(error) if output::is_gone(error) => Err(Unfinished(format!(
            "nobody reads standard output any more, and not all is done; go on with: {go_on}"
        ))
        .into()),
        Some(error) => anyhow::bail!("standard output: {error}; go on with: {go_on}"),
    }
}

/// Names the runs that were left out because they are damaged; `again` is the command that does them
/// again.
fn name_damaged(damaged: &DamagedRuns, again: Option<&str>) -> Exit {
    if damaged.is_empty() {
        return Exit::Done;
    }
    let directories: Vec<String> = damaged.iter().map(|(run, _)| shell_path(run)).collect();
    for (_, error) in damaged.iter() {
        tell!("error: {error}");
    }
    let again = again.map_or(String::new(), |command| {
        let directories = directories.join(" ");
        format!("; to do them again, delete {directories}, then: {command}")
    });
    tell!(
        "{} left out: damaged, made by another version, or not to be read{again}",
        directories.len()
    );
    Exit::Failure
}

/// The threads to work on; one a core if no number is given.
///
/// # Errors
/// If the operating system gives no threads.
pub fn thread_pool(threads: Option<u32>) -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
    let threads = threads.unwrap_or(0) as usize;
    rayon::ThreadPoolBuilder::new().num_threads(threads).build()
}

/// The genome file that a path names: of a run directory, its best genome.
fn genome_file(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join("best.genome")
    } else {
        path.to_owned()
    }
}

/// The bytes of a genome file, or of a run directory's, after a look whether they are a genome for
/// this program.
fn read_genome(path: &Path) -> Result<Vec<u8>, BadInput> {
    let path = &genome_file(path);
    let bytes = files::read(path, CONTAINER_BYTES_MAX as u64).map_err(BadInput::new)?;
    match EncodedGenome::decode(&bytes) {
        Ok(_) => Ok(bytes),
        Err(error) => Err(BadInput::new(format!("{}: {error}", path.display()))),
    }
}
