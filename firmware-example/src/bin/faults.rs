//! Turns the wheels (lights on this board) and triggers the fault named on QEMU's command line. The
//! `faults` test observes the wheels from outside the emulator.
#![no_std]
#![no_main]

use cortex_m::Peripherals;
use cortex_m_rt::entry;
use firmware_example::mps2::Mps2;
use firmware_example::provoke::provoke;
use firmware_example::robot::{Board, Motion};

#[entry]
fn main() -> ! {
    let peripherals = Peripherals::take().expect("first call");
    Mps2::new(peripherals.SYST).drive(Motion::Ahead);
    provoke()
}
