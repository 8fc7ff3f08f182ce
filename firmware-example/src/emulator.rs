//! The emulator: functions that exit a program, and the board's wheels.
//!
//! Linking this module also links the logger and the critical section that the logger needs.
//!
//! Uses `unsafe` to access the wheels' register by address.
#![allow(unsafe_code)]

use crate::faults::{Fault, WheelsOff};
use core::panic::PanicInfo;
use cortex_m as _;
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, ExitStatus, exit};
use defmt_semihosting as _;

/// Exits the emulator with a success status.
pub fn succeed() -> ! {
    end(EXIT_SUCCESS)
}

/// Exits the emulator with a failure status. Call it after logging the error.
pub fn fail() -> ! {
    end(EXIT_FAILURE)
}

fn end(status: ExitStatus) -> ! {
    loop {
        exit(status);
    }
}

/// Register of the board's lights, which represent the left wheel (bit 0) and the right wheel (bit
/// 1).
pub(crate) const WHEELS: u32 = 0x4002_8000;

// SAFETY: a register that only controls lights.
static WHEELS_OFF: WheelsOff<1> = unsafe { WheelsOff::new([[WHEELS, 0]]) };

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    WHEELS_OFF.write();
    defmt::error!("{}", defmt::Display2Format(info));
    end(EXIT_FAILURE)
}

fn say(fault: Fault) -> ! {
    defmt::error!("{}", defmt::Display2Format(&fault));
    end(EXIT_FAILURE)
}

crate::fault_handlers!(WHEELS_OFF, say);
