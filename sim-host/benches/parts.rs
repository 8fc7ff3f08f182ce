//! Benchmarks of the parts of an evaluation, to locate a loss of speed:
//! `cargo bench -p minimal-surprise-sim`. `evolver bench` measures complete evaluations.

use divan::Bencher;
use divan::counter::ItemsCount;
use minimal_surprise_controller::{Controller, EncodedGenome, Genome, SensorModel};
use minimal_surprise_sim::structures::classify;
use minimal_surprise_sim::{
    Engine, EnginePath, Evaluator, Grid, NoiseRate, Scenario, SeedTree, TrialSet, World,
};
use std::hint::black_box;

/// Returns a genome from the middle of an evolution.
fn genome() -> Genome {
    let bytes = include_bytes!("evolved.genome");
    EncodedGenome::decode(bytes)
        .expect("a valid genome")
        .to_genome()
}

fn main() {
    divan::main();
}

fn trials(noise: f64, repetitions: u32) -> TrialSet {
    let grid = Grid::new(15, 15).expect("a valid grid");
    let noise = NoiseRate::new(noise).expect("a valid rate");
    let scenario = Scenario::new(grid, 100, 500, noise).expect("a valid scenario");
    let trials = (0..repetitions)
        .map(|repetition| scenario.trial(SeedTree::new(1), 0, repetition))
        .collect();
    TrialSet::new(scenario, SensorModel::C, trials)
}

#[divan::bench]
fn plain_worlds_step_of_100_robots(bencher: Bencher) {
    let trials = trials(0.0, 1);
    let controller = Controller::new(&genome());
    let trial = &trials.trials()[0];
    let grid = trials.scenario().grid();
    let mut world = World::new(grid, &trial.starts, &controller).expect("the start is valid");
    let mut noise = trial.noise.clone();
    bencher
        .counter(ItemsCount::new(100_usize))
        .bench_local(|| world.step(&controller, &mut noise));
}

/// Measures only the world of the fast engine: sensing, actions by table, moving.
#[divan::bench(args = EnginePath::available().into_iter().map(EnginePath::name))]
fn fast_world_of_500_steps(bencher: Bencher, path: &str) {
    let trials = trials(0.0, 1);
    let genome = genome();
    let mut evaluator = evaluator(path);
    bencher
        .counter(ItemsCount::new(50_000_usize))
        .bench_local(|| evaluator.motion(&genome, &trials, 0));
}

#[divan::bench(args = EnginePath::available().into_iter().map(EnginePath::name))]
fn evaluation(bencher: Bencher, path: &str) {
    evaluation_of(bencher, evaluator(path), 0.0);
}

#[divan::bench(args = EnginePath::available().into_iter().map(EnginePath::name))]
fn evaluation_without_the_shortcut(bencher: Bencher, path: &str) {
    evaluation_of(bencher, evaluator(path).with_repeats_skipped(false), 0.0);
}

#[divan::bench(args = EnginePath::available().into_iter().map(EnginePath::name))]
fn evaluation_with_noise(bencher: Bencher, path: &str) {
    evaluation_of(bencher, evaluator(path), 0.1);
}

#[divan::bench]
fn structures_of_100_robots(bencher: Bencher) {
    let trials = trials(0.0, 1);
    let grid = trials.scenario().grid();
    let poses = &trials.trials()[0].starts;
    bencher.bench(|| classify(grid, black_box(poses)));
}

fn evaluator(path: &str) -> Evaluator {
    let path = EnginePath::named(path).expect("the path is available");
    Evaluator::new(Engine::Fast, path)
}

fn evaluation_of(bencher: Bencher, mut evaluator: Evaluator, noise: f64) {
    let trials = trials(noise, 10);
    let genome = genome();
    bencher
        .counter(ItemsCount::new(500_000_usize))
        .bench_local(|| evaluator.evaluate(&genome, &trials));
}
