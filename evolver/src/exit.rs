//! How the program ends; `docs/exit-codes.md` is the table for users.

use std::process::ExitCode;

/// The exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All that was asked is done.
    Done = 0,
    /// Something broke: a file, a disk, a robot, a damaged run.
    Failure = 1,
    /// What was given cannot be used; nothing was written.
    BadInput = 2,
    /// Not all that was asked is done; nothing is lost, and the command that was printed goes on.
    Unfinished = 3,
    /// Ended by Ctrl-C or another signal; nothing is lost.
    Interrupted = 130,
}

impl Exit {
    /// Ends the program at once.
    pub fn now(self) -> ! {
        std::process::exit(self as i32)
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
