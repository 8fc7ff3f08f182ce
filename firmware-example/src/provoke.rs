//! Triggers faults to check that the wheels stop. Used by the `faults` programs, only under QEMU.
//!
//! Uses `unsafe`, because safe code cannot cause faults.
#![allow(unsafe_code)]

use core::arch::asm;
use core::hint::black_box;
use core::ptr;

/// The semihosting call that reads the command line.
const GET_COMMAND_LINE: u32 = 0x15;
/// The processor's register of pending exceptions, and its bit for the non-maskable interrupt.
const INTERRUPT_STATE: *mut u32 = 0xe000_ed04 as *mut u32;
const NON_MASKABLE_PENDING: u32 = 1 << 31;
/// Registers that enable and trigger interrupts 0 to 31.
const INTERRUPTS_ENABLE: *mut u32 = 0xe000_e100 as *mut u32;
const INTERRUPTS_PENDING: *mut u32 = 0xe000_e200 as *mut u32;
/// An interrupt without a handler in these programs.
const UNEXPECTED: u32 = 1 << 20;
/// An address below RAM, where access is forbidden.
const BELOW_RAM: *mut u32 = 0x1fff_fff0 as *mut u32;
/// Address of processor registers; execution is not allowed there.
const NO_PROGRAM: u32 = 0xe000_0001;

/// Triggers the fault named by the second word of the program's command line, with interrupts
/// masked, as if it occurred while the wheels are being set.
///
/// # Panics
/// If the named fault is a panic, is unknown or does not occur.
pub fn provoke() -> ! {
    let mut line = [0_u8; 64];
    let room: [u32; 2] = [line.as_mut_ptr() as u32, line.len() as u32];
    // SAFETY: the host writes the line, which fits in the buffer, and its length.
    unsafe {
        asm!("bkpt #0xab", inout("r0") GET_COMMAND_LINE => _, in("r1") room.as_ptr());
        asm!("cpsid i");
    }
    let line = core::str::from_utf8(&line).unwrap_or("");
    let fault = line.trim_end_matches('\0').split(' ').nth(1);
    // SAFETY: deliberately unsound; the handlers do not return.
    unsafe {
        match fault {
            Some("panic") => panic!("on purpose"),
            Some("undefined-instruction") => asm!("udf #0"),
            Some("write-below-ram") => ptr::write_volatile(BELOW_RAM, 1),
            Some("jump-to-no-program") => asm!("bx {}", in(reg) NO_PROGRAM),
            Some("non-maskable-interrupt") => {
                ptr::write_volatile(INTERRUPT_STATE, NON_MASKABLE_PENDING);
            }
            Some("unexpected-interrupt") => {
                ptr::write_volatile(INTERRUPTS_ENABLE, UNEXPECTED);
                ptr::write_volatile(INTERRUPTS_PENDING, UNEXPECTED);
                asm!("cpsie i");
            }
            Some("deep-recursion") => drop(black_box(recurse::<4>(1))),
            Some("large-frames") => drop(black_box(recurse::<1024>(1))),
            _ => panic!("unknown fault: {line}"),
        }
        asm!("dsb", "isb");
    }
    panic!("the fault did not occur")
}

#[inline(never)]
#[expect(unconditional_recursion)]
fn recurse<const WORDS: usize>(depth: u32) -> u32 {
    let frame = black_box([depth; WORDS]);
    recurse::<WORDS>(depth + 1) + black_box(frame[WORDS - 1])
}
