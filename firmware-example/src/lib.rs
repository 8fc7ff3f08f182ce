//! Programs that run the controller on a Cortex-M4, and what they share.
//!
//! [`robot`] is the firmware of a robot, for any [`robot::Board`]. It is portable, as is [`parity`]:
//! the host runs the same code to know what the robot must do. The other modules exist for Arm only.
#![no_std]

pub mod parity;
pub mod robot;

#[cfg(target_arch = "arm")]
pub mod board;
#[cfg(target_arch = "arm")]
pub mod instructions;
#[cfg(target_arch = "arm")]
pub mod mps2;
