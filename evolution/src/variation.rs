//! Variation: differences between children and their parents.

use crate::selection::{SelectParent, Selection};
use minimal_surprise_controller::{Genome, GenomeError, MutationRate};
use minimal_surprise_sim::seed::Stream;
use minimal_surprise_sim::{Purpose, SeedTree};
use rand_core::Rng as _;

/// Rules for creating the next generation: the selection of parents and the changes to children.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variation {
    /// Selection method for parents.
    pub selection: Selection,
    /// Probability that a child has two parents, in units of 2⁻³².
    pub crossover_per_2_32: u64,
    /// Probability that a weight mutates.
    pub mutation: MutationRate,
}

impl Variation {
    /// Creates the child in a slot of a generation.
    pub(crate) fn child(
        &self,
        genomes: &[Genome],
        parents: &dyn SelectParent,
        selection: &mut Stream,
        (seeds, generation, slot): (SeedTree, u32, u32),
    ) -> Genome {
        let mut child = genomes[parents.draw(selection)].clone();
        if self.crossover_per_2_32 > 0 {
            let mut stream = seeds.stream(Purpose::Crossover, generation, slot);
            if u64::from(stream.next_u32()) < self.crossover_per_2_32 {
                let other = &genomes[parents.draw(&mut stream)];
                child = uniform_crossover(&child, other, || stream.next_u32() & 1 == 1)
                    .expect("genomes of a generation have one topology");
            }
        }
        let mut mutation = seeds.stream(Purpose::Mutation, generation, slot);
        child.mutate(self.mutation, &mut mutation);
        child
    }
}

/// Returns a genome with the weights of `other` wherever `from_other` is true.
///
/// # Errors
/// [`GenomeError`] if the parents have different numbers of weights.
pub fn uniform_crossover(
    one: &Genome,
    other: &Genome,
    mut from_other: impl FnMut() -> bool,
) -> Result<Genome, GenomeError> {
    let pairs = one.weights().iter().zip(other.weights());
    let weights: Vec<i16> = pairs
        .map(|(&one, &other)| if from_other() { other } else { one })
        .collect();
    Genome::from_weights(one.topology(), &weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_controller::Topology;

    #[test]
    fn a_child_of_two_has_every_weight_of_one_or_the_other() {
        let seeds = SeedTree::new(4);
        let genome = |slot| {
            let mut stream = seeds.stream(Purpose::InitialGenome, 0, slot);
            Genome::random(Topology::default(), &mut stream)
        };
        let (one, other) = (genome(0), genome(1));
        let mut stream = seeds.stream(Purpose::Crossover, 0, 0);
        let child = uniform_crossover(&one, &other, || stream.next_u32() & 1 == 1).unwrap();
        let from = |parent: &Genome| {
            let pairs = child.weights().iter().zip(parent.weights());
            pairs.filter(|(a, b)| a == b).count()
        };
        assert!(from(&one) + from(&other) >= child.weights().len());
        for parent in [&one, &other] {
            let share = from(parent) as f64 / child.weights().len() as f64;
            assert!((0.3..0.7).contains(&share), "{share}");
        }
    }
}
