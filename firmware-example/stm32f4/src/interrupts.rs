//! Interrupts for events during the loop: received bytes and the start of control periods.
//!
//! Uses `unsafe` to unmask interrupts; this accesses no memory.
#![allow(unsafe_code)]

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::asm;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use critical_section::Mutex;
use firmware_example::robot::Motion;
use heapless::Deque;
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{Interrupt, USART2, USART3, interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Instance, Rx};

use crate::wheels::Wheels;

/// Maximum number of bytes stored until the loop reads them; larger than a frame on either line.
/// Further bytes are lost, as if they had been damaged on the line.
const BYTES_MAX: usize = 256;

/// State shared by the loop and the interrupts; `None` until initialised.
type Shared<T> = Mutex<RefCell<Option<T>>>;

/// A serial line's receiver and the bytes received.
struct Receiver<U: Instance> {
    rx: Rx<U>,
    bytes: Deque<u8, BYTES_MAX>,
}

static LINE: Shared<Receiver<USART2>> = Mutex::new(RefCell::new(None));
static MODULE: Shared<Receiver<USART3>> = Mutex::new(RefCell::new(None));
static WHEELS: Shared<Wheels> = Mutex::new(RefCell::new(None));
static PERIOD_BEGUN: AtomicBool = AtomicBool::new(false);

/// Accesses the shared state with interrupts disabled.
fn with<T, R>(shared: &Shared<T>, work: impl FnOnce(&mut T) -> R) -> Option<R> {
    critical_section::with(|section| {
        let mut shared = shared.borrow(section).try_borrow_mut().ok()?;
        shared.as_mut().map(work)
    })
}

fn put<T>(shared: &Shared<T>, value: T) {
    critical_section::with(|section| shared.borrow(section).replace(Some(value)));
}

/// Takes ownership of the wheels and stops them.
pub(crate) fn take_wheels(wheels: Wheels) {
    put(&WHEELS, wheels);
    drive(Motion::Stop);
}

/// Sets the motion of the wheels.
pub(crate) fn drive(motion: Motion) {
    with(&WHEELS, |wheels| wheels.drive(motion));
}

/// Starts receiving from the host's line and the range-and-bearing module.
pub(crate) fn listen(mut line: Rx<USART2>, mut module: Rx<USART3>) {
    line.listen();
    module.listen();
    put(&LINE, Receiver::new(line));
    put(&MODULE, Receiver::new(module));
    // SAFETY: nothing relies on these interrupts being masked; they access shared state only
    // through `with`.
    unsafe {
        NVIC::unmask(Interrupt::USART2);
        NVIC::unmask(Interrupt::USART3);
    }
}

/// Returns the next byte from the host, if one has arrived.
pub(crate) fn byte_from_line() -> Option<u8> {
    with(&LINE, |line| line.bytes.pop_front()).flatten()
}

/// Returns the next byte from the range-and-bearing module, if one has arrived.
pub(crate) fn byte_from_module() -> Option<u8> {
    with(&MODULE, |module| module.bytes.pop_front()).flatten()
}

/// Returns true if a control period has begun since the last call.
pub(crate) fn take_period() -> bool {
    PERIOD_BEGUN.swap(false, Ordering::Relaxed)
}

/// Waits for an interrupt, unless an event is already pending.
pub(crate) fn sleep() {
    critical_section::with(|_| {
        let nothing = |bytes: Option<bool>| bytes.unwrap_or(true);
        let idle = nothing(with(&LINE, |line| line.bytes.is_empty()))
            && nothing(with(&MODULE, |module| module.bytes.is_empty()))
            && !PERIOD_BEGUN.load(Ordering::Relaxed);
        if idle {
            // An interrupt wakes the processor here and is handled after the critical section, so
            // no interrupt is handled between the check and the sleep.
            asm::wfi();
        }
    });
}

impl<U: Instance> Receiver<U> {
    fn new(rx: Rx<U>) -> Self {
        let bytes = Deque::new();
        Self { rx, bytes }
    }

    fn receive(&mut self) {
        loop {
            match self.rx.read() {
                Ok(byte) => {
                    // If the buffer is full, the byte is lost, and the frame's CRC detects the
                    // loss.
                    let _ = self.bytes.push_back(byte);
                }
                Err(nb::Error::WouldBlock) => return,
                // A damaged byte is lost too; reading it has cleared the error.
                Err(nb::Error::Other(_)) => {}
            }
        }
    }
}

#[interrupt]
fn USART2() {
    with(&LINE, Receiver::receive);
}

#[interrupt]
fn USART3() {
    with(&MODULE, Receiver::receive);
}

/// Begins a control period. Stops the wheels if they have received no command for a whole period,
/// since the watchdog would take seconds to stop them.
#[exception]
fn SysTick() {
    if PERIOD_BEGUN.swap(true, Ordering::Relaxed) {
        drive(Motion::Stop);
    }
}
