//! A robot that is stopped for some work and restored to its former state afterwards.

use super::{Robot, RobotError};
use std::sync::Mutex;

/// The message to print if the program exits while a robot is stopped.
static STANDING: Mutex<Option<String>> = Mutex::new(None);

/// The state of the robot after the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Afterwards {
    /// Running if the work succeeded, otherwise unchanged.
    Runs,
    /// Unchanged, but with the controller reset, because the work has used it.
    StartsAnew,
}

/// Returns the message to print if the program exits now: it states that a robot is stopped and
/// names the command that starts the robot.
#[must_use]
pub fn standing() -> Option<String> {
    STANDING.lock().ok().and_then(|words| words.clone())
}

impl Robot {
    /// Stops the robot for some work. Afterwards, even after an interruption or a panic, the robot
    /// is in its former state, or [`RobotError::left`] describes its state and names
    /// `start_command` as the command that starts it.
    ///
    /// # Errors
    /// [`RobotError`] if the robot cannot be stopped, the work fails, or the state cannot be
    /// restored.
    pub fn while_stopped<T>(
        &mut self,
        afterwards: Afterwards,
        start_command: &str,
        work: impl FnOnce(&mut Self) -> Result<T, RobotError>,
    ) -> Result<T, RobotError> {
        let was_running = self.identity.running;
        let words = format!("the robot may still be stopped; start it with: {start_command}");
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
            // Report the first error, since it caused the others.
            let mut error = done.err().unwrap_or(error);
            error.left = held.runs.then(|| held.words.clone());
            done = Err(error);
        }
        done
    }
}

struct Held<'r> {
    robot: &'r mut Robot,
    /// True if the robot should run afterwards.
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
            // Use a new conversation, since the robot may have restarted.
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
    /// Restores the robot's state after a panic.
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
