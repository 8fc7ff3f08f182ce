//! An unchecked index. Must not link; otherwise, linking the other program would prove nothing.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use minimal_surprise_controller::activation::SEGMENTS;
use probe::{read, write};

#[entry]
fn main() -> ! {
    loop {
        let [c0, ..] = SEGMENTS[read() as usize];
        write(c0 as u32);
    }
}
