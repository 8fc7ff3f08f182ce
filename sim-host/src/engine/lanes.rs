//! Lanes: the prediction networks of 32 robots, computed side by side, four steps at a time.
//!
//! A robot's inputs in four steps form one 64-bit word, a *block*. The caller assigns robots and
//! times to lanes: lanes are independent of each other.

use minimal_surprise_controller::network::MAX_HIDDEN;

/// Number of robots computed side by side.
pub(super) const LANES: usize = 32;
/// Number of steps of a block.
pub(super) const BLOCK_STEPS: usize = 4;
/// Number of pairs of hidden neurons: factors come in pairs because vector units multiply pairs.
pub(super) const PAIRS: usize = MAX_HIDDEN / 2;

/// The state of 32 robots between steps: hidden activations 2p (low half) and 2p + 1 (high half) of
/// pair p, lane by lane.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Lanes {
    pub(super) hidden: [[u32; LANES]; PAIRS],
}

/// The inputs of 32 robots in a block.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Blocks {
    /// Inputs of the robots, the first step in the lowest 16 bits.
    pub(super) inputs: [u64; LANES],
    /// One bit per lane, set if the robot in the lane is before its first step, so that its
    /// prediction is fixed.
    pub(super) starting: u32,
    /// Number of steps (0 to 3) whose matches are also counted separately.
    pub(super) first_steps: usize,
}

/// Number of matching bits in a block, lane by lane.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub(super) struct Matches {
    pub(super) block: [u16; LANES],
    /// Number of matching bits in the first `first_steps` steps only.
    pub(super) first_steps: [u16; LANES],
}

impl Lanes {
    /// Creates the state of robots before their first step.
    pub(super) fn at_start() -> Self {
        Self {
            hidden: [[0; LANES]; PAIRS],
        }
    }

    /// Resets a lane to the state of a robot before its first step.
    pub(super) fn restart(&mut self, lane: usize) {
        for pair in &mut self.hidden {
            pair[lane] = 0;
        }
    }
}
