//! Sensor noise: every bit of every reading is flipped with the same probability, independently
//! (paper, Sec. 3.5).
//!
//! The noise is counter-based: the flips of a robot in a step are a function of run seed,
//! generation, repetition, step and robot. The ChaCha8 key encodes the first three (see
//! [`seed`](crate::seed)), the ChaCha stream number is the step, and the words of robot n start at
//! word 8·n. They are sixteen 16-bit draws; sensor k uses draw k (low half of a word first), and
//! its bit is flipped if the draw is below the rate. Draws without a sensor flip nothing. So the
//! noise does not depend on engine, order or thread, and all genomes of a generation get the same
//! noise.

use crate::seed::Stream;
use minimal_surprise_controller::SensorBits;
use minimal_surprise_controller::sensor::MAX_SENSORS;
use rand_core::Rng as _;

/// Number of 32-bit words per robot and step.
const WORDS_PER_ROBOT: u128 = 8;

/// Every sensor has its own 16-bit draw.
const _: () = assert!(MAX_SENSORS as u128 <= 2 * WORDS_PER_ROBOT);

/// Probability that a bit is flipped, in units of 1/65,536.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoiseRate {
    per_65_536: u32,
}

impl NoiseRate {
    /// The rate at which no bit is flipped.
    pub const NONE: Self = Self { per_65_536: 0 };

    /// Rounds a probability to the nearest multiple of 1/65,536; `None` if the probability is not
    /// between 0 and 1.
    #[must_use]
    pub fn new(probability: f64) -> Option<Self> {
        (0.0..=1.0).contains(&probability).then(|| Self {
            per_65_536: (probability * 65_536.0).round() as u32,
        })
    }

    /// Returns the probability in units of 1/65,536.
    #[must_use]
    pub fn per_65_536(self) -> u32 {
        self.per_65_536
    }

    /// Returns true if no bit is ever flipped.
    #[must_use]
    pub fn is_none(self) -> bool {
        self.per_65_536 == 0
    }
}

/// The noise of one repetition, shared by all genomes of a generation.
#[derive(Clone, Debug)]
pub struct NoiseStream {
    stream: Stream,
    rate: NoiseRate,
}

impl NoiseStream {
    /// Creates noise of the given rate from a stream of the seed tree.
    #[must_use]
    pub fn new(stream: Stream, rate: NoiseRate) -> Self {
        Self { stream, rate }
    }

    /// Returns the rate.
    #[must_use]
    pub fn rate(&self) -> NoiseRate {
        self.rate
    }

    /// Returns the ChaCha8 key of the stream, so that a different program can draw the same noise.
    #[must_use]
    pub fn key(&self) -> [u8; 32] {
        self.stream.get_seed()
    }

    /// Flips bits in the readings of all robots in one step, starting with robot 0. Only the bits
    /// of `sensors` are flipped.
    pub fn flip(&mut self, step: u32, sensors: SensorBits, readings: &mut [SensorBits]) {
        if self.rate.is_none() {
            return;
        }
        self.stream.set_stream(step.into());
        self.stream.set_word_pos(0);
        for reading in readings {
            *reading = SensorBits::new(reading.bits() ^ self.next_draws() & sensors.bits());
        }
    }

    /// Returns the sixteen draws of one robot in one step: a bit is set if the draw is below the
    /// rate, even if no sensor uses the draw.
    #[must_use]
    pub fn draws(&mut self, step: u32, robot: u32) -> u16 {
        self.stream.set_stream(step.into());
        self.stream
            .set_word_pos(u128::from(robot) * WORDS_PER_ROBOT);
        self.next_draws()
    }

    fn next_draws(&mut self) -> u16 {
        let mut flips = 0;
        for pair in 0..WORDS_PER_ROBOT {
            let word = self.stream.next_u32();
            let low = u16::from(word & 0xffff < self.rate.per_65_536);
            let high = u16::from(word >> 16 < self.rate.per_65_536);
            flips |= (low | high << 1) << (2 * pair);
        }
        flips
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Purpose, SeedTree};
    use minimal_surprise_controller::SensorModel;

    fn noise(probability: f64) -> NoiseStream {
        let stream = SeedTree::new(11).stream(Purpose::Noise, 2, 3);
        NoiseStream::new(stream, NoiseRate::new(probability).unwrap())
    }

    const ALL: SensorBits = SensorBits::new(0xffff);

    #[test]
    fn value_stability_flips() {
        assert_eq!(noise(0.5).draws(4, 5), 613);
    }

    #[test]
    fn flips_do_not_depend_on_the_order_of_the_calls() {
        let mut readings = [SensorBits::NONE; 37];
        noise(0.3).flip(9, ALL, &mut readings);
        let mut other = noise(0.3);
        for robot in (0..37_u32).rev() {
            assert_eq!(other.draws(9, robot), readings[robot as usize].bits());
        }
    }

    #[test]
    fn noise_flips_no_bit_without_a_sensor() {
        for model in SensorModel::ALL {
            let mut readings = [SensorBits::NONE; 50];
            noise(0.5).flip(3, model.mask(), &mut readings);
            let flipped = readings.iter().fold(0, |all, reading| all | reading.bits());
            assert_eq!(flipped, model.mask().bits());
        }
    }

    #[test]
    fn the_share_of_flipped_bits_is_the_rate() {
        for probability in [0.05, 0.1, 0.15, 0.5] {
            let mut noise = noise(probability);
            let mut readings = vec![SensorBits::NONE; 10_000];
            noise.flip(0, ALL, &mut readings);
            let flipped: u32 = readings.iter().map(|r| r.bits().count_ones()).sum();
            let share = f64::from(flipped) / 160_000.0;
            assert!((share - probability).abs() < 0.005, "{share}");
        }
    }

    #[test]
    fn rates_of_zero_and_one_flip_nothing_and_everything() {
        assert_eq!(noise(0.0).draws(0, 0), 0);
        assert_eq!(noise(1.0).draws(0, 0), 0xffff);
        let mut readings = [SensorBits::new(5)];
        noise(0.0).flip(0, ALL, &mut readings);
        assert_eq!(readings[0].bits(), 5);
    }

    #[test]
    fn rates_are_rounded_to_the_nearest_65_536th_and_refused_outside_0_and_1() {
        assert_eq!(NoiseRate::new(0.1).unwrap().per_65_536(), 6554);
        for probability in [-0.01, 1.01, f64::NAN, f64::INFINITY] {
            assert_eq!(NoiseRate::new(probability), None);
        }
    }
}
