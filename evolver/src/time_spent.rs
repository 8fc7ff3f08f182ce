//! How long a run took, summed over all that worked on it one after the other.
//!
//! Written with every checkpoint, so that at most a generation's time is lost with a process. It is
//! no part of a result, and no hash covers it.

use crate::usage::Stopwatch;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// `time.json`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimeSpent {
    /// Seconds on the clock.
    pub wall_s: f64,
    /// Seconds of computing, all threads together.
    pub cpu_s: f64,
    /// How often it was begun or gone on with.
    pub sittings: u32,
}

impl TimeSpent {
    /// What a file says; nothing if it says nothing.
    #[must_use]
    pub fn of_json(bytes: &[u8]) -> Self {
        serde_json::from_slice(bytes).unwrap_or_default()
    }

    /// The file.
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

    /// The sum of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            wall_s: self.wall_s + other.wall_s,
            cpu_s: self.cpu_s + other.cpu_s,
            sittings: self.sittings + other.sittings,
        }
    }
}

/// Counts the time of this sitting, on top of earlier ones.
#[derive(Clone, Debug)]
pub struct Timer {
    before: TimeSpent,
    started: Instant,
    cpu: Stopwatch,
}

impl Timer {
    /// Starts a sitting.
    #[must_use]
    pub fn after(before: TimeSpent) -> Self {
        Self {
            before,
            started: Instant::now(),
            cpu: Stopwatch::start(),
        }
    }

    /// Everything until now.
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
    fn sittings_are_summed_and_survive_their_file() {
        let before = TimeSpent {
            wall_s: 2.5,
            cpu_s: 4.125,
            sittings: 2,
        };
        assert_eq!(TimeSpent::of_json(before.json().as_bytes()), before);
        let spent = Timer::after(before).spent();
        assert_eq!(spent.sittings, 3);
        assert!(spent.wall_s >= 2.5 && spent.cpu_s >= 4.125);
        assert_eq!(TimeSpent::of_json(b"{"), TimeSpent::default());
    }
}
