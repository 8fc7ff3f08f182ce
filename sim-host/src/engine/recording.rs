//! Recordings: the inputs of the robots' prediction networks, recorded while the world runs.
//!
//! A robot's inputs are stored together, one word per block of four steps, so that predictions can
//! be computed robot by robot, each at its own pace.

use super::flips::FlipSource;
use super::lanes::BLOCK_STEPS;
use super::path::EnginePath;
use super::repeats::History;
use super::robot_word::ROBOTS_AT_ONCE;
use super::swarm::{Behaviour, Swarm};

/// The inputs of several robots over several blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Recording {
    blocks: usize,
    words: Vec<u64>,
}

impl Recording {
    pub(super) fn reset(&mut self, robots: usize, blocks: usize) {
        self.blocks = blocks;
        self.words.resize(robots * blocks, 0);
    }

    pub(super) fn robots(&self) -> usize {
        self.words.len() / self.blocks
    }

    pub(super) fn blocks(&self) -> usize {
        self.blocks
    }

    /// Returns the blocks of one robot.
    #[inline]
    pub(super) fn of_robot(&self, robot: usize) -> &[u64] {
        &self.words[robot * self.blocks..][..self.blocks]
    }

    /// Fills the blocks of some robots, starting at `block`, by repeating the last `period` blocks.
    fn repeat(&mut self, first: usize, robots: usize, block: usize, period: usize) {
        let blocks = self.blocks;
        for words in self.of_robots(first, robots).chunks_exact_mut(blocks) {
            if period == 1 {
                let (before, after) = words.split_at_mut(block);
                after.fill(before[block - 1]);
                continue;
            }
            let from = block - period;
            let mut filled = block;
            while filled < blocks {
                let count = (filled - from).min(blocks - filled);
                words.copy_within(from..from + count, filled);
                filled += count;
            }
        }
    }

    /// Returns all blocks, robot by robot.
    pub(super) fn words(&self) -> &[u64] {
        &self.words
    }

    /// Returns the blocks of several consecutive robots.
    fn of_robots(&mut self, first: usize, robots: usize) -> &mut [u64] {
        &mut self.words[first * self.blocks..][..robots * self.blocks]
    }
}

/// Runs worlds and records them.
pub(super) struct Recorder {
    pub(super) path: EnginePath,
    rows: [Vec<u16>; BLOCK_STEPS],
    history: History,
}

impl Recorder {
    pub(super) fn new(path: EnginePath) -> Self {
        Self {
            path,
            rows: Default::default(),
            history: History::default(),
        }
    }

    /// Runs a swarm from its start for `steps` and records it, starting at robot index `first`.
    ///
    /// The world stops as soon as it repeats a state; the remaining blocks are copied.
    pub(super) fn record_until_it_repeats(
        &mut self,
        swarm: &mut Swarm,
        behaviour: &mut Behaviour<'_>,
        steps: usize,
        recording: &mut Recording,
        first: usize,
    ) {
        let robots = swarm.state().len();
        let blocks = recording.blocks();
        self.history.clear();
        for block in 0..blocks {
            if let Some(earlier) = self.history.find_or_add(swarm.state()) {
                let period = block - earlier;
                recording.repeat(first, robots, block, period);
                return;
            }
            let in_block = BLOCK_STEPS.min(steps - block * BLOCK_STEPS);
            let flips = &mut FlipSource::None;
            self.record_block(
                swarm,
                behaviour,
                flips,
                block * BLOCK_STEPS..block * BLOCK_STEPS + in_block,
                &mut recording.of_robots(first, robots)[block..],
                blocks,
            );
        }
    }

    /// Runs a swarm for the given steps and records them, starting at block 0.
    pub(super) fn record_steps(
        &mut self,
        swarm: &mut Swarm,
        behaviour: &mut Behaviour<'_>,
        flips: &mut FlipSource<'_>,
        steps: core::ops::Range<usize>,
        recording: &mut Recording,
        first: usize,
    ) {
        let robots = swarm.state().len();
        let blocks = recording.blocks();
        for (block, start) in steps.clone().step_by(BLOCK_STEPS).enumerate() {
            self.record_block(
                swarm,
                behaviour,
                flips,
                start..steps.end.min(start + BLOCK_STEPS),
                &mut recording.of_robots(first, robots)[block..],
                blocks,
            );
        }
    }

    /// Records one block of all robots; `words[0]` belongs to the first robot, and the words of the
    /// other robots follow at intervals of `stride`.
    fn record_block(
        &mut self,
        swarm: &mut Swarm,
        behaviour: &mut Behaviour<'_>,
        flips: &mut FlipSource<'_>,
        steps: core::ops::Range<usize>,
        words: &mut [u64],
        stride: usize,
    ) {
        let robots = swarm.state().len();
        for (row, step) in self.rows.iter_mut().zip(steps) {
            row.resize(robots.next_multiple_of(ROBOTS_AT_ONCE), 0);
            swarm.step(self.path, behaviour, flips.row(step, robots), row);
        }
        for row in &mut self.rows {
            row.resize(robots.next_multiple_of(ROBOTS_AT_ONCE), 0);
        }
        let [a, b, c, d] = &self.rows;
        let inputs = a.iter().zip(b).zip(c).zip(d);
        for (word, (((&a, &b), &c), &d)) in words.iter_mut().step_by(stride).zip(inputs) {
            *word = u64::from(a) | u64::from(b) << 16 | u64::from(c) << 32 | u64::from(d) << 48;
        }
    }
}
