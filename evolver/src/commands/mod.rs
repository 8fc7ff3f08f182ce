//! One file a command: check what was given, do it, show it.

pub mod bench;
pub mod classify;
pub mod damage;
pub mod errors;
pub mod evaluate;
pub mod evolve;
pub mod export;
pub mod flash;
pub mod gallery;
pub mod hil;
pub mod import;
pub mod inspect;
pub mod monitor;
mod new_file;
pub mod pictures;
pub mod port;
pub mod replay;
pub mod setting_flags;
pub mod start;
pub mod suite;

pub use errors::{BadInput, Interrupted, exit_of};

use errors::unusable;
use minimal_surprise_evolution::finished_run::require;
use minimal_surprise_evolution::genome_file::{GenomeFile, GenomeFileError};
use minimal_surprise_evolution::run_files::{BEST, DONE};
use minimal_surprise_evolution::settings::{THREADS_MAX, count};
use std::path::{Path, PathBuf};

/// The number of threads, by default one per core.
///
/// # Errors
/// If the operating system gives no threads.
pub fn thread_pool(threads: Option<u32>) -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
    let threads = threads.unwrap_or(0) as usize;
    rayon::ThreadPoolBuilder::new().num_threads(threads).build()
}

/// A flag's value, or an error that names the flag.
fn flag<T>(
    name: &str,
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<T, BadInput> {
    parse(text).map_err(|problem| BadInput::new(format!("--{name} = {text}: {problem}")))
}

/// The value of `--threads`, if it was given.
fn threads_flag(given: &Option<String>) -> Result<Option<u32>, BadInput> {
    let given = given.as_deref();
    given
        .map(|text| flag("threads", text, |text| count(text, THREADS_MAX)))
        .transpose()
}

/// The genome file that a path names: of a run directory, its best genome.
fn genome_file(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join(BEST)
    } else {
        path.to_owned()
    }
}

/// A genome file, or that of a run directory.
fn read_genome(path: &Path) -> anyhow::Result<GenomeFile> {
    if path.is_dir() {
        // Without its mark the run is not complete; marked, it is damaged.
        require(path, BEST)
            .or_else(|error| require(path, DONE).and(Err(error)))
            .map_err(unusable)?;
    }
    GenomeFile::read(&genome_file(path)).map_err(|error| match error {
        GenomeFileError::File(error) => unusable(error),
        // Of a run directory it is the run that is damaged.
        error if path.is_dir() => error.into(),
        error => BadInput::new(error).into(),
    })
}
