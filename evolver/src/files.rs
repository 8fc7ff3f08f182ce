//! Files that are never half-written: written beside, then renamed.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// A file or folder could not be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {error}", path.display())]
pub struct FileError {
    /// The file or folder.
    pub path: PathBuf,
    /// Why.
    pub error: io::Error,
}

impl FileError {
    /// Says which path an error is about.
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |error| Self { path, error }
    }
}

/// What [`beside`] ends its names with.
pub const PART: &str = ".part";

/// A name beside a path, for what is to be renamed to it. It is drawn: process ids are the same on
/// two machines that share a file system.
#[must_use]
pub fn beside(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let number: u64 = rand::random();
    path.with_file_name(format!(".{name}.{number:016x}{PART}"))
}

/// Replaces a file as a whole: after a kill at any moment there is the old one or the new one.
///
/// # Errors
/// [`FileError`] if it cannot be written; the old file is then still there.
pub fn replace(path: &Path, contents: &[u8]) -> Result<(), FileError> {
    let beside = beside(path);
    let write = || {
        let mut file = File::create_new(&beside)?;
        file.write_all(contents)?;
        file.sync_data()?;
        fs::rename(&beside, path)
    };
    write().map_err(|error| {
        // The half-written copy is of no use; that it cannot be removed changes nothing.
        let _ = fs::remove_file(&beside);
        FileError::at(path)(error)
    })
}

/// Most bytes of a file that a person writes, or that says a few things about a run: settings,
/// suites, notes, `meta.json`, `time.json`, `DONE`.
pub const TEXT_BYTES_MAX: u64 = 16 << 20;

/// Most bytes of a file of poses, genomes or generations whose size no settings tell.
pub const DATA_BYTES_MAX: u64 = 256 << 20;

/// A file is larger than what it should hold can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TooLarge {
    /// The file says so.
    #[error("it has {found} bytes; at most {most} are read")]
    Sized {
        /// Its size.
        found: u64,
        /// The most that is read.
        most: u64,
    },
    /// It is no plain file, has no size, and does not end in time.
    #[error("it does not end after {most} bytes, the most that are read")]
    Endless {
        /// The most that is read.
        most: u64,
    },
}

/// Reads a whole file of at most `most` bytes. The size is looked at first, so that no memory is
/// spent on a larger one; of what has no size no more is read than that.
///
/// # Errors
/// [`FileError`] names it; the cause is [`TooLarge`] if there is more.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let too_large = |error: TooLarge| io::Error::new(io::ErrorKind::FileTooLarge, error);
    let read = || {
        let file = File::open(path)?;
        let found = file.metadata()?.len();
        if found > most {
            return Err(too_large(TooLarge::Sized { found, most }));
        }
        let mut bytes = Vec::with_capacity(found as usize);
        file.take(most + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > most {
            return Err(too_large(TooLarge::Endless { most }));
        }
        Ok(bytes)
    };
    read().map_err(FileError::at(path))
}
