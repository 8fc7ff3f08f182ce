//! What the integration tests share.

pub mod firmware;
pub mod golden;
pub mod program;
pub mod structures;
pub mod tools;
