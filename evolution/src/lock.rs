//! Directory locks, which name the process that uses a directory.

use crate::files::FileError;
use std::fmt;
use std::fs::{File, TryLockError};
use std::io::{Read, Write};
use std::path::Path;

/// The lock file in the directory. It contains the holder of the lock.
pub const LOCK: &str = ".lock";

/// A directory locked by this process until this value is dropped. On a file system without locks,
/// the directory is not locked.
#[derive(Debug)]
pub struct Lock {
    _file: Option<File>,
}

/// Error: a directory could not be locked.
#[derive(Debug)]
pub enum LockError {
    /// Another process holds the lock; `None` if it took the lock only a moment ago.
    Held(Option<Holder>),
    /// The lock file could not be used.
    File(FileError),
}

/// The holder of a lock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// Host name.
    pub host: String,
    /// Process ID on that host.
    pub process: u32,
}

impl Lock {
    /// Locks a directory.
    ///
    /// # Errors
    /// [`LockError`] if another process holds the lock, or the lock file cannot be used.
    pub fn take(directory: &Path) -> Result<Self, LockError> {
        let path = directory.join(LOCK);
        let mut options = File::options();
        let options = options.read(true).write(true).create(true).truncate(false);
        let file = options.open(&path).map_err(FileError::at(&path));
        let mut file = file.map_err(LockError::File)?;
        match file.try_lock() {
            Ok(()) => {
                // For information only: if writing fails, the lock is still held.
                let _ = Holder::this_process().write(&mut file);
                Ok(Self { _file: Some(file) })
            }
            Err(TryLockError::WouldBlock) => Err(LockError::Held(Holder::read(&file))),
            Err(TryLockError::Error(_)) => Ok(Self { _file: None }),
        }
    }

    /// Locks a directory if its last holder was a process on this host that has exited. Some file
    /// systems do not show locks to other hosts, so a holder on another host may still be running.
    pub fn take_abandoned(directory: &Path) -> Option<Self> {
        let options = File::options()
            .read(true)
            .write(true)
            .open(directory.join(LOCK));
        let file = options.ok()?;
        file.try_lock().ok()?;
        let holder = Holder::read(&file)?;
        (holder.host == host()).then_some(Self { _file: Some(file) })
    }
}

impl Holder {
    fn this_process() -> Self {
        Self {
            host: host(),
            process: std::process::id(),
        }
    }

    /// Overwrites the last holder's line in one write, then truncates the file after it; readers
    /// use only the first line.
    fn write(&self, file: &mut File) -> std::io::Result<()> {
        let line = format!("{} {}\n", self.host, self.process);
        file.write_all(line.as_bytes())?;
        file.set_len(line.len() as u64)
    }

    /// Reads a lock file.
    pub fn read(file: impl Read) -> Option<Self> {
        let mut text = String::new();
        file.take(400).read_to_string(&mut text).ok()?;
        let (host, process) = text.split_once('\n')?.0.rsplit_once(' ')?;
        // The name is printed on terminals.
        let is_name = host.chars().all(|c| c.is_ascii_graphic());
        is_name.then_some(Self {
            host: host.to_owned(),
            process: process.parse().ok()?,
        })
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "process {} on {}", self.process, self.host)
    }
}

/// Describes the holder of a lock, for messages.
#[must_use]
pub fn named(holder: Option<&Holder>) -> String {
    holder.map_or_else(|| "another process".to_owned(), Holder::to_string)
}

#[cfg(unix)]
fn host() -> String {
    let name = nix::unistd::gethostname().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

#[cfg(not(unix))]
fn host() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}
