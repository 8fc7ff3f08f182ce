//! Prints the instruction counts of a layer of activations and of a control step.
//!
//! Runs under QEMU with `-icount`. The counts depend on the compiler, so the expected
//! output is not stored.
#![no_std]
#![no_main]

use core::hint::black_box;
use cortex_m::Peripherals;
use cortex_m_rt::entry;
use defmt::println;
use firmware_example::emulator;
use firmware_example::instructions::Counter;
use firmware_example::parity::{MUTATIONS, SEED, draw_genome, draw_sensors};
use minimal_surprise_controller::{Controller, Decision, SensorBits, State, Topology, activate};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Number of input sets for which the activation instructions are counted.
const INPUT_SETS: u32 = 1000;

/// Number of steps of each genome that are counted.
const STEPS_PER_GENOME: u32 = 100;

#[entry]
fn main() -> ! {
    let peripherals = Peripherals::take().expect("first call");
    let counter = Counter::new(peripherals.SYST).expect("SysTick counts instructions");
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);

    let mut most = 0;
    for _ in 0..INPUT_SETS {
        let mut values: [i16; 14] = core::array::from_fn(|_| rng.next_u32() as i16);
        let (instructions, ()) = counter.count(|| layer(black_box(&mut values)));
        black_box(values);
        most = most.max(instructions);
    }
    println!(
        "14 activations: {=u32} instructions at most, of {=u32} sets of inputs",
        most, INPUT_SETS
    );

    let topology = Topology::default();
    let (mut most, mut steps) = (0, 0);
    for mutations in MUTATIONS {
        let controller = Controller::new(&draw_genome(topology, mutations, &mut rng));
        let mut state = State::new(&controller);
        let mut sensors = SensorBits::NONE;
        for _ in 0..STEPS_PER_GENOME {
            sensors = draw_sensors(sensors, &mut rng);
            let (instructions, decision) =
                counter.count(|| step(black_box(&controller), black_box(&mut state), sensors));
            black_box(decision);
            most = most.max(instructions);
            steps += 1;
        }
    }
    println!(
        "one control step: {=u32} instructions at most, of {=u32} steps",
        most, steps
    );
    emulator::succeed()
}

/// Computes the activations of a layer, in a separate function so that its instructions can be
/// counted and read.
#[inline(never)]
fn layer(values: &mut [i16; 14]) {
    for value in values {
        *value = activate(*value);
    }
}

/// Runs a control step; the count includes call and return.
#[inline(never)]
fn step(controller: &Controller, state: &mut State, sensors: SensorBits) -> Decision {
    controller.step(state, sensors)
}
