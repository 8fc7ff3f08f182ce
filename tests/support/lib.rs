//! Code shared by the integration tests.

pub mod browser;
pub mod disk;
pub mod firmware;
pub mod genome;
pub mod golden;
pub mod noisy_run;
pub mod program;
#[cfg(target_os = "linux")]
pub mod pty;
pub mod robot;
pub mod structures;
#[cfg(unix)]
pub mod terminal;
pub mod tools;

pub use robot_support::{flash, full, link_robot};
