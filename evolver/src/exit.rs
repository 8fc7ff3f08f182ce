//! Exit codes; documented for users in `docs/exit-codes.md`.

use std::process::ExitCode;

/// The exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All requested work is done.
    Done = 0,
    /// Something failed: a file, a disk, a robot, a damaged run.
    Failure = 1,
    /// The input is invalid; nothing was written.
    BadInput = 2,
    /// Some of the requested work is not done; nothing is lost, and the printed command continues
    /// the work.
    Unfinished = 3,
    /// Ended by Ctrl-C or another signal; nothing is lost.
    Interrupted = 130,
}

impl Exit {
    /// Exits the program immediately.
    pub fn now(self) -> ! {
        std::process::exit(self as i32)
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
