//! Programs that are only linked, never run, so that their contents can be inspected.
//!
//! A panic calls a function that does not exist, so linking a program that contains a panic fails.
//!
//! Uses `unsafe` to declare that function, and to access the addresses that stand for a board; the
//! compiler must not know their contents.
#![no_std]
#![allow(unsafe_code)]

use core::hint::black_box;
use core::panic::PanicInfo;
use core::ptr;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use firmware_example::robot::{Board, Motion, NEIGHBOURS_MAX};
use minimal_surprise_controller::neighbours::{Detection, Neighbours};
use minimal_surprise_link::Report;

unsafe extern "C" {
    safe fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    a_panic_can_be_reached()
}

/// A register that may hold any value.
const REGISTER: *mut u32 = 0x4000_0000 as *mut u32;

/// Reads a value that the compiler does not know.
pub fn read() -> u32 {
    // SAFETY: the address of a device; this code is never run.
    unsafe { ptr::read_volatile(REGISTER) }
}

/// Forces the compiler to compute a value.
pub fn write(value: u32) {
    // SAFETY: the address of a device; this code is never run.
    unsafe { ptr::write_volatile(REGISTER, value) }
}

/// A board whose behaviour the compiler does not know.
#[derive(Debug)]
pub struct AnyBoard;

impl Board for AnyBoard {
    const CELL_MM: f32 = 100.0;

    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool {
        while read() != 0 {
            neighbours.push(Detection {
                range_mm: f32::from_bits(read()),
                bearing_rad: f32::from_bits(read()),
            });
        }
        read() != 0
    }

    fn drive(&mut self, motion: Motion) {
        write(motion as u32);
    }

    fn receive(&mut self) -> Option<u8> {
        u8::try_from(read()).ok()
    }

    fn send(&mut self, byte: u8) -> bool {
        write(byte.into());
        read() != 0
    }

    fn period_begun(&mut self) -> bool {
        read() != 0
    }

    fn sleep(&mut self) {
        read();
    }

    fn feed_watchdog(&mut self) {
        write(0);
    }

    fn restarted_by_watchdog(&self) -> bool {
        read() != 0
    }

    fn log(&mut self, report: &Report) {
        write(report.straight);
    }
}

/// A flash whose contents the compiler does not know.
#[derive(Debug)]
pub struct AnyFlash;

/// Error of a flash that has failed.
#[derive(Debug)]
pub struct AnyError;

impl NorFlashError for AnyError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for AnyFlash {
    type Error = AnyError;
}

fn result() -> Result<(), AnyError> {
    if read() == 0 { Ok(()) } else { Err(AnyError) }
}

impl ReadNorFlash for AnyFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), AnyError> {
        write(offset);
        for byte in bytes {
            *byte = read() as u8;
        }
        result()
    }

    fn capacity(&self) -> usize {
        2 * Self::ERASE_SIZE
    }
}

impl NorFlash for AnyFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), AnyError> {
        write(from);
        write(to);
        result()
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), AnyError> {
        write(offset);
        for byte in bytes {
            write((*byte).into());
        }
        result()
    }
}

#[repr(align(8))]
struct Longs {
    _bytes: [u8; 64],
}

/// Calls the compiler's functions for copying, comparing and clearing memory, which any firmware
/// contains.
#[inline(never)]
pub fn use_memory() {
    let mut bytes = [0_u8; 256];
    let mut words = [0_u32; 256];
    let mut longs = [0_u64; 256];
    let mut set = Longs { _bytes: [0xff; 64] };
    let found = AnyFlash.read(read(), &mut bytes).is_ok();
    black_box((&mut words, &mut longs, &mut set));
    let copied = (bytes, words);
    black_box(&copied);
    words.fill(0);
    bytes.fill(read() as u8);
    black_box(&words);
    write(u32::from(found) + u32::from(copied.0 == bytes));
}
