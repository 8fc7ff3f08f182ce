//! Predictions without noise: stretches in which nothing changes are counted, not worked out.
//!
//! Once a robot's inputs are the same block over and over, its hidden activations soon are after
//! a block what they were before it. From then on until its inputs change every such block
//! matches in as many bits as the last one. Each lane is at its own place in the recording of its
//! own robot, skips by itself, and takes the next robot when it has come to the end.

use super::lanes::{BLOCK_STEPS, Blocks, LANES, Lanes, Matches, Predictor};
use super::recording::Recording;

/// Counts the matches of every robot recorded and hands them to `add`.
pub(super) fn count_matches(
    predictor: &Predictor,
    recording: &Recording,
    steps: usize,
    mut add: impl FnMut(usize, u64),
) {
    let whole_blocks = steps / BLOCK_STEPS;
    let mut waiting = 0..recording.robots();
    let mut lanes = Lanes::at_start();
    let mut matches = Matches::default();
    let mut robot = [0; LANES];
    let mut block = [0; LANES];
    let mut matched = [0_u64; LANES];
    let mut busy = 0_u32;
    let mut next = Blocks {
        inputs: [0; LANES],
        starting: 0,
        first_steps: steps % BLOCK_STEPS,
    };
    for (lane, first) in waiting.by_ref().take(LANES).enumerate() {
        robot[lane] = first;
        next.inputs[lane] = recording.of_robot(first)[0];
        busy |= 1 << lane;
    }
    next.starting = busy;
    while busy != 0 {
        // A robot's first prediction is not made by its network, so its first block stands alone.
        let unchanged = predictor.run_block(&mut lanes, &next, &mut matches) & !next.starting;
        next.starting = 0;
        let now_busy = busy;
        for lane in (0..LANES).filter(|lane| now_busy >> lane & 1 == 1) {
            let blocks = recording.of_robot(robot[lane]);
            if block[lane] == whole_blocks {
                matched[lane] += u64::from(matches.first_steps[lane]);
                block[lane] += 1;
            } else {
                let in_block = u64::from(matches.block[lane]);
                matched[lane] += in_block;
                block[lane] += 1;
                if unchanged >> lane & 1 == 1 {
                    let alike = blocks[block[lane]..whole_blocks]
                        .iter()
                        .take_while(|&&inputs| inputs == next.inputs[lane])
                        .count();
                    matched[lane] += alike as u64 * in_block;
                    block[lane] += alike;
                }
            }
            if let Some(&inputs) = blocks.get(block[lane]) {
                next.inputs[lane] = inputs;
                continue;
            }
            add(robot[lane], matched[lane]);
            match waiting.next() {
                Some(another) => {
                    robot[lane] = another;
                    block[lane] = 0;
                    matched[lane] = 0;
                    next.inputs[lane] = recording.of_robot(another)[0];
                    lanes.restart(lane);
                    next.starting |= 1 << lane;
                }
                None => busy &= !(1 << lane),
            }
        }
    }
}
