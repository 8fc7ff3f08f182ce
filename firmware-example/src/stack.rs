//! Measurement of the stack that a function uses.
//!
//! Uses `unsafe` to write to the unused stack and to check later which words have changed.
#![allow(unsafe_code)]

use core::ptr;
use core::sync::atomic::{Ordering, compiler_fence};
use cortex_m::register::msp;

/// Number of stack bytes that are checked; a larger depth is reported as this number.
pub const DEPTH_MAX: u32 = 8192;

/// The pattern written to the unused stack.
const PAINT: u32 = 0x7a7a_a5a5;

/// Returns the number of stack bytes, up to [`DEPTH_MAX`], that are used by `work` and the
/// functions it calls. Interrupts must be disabled.
///
/// The measured depth ends at the deepest word written; a frame may extend deeper than that without
/// writing there.
#[inline(never)]
pub fn depth(work: &mut dyn FnMut()) -> u32 {
    let top = msp::read() & !3;
    let bottom = top - DEPTH_MAX;
    for at in (bottom..top).step_by(4) {
        // SAFETY: writes RAM below the stack pointer, far from this program's variables; nothing
        // else uses it, since interrupts are disabled.
        unsafe { ptr::write_volatile(at as *mut u32, PAINT) };
    }
    compiler_fence(Ordering::SeqCst);
    work();
    compiler_fence(Ordering::SeqCst);
    for at in (bottom..top).step_by(4) {
        // SAFETY: as above.
        if unsafe { ptr::read_volatile(at as *const u32) } != PAINT {
            return top - at;
        }
    }
    0
}
