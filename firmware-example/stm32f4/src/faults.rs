//! Functions that stop the wheels in every fault.
//!
//! Uses `unsafe` to access the wheels' registers by address.
#![allow(unsafe_code)]

use core::panic::PanicInfo;
use cortex_m::{asm, interrupt};
use defmt_rtt as _;
use firmware_example::fault_handlers;
use firmware_example::faults::{Fault, WheelsOff};

/// Registers of port C: one selects the port's program-controlled outputs, the other sets and
/// clears pins.
const GPIOC_MODER: u32 = 0x4002_0800;
const GPIOC_BSRR: u32 = 0x4002_0818;

/// Register writes that set PC6 to PC9 (speed and direction of both wheels) low and make them
/// program-controlled outputs, which disconnects the timer. All other pins of port C are unused
/// inputs, as after a reset.
// SAFETY: only the wheels' pins are affected.
static WHEELS_OFF: WheelsOff<2> =
    unsafe { WheelsOff::new([[GPIOC_BSRR, 0x03c0_0000], [GPIOC_MODER, 0x0005_5000]]) };

/// Stops the wheels and waits until the watchdog restarts the chip; the restart is reported to the
/// host.
pub(crate) fn stand() -> ! {
    interrupt::disable();
    WHEELS_OFF.write();
    loop {
        asm::nop();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    interrupt::disable();
    WHEELS_OFF.write();
    defmt::error!("{}", defmt::Display2Format(info));
    stand()
}

fn say(fault: Fault) -> ! {
    defmt::error!("{}", defmt::Display2Format(&fault));
    stand()
}

fault_handlers!(WHEELS_OFF, say);
