//! The `with` program, without its controller.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use probe::use_memory;

#[entry]
fn main() -> ! {
    loop {
        use_memory();
    }
}
