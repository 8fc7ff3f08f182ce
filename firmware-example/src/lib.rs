//! Programs that run the controller on a Cortex-M4, and what they share.
//!
//! [`robot`] is the firmware of a robot, for any [`robot::Board`]. It is portable, as is [`parity`]:
//! the host runs the same code to know what the robot must do. The other modules exist for
//! Arm only, with the feature `qemu`.
#![no_std]

pub mod memory_flash;
pub mod parity;
pub mod robot;

#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod board;
#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod instructions;
#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod mps2;
#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod stack;
