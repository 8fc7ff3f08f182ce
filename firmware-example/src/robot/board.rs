//! What a robot's electronics must offer.

use minimal_surprise_controller::neighbours::Neighbours;
use minimal_surprise_link::Report;

/// Most neighbours that are kept in one period.
pub const NEIGHBOURS_MAX: usize = 16;

/// What the wheels do until they are told something else.
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

/// A robot's electronics, but for its flash. No function waits, except [`Board::sleep`].
pub trait Board {
    /// Side of a grid cell, in mm.
    const CELL_MM: f32;

    /// Adds the neighbours detected since the last call; says whether the detector has delivered
    /// anything since then. If it has, and nothing was added, there is no neighbour.
    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool;

    /// Sets the motors.
    fn drive(&mut self, motion: Motion);

    /// The next byte from the line, if one has arrived.
    fn receive(&mut self) -> Option<u8>;

    /// Puts a byte on the line; says whether there was room for it.
    fn send(&mut self, byte: u8) -> bool;

    /// Whether another control period has begun since the last call.
    fn period_begun(&mut self) -> bool;

    /// Waits until a byte arrives or a control period begins; may return early.
    fn sleep(&mut self);

    /// Puts off the restart by the watchdog.
    fn feed_watchdog(&mut self);

    /// Whether the watchdog has caused the last restart.
    fn restarted_by_watchdog(&self) -> bool;

    /// Logs how it is going.
    fn log(&mut self, report: &Report);
}
