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
pub mod checkpoint;
pub mod cli;
pub mod commands;
pub mod damaged_runs;
pub mod evolution;
pub mod evolving;
pub mod exit;
pub mod experiment;
pub mod files;
pub mod finished_run;
pub mod generation_work;
pub mod hil;
pub mod limits;
pub mod lock;
pub mod new_dir;
mod ranges;
pub mod reevaluation;
pub mod replay;
pub mod report;
pub mod robot;
pub mod run_dir;
mod run_files;
pub mod run_hash;
pub mod settings;
pub mod signals;
pub mod steps_hash;
pub mod suite;
pub mod text;
pub mod time_spent;
pub mod usage;
