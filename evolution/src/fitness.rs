//! Custom fitness functions: any number computed from the plain world, step by step.
//!
//! The fast engine computes the paper's fitness (see [`generation_work`](crate::generation_work));
//! [`Matches`] computes the same value in the plain world.

use minimal_surprise_controller::{Controller, Genome};
use minimal_surprise_sim::evaluation::{matches_of, run};
use minimal_surprise_sim::{Scenario, Trial, World, WorldError};
use rayon::prelude::*;

/// Fitness of one run of a swarm.
pub trait Fitness {
    /// Observes the world after each step.
    fn observe(&mut self, world: &World);

    /// Returns the fitness after the run; higher is better.
    fn value(&self) -> u64;
}

/// Number of correctly predicted sensor bits: the paper's fitness (Eq. 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Matches(u64);

impl Fitness for Matches {
    fn observe(&mut self, world: &World) {
        self.0 = matches_of(world).0;
    }

    fn value(&self) -> u64 {
        self.0
    }
}

/// Evaluates genomes in parallel; returns the fitness of each in its worst trial, by slot.
///
/// # Errors
/// [`WorldError`] if a trial's poses do not fit the grid.
pub fn evaluate<F: Fitness>(
    genomes: &[Genome],
    scenario: &Scenario,
    trials: &[Trial],
    new: impl Fn() -> F + Sync,
) -> Result<Vec<u64>, WorldError> {
    let of_trial = |controller: &Controller, trial: &Trial| {
        let mut fitness = new();
        run(controller, scenario, trial, |world| fitness.observe(world))?;
        Ok(fitness.value())
    };
    let of_genome = |genome: &Genome| {
        let controller = Controller::new(genome);
        trials.iter().try_fold(u64::MAX, |worst, trial| {
            Ok(worst.min(of_trial(&controller, trial)?))
        })
    };
    genomes.par_iter().map(of_genome).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::population::Population;
    use minimal_surprise_controller::Topology;
    use minimal_surprise_sim::{Grid, NoiseRate, SeedTree};

    #[test]
    fn matches_on_the_plain_world_are_those_of_the_evaluation() {
        let seeds = SeedTree::new(2);
        let population = Population::random(Topology::default(), 5, seeds);
        let noise = NoiseRate::new(0.1).unwrap();
        let scenario = Scenario::new(Grid::new(7, 6).unwrap(), 12, 40, noise).unwrap();
        let trials: Vec<Trial> = (0..3).map(|n| scenario.trial(seeds, 0, n)).collect();
        let matches = evaluate(population.ask(), &scenario, &trials, Matches::default).unwrap();
        let expected = population
            .ask()
            .iter()
            .map(|genome| minimal_surprise_sim::evaluate(genome, &scenario, &trials).matches);
        assert!(matches.into_iter().eq(expected));
    }
}
