//! Time that a run took, summed over all processes that worked on it.
//!
//! The time is saved with every checkpoint, so that a killed process loses at most one generation's
//! time. It is not part of a result or of any hash.

use crate::files::{self, FileError, TEXT_BYTES_MAX};
use crate::ranges;
use crate::run_files::TIME;
use crate::usage::Stopwatch;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// The contents of `time.json`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimeSpent {
    /// Wall-clock seconds.
    #[serde(deserialize_with = "ranges::seconds")]
    pub wall_s: f64,
    /// CPU seconds, summed over all threads.
    #[serde(deserialize_with = "ranges::seconds")]
    pub cpu_s: f64,
    /// Number of processes that started or resumed the run.
    pub sittings: u32,
}

impl TimeSpent {
    /// Reads the file in a run directory; returns zero times for a run of an older program.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be read or its numbers are not valid times.
    pub fn read(run: &Path) -> Result<Self, FileError> {
        let path = run.join(TIME);
        if !files::exists(&path)? {
            return Ok(Self::default());
        }
        let read = serde_json::from_slice(&files::read(&path, TEXT_BYTES_MAX)?);
        read.map_err(|error: serde_json::Error| FileError::at(&path)(error.into()))
    }

    /// Formats the contents of the file.
    #[must_use]
    pub fn json(&self) -> String {
        let rounded = Self {
            wall_s: (self.wall_s * 1000.0).round() / 1000.0,
            cpu_s: (self.cpu_s * 1000.0).round() / 1000.0,
            ..*self
        };
        let mut text = serde_json::to_string(&rounded).expect("plain numbers");
        text.push('\n');
        text
    }

    /// Returns the sum of two times.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            wall_s: self.wall_s + other.wall_s,
            cpu_s: self.cpu_s + other.cpu_s,
            sittings: self.sittings.saturating_add(other.sittings),
        }
    }
}

/// Timer that adds the time of this process to that of earlier processes.
#[derive(Clone, Debug)]
pub struct Timer {
    before: TimeSpent,
    started: Instant,
    cpu: Stopwatch,
}

impl Timer {
    /// Starts measuring; earlier processes spent `before`.
    #[must_use]
    pub fn after(before: TimeSpent) -> Self {
        Self {
            before,
            started: Instant::now(),
            cpu: Stopwatch::start(),
        }
    }

    /// Returns the total time spent until now.
    #[must_use]
    pub fn spent(&self) -> TimeSpent {
        self.before.and(TimeSpent {
            wall_s: self.started.elapsed().as_secs_f64(),
            cpu_s: self.cpu.cpu_seconds(),
            sittings: 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_summed_and_survive_a_round_trip_through_the_file() {
        let before = TimeSpent {
            wall_s: 2.5,
            cpu_s: 4.125,
            sittings: 2,
        };
        let run = tempfile::tempdir().unwrap();
        let read = |text: &str| {
            std::fs::write(run.path().join(TIME), text).unwrap();
            TimeSpent::read(run.path())
        };
        assert_eq!(read(&before.json()).unwrap(), before);
        let spent = Timer::after(before).spent();
        assert_eq!(spent.sittings, 3);
        assert!(spent.wall_s >= 2.5 && spent.cpu_s >= 4.125);
        let bad = [
            "{".to_owned(),
            before.json().replace("2.5", "-2.5"),
            before.json().replace("4.125", "1e300"),
            before.json().replace('2', "2e99"),
        ];
        for text in bad {
            let error = read(&text).unwrap_err().to_string();
            assert!(error.contains(TIME) && error.contains("line 1"), "{error}");
        }
        std::fs::remove_file(run.path().join(TIME)).unwrap();
        assert_eq!(TimeSpent::read(run.path()).unwrap(), TimeSpent::default());
    }
}
