//! The window: the three by five cells around a robot as one word, its rows along the heading.
//!
//! A robot senses by extracting its window from rows of bits, so the engine uses window order
//! throughout: action table, prediction network and score are converted once, and readings never
//! need conversion to sensor order. Bit `5·(left + 1) + ahead + 2` is the cell (ahead, left). The
//! bit of a robot's own cell, which is always occupied, holds the action value instead, so that a
//! window is the whole input of a network.

use minimal_surprise_controller::sensor::{Cell, MAX_SENSORS, SensorModel};
use minimal_surprise_controller::{Action, SensorBits};

/// Number of cells in the window, which is the number of bits in a network's input.
pub(super) const WINDOW_BITS: usize = 15;
/// All sensors and the action value fit the window.
const _: () = assert!(MAX_SENSORS < WINDOW_BITS);
/// Number of different windows.
pub(super) const WINDOWS: usize = 1 << WINDOW_BITS;
/// Number of cells of one row.
pub(super) const ROW_BITS: usize = 5;
/// The bit of the robot's own cell, used for the action value.
pub(super) const ACTION_BIT: u16 = 1 << 7;
/// The cell straight ahead.
pub(super) const AHEAD_BIT: u16 = 1 << 8;

/// Positions of a model's sensors in the window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct WindowOrder {
    model: SensorModel,
    /// Window bits of each byte of a reading.
    from_sensors: [[u16; 256]; 2],
}

/// Returns the window bit of a cell.
pub(super) fn bit_of(cell: Cell) -> usize {
    (ROW_BITS as i32 * (i32::from(cell.left) + 1) + i32::from(cell.ahead) + 2) as usize
}

impl WindowOrder {
    pub(super) fn new(model: SensorModel) -> Self {
        let mut from_sensors = [[0; 256]; 2];
        for (sensor, &cell) in model.cells().iter().enumerate() {
            for (byte, window) in from_sensors[sensor / 8].iter_mut().enumerate() {
                *window |= ((byte >> (sensor % 8) & 1) << bit_of(cell)) as u16;
            }
        }
        Self {
            model,
            from_sensors,
        }
    }

    pub(super) fn model(&self) -> SensorModel {
        self.model
    }

    /// Converts a reading to window order, with the action bit zero.
    pub(super) fn window(&self, reading: u16) -> u16 {
        let [low, high] = &self.from_sensors;
        low[usize::from(reading & 0xff)] | high[usize::from(reading >> 8)]
    }

    /// Returns a mask with one bit set for every sensor.
    pub(super) fn sensors(&self) -> u16 {
        self.window(self.model.mask().bits())
    }

    /// Returns the window bits of a network's inputs: sensor 0, 1, … and, last, the action value.
    pub(super) fn inputs(&self) -> impl Iterator<Item = usize> + use<> {
        let cells = self.model.cells().iter().copied().map(bit_of);
        cells.chain([ACTION_BIT.trailing_zeros() as usize])
    }

    /// Returns the reading and the action of a window.
    pub(super) fn reading(&self, window: u16) -> (SensorBits, Action) {
        let mut bits = 0;
        for (sensor, &cell) in self.model.cells().iter().enumerate() {
            bits |= (window >> bit_of(cell) & 1) << sensor;
        }
        let action = if window & ACTION_BIT == 0 {
            Action::Straight
        } else {
            Action::Turn
        };
        (SensorBits::new(bits), action)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_survive_the_conversion_to_window_order_and_back() {
        for model in SensorModel::ALL {
            let order = WindowOrder::new(model);
            for bits in 0..=model.mask().bits() {
                let window = order.window(bits);
                assert_eq!(window & !order.sensors(), 0);
                assert_eq!(order.reading(window).0.bits(), bits);
            }
            assert_eq!(order.sensors() & ACTION_BIT, 0);
            assert_eq!(order.sensors().count_ones() as usize, model.sensors());
            assert_eq!(order.window(1), AHEAD_BIT);
        }
    }
}
