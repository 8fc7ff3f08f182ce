//! Suites: many evolutions described as data, the paper's among them.
//!
//! A suite is a TOML file. Every combination of the values that an experiment lists is run `runs`
//! times. [`plan`] makes runs with names of it, [`work`] does one of them, [`worker`] does those that
//! are not done, [`search`] evolves further seeds until a wanted structure forms, [`status`] counts.
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
