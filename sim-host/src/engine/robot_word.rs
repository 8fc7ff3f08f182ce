//! A robot as one word: all of its properties that affect the world.
//!
//! ```text
//! bits 0–13   x
//! bits 14–27  y
//! bit  28     zero
//! bits 29–30  heading
//! bit  31     last action, 1 = turn
//! ```
//!
//! A turn is an addition at bit 29; a carry out of bit 30 changes the action, which is overwritten
//! in the same step. Two swarms are in the same state if and only if their words are equal.

use crate::torus::{Heading, Pose};
use minimal_surprise_controller::{Action, Turn};

const COORDINATE_BITS: u32 = 14;
const COORDINATE: u32 = (1 << COORDINATE_BITS) - 1;
/// Bits of both coordinates.
pub(super) const POSITION: u32 = (1 << (2 * COORDINATE_BITS)) - 1;
/// Lowest bit of the heading: set if the robot faces north or south.
pub(super) const HEADING_SHIFT: u32 = 29;
/// Bit of the last action.
pub(super) const ACTION: u32 = 1 << 31;

const _: () = assert!(crate::torus::SIDE_MAX == 1 << COORDINATE_BITS);

/// Number of robots processed at once. The robot words are padded to a multiple of it.
pub(super) const ROBOTS_AT_ONCE: usize = 16;

/// An action as the top byte of the addend for a robot word: bit 7 is the action, bits 5 and 6 are
/// the turn (0, 1 or 3 quarter turns), and bit 0 is set until the entry is computed.
pub(super) type Entry = u8;

/// Number of bits that an entry is shifted by when it is added to a robot word.
pub(super) const ENTRY_SHIFT: u32 = 24;
/// Entry for a quarter turn to the left.
pub(super) const TURN_LEFT: Entry = to_entry(Action::Turn, Turn::CounterClockwise);
/// Entry for a quarter turn to the right.
pub(super) const TURN_RIGHT: Entry = to_entry(Action::Turn, Turn::Clockwise);
/// Entry for going straight.
pub(super) const STRAIGHT: Entry = to_entry(Action::Straight, Turn::Clockwise);

pub(super) const fn to_entry(action: Action, turn: Turn) -> Entry {
    let quarters: u32 = match turn {
        Turn::CounterClockwise => 1,
        Turn::Clockwise => 3,
    };
    match action {
        Action::Straight => 0,
        Action::Turn => ((ACTION | quarters << HEADING_SHIFT) >> ENTRY_SHIFT) as Entry,
    }
}

/// Returns the word of a robot before its first step.
pub(super) fn from_pose(pose: Pose) -> u32 {
    position(pose.x.into(), pose.y.into()) | (pose.heading as u32) << HEADING_SHIFT
}

/// Returns the pose stored in a robot word.
pub(super) fn pose(word: u32) -> Pose {
    Pose {
        x: x(word) as u16,
        y: y(word) as u16,
        heading: Heading::from_low_bits(heading(word)),
    }
}

/// Returns the coordinates shifted to their bit positions.
pub(super) fn position(x: u32, y: u32) -> u32 {
    x | y << COORDINATE_BITS
}

pub(super) fn x(word: u32) -> u32 {
    word & COORDINATE
}

pub(super) fn y(word: u32) -> u32 {
    word >> COORDINATE_BITS & COORDINATE
}

/// Returns the number of the heading.
pub(super) fn heading(word: u32) -> u32 {
    word >> HEADING_SHIFT & 3
}
