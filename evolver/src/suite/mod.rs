//! Suites: many evolutions described as data, including the paper's.
//!
//! A suite is a TOML file. Every combination of an experiment's listed values is run `runs` times.
//! [`plan`] converts a suite into named runs, [`work`] executes one run, [`worker`] executes all
//! runs that are not complete, [`search`] evolves further seeds until a wanted structure forms, and
//! [`status`] counts the completed runs.
//!
//! ```toml
//! name = "densities"
//!
//! [[experiment]]
//! name = "sparse-and-dense"
//! runs = 5
//! grids = ["15x15", "20x20"]
//! robots = [50, 100]
//! ```

pub mod cluster;
mod experiment;
mod file;
pub mod plan;
pub mod report;
pub mod search;
pub mod slurm;
pub mod status;
pub mod work;
pub mod worker;

pub use experiment::ExperimentTable;
pub use file::{PAPER, Reevaluation, Reference, Resilience, Suite, SuiteError};
