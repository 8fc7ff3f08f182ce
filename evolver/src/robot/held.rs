//! A robot that is stopped for some work, and afterwards is as it was found.

use super::{Robot, RobotError};
use std::sync::Mutex;

/// What to say about a robot that is stopped when the program ends at once.
static STANDING: Mutex<Option<String>> = Mutex::new(None);

/// How a robot is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Afterwards {
    /// It runs if the work was done; as it was found if not.
    Runs,
    /// As it was found, but its controller starts anew: the work has used it.
    StartsAnew,
}

/// How the robot stands and what starts it, if one is stopped for some work now.
#[must_use]
pub fn standing() -> Option<String> {
    STANDING.lock().ok().and_then(|words| words.clone())
}

impl Robot {
    /// Stops the robot for some work. Whatever comes of it, an interruption and a panic too, the
    /// robot is left as it was found, or [`RobotError::left`] says how it stands, and that
    /// `start_command` starts it.
    ///
    /// # Errors
    /// [`RobotError`] of stopping, of the work, or of putting the robot back.
    pub fn while_stopped<T>(
        &mut self,
        afterwards: Afterwards,
        start_command: &str,
        work: impl FnOnce(&mut Self) -> Result<T, RobotError>,
    ) -> Result<T, RobotError> {
        let was_running = self.identity.running;
        let words = format!("the robot may be standing now; start it with: {start_command}");
        set_standing(was_running.then(|| words.clone()));
        let mut held = Held {
            runs: was_running,
            starts_anew: afterwards == Afterwards::StartsAnew,
            words,
            robot: self,
            is_back: false,
        };
        let mut done = held.robot.stop().and_then(|()| work(held.robot));
        if done.is_ok() && afterwards == Afterwards::Runs {
            held.runs = true;
        }
        if let Err(error) = held.put_back() {
            // The first error is the reason of the others.
            let mut error = done.err().unwrap_or(error);
            error.left = held.runs.then(|| held.words.clone());
            done = Err(error);
        }
        done
    }
}

struct Held<'r> {
    robot: &'r mut Robot,
    /// Whether it is to run afterwards.
    runs: bool,
    starts_anew: bool,
    words: String,
    is_back: bool,
}

impl Held<'_> {
    fn put_back(&mut self) -> Result<(), RobotError> {
        self.is_back = true;
        self.robot.finish();
        let mut back = Ok(());
        if self.runs || self.starts_anew {
            // In a new conversation: it may have been restarted.
            back = self.robot.identify().map(|_| ());
            if self.starts_anew && !self.robot.identity.running {
                back = back.and_then(|()| self.robot.reset());
            }
            if self.runs {
                back = back.and_then(|()| self.robot.start());
            }
        }
        set_standing(None);
        back
    }
}

impl Drop for Held<'_> {
    /// In a panic.
    fn drop(&mut self) {
        if !self.is_back && self.put_back().is_err() && self.runs {
            tell!("{}", self.words);
        }
    }
}

fn set_standing(words: Option<String>) {
    if let Ok(mut standing) = STANDING.lock() {
        *standing = words;
    }
}
