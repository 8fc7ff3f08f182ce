//! Evolution of minimal-surprise swarms, as a library.
//!
//! Data flows one way: [`settings`] → [`population`] → [`experiment`] → [`checkpoint`] →
//! [`finished_run`] and [`run_dir`] → [`reevaluation`].
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod damaged_runs;
#[cfg(feature = "files")]
pub mod evolving;
pub mod experiment;
pub mod files;
pub mod finished_run;
pub mod fitness;
pub mod generation_work;
pub mod genome_file;
pub mod limits;
#[cfg(feature = "files")]
pub mod lock;
#[cfg(feature = "files")]
pub mod new_dir;
pub mod population;
pub mod ranges;
pub mod reevaluation;
#[cfg(feature = "files")]
pub mod run_dir;
pub mod run_files;
pub mod run_hash;
pub mod run_id;
pub mod selection;
pub mod settings;
pub mod steps_hash;
pub mod text;
pub mod time_spent;
pub mod usage;
pub mod variation;
