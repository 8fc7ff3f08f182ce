//! The board that the robot's loop uses.

use firmware_example::range_bearing::RangeBearing;
use firmware_example::robot::{Board, Motion, NEIGHBOURS_MAX};
use minimal_surprise_controller::neighbours::Neighbours;
use minimal_surprise_link::Report;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::Tx;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::interrupts;

/// Frequency of the processor's clock: half of the chip's maximum, so that SysTick can count a
/// second.
pub(crate) const CLOCK_HZ: u32 = 84_000_000;
/// Number of control periods per second.
pub(crate) const CONTROL_HZ: u32 = 1;
/// Side of a grid cell, in mm.
pub(crate) const CELL_MM: f32 = 100.0;

/// An STM32F405 or STM32F407 with two wheels and a range-and-bearing module.
pub(crate) struct Stm32F4 {
    line: Tx<USART2>,
    watchdog: IndependentWatchdog,
    restarted_by_watchdog: bool,
    module: RangeBearing,
    /// The newest scan.
    scan: Neighbours<NEIGHBOURS_MAX>,
    /// True if the loop has not read the scan yet.
    scan_is_new: bool,
}

impl Stm32F4 {
    pub(crate) fn new(
        line: Tx<USART2>,
        watchdog: IndependentWatchdog,
        restarted_by_watchdog: bool,
    ) -> Self {
        Self {
            line,
            watchdog,
            restarted_by_watchdog,
            module: RangeBearing::new(),
            scan: Neighbours::new(),
            scan_is_new: false,
        }
    }

    /// Reads the bytes from the module. If a period has several scans, the newest one is used.
    fn take_scans(&mut self) {
        while let Some(byte) = interrupts::byte_from_module() {
            self.scan_is_new |= self.module.feed(byte, &mut self.scan);
        }
    }
}

impl Board for Stm32F4 {
    const CELL_MM: f32 = CELL_MM;

    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool {
        self.take_scans();
        if self.scan_is_new {
            for &detection in self.scan.detections() {
                neighbours.push(detection);
            }
        }
        core::mem::take(&mut self.scan_is_new)
    }

    fn drive(&mut self, motion: Motion) {
        interrupts::drive(motion);
    }

    fn receive(&mut self) -> Option<u8> {
        // `receive` is called more often than once per period, so the module's bytes do not
        // accumulate.
        self.take_scans();
        interrupts::byte_from_line()
    }

    fn send(&mut self, byte: u8) -> bool {
        self.line.write(byte).is_ok()
    }

    fn period_begun(&mut self) -> bool {
        interrupts::take_period()
    }

    fn sleep(&mut self) {
        interrupts::sleep();
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn restarted_by_watchdog(&self) -> bool {
        self.restarted_by_watchdog
    }

    fn log(&mut self, report: &Report) {
        defmt::info!("{}", report);
    }
}
