//! The genetic algorithm, with an ask-and-tell interface and independent of the world.
//!
//! The best genome stays in its slot; every other slot draws a parent from all slots, including the
//! best, and [varies](crate::variation) it. Fitness is an integer, such as a number of matches.
//! Every draw comes from the seed tree, by generation and slot.

use crate::selection::SelectParent;
use crate::variation::Variation;
use minimal_surprise_controller::{Genome, MutationRate, Topology};
use minimal_surprise_sim::{Purpose, SeedTree};

/// A generation of genomes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Population {
    generation: u32,
    genomes: Vec<Genome>,
}

impl Population {
    /// Creates the first generation from random genomes.
    #[must_use]
    pub fn random(topology: Topology, size: u32, seeds: SeedTree) -> Self {
        let genome = |slot| {
            let mut stream = seeds.stream(Purpose::InitialGenome, 0, slot);
            Genome::random(topology, &mut stream)
        };
        Self {
            generation: 0,
            genomes: (0..size).map(genome).collect(),
        }
    }

    /// Creates the first generation: a genome in slot 0 and its mutants in all other slots.
    #[must_use]
    pub fn mutants_of(ancestor: &Genome, size: u32, rate: MutationRate, seeds: SeedTree) -> Self {
        let genome = |slot| {
            let mut genome = ancestor.clone();
            if slot > 0 {
                genome.mutate(rate, &mut seeds.stream(Purpose::Mutation, 0, slot));
            }
            genome
        };
        Self {
            generation: 0,
            genomes: (0..size).map(genome).collect(),
        }
    }

    /// Restores a stored generation.
    #[must_use]
    pub fn restored(generation: u32, genomes: Vec<Genome>) -> Self {
        Self {
            generation,
            genomes,
        }
    }

    /// Returns the generation number, counted from 0.
    #[must_use]
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// Returns the genomes to evaluate, by slot.
    #[must_use]
    pub fn ask(&self) -> &[Genome] {
        &self.genomes
    }

    /// Creates the next generation from the genomes' fitness, by slot. The best genome stays in its
    /// slot; every other slot gets a child of randomly drawn parents.
    ///
    /// # Panics
    /// If the number of fitness values differs from the number of genomes.
    #[must_use]
    pub fn tell(&self, fitness: &[u64], variation: Variation, seeds: SeedTree) -> Self {
        let parents = variation.selection.of(fitness);
        self.tell_parents(fitness, &parents, variation, seeds)
    }

    /// Like [`tell`](Self::tell), with a custom selection instead of that of `variation`.
    ///
    /// # Panics
    /// If the number of fitness values differs from the number of genomes.
    #[must_use]
    pub fn tell_parents(
        &self,
        fitness: &[u64],
        parents: &dyn SelectParent,
        variation: Variation,
        seeds: SeedTree,
    ) -> Self {
        assert_eq!(fitness.len(), self.genomes.len(), "one fitness per genome");
        let generation = self.generation + 1;
        let best = best_slot(fitness);
        let mut selection = seeds.stream(Purpose::Selection, generation, 0);
        let genomes = self.genomes.iter().enumerate().map(|(slot, genome)| {
            if slot == best {
                return genome.clone();
            }
            let place = (seeds, generation, slot as u32);
            variation.child(&self.genomes, parents, &mut selection, place)
        });
        Self {
            generation,
            genomes: genomes.collect(),
        }
    }
}

/// Returns the slot with the most matches; ties go to the lowest slot.
#[must_use]
pub fn best_slot(matches: &[u64]) -> usize {
    let mut best = 0;
    for (slot, &count) in matches.iter().enumerate() {
        if count > matches[best] {
            best = slot;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selection::Selection;

    const SEEDS: SeedTree = SeedTree::new(5);

    fn rate(numerator: u32) -> MutationRate {
        MutationRate::ratio(numerator, 10).unwrap()
    }

    fn variation(numerator: u32) -> Variation {
        Variation {
            selection: Selection::Roulette,
            crossover_per_2_32: 0,
            mutation: rate(numerator),
        }
    }

    #[test]
    fn the_best_genome_stays_in_its_slot() {
        let population = Population::random(Topology::default(), 4, SEEDS);
        let next = population.tell(&[3, 9, 9, 1], variation(10), SEEDS);
        assert_eq!(next.ask()[1], population.ask()[1]);
        assert_ne!(next.ask()[2], population.ask()[2]);
        assert_eq!(next.generation(), 1);
    }

    #[test]
    fn without_mutation_every_child_is_one_of_the_parents() {
        let population = Population::random(Topology::default(), 6, SEEDS);
        let next = population.tell(&[0, 0, 0, 7, 0, 0], variation(0), SEEDS);
        assert!(next.ask().iter().all(|g| *g == population.ask()[3]));
        let uniform = population.tell(&[0; 6], variation(0), SEEDS);
        assert!(uniform.ask().iter().all(|g| population.ask().contains(g)));
    }

    #[test]
    fn mutants_keep_their_ancestor_in_slot_0() {
        let ancestor = Population::random(Topology::default(), 1, SEEDS).ask()[0].clone();
        let mutants = Population::mutants_of(&ancestor, 3, rate(1), SEEDS);
        assert_eq!(mutants.ask()[0], ancestor);
        assert_ne!(mutants.ask()[1], ancestor);
        assert_ne!(mutants.ask()[1], mutants.ask()[2]);
    }

    #[test]
    fn value_stability_tell() {
        let population = Population::random(Topology::default(), 3, SEEDS);
        let next = population.tell(&[10, 20, 30], variation(1), SEEDS);
        let sum = |g: &Genome| g.weights().iter().map(|&w| i64::from(w)).sum::<i64>();
        let sums: Vec<i64> = next.ask().iter().map(sum).collect();
        assert_eq!(sums, [-9694, -3278, 3021]);
    }
}
