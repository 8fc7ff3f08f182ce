//! The board of QEMU's machine `mps2-an386`: serial line, clock, and flash in a file on the host.
//!
//! Two lights represent the wheels, and the sensors detect one simulated neighbour. The host
//! controls the robot with step requests.
//!
//! Uses `unsafe` to access device registers and to pass semihosting arguments by address.
#![allow(unsafe_code)]

use crate::emulator::WHEELS;
use crate::faults::guard_stack;
use crate::robot::{Board, Motion, NEIGHBOURS_MAX};
use core::ptr;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, SCB, SYST};
use cortex_m::{asm, interrupt};
use cortex_m_semihosting::{nr, syscall};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};
use minimal_surprise_controller::neighbours::{Detection, Neighbours};
use minimal_surprise_link::Report;

/// Frequency of the processor's clock.
const CLOCK_HZ: u32 = 25_000_000;
/// Number of control periods per second.
pub const CONTROL_HZ: u32 = 10;

/// Registers of the serial line, the first UART of Arm's CMSDK.
mod uart {
    /// The received byte (when read) or the byte to send (when written).
    pub(super) const DATA: *mut u32 = 0x4000_4000 as *mut u32;
    /// Status bits: a byte was received; the transmit buffer is full.
    pub(super) const STATE: *mut u32 = 0x4000_4004 as *mut u32;
    pub(super) const STATE_SENDING: u32 = 1;
    pub(super) const STATE_RECEIVED: u32 = 1 << 1;
    pub(super) const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
    pub(super) const CONTROL_SEND: u32 = 1;
    pub(super) const CONTROL_RECEIVE: u32 = 1 << 1;
    pub(super) const CONTROL_RECEIVE_INTERRUPT: u32 = 1 << 3;
    pub(super) const INTERRUPT: *mut u32 = 0x4000_400c as *mut u32;
    pub(super) const INTERRUPT_RECEIVED: u32 = 1 << 1;
    pub(super) const DIVIDER: *mut u32 = 0x4000_4010 as *mut u32;
}

/// Speed of the serial line, in bits per second; QEMU accepts any speed.
const BAUD: u32 = 115_200;

/// The interrupt that signals a received byte.
#[derive(Clone, Copy)]
struct Received;

// SAFETY: the machine's interrupt 0 is the interrupt of the first UART's receiver.
unsafe impl InterruptNumber for Received {
    fn number(self) -> u16 {
        0
    }
}

/// QEMU's board: serial line and clock.
///
/// No interrupt handler ever runs: interrupts only wake the processor, and the loop polls.
pub struct Mps2 {
    systick: SYST,
    periods: u32,
}

impl Mps2 {
    /// Starts the clock and the serial line.
    #[must_use]
    pub fn new(mut systick: SYST) -> Self {
        guard_stack();
        interrupt::disable();
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(CLOCK_HZ / CONTROL_HZ - 1);
        systick.clear_current();
        systick.enable_interrupt();
        systick.enable_counter();
        // SAFETY: writes registers of a device that no other code uses. The interrupt is masked.
        unsafe {
            ptr::write_volatile(uart::DIVIDER, CLOCK_HZ / BAUD);
            let control =
                uart::CONTROL_SEND | uart::CONTROL_RECEIVE | uart::CONTROL_RECEIVE_INTERRUPT;
            ptr::write_volatile(uart::CONTROL, control);
            NVIC::unmask(Received);
        }
        Self {
            systick,
            periods: 0,
        }
    }
}

fn uart_state() -> u32 {
    // SAFETY: reading this device register has no side effects.
    unsafe { ptr::read_volatile(uart::STATE) }
}

impl Board for Mps2 {
    const CELL_MM: f32 = 100.0;

    /// Adds one neighbour that circles the robot.
    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool {
        self.periods = self.periods.wrapping_add(1);
        let eighths = (self.periods / CONTROL_HZ % 8) as f32;
        neighbours.push(Detection {
            range_mm: Self::CELL_MM,
            bearing_rad: eighths * core::f32::consts::FRAC_PI_4,
        });
        true
    }

    fn drive(&mut self, motion: Motion) {
        let turning = match motion {
            Motion::Stop => 0b00,
            Motion::Ahead => 0b11,
            Motion::Left => 0b10,
            Motion::Right => 0b01,
        };
        // SAFETY: writes a register that only controls lights.
        unsafe { ptr::write_volatile(WHEELS as *mut u32, turning) };
    }

    fn receive(&mut self) -> Option<u8> {
        if uart_state() & uart::STATE_RECEIVED == 0 {
            return None;
        }
        // SAFETY: reads device registers; reading the data register consumes the byte.
        let data = unsafe {
            ptr::write_volatile(uart::INTERRUPT, uart::INTERRUPT_RECEIVED);
            ptr::read_volatile(uart::DATA)
        };
        NVIC::unpend(Received);
        Some(data as u8)
    }

    fn send(&mut self, byte: u8) -> bool {
        if uart_state() & uart::STATE_SENDING != 0 {
            return false;
        }
        // SAFETY: writes a device register, which sends the byte.
        unsafe { ptr::write_volatile(uart::DATA, byte.into()) };
        true
    }

    fn period_begun(&mut self) -> bool {
        let begun = self.systick.has_wrapped();
        if begun {
            SCB::clear_pendst();
        }
        begun
    }

    fn sleep(&mut self) {
        // A pending interrupt ends the wait immediately, so no byte that arrived in the meantime is
        // missed.
        asm::wfi();
    }

    /// Does nothing: the machine's watchdog is not used, because a debugger would have to feed it.
    fn feed_watchdog(&mut self) {}

    fn restarted_by_watchdog(&self) -> bool {
        false
    }

    fn log(&mut self, report: &Report) {
        defmt::info!("{}", report);
    }
}

/// Flash in the file `flash.bin`, in the directory where QEMU was started. Data that has been
/// written is kept if QEMU is killed.
///
/// The flash is as strict as real flash: it has 4-byte words and 4-KiB pages, and no word may be
/// written twice between erases.
#[derive(Debug)]
pub struct FileFlash {
    handle: usize,
}

/// The reason why an access to the flash failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum FileError {
    /// The access is out of bounds or not aligned.
    Place(#[defmt(Debug2Format)] NorFlashErrorKind),
    /// The host's operating system reports an error.
    Host,
    /// The word to write is not erased.
    WrittenTwice,
}

impl NorFlashError for FileError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place(kind) => *kind,
            Self::Host | Self::WrittenTwice => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for FileError {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self::Place(kind)
    }
}

/// Number of bytes erased by one write to the file; QEMU may be killed between two of these writes.
const ERASE_STEP: usize = 512;

impl FileFlash {
    /// Size of the flash, in bytes: two slots.
    pub const CAPACITY: usize = 2 * Self::ERASE_SIZE;

    /// Opens the file; creates it in the factory state if it does not exist.
    ///
    /// # Errors
    /// [`FileError::Host`] if the host cannot open or write the file.
    pub fn open() -> Result<Self, FileError> {
        let handle = match host_open(nr::open::RW_BINARY) {
            None => host_open(nr::open::RW_TRUNC_BINARY),
            handle => handle,
        };
        let mut flash = Self {
            handle: handle.ok_or(FileError::Host)?,
        };
        // SAFETY: the host reads the handle.
        let length = unsafe { syscall!(FLEN, flash.handle) };
        flash.host_fill(length.min(Self::CAPACITY), Self::CAPACITY)?;
        Ok(flash)
    }

    fn host_seek(&mut self, at: usize) -> Result<(), FileError> {
        // SAFETY: the host reads the handle.
        match unsafe { syscall!(SEEK, self.handle, at) } {
            0 => Ok(()),
            _ => Err(FileError::Host),
        }
    }

    fn host_read(&mut self, at: usize, bytes: &mut [u8]) -> Result<(), FileError> {
        self.host_seek(at)?;
        // SAFETY: the host writes to the bytes, within their length.
        match unsafe { syscall!(READ, self.handle, bytes.as_mut_ptr(), bytes.len()) } {
            0 => Ok(()),
            _ => Err(FileError::Host),
        }
    }

    fn host_write(&mut self, at: usize, bytes: &[u8]) -> Result<(), FileError> {
        self.host_seek(at)?;
        // SAFETY: the host reads the bytes, within their length.
        match unsafe { syscall!(WRITE, self.handle, bytes.as_ptr(), bytes.len()) } {
            0 => Ok(()),
            _ => Err(FileError::Host),
        }
    }

    fn host_fill(&mut self, from: usize, to: usize) -> Result<(), FileError> {
        for at in (from..to).step_by(ERASE_STEP) {
            let bytes = [0xff; ERASE_STEP];
            self.host_write(at, &bytes[..ERASE_STEP.min(to - at)])?;
        }
        Ok(())
    }
}

fn host_open(mode: usize) -> Option<usize> {
    let name = c"flash.bin".to_bytes_with_nul();
    // SAFETY: the host reads the name, which ends with a zero byte, and its length, which excludes
    // that byte.
    let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, name.len() - 1) };
    (handle != usize::MAX).then_some(handle)
}

impl ErrorType for FileFlash {
    type Error = FileError;
}

impl ReadNorFlash for FileFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FileError> {
        check_read(self, offset, bytes.len())?;
        self.host_read(offset as usize, bytes)
    }

    fn capacity(&self) -> usize {
        Self::CAPACITY
    }
}

impl NorFlash for FileFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FileError> {
        check_erase(self, from, to)?;
        self.host_fill(from as usize, to as usize)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FileError> {
        check_write(self, offset, bytes.len())?;
        for (index, word) in bytes.chunks(Self::WRITE_SIZE).enumerate() {
            let at = offset as usize + index * Self::WRITE_SIZE;
            let mut before = [0; Self::WRITE_SIZE];
            self.host_read(at, &mut before)?;
            if before != [0xff; Self::WRITE_SIZE] {
                return Err(FileError::WrittenTwice);
            }
            self.host_write(at, word)?;
        }
        Ok(())
    }
}
