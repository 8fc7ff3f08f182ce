//! Damaged runs of a suite or a gallery. They are listed together at the end, after all other runs
//! have been processed.

use crate::finished_run::{FinishedRun, ReadRunError};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// Descriptions of the runs' problems, by run directory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DamagedRuns(BTreeMap<PathBuf, String>);

impl DamagedRuns {
    /// Reads a run; returns `None` if it is incomplete or damaged. If it is damaged, adds it to the
    /// damaged ones.
    pub fn read(&mut self, run: &Path) -> Option<FinishedRun> {
        self.take(run, FinishedRun::read_if_complete(run)).flatten()
    }

    /// Returns the result of reading a run; if reading failed, adds the run to the damaged ones.
    pub fn take<T>(&mut self, run: &Path, read: Result<T, ReadRunError>) -> Option<T> {
        read.map_err(|error| self.add(run, error.cause())).ok()
    }

    /// Adds a damaged run with its error.
    pub fn add(&mut self, run: &Path, error: impl fmt::Display) {
        self.0.insert(run.to_owned(), error.to_string());
    }

    /// Adds the runs of another list.
    pub fn extend(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// Returns true if the run is damaged.
    #[must_use]
    pub fn contains(&self, run: &Path) -> bool {
        self.0.contains_key(run)
    }

    /// Returns each run directory with a description of its problem.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&Path, &str)> {
        self.0
            .iter()
            .map(|(path, error)| (path.as_path(), error.as_str()))
    }

    /// Returns true if no run is damaged.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
