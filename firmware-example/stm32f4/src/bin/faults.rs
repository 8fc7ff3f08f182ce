//! Turns the wheels and provokes the fault that QEMU's command line names. The test `faults` watches
//! the wheels' registers from outside. Not for a robot: QEMU's chip has neither clock nor timers,
//! so that this is all of the firmware that it can run.
//!
//! With `unsafe` code: a register is an address.
#![no_std]
#![no_main]
#![allow(unsafe_code)]

#[path = "../faults.rs"]
mod faults;

use cortex_m_rt::entry;
use firmware_example::faults::guard_stack;
use firmware_example::provoke::provoke;
// Links the chip's interrupts.
use stm32f4xx_hal as _;

/// Setting pins of port C.
const GPIOC_BSRR: *mut u32 = 0x4002_0818 as *mut u32;
/// Both wheels ahead at full speed.
const AHEAD: u32 = 0x03c0;

#[entry]
fn main() -> ! {
    guard_stack();
    // SAFETY: a register of pins that nothing else uses.
    unsafe { core::ptr::write_volatile(GPIOC_BSRR, AHEAD) };
    provoke()
}
