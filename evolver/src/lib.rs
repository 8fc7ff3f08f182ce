//! The program `evolver`: its command line and commands, suites of evolutions, reports, exports, and
//! the robot on a serial line.
//!
//! Evolution is the library `minimal-surprise-evolution`, and showing runs is
//! `minimal-surprise-replay`; here [`suite`] → [`report`] → [`commands`] → [`cli`] put them to use,
//! and [`robot`] and [`hil`] bring in a real robot.
#![forbid(unsafe_code)]

#[macro_use]
mod output;
pub mod bench;
pub mod cli;
pub mod commands;
pub mod exit;
pub mod hil;
pub mod program;
pub mod report;
pub mod robot;
pub mod signals;
pub mod suite;
