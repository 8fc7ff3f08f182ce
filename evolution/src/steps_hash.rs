//! The hash of the steps of one run of a swarm: readings, actions, predictions and poses.
//!
//! A chain of SHA-256 hashes, so that a decoder can check the steps one at a time. The chain starts
//! with the SHA-256 of a fixed text, the number of robots in 64 bits and their starting poses. Each
//! step is `h ← SHA-256(h ‖ step)`: for every robot its reading in 16 bits, action and turn in 8
//! bits each, its new prediction in 16 bits, and its pose afterwards. A pose is x and y in 16 bits
//! each and the heading in 8. All numbers are little-endian.
//!
//! In version 1, a reading also includes the noise bits drawn beyond the model's sensors. Without
//! noise, both versions give the same hash.

use crate::text::hex;
use minimal_surprise_controller::SensorModel;
use minimal_surprise_controller::sensor::MAX_SENSORS;
use minimal_surprise_sim::noise::NoiseStream;
use minimal_surprise_sim::{Trial, World};
use sha2::{Digest, Sha256};
use std::fmt;

/// A reading is hashed as 16 bits.
const _: () = assert!(MAX_SENSORS <= u16::BITS as usize);

/// The text that starts the chain.
pub const START: &[u8] = b"minimal surprise steps, version 1";

/// Hashed bits of a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Version {
    /// All sixteen bits, as hashed in `steps_hash`.
    V1,
    /// The bits of sensors only, as hashed in `steps_hash_v2`.
    #[default]
    V2,
}

/// A steps hash recorded by a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedHash {
    /// Version of the hash.
    pub version: Version,
    /// The hash.
    pub hash: String,
}

/// State of the chain after some steps.
#[derive(Clone, Debug)]
pub struct StepsHash {
    chain: [u8; 32],
    /// In version 1: the noise, and the bits of a reading that no sensor uses.
    beyond_sensors: Option<(NoiseStream, u16)>,
}

impl StepsHash {
    /// Creates the chain for a swarm at the start of a trial.
    #[must_use]
    pub fn new(version: Version, trial: &Trial, model: SensorModel) -> Self {
        let starts = &trial.starts;
        let mut hash = Sha256::new_with_prefix(START);
        hash.update((starts.len() as u64).to_le_bytes());
        for &pose in starts {
            hash.update(pose.bytes());
        }
        let all_bits = version == Version::V1 && !trial.noise.rate().is_none();
        Self {
            chain: hash.finalize().into(),
            beyond_sensors: all_bits.then(|| (trial.noise.clone(), !model.mask().bits())),
        }
    }

    /// Adds the world's latest step.
    pub fn observe(&mut self, world: &World) {
        let mut hash = Sha256::new_with_prefix(self.chain);
        let robots = world.readings().iter().zip(world.decisions());
        for (robot, ((reading, decision), &pose)) in (0..).zip(robots.zip(world.poses())) {
            let beyond = self.beyond_sensors.as_mut().map_or(0, |(noise, bits)| {
                noise.draws(world.steps() - 1, robot) & *bits
            });
            hash.update((reading.bits() | beyond).to_le_bytes());
            hash.update([decision.action as u8, decision.turn as u8]);
            hash.update(decision.prediction.bits().to_le_bytes());
            hash.update(pose.bytes());
        }
        self.chain = hash.finalize().into();
    }
}

impl fmt::Display for StepsHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex(&self.chain))
    }
}
