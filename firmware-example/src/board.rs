//! The emulated board: how a program ends there.
//!
//! Linking this module also brings in the logger and the critical section that it needs.
//!
//! The one module of this package with `unsafe` code: the runtime asks for an `unsafe fn` as
//! handler of hard faults. It touches nothing that could be unsound.
#![allow(unsafe_code)]

use core::panic::PanicInfo;
use cortex_m as _;
use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, ExitStatus, exit};
use defmt_semihosting as _;

/// Ends the emulator: the program did what it should.
pub fn succeed() -> ! {
    end(EXIT_SUCCESS)
}

/// Ends the emulator: the program cannot go on. What is wrong has been logged.
pub fn fail() -> ! {
    end(EXIT_FAILURE)
}

fn end(status: ExitStatus) -> ! {
    loop {
        exit(status);
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    end(EXIT_FAILURE)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}", frame.pc());
    end(EXIT_FAILURE)
}
