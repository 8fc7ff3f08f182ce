//! Prints the cost of the controller: instructions, memory and stack. Each line consists of a key
//! of `budget.toml` and the maximum value measured.
//!
//! Runs under QEMU with `-icount`. The values depend on the compiler, so the expected
//! output is not stored; the `budget` test compares them with `budget.toml`.
//!
//! Uses `unsafe` for assembly that starts the clock before any other code.
#![no_std]
#![no_main]
#![allow(unsafe_code)]

use core::arch::global_asm;
use core::hint::black_box;
use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m_rt::entry;
use defmt::println;
use firmware_example::emulator;
use firmware_example::instructions::{Counter, RELOAD};
use firmware_example::memory_flash::MemoryFlash;
use firmware_example::parity::{MUTATIONS, SEED, draw_genome, draw_sensors};
use firmware_example::stack;
use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, Provenance, encode};
use minimal_surprise_controller::{
    Controller, Decision, EncodedGenome, SensorBits, SensorModel, State, Topology, activate,
};
use minimal_surprise_slots::{Buffer, InUse, Slots};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Number of input sets for which the activation instructions are counted.
const INPUT_SETS: u32 = 1000;
/// Number of steps of each genome that are counted.
const STEPS_PER_GENOME: u32 = 100;
/// Number of stack bytes used to test the stack measurement.
const KNOWN_BYTES: usize = 400;

// Starts the clock at reset: writes SysTick's reload value, its current value, then its control
// register (on, the processor's clock, no interrupt).
global_asm!(
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =0xe000e010",
    "ldr r1, =0x00ffffff",
    "str r1, [r0, #4]",
    "str r1, [r0, #8]",
    "movs r1, #5",
    "str r1, [r0]",
    "bx lr",
);

#[entry]
fn main() -> ! {
    let reset_ticks = RELOAD - SYST::get_current();
    let peripherals = Peripherals::take().expect("first call");
    let counter = Counter::new(peripherals.SYST).expect("SysTick counts instructions");
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);

    let mut layer_most = 0;
    for _ in 0..INPUT_SETS {
        let mut values: [i16; 14] = core::array::from_fn(|_| rng.next_u32() as i16);
        let (instructions, ()) = counter.count(|| layer(black_box(&mut values)));
        black_box(values);
        layer_most = layer_most.max(instructions);
    }
    println!("activations_14_instructions {=u32}", layer_most);

    let mut flash = MemoryFlash::new();
    let mut room = Buffer::new();
    let mut container = [0; CONTAINER_BYTES_MAX];
    let (mut step_most, mut step_depth, mut decode_depth, mut start_most) = (0, 0, 0, 0);
    let (mut build_depth, mut open_depth) = (0, 0);
    let model_c = Topology::ALL
        .into_iter()
        .filter(|topology| topology.model() == SensorModel::C);
    for topology in model_c {
        for mutations in MUTATIONS {
            let genome = draw_genome(topology, mutations, &mut rng);
            let provenance = Provenance {
                seed: Some(u64::MAX),
                generation: u32::MAX,
                matched_bits: u64::MAX,
                scored_bits: u64::MAX,
            };
            let bytes = encode(&genome, provenance, &mut container).expect("it fits");
            let depth = stack::depth(&mut || {
                black_box(decode(black_box(bytes)));
            });
            decode_depth = decode_depth.max(depth);
            let depth = stack::depth(&mut || build(black_box(bytes)));
            build_depth = build_depth.max(depth);

            let mut slots = Slots::open(&mut flash, 0, &mut room).expect("the slots fit");
            slots.write(bytes, &mut room).expect("the genome fits");
            let depth = stack::depth(&mut || open(&mut flash, &mut room));
            open_depth = open_depth.max(depth);
            let (instructions, controller) = counter.count(|| start(&mut flash, &mut room));
            start_most = start_most.max(instructions);

            let mut state = State::new(&controller);
            let mut sensors = SensorBits::NONE;
            for _ in 0..STEPS_PER_GENOME {
                sensors = draw_sensors(sensors, &mut rng);
                let (instructions, decision) =
                    counter.count(|| step(black_box(&controller), black_box(&mut state), sensors));
                black_box(decision);
                step_most = step_most.max(instructions);
                let depth = stack::depth(&mut || {
                    black_box(step(black_box(&controller), black_box(&mut state), sensors));
                });
                step_depth = step_depth.max(depth);
            }
        }
    }
    println!("step_instructions {=u32}", step_most);
    println!("step_stack_bytes {=u32}", step_depth);
    println!("decode_stack_bytes {=u32}", decode_depth);
    println!("build_stack_bytes {=u32}", build_depth);
    println!("start_stack_bytes {=u32}", open_depth);
    println!(
        "ram_bytes {=usize}",
        size_of::<Controller>() + size_of::<State>()
    );
    println!(
        "reset_to_first_step_instructions {=u32}",
        counter.instructions(reset_ticks) + start_most + step_most
    );
    let known = stack::depth(&mut || known_depth());
    assert!((KNOWN_BYTES..KNOWN_BYTES + 100).contains(&(known as usize)));
    emulator::succeed()
}

/// Computes the activations of a layer.
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

/// Returns true if the bytes are a genome.
#[inline(never)]
fn decode(bytes: &[u8]) -> bool {
    EncodedGenome::decode(bytes).is_ok()
}

#[inline(never)]
fn build(bytes: &[u8]) {
    if let Ok(genome) = EncodedGenome::decode(bytes) {
        black_box(&Controller::from_encoded(&genome));
    }
}

/// Runs the code that a robot runs at startup.
#[inline(never)]
fn start(flash: &mut MemoryFlash, room: &mut Buffer) -> Controller {
    let mut slots = Slots::open(flash, 0, room).expect("the slots fit");
    let in_use = slots.in_use(room);
    assert!(matches!(in_use, InUse::Slot { .. }));
    in_use.controller()
}

#[inline(never)]
fn open(flash: &mut MemoryFlash, room: &mut Buffer) {
    black_box(&start(flash, room));
}

/// Uses a known amount of stack, so that wrong measurements are detected.
#[inline(never)]
fn known_depth() {
    black_box(&mut [black_box(1_u8); KNOWN_BYTES]);
}
