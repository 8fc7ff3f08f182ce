//! A custom selection: parents are drawn from the better half with equal probability.
//!
//! `cargo run --release -p minimal-surprise-evolution --example own_selection`

use minimal_surprise_evolution::fitness::{Matches, evaluate};
use minimal_surprise_evolution::population::Population;
use minimal_surprise_evolution::selection::SelectParent;
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_sim::seed::{Stream, uniform_below};
use minimal_surprise_sim::{SeedTree, Trial};

/// Slots of the better half of the genomes.
struct Truncation(Vec<usize>);

impl Truncation {
    fn new(fitness: &[u64]) -> Self {
        let mut slots: Vec<usize> = (0..fitness.len()).collect();
        slots.sort_by_key(|&slot| std::cmp::Reverse(fitness[slot]));
        slots.truncate(fitness.len().div_ceil(2));
        Self(slots)
    }
}

impl SelectParent for Truncation {
    fn draw(&self, rng: &mut Stream) -> usize {
        self.0[uniform_below(rng, self.0.len() as u64) as usize]
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let settings = Settings::builder()
        .steps(60)
        .population(12)
        .repetitions(2)
        .build()?;
    let (scenario, seeds) = (settings.scenario(), SeedTree::new(settings.seed()));
    let scored = settings.scored_bits() as f64;
    let mut population = Population::random(settings.topology(), settings.population(), seeds);
    for generation in 0..10 {
        let trial = |repetition| scenario.trial(seeds, generation, repetition);
        let trials: Vec<Trial> = (0..settings.repetitions()).map(trial).collect();
        let matches = evaluate(population.ask(), scenario, &trials, Matches::default)?;
        let best = matches.iter().max().copied().unwrap_or(0);
        println!(
            "generation {generation}: fitness {:.4}",
            best as f64 / scored
        );
        let parents = Truncation::new(&matches);
        population = population.tell_parents(&matches, &parents, settings.variation(), seeds);
    }
    Ok(())
}
