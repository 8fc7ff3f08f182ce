//! A genome's prediction network for each path.

use super::lanes::{Blocks, Lanes, Matches};
use super::network::PredictionWeights;
use super::path::EnginePath;
use super::portable;
#[cfg(target_arch = "x86_64")]
use super::x86;

/// A genome's prediction network, in the layout of a path.
pub(super) enum Predictor {
    Portable(Box<portable::Network>),
    #[cfg(target_arch = "x86_64")]
    Avx2(x86::Avx2, Box<x86::avx2::Network>),
    #[cfg(target_arch = "x86_64")]
    Avx512(x86::Avx512, Box<x86::avx512::Network>),
}

impl Predictor {
    pub(super) fn new(path: EnginePath, weights: &PredictionWeights) -> Self {
        match path {
            EnginePath::Portable => Self::Portable(Box::new(portable::Network::new(weights))),
            #[cfg(target_arch = "x86_64")]
            EnginePath::Avx2(cpu) => Self::Avx2(cpu, Box::new(x86::avx2::Network::new(weights))),
            #[cfg(target_arch = "x86_64")]
            EnginePath::Avx512(cpu) => {
                Self::Avx512(cpu, Box::new(x86::avx512::Network::new(weights)))
            }
        }
    }

    /// Runs four steps of all lanes. Returns one bit per lane, set if its hidden activations have
    /// not changed.
    #[inline]
    pub(super) fn run_block(
        &self,
        lanes: &mut Lanes,
        blocks: &Blocks,
        matches: &mut Matches,
    ) -> u32 {
        match self {
            Self::Portable(network) => network.run_block(lanes, blocks, matches),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(cpu, network) => cpu.run_block(network, lanes, blocks, matches),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(cpu, network) => cpu.run_block(network, lanes, blocks, matches),
        }
    }
}
