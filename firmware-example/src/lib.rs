//! Programs that run the controller on a Cortex-M4, and what they share.
//!
//! [`parity`] is portable: the host runs the same code to know what the robot must compute. The
//! other modules exist for Arm only.
#![no_std]

pub mod parity;

#[cfg(target_arch = "arm")]
pub mod board;
#[cfg(target_arch = "arm")]
pub mod instructions;
