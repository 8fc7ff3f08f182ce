//! Geometry: the grid, headings and poses. x increases to the east, y to the north; opposite edges
//! are joined.

use minimal_surprise_controller::Turn;
use minimal_surprise_controller::sensor::Cell;
use serde::{Deserialize, Serialize};

/// Minimum length of a side: on a shorter side, a robot would sense itself.
pub const SIDE_MIN: u32 = 3;
/// Maximum length of a side.
pub const SIDE_MAX: u32 = 16_384;

/// A torus of `width` × `height` cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Grid {
    width: u16,
    height: u16,
}

/// Error: a side of the grid is too short or too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a grid of {width}x{height}; each side must be from {SIDE_MIN} to {SIDE_MAX} cells")]
pub struct GridError {
    /// Width requested.
    pub width: u32,
    /// Height requested.
    pub height: u32,
}

impl Grid {
    /// Creates a torus of `width` × `height` cells.
    ///
    /// # Errors
    /// [`GridError`] if a side is shorter than [`SIDE_MIN`] or longer than [`SIDE_MAX`].
    pub fn new(width: u32, height: u32) -> Result<Self, GridError> {
        let sides = SIDE_MIN..=SIDE_MAX;
        if sides.contains(&width) && sides.contains(&height) {
            Ok(Self {
                width: width as u16,
                height: height as u16,
            })
        } else {
            Err(GridError { width, height })
        }
    }

    /// Returns the number of cells from west to east.
    #[must_use]
    pub fn width(self) -> u16 {
        self.width
    }

    /// Returns the number of cells from south to north.
    #[must_use]
    pub fn height(self) -> u16 {
        self.height
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn cells(self) -> u32 {
        u32::from(self.width) * u32::from(self.height)
    }

    /// Returns the number of a cell: row by row from the south, each row from the west.
    #[must_use]
    pub fn cell(self, x: u16, y: u16) -> u32 {
        u32::from(y) * u32::from(self.width) + u32::from(x)
    }

    /// Returns the cell at offset (dx, dy) from the cell (x, y), across the edges and at any
    /// distance.
    #[must_use]
    pub fn moved(self, x: u16, y: u16, dx: i32, dy: i32) -> (u16, u16) {
        let along = |from: u16, by: i32, side: u16| {
            (i32::from(from) + by).rem_euclid(i32::from(side)) as u16
        };
        (along(x, dx, self.width), along(y, dy, self.height))
    }
}

impl core::fmt::Display for Grid {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// The direction that a robot faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "u8", try_from = "u8")]
#[repr(u8)]
pub enum Heading {
    /// Towards +x.
    East = 0,
    /// Towards +y.
    North = 1,
    /// Towards −x.
    West = 2,
    /// Towards −y.
    South = 3,
}

/// Error: the number is not a heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("heading {0}; headings are 0 (east), 1 (north), 2 (west) and 3 (south)")]
pub struct UnknownHeading(pub u8);

impl From<Heading> for u8 {
    fn from(heading: Heading) -> Self {
        heading as Self
    }
}

impl TryFrom<u8> for Heading {
    type Error = UnknownHeading;

    fn try_from(number: u8) -> Result<Self, UnknownHeading> {
        if number < 4 {
            Ok(Self::from_low_bits(number.into()))
        } else {
            Err(UnknownHeading(number))
        }
    }
}

impl Heading {
    /// Every heading, in order.
    pub const ALL: [Self; 4] = [Self::East, Self::North, Self::West, Self::South];

    /// Returns the heading with the number in the two lowest bits.
    #[must_use]
    pub fn from_low_bits(bits: u32) -> Self {
        Self::ALL[(bits & 3) as usize]
    }

    /// Returns the heading after a quarter turn.
    #[must_use]
    pub fn turned(self, turn: Turn) -> Self {
        Self::from_low_bits(match turn {
            Turn::CounterClockwise => self as u32 + 1,
            Turn::Clockwise => self as u32 + 3,
        })
    }

    /// Returns the step (dx, dy) ahead.
    #[must_use]
    pub fn ahead(self) -> (i32, i32) {
        match self {
            Self::East => (1, 0),
            Self::North => (0, 1),
            Self::West => (-1, 0),
            Self::South => (0, -1),
        }
    }

    /// Returns the offset (dx, dy) of a sensed cell from a robot with this heading.
    #[must_use]
    pub fn offset(self, cell: Cell) -> (i32, i32) {
        let (ahead_x, ahead_y) = self.ahead();
        let (left_x, left_y) = (-ahead_y, ahead_x);
        let (ahead, left) = (i32::from(cell.ahead), i32::from(cell.left));
        (
            ahead * ahead_x + left * left_x,
            ahead * ahead_y + left * left_y,
        )
    }
}

/// Position and heading of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "(u16, u16, Heading)", from = "(u16, u16, Heading)")]
pub struct Pose {
    /// Number of cells from the west edge.
    pub x: u16,
    /// Number of cells from the south edge.
    pub y: u16,
    /// Direction that the robot faces.
    pub heading: Heading,
}

impl Pose {
    /// Returns the bytes of a pose in every hash: x and y in 16 bits, little-endian, and the
    /// heading in 8 bits.
    #[must_use]
    pub fn bytes(self) -> [u8; 5] {
        let ([x0, x1], [y0, y1]) = (self.x.to_le_bytes(), self.y.to_le_bytes());
        [x0, x1, y0, y1, self.heading as u8]
    }
}

impl From<Pose> for (u16, u16, Heading) {
    fn from(pose: Pose) -> Self {
        (pose.x, pose.y, pose.heading)
    }
}

impl From<(u16, u16, Heading)> for Pose {
    fn from((x, y, heading): (u16, u16, Heading)) -> Self {
        Self { x, y, heading }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_of_a_robot_facing_east_is_south() {
        let right = Cell { ahead: 0, left: -1 };
        assert_eq!(Heading::East.offset(right), (0, -1));
        assert_eq!(Heading::North.offset(right), (1, 0));
        assert_eq!(Heading::West.offset(right), (0, 1));
        assert_eq!(Heading::South.offset(right), (-1, 0));
    }

    #[test]
    fn four_turns_of_either_kind_end_where_they_began() {
        for turn in [Turn::Clockwise, Turn::CounterClockwise] {
            for heading in Heading::ALL {
                let turned = (0..4).fold(heading, |h, _| h.turned(turn));
                assert_eq!(turned, heading);
            }
        }
        assert_eq!(Heading::East.turned(Turn::CounterClockwise), Heading::North);
        assert_eq!(Heading::East.turned(Turn::Clockwise), Heading::South);
    }

    #[test]
    fn sides_below_three_are_refused() {
        assert!(Grid::new(3, 3).is_ok());
        for (width, height) in [(2, 3), (3, 2), (0, 0), (16_385, 3)] {
            assert_eq!(Grid::new(width, height), Err(GridError { width, height }));
        }
    }
}
