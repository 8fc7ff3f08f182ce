//! Prints the hashes of [`firmware_example::parity`], computed on the emulated robot.
//!
//! The output must equal `parity.out` in this directory.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt::{Display2Format, println};
use firmware_example::{emulator, parity};

#[entry]
fn main() -> ! {
    parity::run(|line| println!("{}", Display2Format(&line)));
    emulator::succeed()
}
