//! Predefined predictions: without a network, blocks are compared with a constant.

use super::lanes::BLOCK_STEPS;
use super::recording::Recording;

/// Counts the matches of every robot over the recorded `steps` and passes them to `add`.
pub(super) fn count_matches(
    recording: &Recording,
    steps: usize,
    expected_empty: u16,
    sensors: u16,
    mut add: impl FnMut(usize, u64),
) {
    let in_every_step = 0x0001_0001_0001_0001;
    let expected_empty = u64::from(expected_empty) * in_every_step;
    let sensors = u64::from(sensors) * in_every_step;
    let whole_blocks = steps / BLOCK_STEPS;
    let last_steps = (1_u64 << (16 * (steps % BLOCK_STEPS))) - 1;
    for robot in 0..recording.robots() {
        let blocks = recording.of_robot(robot);
        let matching = |block: u64| (block ^ expected_empty) & sensors;
        let mut matched = 0;
        for &block in &blocks[..whole_blocks] {
            matched += u64::from(matching(block).count_ones());
        }
        if let Some(&block) = blocks.get(whole_blocks) {
            matched += u64::from((matching(block) & last_steps).count_ones());
        }
        add(robot, matched);
    }
}
