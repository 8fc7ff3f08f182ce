//! The hash of a run, which covers only the computed results.
//!
//! A chain of SHA-256 hashes: `h ← SHA-256(h ‖ best ‖ total ‖ matches of slot 0, 1, …)` for every
//! generation, starting from the SHA-256 of a fixed text; at the end `SHA-256(h ‖ weights of the
//! best genome ‖ final poses)`. Counts are 64 bits, weights 16, a pose is x and y in 16 bits each
//! and the heading in 8; all numbers are little-endian. The hash does not depend on version, time,
//! path, thread count or engine.

use crate::text::hex;
use minimal_surprise_controller::Genome;
use minimal_surprise_sim::Pose;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The text that starts the chain.
const START: &[u8] = b"minimal surprise run, version 1";

/// State of the chain after some generations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunHash([u8; 32]);

impl Default for RunHash {
    fn default() -> Self {
        Self(Sha256::digest(START).into())
    }
}

impl RunHash {
    /// Returns the chain extended by a generation's matches, by slot.
    #[must_use]
    pub fn generation(self, matches: &[u64]) -> Self {
        let best = matches.iter().copied().max().unwrap_or(0);
        let total: u64 = matches.iter().sum();
        let mut hash = Sha256::new_with_prefix(self.0);
        for count in [best, total].iter().chain(matches) {
            hash.update(count.to_le_bytes());
        }
        Self(hash.finalize().into())
    }

    /// Returns the final hash, which includes the best genome and the swarm's final poses.
    #[must_use]
    pub fn end(self, best: &Genome, final_poses: &[Pose]) -> Self {
        let mut hash = Sha256::new_with_prefix(self.0);
        for weight in best.weights() {
            hash.update(weight.to_le_bytes());
        }
        for pose in final_poses {
            hash.update(pose.bytes());
        }
        Self(hash.finalize().into())
    }
}

impl std::fmt::Display for RunHash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&hex(&self.0))
    }
}
