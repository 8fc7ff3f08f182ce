//! Hashes of everything that the controller computes. They must be equal on every machine.
//!
//! The hashes cover all 65,536 activations and, for every topology, the decisions and hidden values
//! of many control steps. Genomes and sensor bits come from ChaCha8 with the seed [`SEED`] and the
//! topology's index in [`Topology::ALL`] as its stream.

use core::fmt;
use minimal_surprise_controller::{
    Controller, Genome, MutationRate, Prediction, SensorBits, State, Topology, activate,
};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use sha2::{Digest as _, Sha256};

/// Seed of the generator that draws genomes and sensor bits.
pub const SEED: u64 = 0x5357_4152_4d20_4d34;

/// Number of times that every weight of a genome mutates, one entry per genome. The weights of the
/// last genomes cover the whole range of `i16`, and many of them are saturated.
pub const MUTATIONS: [u32; 10] = [0, 0, 1, 2, 5, 10, 50, 100, 500, 1000];

/// Number of control steps of each genome.
pub const STEPS_PER_GENOME: u32 = 1000;

/// Number of control steps of each topology.
pub const STEPS_PER_TOPOLOGY: u32 = MUTATIONS.len() as u32 * STEPS_PER_GENOME;

/// Number of control steps over all topologies.
pub const STEPS: u32 = Topology::ALL.len() as u32 * STEPS_PER_TOPOLOGY;

const _: () = assert!(STEPS >= 100_000);

/// A SHA-256 hash, displayed in hexadecimal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(pub [u8; 32]);

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for byte in self.0 {
            write!(f, "{byte:02x}")?;
        }
        Ok(())
    }
}

/// One result, displayed as the line that a program prints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Hash of all activations. Begins with the kernel ID.
    Activations(Digest),
    /// Hash of the control steps of one topology.
    Topology(Topology, Digest),
    /// Hash of all preceding digests, and therefore of all results.
    Total(Digest),
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Activations(digest) => write!(f, "65536 activations: {digest}"),
            Self::Topology(topology, digest) => {
                let model = topology.model();
                write!(f, "{STEPS_PER_TOPOLOGY} steps of {model:?} ")?;
                match topology.prediction() {
                    Prediction::Free => write!(f, "free")?,
                    Prediction::PartlyPredefined(template) => {
                        write!(f, "partly predefined {}", template.name())?;
                    }
                    Prediction::Predefined(template) => {
                        write!(f, "predefined {}", template.name())?;
                    }
                }
                write!(f, ": {digest}")
            }
            Self::Total(digest) => write!(f, "all, {STEPS} steps: {digest}"),
        }
    }
}

/// Computes all results, and passes each to `line` as soon as it is computed.
pub fn run(mut line: impl FnMut(Line)) {
    let mut total = Sha256::new();
    let digest = activations();
    total.update(digest.0);
    line(Line::Activations(digest));
    for (index, topology) in Topology::ALL.into_iter().enumerate() {
        let digest = control_steps(topology, index as u64);
        total.update(digest.0);
        line(Line::Topology(topology, digest));
    }
    line(Line::Total(Digest(total.finalize().into())));
}

/// Hashes every activation as a little-endian `i16`, in the order of the inputs from −32768 to
/// 32767.
#[must_use]
pub fn activations() -> Digest {
    let mut hash = Sha256::new();
    for x in i16::MIN..=i16::MAX {
        hash.update(activate(x).to_le_bytes());
    }
    Digest(hash.finalize().into())
}

/// Hashes [`STEPS_PER_TOPOLOGY`] steps: action, turn, prediction and all hidden values of each
/// step, and each genome's surprise at the end.
#[must_use]
pub fn control_steps(topology: Topology, stream: u64) -> Digest {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    rng.set_stream(stream);
    let mut hash = Sha256::new();
    for mutations in MUTATIONS {
        let controller = Controller::new(&draw_genome(topology, mutations, &mut rng));
        let mut state = State::new(&controller);
        let mut sensors = SensorBits::NONE;
        for _ in 0..STEPS_PER_GENOME {
            sensors = draw_sensors(sensors, &mut rng);
            let decision = controller.step(&mut state, sensors);
            hash.update([decision.action as u8, decision.turn as u8]);
            hash.update(decision.prediction.bits().to_le_bytes());
            for value in state.hidden_q3_12() {
                hash.update(value.to_le_bytes());
            }
        }
        let surprise = state.surprise();
        hash.update(surprise.mispredicted_bits.to_le_bytes());
        hash.update(surprise.seen_bits.to_le_bytes());
    }
    Digest(hash.finalize().into())
}

/// Draws a random genome and mutates every weight the given number of times.
#[must_use]
pub fn draw_genome(topology: Topology, mutations: u32, rng: &mut ChaCha8Rng) -> Genome {
    let every_weight = const { MutationRate::ratio(1, 1).unwrap() };
    let mut genome = Genome::random(topology, rng);
    for _ in 0..mutations {
        genome.mutate(every_weight, rng);
    }
    genome
}

/// Draws the next reading, similar to a robot's readings: half of the time, the previous reading; a
/// quarter of the time, the previous reading with one sensor changed; a quarter of the time, a new
/// random reading.
#[must_use]
pub fn draw_sensors(last: SensorBits, rng: &mut ChaCha8Rng) -> SensorBits {
    let word = rng.next_u32();
    SensorBits::new(match word >> 30 {
        0 | 1 => last.bits(),
        2 => last.bits() ^ 1 << (word >> 16 & 15),
        _ => word as u16,
    })
}
