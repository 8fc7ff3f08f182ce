//! A custom optimiser: CMA-ES from the crate `cmaes` proposes the weights and receives their
//! fitness.
//!
//! `cargo run --release -p minimal-surprise-evolution --example ask_tell`

use cmaes::{CMAESOptions, DVector, Mode};
use minimal_surprise_controller::{Genome, Topology};
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_sim::{Engine, EnginePath, Evaluator, SeedTree, Trial, TrialSet};

/// Converts a real number to Q3.12, limited to the range of weights.
fn weight_q3_12(weight: f64) -> i16 {
    (weight * 4096.0).round().clamp(-32767.0, 32767.0) as i16
}

fn genome(topology: Topology, weights: &DVector<f64>) -> Genome {
    let weights: Vec<i16> = weights.iter().map(|&weight| weight_q3_12(weight)).collect();
    Genome::from_weights(topology, &weights).expect("as many weights as the topology has, in range")
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let settings = Settings::builder().steps(60).repetitions(2).build()?;
    let (scenario, topology) = (settings.scenario(), settings.topology());
    let seeds = SeedTree::new(settings.seed());
    let trial = |repetition| scenario.trial(seeds, 0, repetition);
    let trials: Vec<Trial> = (0..settings.repetitions()).map(trial).collect();
    let trials = TrialSet::new(*scenario, topology.model(), trials);
    let scored = settings.scored_bits() as f64;
    let fitness = |weights: &DVector<f64>| {
        let mut evaluator = Evaluator::new(Engine::Fast, EnginePath::best());
        evaluator
            .evaluate(&genome(topology, weights), &trials)
            .matches as f64
            / scored
    };
    let mut optimiser = CMAESOptions::new(vec![0.0; topology.weights()], 0.3)
        .mode(Mode::Maximize)
        .population_size(12)
        .seed(settings.seed())
        .build(fitness)
        .map_err(|error| format!("CMA-ES: {error:?}"))?;
    for generation in 0..10 {
        let stopped = optimiser.next_parallel();
        let best = optimiser.current_best_individual();
        let fitness = best.map_or(0.0, |best| best.value);
        println!("generation {generation}: fitness {fitness:.4}");
        if stopped.is_some() {
            break;
        }
    }
    Ok(())
}
