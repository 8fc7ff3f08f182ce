//! The commands, one file each: check the arguments, do the work, print the result.

pub mod baseline;
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

/// Creates a pool of threads, by default one per core.
///
/// # Errors
/// If the operating system cannot create the threads.
pub fn thread_pool(threads: Option<u32>) -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
    let threads = threads.unwrap_or(0) as usize;
    rayon::ThreadPoolBuilder::new().num_threads(threads).build()
}

/// Parses a flag's value; an error names the flag.
fn flag<T>(
    name: &str,
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<T, BadInput> {
    parse(text).map_err(|problem| BadInput::new(format!("--{name} = {text}: {problem}")))
}

/// Parses the value of `--threads`, if given.
fn threads_flag(given: &Option<String>) -> Result<Option<u32>, BadInput> {
    let given = given.as_deref();
    given
        .map(|text| flag("threads", text, |text| count(text, THREADS_MAX)))
        .transpose()
}

/// Returns the genome file at a path; for a run directory, the file of its best genome.
fn genome_file(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join(BEST)
    } else {
        path.to_owned()
    }
}

/// Reads a genome file, or the best genome of a run directory.
fn read_genome(path: &Path) -> anyhow::Result<GenomeFile> {
    if path.is_dir() {
        // Without its completion mark, the run is incomplete; with the mark, the run is damaged.
        require(path, BEST)
            .or_else(|error| require(path, DONE).and(Err(error)))
            .map_err(unusable)?;
    }
    GenomeFile::read(&genome_file(path)).map_err(|error| match error {
        GenomeFileError::File(error) => unusable(error),
        // In a run directory, an invalid genome means that the run is damaged.
        error if path.is_dir() => error.into(),
        error => BadInput::new(error).into(),
    })
}
