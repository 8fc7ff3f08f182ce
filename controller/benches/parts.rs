//! Benchmarks of the parts of a robot's step: `cargo bench -p minimal-surprise-controller`.

use divan::Bencher;
use divan::counter::ItemsCount;
use minimal_surprise_controller::{
    Controller, EncodedGenome, Genome, MutationRate, Provenance, SensorBits, State, activate, codec,
};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
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

#[divan::bench]
fn activation_of_all_inputs(bencher: Bencher) {
    bencher.counter(ItemsCount::new(65_536_usize)).bench(|| {
        (i16::MIN..=i16::MAX)
            .map(|x| i32::from(activate(black_box(x))))
            .sum::<i32>()
    });
}

#[divan::bench]
fn controller_from_a_genome(bencher: Bencher) {
    let genome = genome();
    bencher.bench(|| Controller::new(black_box(&genome)));
}

#[divan::bench]
fn genome_decoded(bencher: Bencher) {
    let mut buffer = [0; codec::CONTAINER_BYTES_MAX];
    let bytes = codec::encode(&genome(), Provenance::default(), &mut buffer).expect("it fits");
    bencher.bench(|| EncodedGenome::decode(black_box(bytes)).is_ok());
}

#[divan::bench]
fn genome_mutated(bencher: Bencher) {
    let rate = MutationRate::ratio(1, 10).expect("a valid rate");
    let mut stream = ChaCha8Rng::seed_from_u64(1);
    let mut genome = genome();
    bencher.bench_local(|| genome.mutate(rate, &mut stream));
}

#[divan::bench]
fn one_robots_decision(bencher: Bencher) {
    let controller = Controller::new(&genome());
    let state = State::new(&controller);
    bencher.bench(|| controller.decide(black_box(SensorBits::new(0x1234)), state.last_action()));
}

#[divan::bench]
fn one_robots_step(bencher: Bencher) {
    let controller = Controller::new(&genome());
    let mut state = State::new(&controller);
    bencher.bench_local(|| controller.step(&mut state, black_box(SensorBits::new(0x1234))));
}
