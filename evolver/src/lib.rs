//! Evolution of minimal-surprise swarms on the host: the genetic algorithm, experiments, run
//! directories, and the command line `evolver`.
//!
//! Data flows one way: [`settings`] → [`evolution`] → [`experiment`] → [`checkpoint`],
//! [`finished_run`] and [`run_dir`] → [`reevaluation`], [`hil`], [`replay`] and [`suite`] →
//! [`report`] → [`commands`] → [`cli`]. Beside it: [`robot`], a robot on a serial line.
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
