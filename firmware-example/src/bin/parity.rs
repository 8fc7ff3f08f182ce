//! Prints the hashes of [`firmware_example::parity`] as computed here.
//!
//! `parity.out` beside this file is what it must print.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt::{Display2Format, println};
use firmware_example::{board, parity};

#[entry]
fn main() -> ! {
    parity::run(|line| println!("{}", Display2Format(&line)));
    board::succeed()
}
