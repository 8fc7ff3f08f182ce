//! Files: read with a bound, and never half-written.

#[cfg(feature = "files")]
mod write;

#[cfg(feature = "files")]
pub use write::{beside, create, is_part, remove_old_parts, replace, write};

use crate::text::{self, TextError};
use std::fs::File;
use std::io::{self, ErrorKind, Read};
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

    /// There is something already.
    #[must_use]
    pub fn exists(path: &Path) -> Self {
        let error = io::Error::new(ErrorKind::AlreadyExists, "it exists already");
        Self::at(path)(error)
    }

    /// Whether nothing was written because there is something already.
    #[must_use]
    pub fn is_exists(&self) -> bool {
        self.error.kind() == ErrorKind::AlreadyExists
    }

    /// Whether another path would do, as opposed to something that broke.
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

/// What to do where there is something already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Write nothing.
    Refuse,
    /// Replace a file; in a folder, files of the same names.
    Replace,
}

impl Existing {
    /// As the flag `--overwrite` says.
    #[must_use]
    pub fn with_overwrite(overwrite: bool) -> Self {
        if overwrite {
            Self::Replace
        } else {
            Self::Refuse
        }
    }
}

/// The directory that a path is in.
#[must_use]
pub fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Whether there is something of this name, symbolic links followed.
///
/// # Errors
/// [`FileError`] if that cannot be known, as where a folder must not be looked into.
pub fn exists(path: &Path) -> Result<bool, FileError> {
    path.try_exists().map_err(FileError::at(path))
}

/// Most bytes of a file that a person writes, or that says a few things about a run: settings,
/// suites, notes, `meta.json`, `time.json`, `DONE`.
pub const TEXT_BYTES_MAX: u64 = 16 << 20;

/// Most bytes of a file of poses, genomes or generations whose size no settings tell.
pub const DATA_BYTES_MAX: u64 = 256 << 20;

/// A file is larger than what it should hold can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
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
        let metadata = file.metadata()?;
        let found = metadata.len();
        // That a directory is in its place is said by reading.
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

/// Reads a whole text file of at most `most` bytes, whatever program saved it: see
/// [`text::decode`].
///
/// # Errors
/// [`FileError`] names it.
pub fn read_text(path: &Path, most: u64) -> Result<String, FileError> {
    text::decode(&read(path, most)?)
        .map_err(|error| FileError::at(path)(io::Error::new(io::ErrorKind::InvalidData, error)))
}
