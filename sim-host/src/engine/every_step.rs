//! Predictions step by step, for noise and for swarms too large to record as a whole: robots stay
//! in their lanes, and recordings are worked off part by part.

use super::lanes::{BLOCK_STEPS, LANES, Lanes, Matches, Predictor};
use super::recording::Recording;

/// The robots of some repetitions, 32 to a group, whose last group may not be full.
#[derive(Default)]
pub(super) struct Groups {
    lanes: Vec<Lanes>,
    matched: Vec<u64>,
}

impl Groups {
    pub(super) fn reset(&mut self, robots: usize, expected_empty: u16) {
        self.lanes.clear();
        self.lanes
            .resize(robots.div_ceil(LANES), Lanes::at_start(expected_empty));
        self.matched.clear();
        self.matched.resize(robots.next_multiple_of(LANES), 0);
    }

    /// Goes on by the `steps` recorded.
    pub(super) fn advance(&mut self, predictor: &Predictor, recording: &Recording, steps: usize) {
        let whole_blocks = steps / BLOCK_STEPS;
        let last_steps = steps % BLOCK_STEPS;
        let robots = recording.robots();
        let mut matches = Matches::default();
        for (group, (lanes, matched)) in self
            .lanes
            .iter_mut()
            .zip(self.matched.chunks_exact_mut(LANES))
            .enumerate()
        {
            let first = group * LANES;
            let in_group = LANES.min(robots - first);
            let mut inputs = [0; LANES];
            for block in 0..steps.div_ceil(BLOCK_STEPS) {
                for (lane, input) in inputs.iter_mut().enumerate().take(in_group) {
                    *input = recording.of_robot(first + lane)[block];
                }
                predictor.run_block(lanes, &inputs, last_steps, &mut matches);
                let counts = if block < whole_blocks {
                    &matches.block
                } else {
                    &matches.first_steps
                };
                for (total, &count) in matched.iter_mut().zip(counts) {
                    *total += u64::from(count);
                }
            }
        }
    }

    /// Matches of robot `index`.
    pub(super) fn matched(&self) -> &[u64] {
        &self.matched
    }
}
