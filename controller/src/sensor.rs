//! Sensor models: the cells around a robot that it senses, one bit per cell.
//!
//! [`SensorModel::cells`] defines the cells for both the simulator and the robot.

use crate::fixed::MAX_TERMS;
use serde::{Deserialize, Serialize};

/// Number of sensors of the largest model, C.
///
/// Assertions guard everything that depends on this number: the sums in this crate, the engine's
/// window, the noise draws and the step hashes.
pub const MAX_SENSORS: usize = 14;

/// A hidden neuron sums the sensors, the action value and its own previous output.
const _: () = assert!(MAX_SENSORS + 2 <= MAX_TERMS);

/// A cell relative to a robot: steps ahead (negative: behind) and to the left (negative: right).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cell {
    /// Cells ahead of the robot, along its heading.
    pub ahead: i8,
    /// Cells to the left of the robot.
    pub left: i8,
}

/// Creates a cell; shorthand for the tables below.
const fn cell(ahead: i8, left: i8) -> Cell {
    Cell { ahead, left }
}

/// Cells of model A: the Moore neighbourhood.
static CELLS_A: [Cell; 8] = [
    cell(1, 0),
    cell(1, -1),
    cell(1, 1),
    cell(0, -1),
    cell(0, 1),
    cell(-1, 0),
    cell(-1, -1),
    cell(-1, 1),
];

/// Cells of model C; its first six are the cells of model B.
static CELLS_C: [Cell; 14] = [
    cell(1, 0),
    cell(1, -1),
    cell(1, 1),
    cell(2, 0),
    cell(2, -1),
    cell(2, 1),
    cell(0, -1),
    cell(0, 1),
    cell(-1, 0),
    cell(-1, -1),
    cell(-1, 1),
    cell(-2, 0),
    cell(-2, -1),
    cell(-2, 1),
];

/// The three sensor models of the paper (Sec. 2.1, Fig. 3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SensorModel {
    /// Eight cells: the Moore neighbourhood.
    A,
    /// Six cells: two rows of three ahead.
    B,
    /// Fourteen cells: two rows of three ahead, two behind, and the cells left and right.
    #[default]
    C,
}

impl SensorModel {
    /// Every model, in order.
    pub const ALL: [Self; 3] = [Self::A, Self::B, Self::C];

    /// Returns the sensed cells, in the order of the sensor bits.
    #[must_use]
    pub const fn cells(self) -> &'static [Cell] {
        match self {
            Self::A => &CELLS_A,
            Self::B => CELLS_C.split_at(6).0,
            Self::C => &CELLS_C,
        }
    }

    /// Returns the number of sensors: 8, 6 or 14.
    #[must_use]
    pub const fn sensors(self) -> usize {
        self.cells().len()
    }

    /// Returns a mask with one bit set for every sensor of the model.
    #[must_use]
    pub const fn mask(self) -> SensorBits {
        SensorBits((1 << self.sensors()) - 1)
    }
}

/// One bit per sensor: bit k is sensor k; 1 means occupied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorBits(u16);

impl SensorBits {
    /// The reading with no occupied cell.
    pub const NONE: Self = Self(0);

    /// Creates sensor bits from raw bits. The controller ignores bits beyond the model's sensors.
    #[must_use]
    pub const fn new(bits: u16) -> Self {
        Self(bits)
    }

    /// Returns the raw bits.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Returns true if sensor `index` reads occupied; false for an index beyond 15.
    #[must_use]
    pub const fn get(self, index: usize) -> bool {
        index < 16 && self.0 >> index & 1 == 1
    }

    /// Counts the sensors whose bits differ.
    #[must_use]
    pub const fn differing(self, other: Self) -> u32 {
        (self.0 ^ other.0).count_ones()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cells_of_a_model_are_distinct_and_not_the_robots_own() {
        for model in SensorModel::ALL {
            let cells = model.cells();
            for (index, cell) in cells.iter().enumerate() {
                assert!(!cells[..index].contains(cell), "{model:?} {cell:?}");
                assert!(cell.ahead != 0 || cell.left != 0);
                assert!(cell.ahead.abs() <= 2 && cell.left.abs() <= 1);
            }
        }
    }

    #[test]
    fn sensors_are_the_bits_of_a_word_and_none_beyond() {
        for bit in 0..16 {
            let bits = SensorBits::new(1 << bit);
            for index in 0..20 {
                assert_eq!(bits.get(index), index == bit);
                assert!(!SensorBits::NONE.get(index));
            }
            assert!(!bits.get(usize::MAX));
            assert_eq!(bits.differing(SensorBits::NONE), 1);
            assert_eq!(bits.differing(SensorBits::new(u16::MAX)), 15);
            assert_eq!(bits.differing(bits), 0);
        }
    }

    #[test]
    fn models_have_8_6_and_14_sensors() {
        assert_eq!(SensorModel::ALL.map(SensorModel::sensors), [8, 6, 14]);
        assert_eq!(
            SensorModel::ALL.map(|model| model.mask().bits()),
            [0xff, 0x3f, 0x3fff]
        );
    }
}
