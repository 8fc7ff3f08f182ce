//! Converts detected neighbours to sensor bits, for robots that measure range and bearing.
//!
//! The robot is in the middle of its own cell, facing ahead; a neighbour at range r and bearing b
//! is `r·cos b` ahead and `r·sin b` to the left. With cell size s, the cell in direction v is
//! `⌊v / s + ½⌋`: a neighbour exactly on a border belongs to the cell further ahead, or further
//! left. Trigonometry comes from `micromath`, with an error of at most 0.002 of the range
//! (`encoding_error_max_bearings`), so a neighbour that close to a border may be assigned to either
//! side. This conversion is the only floating point on a robot; all later arithmetic is in
//! integers.
//!
//! | detection | result |
//! |---|---|
//! | range 0, or within the robot's own cell | ignored |
//! | range or bearing not a number or infinite, range negative | rejected by [`Neighbours::push`], counted in [`Neighbours::refused`] |
//! | outside the model's cells | ignored |
//! | bearing outside ±π | taken modulo 2π |
//! | more neighbours than fit | the nearest are kept, the rest are counted in [`Neighbours::dropped`] |

use crate::sensor::{SensorBits, SensorModel};
use micromath::F32;

/// One detected neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// Distance between the centres of the two robots, in mm.
    pub range_mm: f32,
    /// Direction in rad, counter-clockwise from straight ahead.
    pub bearing_rad: f32,
}

/// Side of a grid cell.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CellSize {
    mm: f32,
}

/// Error: the cell size is not a positive number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("a cell size of {mm} mm; it must be a positive number")]
pub struct InvalidCellSize {
    /// The size given, in mm.
    pub mm: f32,
}

impl CellSize {
    /// Creates a cell size from a length in mm.
    ///
    /// # Errors
    /// [`InvalidCellSize`] if the length is not positive and finite.
    pub fn from_mm(mm: f32) -> Result<Self, InvalidCellSize> {
        if mm.is_finite() && mm > 0.0 {
            Ok(Self { mm })
        } else {
            Err(InvalidCellSize { mm })
        }
    }
}

/// The neighbours detected in one control step, at most `N`.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Neighbours<const N: usize> {
    detections: heapless::Vec<Detection, N>,
    refused: u32,
    dropped: u32,
}

impl<const N: usize> Neighbours<N> {
    /// Creates an empty list.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            detections: heapless::Vec::new(),
            refused: 0,
            dropped: 0,
        }
    }

    /// Adds a detection. If the list is full, drops the farthest detection, which may be this one.
    pub fn push(&mut self, detection: Detection) {
        let Detection {
            range_mm,
            bearing_rad,
        } = detection;
        if !(range_mm.is_finite() && range_mm >= 0.0 && bearing_rad.is_finite()) {
            self.refused = self.refused.saturating_add(1);
            return;
        }
        let Err(detection) = self.detections.push(detection) else {
            return;
        };
        self.dropped = self.dropped.saturating_add(1);
        let farthest = self
            .detections
            .iter_mut()
            .max_by(|a, b| a.range_mm.total_cmp(&b.range_mm));
        if let Some(farthest) = farthest
            && farthest.range_mm > detection.range_mm
        {
            *farthest = detection;
        }
    }

    /// Removes all detections before the next control step; keeps the counts.
    pub fn clear(&mut self) {
        self.detections.clear();
    }

    /// Returns the detections in the list.
    #[must_use]
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// Returns the number of detections rejected so far because a value was not finite or the range
    /// was negative.
    #[must_use]
    pub fn refused(&self) -> u32 {
        self.refused
    }

    /// Returns the number of detections dropped so far because the list was full.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Returns the sensor bits: a bit is set if at least one neighbour is in its cell.
    #[must_use]
    pub fn sensor_bits(&self, model: SensorModel, cell: CellSize) -> SensorBits {
        let mut bits = 0;
        for detection in &self.detections {
            let (ahead, left) = cell_of(*detection, cell);
            let sensor = model
                .cells()
                .iter()
                .position(|c| i32::from(c.ahead) == ahead && i32::from(c.left) == left);
            if let Some(index) = sensor {
                bits |= 1 << index;
            }
        }
        SensorBits::new(bits)
    }
}

/// Returns a neighbour's cell, as the number of cells ahead and to the left of the robot. If the
/// neighbour is far away, the cell is outside every model.
fn cell_of(detection: Detection, cell: CellSize) -> (i32, i32) {
    let bearing = F32(detection.bearing_rad % core::f32::consts::TAU);
    let cells = F32(detection.range_mm / cell.mm);
    let index = |direction: F32| (cells * direction + F32(0.5)).floor().0 as i32;
    (index(bearing.cos()), index(bearing.sin()))
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use core::f32::consts::{FRAC_PI_2, PI, TAU};

    fn bits(model: SensorModel, detections: &[(f32, f32)]) -> u16 {
        let mut neighbours = Neighbours::<8>::new();
        for &(range_mm, bearing_rad) in detections {
            neighbours.push(Detection {
                range_mm,
                bearing_rad,
            });
        }
        let cell = CellSize::from_mm(100.0).unwrap();
        neighbours.sensor_bits(model, cell).bits()
    }

    #[test]
    fn a_neighbour_in_the_middle_of_each_cell_sets_its_bit_alone() {
        for model in SensorModel::ALL {
            for (index, cell) in model.cells().iter().enumerate() {
                let (ahead, left) = (f32::from(cell.ahead), f32::from(cell.left));
                let range = 100.0 * ahead.hypot(left);
                let bearing = left.atan2(ahead);
                for turns in [-2.0, 0.0, 3.0] {
                    let found = bits(model, &[(range, bearing + turns * TAU)]);
                    assert_eq!(found, 1 << index, "{model:?} {cell:?}");
                }
            }
        }
    }

    #[test]
    fn bearings_of_any_number_of_turns_are_taken_modulo_a_turn() {
        for bearing in [7.0, 1e3, 1e5, 1e7, 1e9, 1e20, f32::MAX] {
            let within_a_turn = (f64::from(bearing) % f64::from(TAU)) as f32;
            for sign in [1.0, -1.0] {
                for range in [100.0, 141.0, 200.0] {
                    assert_eq!(
                        bits(SensorModel::C, &[(range, sign * bearing)]),
                        bits(SensorModel::C, &[(range, sign * within_a_turn)]),
                        "{range} mm at {bearing} rad"
                    );
                }
            }
        }
    }

    #[test]
    fn a_neighbour_on_a_border_belongs_to_the_cell_further_ahead_or_further_left() {
        let ahead_1 = 1 << 0;
        let ahead_2 = 1 << 3;
        assert_eq!(bits(SensorModel::C, &[(50.0, 0.0)]), ahead_1);
        assert_eq!(bits(SensorModel::C, &[(150.0, 0.0)]), ahead_2);
        assert_eq!(bits(SensorModel::C, &[(250.0, 0.0)]), 0);
    }

    #[test]
    fn detections_at_range_zero_in_the_robots_cell_and_out_of_reach_set_no_bit() {
        let all = [
            (0.0, 1.0),
            (49.0, PI),
            (300.0, 0.0),
            (1e30, 0.3),
            (f32::MAX, -3.0),
        ];
        for model in SensorModel::ALL {
            assert_eq!(bits(model, &all), 0);
        }
    }

    #[test]
    fn detections_that_are_not_numbers_are_refused_and_counted() {
        let mut neighbours = Neighbours::<4>::new();
        for (range_mm, bearing_rad) in [
            (f32::NAN, 0.0),
            (100.0, f32::NAN),
            (f32::INFINITY, 0.0),
            (100.0, f32::NEG_INFINITY),
            (-1.0, 0.0),
        ] {
            neighbours.push(Detection {
                range_mm,
                bearing_rad,
            });
        }
        assert_eq!(neighbours.refused(), 5);
        assert!(neighbours.detections().is_empty());
    }

    #[test]
    fn the_nearest_are_kept_when_more_are_detected_than_fit() {
        let mut neighbours = Neighbours::<2>::new();
        for range_mm in [300.0, 100.0, 200.0, 400.0] {
            neighbours.push(Detection {
                range_mm,
                bearing_rad: FRAC_PI_2,
            });
        }
        assert_eq!(neighbours.dropped(), 2);
        let mut kept: std::vec::Vec<f32> =
            neighbours.detections().iter().map(|d| d.range_mm).collect();
        kept.sort_by(f32::total_cmp);
        assert_eq!(kept, [100.0, 200.0]);
        neighbours.clear();
        assert!(neighbours.detections().is_empty());
    }

    #[test]
    fn of_equally_distant_neighbours_the_one_detected_first_is_kept() {
        let mut neighbours = Neighbours::<1>::new();
        for bearing_rad in [1.0, 2.0] {
            neighbours.push(Detection {
                range_mm: 100.0,
                bearing_rad,
            });
        }
        assert_eq!(neighbours.detections()[0].bearing_rad, 1.0);
        assert_eq!(neighbours.dropped(), 1);
    }

    #[test]
    fn a_list_without_room_drops_everything() {
        let mut neighbours = Neighbours::<0>::new();
        neighbours.push(Detection {
            range_mm: 1.0,
            bearing_rad: 0.0,
        });
        assert_eq!(neighbours.dropped(), 1);
    }

    #[test]
    fn a_cell_size_must_be_a_positive_number() {
        for mm in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(CellSize::from_mm(mm).is_err(), "{mm}");
        }
    }

    #[test]
    fn encoding_error_max_bearings() {
        let error_max = (-31_416..=31_416)
            .map(|step| {
                let bearing = step as f32 * 1e-4;
                let sine = f64::from(F32(bearing).sin().0) - f64::from(bearing).sin();
                let cosine = f64::from(F32(bearing).cos().0) - f64::from(bearing).cos();
                sine.abs().max(cosine.abs())
            })
            .fold(0.0, f64::max);
        std::println!("largest error: {error_max:.6} of the range");
        assert!(error_max < 0.002, "{error_max}");
    }
}
