//! Programs that run the controller on a Cortex-M4, and the code that they share.
//!
//! [`robot`] is the firmware of a robot, for any [`robot::Board`]. It is portable, as are
//! [`parity`], [`range_bearing`] and [`stm32f4`]: the host runs the same code to compute the
//! expected results of the robot. [`mps2`] is QEMU's board; the board and the code shared by its
//! programs are built only for Arm, with the feature `qemu`. The STM32F405's board is a separate
//! package, `stm32f4/`. Every board uses `faults` to stop its wheels when it cannot continue.
#![no_std]

pub mod memory_flash;
pub mod parity;
pub mod range_bearing;
pub mod robot;
pub mod stm32f4;

#[cfg(all(target_arch = "arm", feature = "qemu"))]
pub mod emulator;
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
