//! What people and other programs get to see: progress, files, and words at the end.

pub mod progress;
pub mod summary;
pub mod tables;
