//! Files that are never half-written: written beside, then renamed.

use std::fs::{self, File};
use std::io::{self, Write};
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

/// Reads a whole file.
///
/// # Errors
/// [`FileError`] names it.
pub fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    fs::read(path).map_err(FileError::at(path))
}
