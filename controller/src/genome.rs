//! Genomes: the weights of both networks, and the operators of evolution.
//!
//! The operators take any [`rand_core::Rng`], so a robot can use the same operators as the host.
//! The same generator state yields the same genome on every machine.

use crate::fixed::WEIGHT_MAX_Q3_12;
use crate::topology::{MAX_WEIGHTS, Topology};
use rand_core::Rng;

/// Maximum initial weight (0.5 in Q3.12). Initial weights are drawn uniformly between minus this
/// value and this value, inclusive.
pub const INITIAL_WEIGHT_MAX_Q3_12: i16 = 2048;

/// Maximum addend of a mutation (0.4 in Q3.12). Addends are drawn uniformly between minus this
/// value and this value, inclusive.
pub const MUTATION_MAX_Q3_12: i16 = 1638;

/// The weights of an action network and, unless all predictions are fixed, a prediction network.
///
/// The size is fixed and large enough for any topology. Weights are Q3.12 within ±32767, in the
/// order described in [`network`](crate::network): first those of the action network, then those of
/// the prediction network.
///
/// ```
/// use minimal_surprise_controller::{Genome, MutationRate, Topology};
/// use rand_chacha::ChaCha8Rng;
/// use rand_core::SeedableRng;
///
/// let mut rng = ChaCha8Rng::seed_from_u64(1);
/// let parent = Genome::random(Topology::default(), &mut rng);
/// let mut child = parent.clone();
/// child.mutate(MutationRate::ratio(1, 10).expect("at most 1"), &mut rng);
/// assert_ne!(child, parent);
/// assert_eq!(child.weights().len(), 616);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Genome {
    topology: Topology,
    weights: [i16; MAX_WEIGHTS],
}

/// Error: the weights do not form a genome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GenomeError {
    /// The number of weights does not match the topology.
    #[error("{found} weights; the topology has {expected}")]
    WrongCount {
        /// Number of weights given.
        found: usize,
        /// Number of weights of the topology.
        expected: usize,
    },
    /// A weight is −32768, which is not a valid value.
    #[error("weight {index} is −32768; weights are within ±32767")]
    InvalidWeight {
        /// Index of the weight.
        index: usize,
    },
}

impl Genome {
    /// Creates a genome with all weights zero.
    #[must_use]
    pub const fn zeroed(topology: Topology) -> Self {
        Self {
            topology,
            weights: [0; MAX_WEIGHTS],
        }
    }

    /// Creates a genome from weights in genome order.
    ///
    /// # Errors
    /// [`GenomeError`] if the number of weights does not match the topology or a weight is −32768.
    pub fn from_weights(topology: Topology, weights: &[i16]) -> Result<Self, GenomeError> {
        if weights.len() != topology.weights() {
            return Err(GenomeError::WrongCount {
                found: weights.len(),
                expected: topology.weights(),
            });
        }
        if let Some(index) = weights.iter().position(|&weight| weight == i16::MIN) {
            return Err(GenomeError::InvalidWeight { index });
        }
        Ok(Self::from_iter(topology, weights.iter().copied()))
    }

    /// Creates a genome from valid weights whose number matches the topology.
    pub(crate) fn from_iter(topology: Topology, weights: impl Iterator<Item = i16>) -> Self {
        let mut genome = Self::zeroed(topology);
        for (to, from) in genome.weights_mut().zip(weights) {
            *to = from;
        }
        genome
    }

    /// Draws a genome whose weights are uniformly distributed within ±[`INITIAL_WEIGHT_MAX_Q3_12`].
    #[must_use]
    pub fn random<R: Rng>(topology: Topology, rng: &mut R) -> Self {
        let mut genome = Self::zeroed(topology);
        for weight in genome.weights_mut() {
            *weight = uniform_within(rng, INITIAL_WEIGHT_MAX_Q3_12);
        }
        genome
    }

    /// Mutates each weight independently, with the given rate, by adding a value drawn uniformly
    /// within ±[`MUTATION_MAX_Q3_12`]; the result saturates at ±32767.
    pub fn mutate<R: Rng>(&mut self, rate: MutationRate, rng: &mut R) {
        for weight in self.weights_mut() {
            if u64::from(rng.next_u32()) < rate.per_2_32 {
                let addend = uniform_within(rng, MUTATION_MAX_Q3_12);
                let sum = weight.saturating_add(addend);
                *weight = sum.max(-WEIGHT_MAX_Q3_12);
            }
        }
    }

    /// Returns the topology.
    #[must_use]
    pub const fn topology(&self) -> Topology {
        self.topology
    }

    /// Returns all weights, Q3.12, in genome order.
    #[must_use]
    pub fn weights(&self) -> &[i16] {
        self.weights
            .get(..self.topology.weights())
            .unwrap_or(&self.weights)
    }

    /// Returns the weights of the action network.
    #[must_use]
    pub fn action_weights(&self) -> &[i16] {
        let count = self.topology.action_weights();
        self.weights.get(..count).unwrap_or(&self.weights)
    }

    /// Returns the weights of the prediction network; empty if all predictions are fixed.
    #[must_use]
    pub fn prediction_weights(&self) -> &[i16] {
        let range = self.topology.action_weights()..self.topology.weights();
        self.weights.get(range).unwrap_or(&[])
    }

    fn weights_mut(&mut self) -> impl Iterator<Item = &mut i16> {
        self.weights.iter_mut().take(self.topology.weights())
    }
}

/// Probability that a weight mutates, in units of 2⁻³².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MutationRate {
    per_2_32: u64,
}

impl MutationRate {
    /// Returns the rate `numerator / denominator`, rounded down to a multiple of 2⁻³²; `None` if
    /// the rate is above 1 or the denominator is 0.
    #[must_use]
    pub const fn ratio(numerator: u32, denominator: u32) -> Option<Self> {
        if denominator == 0 || numerator > denominator {
            None
        } else {
            Some(Self {
                per_2_32: ((numerator as u64) << 32) / denominator as u64,
            })
        }
    }

    /// Returns the rate `threshold / 2³²`; `None` if the rate is above 1.
    #[must_use]
    pub const fn from_per_2_32(threshold: u64) -> Option<Self> {
        if threshold > 1 << 32 {
            None
        } else {
            Some(Self {
                per_2_32: threshold,
            })
        }
    }
}

/// Draws a value uniformly from `-max..=max` with Lemire's method: multiplies one word per draw by
/// the number of values, takes the upper half, and rejects the few words that would bias the
/// result.
fn uniform_within<R: Rng>(rng: &mut R, max: i16) -> i16 {
    let values = 2 * max.unsigned_abs() as u32 + 1;
    let rejected_below = values.wrapping_neg() % values;
    loop {
        let product = u64::from(rng.next_u32()) * u64::from(values);
        if product as u32 >= rejected_below {
            return ((product >> 32) as i32 - i32::from(max)) as i16;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use core::convert::Infallible;
    use rand_chacha::ChaCha8Rng;
    use rand_core::{SeedableRng, TryRng};
    use std::vec::Vec;

    fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(2020)
    }

    #[test]
    fn value_stability_random() {
        let genome = Genome::random(Topology::default(), &mut rng());
        assert_eq!(
            genome.weights()[..6],
            [-1243, -1748, 1797, 1017, -548, -866]
        );
    }

    #[test]
    fn value_stability_mutate() {
        let mut genome = Genome::zeroed(Topology::default());
        genome.mutate(MutationRate::ratio(1, 10).unwrap(), &mut rng());
        let changed: Vec<_> = genome
            .weights()
            .iter()
            .enumerate()
            .filter(|(_, weight)| **weight != 0)
            .map(|(index, weight)| (index, *weight))
            .collect();
        assert_eq!(changed[..3], [(1, 1437), (14, -1334), (46, 1625)]);
    }

    #[test]
    fn initial_weights_reach_both_ends_and_nothing_beyond() {
        let mut rng = rng();
        let weights: Vec<i16> = (0..200)
            .flat_map(|_| {
                Genome::random(Topology::default(), &mut rng)
                    .weights()
                    .to_vec()
            })
            .collect();
        assert_eq!(weights.iter().min(), Some(&-INITIAL_WEIGHT_MAX_Q3_12));
        assert_eq!(weights.iter().max(), Some(&INITIAL_WEIGHT_MAX_Q3_12));
        let mean = weights.iter().map(|&w| f64::from(w)).sum::<f64>() / weights.len() as f64;
        assert!(mean.abs() < 15.0, "{mean}");
    }

    #[test]
    fn mutation_changes_the_given_share_and_saturates() {
        let topology = Topology::default();
        let rate = MutationRate::ratio(3, 10).unwrap();
        let mut rng = rng();
        let mut changed = 0;
        for _ in 0..200 {
            let mut genome = Genome::zeroed(topology);
            genome.mutate(rate, &mut rng);
            changed += genome.weights().iter().filter(|w| **w != 0).count();
        }
        let share = changed as f64 / (200.0 * 616.0);
        assert!((share - 0.3).abs() < 0.01, "{share}");

        for end in [32767, -32767] {
            let mut genome = Genome::from_weights(topology, &[end; 616]).unwrap();
            genome.mutate(MutationRate::ratio(1, 1).unwrap(), &mut rng);
            assert!(genome.weights().contains(&end));
            assert!(!genome.weights().contains(&i16::MIN));
        }
    }

    #[test]
    fn rates_of_zero_and_one_mutate_nothing_and_everything() {
        let zeroed = Genome::zeroed(Topology::default());
        let mut genome = zeroed.clone();
        genome.mutate(MutationRate::ratio(0, 1).unwrap(), &mut rng());
        assert_eq!(genome, zeroed);
        genome.mutate(MutationRate::from_per_2_32(1 << 32).unwrap(), &mut rng());
        assert!(genome.weights().iter().filter(|w| **w != 0).count() > 600);
        assert_eq!(MutationRate::ratio(2, 1), None);
        assert_eq!(MutationRate::ratio(0, 0), None);
        assert_eq!(MutationRate::from_per_2_32((1 << 32) + 1), None);
    }

    /// Generator that returns the given words in order.
    struct Script<I>(I);

    impl<I: Iterator<Item = u32>> TryRng for Script<I> {
        type Error = Infallible;

        fn try_next_u32(&mut self) -> Result<u32, Infallible> {
            Ok(self.0.next().expect("a word is left"))
        }

        fn try_next_u64(&mut self) -> Result<u64, Infallible> {
            unreachable!("weights use 32-bit words")
        }

        fn try_fill_bytes(&mut self, _: &mut [u8]) -> Result<(), Infallible> {
            unreachable!("weights use 32-bit words")
        }
    }

    #[test]
    fn every_value_has_equally_many_words_and_surplus_words_are_rejected() {
        // 2³² words for 3 values: the first word is surplus.
        let draw = |words: &[u32]| {
            let mut script = Script(words.iter().copied());
            let value = uniform_within(&mut script, 1);
            assert_eq!(script.0.next(), None, "words are left");
            value
        };
        assert_eq!(draw(&[0, 1]), -1);
        assert_eq!(draw(&[1]), -1);
        assert_eq!(draw(&[0x5555_5555]), -1);
        assert_eq!(draw(&[0x5555_5556]), 0);
        assert_eq!(draw(&[0xaaaa_aaaa]), 0);
        assert_eq!(draw(&[0xaaaa_aaab]), 1);
        assert_eq!(draw(&[u32::MAX]), 1);

        // 2³² modulo 4097 is 256: a word is rejected if the lower half of its product with 4097 is
        // less than 256. The factor is the inverse of 4097 modulo 2³².
        let of_4097 = |low: u32| low.wrapping_mul(0x00ff_f001);
        for low in [0, 1, 255] {
            assert_eq!(of_4097(low).wrapping_mul(4097), low);
            let mut script = Script([of_4097(low), u32::MAX].into_iter());
            assert_eq!(uniform_within(&mut script, 2048), 2048, "{low}");
        }
        for low in [256, 257, u32::MAX] {
            let mut script = Script([of_4097(low), u32::MAX].into_iter());
            uniform_within(&mut script, 2048);
            assert_eq!(script.0.next(), Some(u32::MAX), "{low} is accepted");
        }
    }

    #[test]
    fn a_weight_mutates_on_words_below_the_rate() {
        let topology = Topology::default();
        let rate = MutationRate::from_per_2_32(1000).unwrap();
        // Only the first weight mutates, by the largest addend.
        let words = [999, u32::MAX].into_iter().chain([1000; 615]);
        let mut genome = Genome::zeroed(topology);
        genome.mutate(rate, &mut Script(words));
        assert_eq!(genome.weights()[0], MUTATION_MAX_Q3_12);
        assert!(genome.weights()[1..].iter().all(|&weight| weight == 0));
    }

    #[test]
    fn rates_are_rounded_down_to_multiples_of_2_to_the_minus_32() {
        for (numerator, denominator, per_2_32) in [
            (0, 1, 0),
            (1, 10, 429_496_729),
            (2, 3, 2_863_311_530),
            (1, u32::MAX, 1),
            (u32::MAX, u32::MAX, 1 << 32),
        ] {
            assert_eq!(
                MutationRate::ratio(numerator, denominator),
                MutationRate::from_per_2_32(per_2_32),
                "{numerator} / {denominator}"
            );
        }
        assert_eq!(MutationRate::from_per_2_32(u64::MAX), None);
    }

    #[test]
    fn a_genome_is_the_weights_of_its_networks_one_after_the_other() {
        for topology in Topology::ALL {
            let genome = Genome::random(topology, &mut rng());
            let (action, prediction) = genome.weights().split_at(topology.action_weights());
            assert_eq!(genome.topology(), topology);
            assert_eq!(genome.action_weights(), action);
            assert_eq!(genome.prediction_weights(), prediction);
            assert_eq!(prediction.len(), topology.prediction_weights());
        }
    }

    #[test]
    fn rejects_a_wrong_count_and_the_weight_minus_32768() {
        let topology = Topology::default();
        assert_eq!(
            Genome::from_weights(topology, &[0; 615]),
            Err(GenomeError::WrongCount {
                found: 615,
                expected: 616
            })
        );
        let mut weights = [0; 616];
        weights[9] = i16::MIN;
        assert_eq!(
            Genome::from_weights(topology, &weights),
            Err(GenomeError::InvalidWeight { index: 9 })
        );
    }
}
