//! What the integration tests share.

pub mod firmware;
pub mod golden;
pub mod program;
pub mod tools;
