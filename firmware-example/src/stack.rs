//! How deep a piece of work goes into the stack.
//!
//! With `unsafe` code: it writes to the stack below everything that is on it, and looks what is
//! left of that.
#![allow(unsafe_code)]

use core::ptr;
use core::sync::atomic::{Ordering, compiler_fence};
use cortex_m::register::msp;

/// Bytes that are looked at; deeper work seems to have this depth.
pub const DEPTH_MAX: u32 = 8192;

/// What the stack is painted with.
const PAINT: u32 = 0x7a7a_a5a5;

/// Bytes of stack that `work` takes, what it calls included, up to [`DEPTH_MAX`]. No interrupt may
/// occur.
///
/// What counts is the deepest word that was written; a frame may reach deeper without using it.
#[inline(never)]
pub fn depth(work: &mut dyn FnMut()) -> u32 {
    let top = msp::read() & !3;
    let bottom = top - DEPTH_MAX;
    for at in (bottom..top).step_by(4) {
        // SAFETY: RAM below the stack pointer, at whose lower end this program's variables are far
        // away; nothing is there as no interrupt occurs.
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
