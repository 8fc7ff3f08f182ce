//! File access: reading up to a size limit, and writing that never leaves a partial file.

#[cfg(feature = "files")]
mod write;

#[cfg(feature = "files")]
pub use write::{beside, create, is_part, remove_old_parts, replace, write};

use crate::text::{self, TextError};
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Error: a file or folder could not be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {error}", path.display())]
pub struct FileError {
    /// The file or folder.
    pub path: PathBuf,
    /// The cause.
    pub error: io::Error,
}

impl FileError {
    /// Adds the path to an I/O error.
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |error| Self { path, error }
    }

    /// Creates the error for a path that already exists.
    #[must_use]
    pub fn exists(path: &Path) -> Self {
        let error = io::Error::new(ErrorKind::AlreadyExists, "it already exists");
        Self::at(path)(error)
    }

    /// Returns true if the path already exists; nothing was written in that case.
    #[must_use]
    pub fn is_exists(&self) -> bool {
        self.error.kind() == ErrorKind::AlreadyExists
    }

    /// Returns true if a different path could work; false for a system failure.
    #[must_use]
    pub fn is_bad_path(&self) -> bool {
        use ErrorKind as Kind;
        let kinds = [
            Kind::AlreadyExists,
            Kind::InvalidFilename,
            Kind::InvalidInput,
            Kind::IsADirectory,
            Kind::NotADirectory,
            Kind::NotFound,
            Kind::PermissionDenied,
            Kind::ReadOnlyFilesystem,
        ];
        let cause = self.error.get_ref();
        kinds.contains(&self.error.kind())
            || cause.is_some_and(|cause| cause.is::<TooLarge>() || cause.is::<TextError>())
    }
}

/// Behaviour if a path already exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Keep the existing path and report an error.
    Refuse,
    /// Replace an existing file; in a folder, replace files with the same names.
    Replace,
}

impl Existing {
    /// Returns the behaviour that the flag `--overwrite` selects.
    #[must_use]
    pub fn with_overwrite(overwrite: bool) -> Self {
        if overwrite {
            Self::Replace
        } else {
            Self::Refuse
        }
    }
}

/// Returns the directory that contains a path.
#[must_use]
pub fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Checks whether a path exists, following symbolic links.
///
/// # Errors
/// [`FileError`] if that cannot be determined, for example without permission to read the folder.
pub fn exists(path: &Path) -> Result<bool, FileError> {
    path.try_exists().map_err(FileError::at(path))
}

/// Size limit for files that people write or that describe a run: settings, suites, notes,
/// `meta.json`, `time.json`, `DONE`.
pub const TEXT_BYTES_MAX: u64 = 16 << 20;

/// Size limit for files of poses, genomes or generations whose size does not follow from settings.
pub const DATA_BYTES_MAX: u64 = 256 << 20;

/// Error: a file exceeds the size limit for its contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TooLarge {
    /// The file is larger than the limit.
    #[error("it has {found} bytes; at most {most} are read")]
    Sized {
        /// The size of the file.
        found: u64,
        /// The size limit.
        most: u64,
    },
    /// The file has no known size, for example because it is a pipe, and does not end within the
    /// limit.
    #[error("it does not end within {most} bytes; no more are read")]
    Endless {
        /// The size limit.
        most: u64,
    },
}

/// Reads a whole file of at most `most` bytes. The size is checked first, so that no memory is
/// spent on a larger file; from a file without a size, no more than the limit is read.
///
/// # Errors
/// [`FileError`] if the file cannot be read; its cause is [`TooLarge`] if it exceeds the limit.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let too_large = |error: TooLarge| io::Error::new(io::ErrorKind::FileTooLarge, error);
    let read = || {
        let file = File::open(path)?;
        let metadata = file.metadata()?;
        let found = metadata.len();
        // Reading a directory reports a clearer error.
        if found > most && !metadata.is_dir() {
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

/// Reads a whole text file of at most `most` bytes, saved by any program; see [`text::decode`].
///
/// # Errors
/// [`FileError`] if the file cannot be read, exceeds the limit or is not UTF-8.
pub fn read_text(path: &Path, most: u64) -> Result<String, FileError> {
    text::decode(&read(path, most)?)
        .map_err(|error| FileError::at(path)(io::Error::new(io::ErrorKind::InvalidData, error)))
}
