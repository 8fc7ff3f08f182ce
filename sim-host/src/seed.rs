//! The seed tree: every random stream of a run, identified by its purpose.
//!
//! A stream is a ChaCha8 generator whose 256-bit key is the four numbers run seed, purpose,
//! generation and index, 64 bits each, little-endian. Streams do not depend on each other, on the
//! number of threads or on the order of work.

use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// The generator of every stream. A different generator would change all results.
pub type Stream = ChaCha8Rng;

/// The purpose of a stream. Results depend on the numbers, which never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u64)]
pub enum Purpose {
    /// Weights of the first population; index: slot of the genome.
    InitialGenome = 1,
    /// Parents of a generation; index 0.
    Selection = 2,
    /// Mutation of a genome; index: slot of the genome.
    Mutation = 3,
    /// Starting poses; index: repetition.
    Starts = 4,
    /// Sensor noise; index: repetition.
    Noise = 5,
    /// Starting poses of a re-evaluation; generation: 0, index: start.
    ReevaluationStarts = 6,
    /// Sensor noise of a re-evaluation; generation: 0, index: start.
    ReevaluationNoise = 7,
    /// New poses of repositioned robots; generation: 0, index: repetition of the damage experiment.
    Damage = 8,
    /// Sensor noise after damage; generation: 0, index: repetition of the damage experiment.
    DamageNoise = 9,
    /// Crossover of a genome: the decision to cross, the second parent and the weights; index: slot
    /// of the genome.
    Crossover = 10,
    /// Poses of a state drawn as a baseline; generation: 0, index: draw.
    Placement = 11,
}

/// The root of all streams of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeedTree {
    seed: u64,
}

impl SeedTree {
    /// Creates the tree of a run's seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// Returns the run's seed.
    #[must_use]
    pub const fn seed(self) -> u64 {
        self.seed
    }

    /// Returns the stream for one purpose.
    #[must_use]
    pub fn stream(self, purpose: Purpose, generation: u32, index: u32) -> Stream {
        let mut key = [0; 32];
        let parts = [self.seed, purpose as u64, generation.into(), index.into()];
        for (place, part) in key.chunks_exact_mut(8).zip(parts) {
            place.copy_from_slice(&part.to_le_bytes());
        }
        Stream::from_seed(key)
    }
}

/// Draws a value uniformly from `0..values`, without bias (Lemire's method on 64-bit words).
///
/// # Panics
/// If `values` is 0.
pub fn uniform_below(rng: &mut Stream, values: u64) -> u64 {
    use rand_core::Rng as _;
    assert!(values > 0, "no value to choose from");
    let rejected_below = values.wrapping_neg() % values;
    loop {
        let product = u128::from(rng.next_u64()) * u128::from(values);
        if product as u64 >= rejected_below {
            return (product >> 64) as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng as _;

    #[test]
    fn value_stability_stream() {
        let mut stream = SeedTree::new(7).stream(Purpose::Starts, 3, 9);
        assert_eq!(stream.next_u64(), 17_778_294_335_624_794_601);
    }

    #[test]
    fn value_stability_uniform_below() {
        let mut stream = SeedTree::new(7).stream(Purpose::Selection, 0, 0);
        let drawn: Vec<u64> = (0..6).map(|_| uniform_below(&mut stream, 100)).collect();
        assert_eq!(drawn, [90, 57, 89, 9, 23, 1]);
    }

    #[test]
    fn streams_differ_in_every_part_of_their_name() {
        let tree = SeedTree::new(1);
        let mut firsts: Vec<u64> = [
            tree.stream(Purpose::Starts, 0, 0),
            tree.stream(Purpose::Noise, 0, 0),
            tree.stream(Purpose::Starts, 1, 0),
            tree.stream(Purpose::Starts, 0, 1),
            SeedTree::new(2).stream(Purpose::Starts, 0, 0),
        ]
        .iter_mut()
        .map(|stream| stream.next_u64())
        .collect();
        firsts.sort_unstable();
        firsts.dedup();
        assert_eq!(firsts.len(), 5);
    }
}
