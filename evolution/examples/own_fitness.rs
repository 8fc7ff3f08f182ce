//! A custom fitness function: swarms are selected for robots that keep moving.
//!
//! `cargo run --release -p minimal-surprise-evolution --example own_fitness`

use minimal_surprise_evolution::fitness::{Fitness, evaluate};
use minimal_surprise_evolution::population::Population;
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_sim::{Pose, SeedTree, Trial, World};

/// Number of forward steps of all robots together.
#[derive(Default)]
struct Moves {
    before: Vec<Pose>,
    moves: u64,
}

impl Fitness for Moves {
    fn observe(&mut self, world: &World) {
        let pairs = self.before.iter().zip(world.poses());
        let moved = pairs.filter(|(before, after)| (before.x, before.y) != (after.x, after.y));
        self.moves += moved.count() as u64;
        self.before = world.poses().to_vec();
    }

    fn value(&self) -> u64 {
        self.moves
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let settings = Settings::builder()
        .robots(60)
        .steps(60)
        .population(12)
        .repetitions(2)
        .build()?;
    let (scenario, seeds) = (settings.scenario(), SeedTree::new(settings.seed()));
    let mut population = Population::random(settings.topology(), settings.population(), seeds);
    for generation in 0..10 {
        let trial = |repetition| scenario.trial(seeds, generation, repetition);
        let trials: Vec<Trial> = (0..settings.repetitions()).map(trial).collect();
        let fitness = evaluate(population.ask(), scenario, &trials, Moves::default)?;
        let best = fitness.iter().max().copied().unwrap_or(0);
        println!("generation {generation}: {best} moves");
        population = population.tell(&fitness, settings.variation(), seeds);
    }
    Ok(())
}
