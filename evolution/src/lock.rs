//! Locks: a directory that is in use, and by whom.

use crate::files::FileError;
use std::fmt;
use std::fs::{File, TryLockError};
use std::io::{Read, Write};
use std::path::Path;

/// The lock's file in the directory. It says who holds the lock.
pub const LOCK: &str = ".lock";

/// A directory taken by this process for as long as this lives, where the file system knows locks;
/// where it does not, there is nothing to hold.
#[derive(Debug)]
pub struct Lock {
    _file: Option<File>,
}

/// A directory cannot be taken.
#[derive(Debug)]
pub enum LockError {
    /// Another process has it; it says who it is, unless it has taken it just now.
    Held(Option<Holder>),
    /// The lock's file cannot be used.
    File(FileError),
}

/// Who holds a lock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// The name of its host.
    pub host: String,
    /// The number of its process there.
    pub process: u32,
}

impl Lock {
    /// Takes a directory.
    ///
    /// # Errors
    /// [`LockError`] if another process has it, or its file cannot be used.
    pub fn take(directory: &Path) -> Result<Self, LockError> {
        let path = directory.join(LOCK);
        let mut options = File::options();
        let options = options.read(true).write(true).create(true).truncate(false);
        let file = options.open(&path).map_err(FileError::at(&path));
        let mut file = file.map_err(LockError::File)?;
        match file.try_lock() {
            Ok(()) => {
                // For others to read; without it, too, the lock is held.
                let _ = Holder::this_process().write(&mut file);
                Ok(Self { _file: Some(file) })
            }
            Err(TryLockError::WouldBlock) => Err(LockError::Held(Holder::read(&file))),
            Err(TryLockError::Error(_)) => Ok(Self { _file: None }),
        }
    }

    /// Takes a directory whose holder has ended on this host. There are file systems whose locks
    /// are not seen by other hosts, so nothing is known of a holder there.
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

    /// In one step over what the last holder wrote, of which a longer end is cut off then; who
    /// reads looks at the first line only.
    fn write(&self, file: &mut File) -> std::io::Result<()> {
        let line = format!("{} {}\n", self.host, self.process);
        file.write_all(line.as_bytes())?;
        file.set_len(line.len() as u64)
    }

    /// Reads what a lock's file says.
    pub fn read(file: impl Read) -> Option<Self> {
        let mut text = String::new();
        file.take(400).read_to_string(&mut text).ok()?;
        let (host, process) = text.split_once('\n')?.0.rsplit_once(' ')?;
        // It is shown on terminals.
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

/// Who holds a lock, in words.
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
