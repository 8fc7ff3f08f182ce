//! The hash of the steps of one run of a swarm: who sensed, did and expected what, and where.
//!
//! A chain of SHA-256, so that whoever decodes the steps can check them one at a time: it starts
//! with the SHA-256 of a fixed text, the number of robots in 64 bits and their starting poses. Each
//! step is `h ← SHA-256(h ‖ step)`: for every robot its reading in 16 bits, action and turn in 8
//! bits each, its new prediction in 16 bits, and its pose afterwards. A pose is x and y in 16 bits
//! each and the heading in 8. All little-endian.

use minimal_surprise_sim::{Pose, World};
use sha2::{Digest, Sha256};
use std::fmt;

/// What the chain starts with.
pub const START: &[u8] = b"minimal surprise steps, version 1";

/// The chain after some steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepsHash([u8; 32]);

impl StepsHash {
    /// A swarm at its start.
    #[must_use]
    pub fn starting_from(starts: &[Pose]) -> Self {
        let mut hash = Sha256::new_with_prefix(START);
        hash.update((starts.len() as u64).to_le_bytes());
        for &pose in starts {
            add_pose(&mut hash, pose);
        }
        Self(hash.finalize().into())
    }

    /// Adds the step that the world has just done.
    pub fn observe(&mut self, world: &World) {
        let mut hash = Sha256::new_with_prefix(self.0);
        let robots = world.readings().iter().zip(world.decisions());
        for ((reading, decision), &pose) in robots.zip(world.poses()) {
            hash.update(reading.bits().to_le_bytes());
            hash.update([decision.action as u8, decision.turn as u8]);
            hash.update(decision.prediction.bits().to_le_bytes());
            add_pose(&mut hash, pose);
        }
        self.0 = hash.finalize().into();
    }
}

impl fmt::Display for StepsHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

fn add_pose(hash: &mut Sha256, pose: Pose) {
    hash.update(pose.x.to_le_bytes());
    hash.update(pose.y.to_le_bytes());
    hash.update([pose.heading as u8]);
}
