//! Turns the wheels and triggers the fault named on QEMU's command line. The `faults` test observes
//! the wheels' registers from outside the emulator. Do not flash this program to a robot. QEMU
//! emulates neither the clocks nor the timers of the chip, so it cannot run the rest of the
//! firmware.
//!
//! Uses `unsafe` to access a register by address.
#![no_std]
#![no_main]
#![allow(unsafe_code)]

#[path = "../faults.rs"]
mod faults;

use cortex_m_rt::entry;
use firmware_example::faults::guard_stack;
use firmware_example::provoke::provoke;
// Links the chip's interrupt table.
use stm32f4xx_hal as _;

/// The register that sets pins of port C.
const GPIOC_BSRR: *mut u32 = 0x4002_0818 as *mut u32;
/// Both wheels ahead at full speed.
const AHEAD: u32 = 0x03c0;

#[entry]
fn main() -> ! {
    guard_stack();
    // SAFETY: writes a register of pins that no other code uses.
    unsafe { core::ptr::write_volatile(GPIOC_BSRR, AHEAD) };
    provoke()
}
