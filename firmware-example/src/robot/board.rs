//! The functions that a robot's electronics must provide.

use minimal_surprise_controller::neighbours::Neighbours;
use minimal_surprise_link::Report;

/// Maximum number of neighbours kept in one period.
pub const NEIGHBOURS_MAX: usize = 16;

/// Motion of the robot until the next command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// No motion.
    Stop,
    /// A move of one cell ahead.
    Ahead,
    /// A quarter turn to the left.
    Left,
    /// A quarter turn to the right.
    Right,
}

/// A robot's electronics, except its flash. Only [`Board::sleep`] waits.
pub trait Board {
    /// Side of a grid cell, in mm.
    const CELL_MM: f32;

    /// Adds the neighbours detected since the last call; returns true if the detector has delivered
    /// data since then. If it returns true without adding a neighbour, none is in range.
    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool;

    /// Sets the motors.
    fn drive(&mut self, motion: Motion);

    /// Returns the next byte from the line, if one has arrived.
    fn receive(&mut self) -> Option<u8>;

    /// Sends a byte on the line; returns false if the transmit buffer is full.
    fn send(&mut self, byte: u8) -> bool;

    /// Returns true if a new control period has begun since the last call.
    fn period_begun(&mut self) -> bool;

    /// Waits until a byte arrives or a control period begins; may return early.
    fn sleep(&mut self);

    /// Feeds the watchdog, so that it does not restart the robot.
    fn feed_watchdog(&mut self);

    /// Returns true if the watchdog caused the last restart.
    fn restarted_by_watchdog(&self) -> bool;

    /// Logs a status report.
    fn log(&mut self, report: &Report);
}
