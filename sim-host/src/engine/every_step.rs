//! Predictions step by step, for noisy swarms and for swarms too large to record as a whole: robots
//! stay in their lanes, and recordings are processed part by part.

use super::lanes::{BLOCK_STEPS, Blocks, LANES, Lanes, Matches};
use super::predictor::Predictor;
use super::recording::Recording;

/// The robots of a few repetitions, in groups of 32; the last group may be incomplete.
#[derive(Default)]
pub(super) struct Groups {
    started: bool,
    lanes: Vec<Lanes>,
    matched: Vec<u64>,
}

impl Groups {
    pub(super) fn reset(&mut self, robots: usize) {
        self.started = false;
        self.lanes.clear();
        self.lanes.resize(robots.div_ceil(LANES), Lanes::at_start());
        self.matched.clear();
        self.matched.resize(robots.next_multiple_of(LANES), 0);
    }

    /// Processes the recorded `steps`.
    pub(super) fn advance(&mut self, predictor: &Predictor, recording: &Recording, steps: usize) {
        let whole_blocks = steps / BLOCK_STEPS;
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
            let mut next = Blocks {
                inputs: [0; LANES],
                starting: if self.started { 0 } else { u32::MAX },
                first_steps: steps % BLOCK_STEPS,
            };
            for block in 0..steps.div_ceil(BLOCK_STEPS) {
                for (lane, input) in next.inputs.iter_mut().enumerate().take(in_group) {
                    *input = recording.of_robot(first + lane)[block];
                }
                predictor.run_block(lanes, &next, &mut matches);
                next.starting = 0;
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
        self.started = true;
    }

    /// Returns the number of matches of each robot.
    pub(super) fn matched(&self) -> &[u64] {
        &self.matched
    }
}
