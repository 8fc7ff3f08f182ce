#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

#[macro_use]
mod output;
pub mod bench;
pub mod cli;
pub mod commands;
pub mod data;
pub mod exit;
pub mod hil;
pub mod program;
pub mod report;
pub mod robot;
pub mod signals;
pub mod suite;
