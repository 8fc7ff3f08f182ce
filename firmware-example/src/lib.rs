//! Programs that run the controller on a Cortex-M4, and what they share.
//!
//! [`robot`] is the firmware of a robot, for any [`robot::Board`]. It is portable, as are [`parity`],
//! [`range_bearing`] and [`stm32f4`]: the host runs the same code to know what the robot must do.
//! [`mps2`] is QEMU's board; it and what its programs share exist for Arm only, with the feature
//! `qemu`. The STM32F405's board is a package of its own, `stm32f4/`. Every board stops its wheels by
//! `faults` when it cannot go on.
#![no_std]

pub mod memory_flash;
pub mod parity;
pub mod range_bearing;
pub mod robot;
pub mod stm32f4;

#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod board;
#[cfg(target_arch = "arm")]
pub mod faults;
#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod instructions;
#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod mps2;
#[cfg(target_arch = "arm")]
pub mod provoke;
#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod stack;
