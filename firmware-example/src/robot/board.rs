//! What a robot's electronics must provide.

use minimal_surprise_controller::neighbours::Neighbours;
use minimal_surprise_link::Report;

/// Maximum number of neighbours kept in one period.
pub const NEIGHBOURS_MAX: usize = 16;

/// What the wheels do until the next command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// They stand.
    Stop,
    /// One cell ahead.
    Ahead,
    /// A quarter turn to the left.
    Left,
    /// A quarter turn to the right.
    Right,
}

/// A robot's electronics, except its flash. No function waits, except [`Board::sleep`].
pub trait Board {
    /// Side of a grid cell, in mm.
    const CELL_MM: f32;

    /// Adds the neighbours detected since the last call; returns whether the detector has delivered
    /// data since then. If it has, and nothing was added, there is no neighbour.
    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool;

    /// Sets the motors.
    fn drive(&mut self, motion: Motion);

    /// Returns the next byte from the line, if one has arrived.
    fn receive(&mut self) -> Option<u8>;

    /// Puts a byte on the line; returns whether there was room for it.
    fn send(&mut self, byte: u8) -> bool;

    /// Returns whether another control period has begun since the last call.
    fn period_begun(&mut self) -> bool;

    /// Waits until a byte arrives or a control period begins; may return early.
    fn sleep(&mut self);

    /// Feeds the watchdog, which postpones its restart of the robot.
    fn feed_watchdog(&mut self);

    /// Returns whether the watchdog has caused the last restart.
    fn restarted_by_watchdog(&self) -> bool;

    /// Logs a status report.
    fn log(&mut self, report: &Report);
}
