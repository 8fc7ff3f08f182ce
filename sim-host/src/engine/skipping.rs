//! Predictions without noise: blocks in which nothing changes are counted, not computed.
//!
//! If the same block of inputs repeats, the hidden activations of a robot soon become the same
//! before and after a block. As long as the inputs do not change after that, every block has as
//! many matching bits as the previous one. Each lane has its own position in the recording of its
//! robot, skips independently, and takes the next robot when its recording is complete.

use super::lanes::{BLOCK_STEPS, Blocks, LANES, Lanes, Matches};
use super::predictor::Predictor;
use super::recording::Recording;

/// Counts the matches of every recorded robot and passes them to `add`.
pub(super) fn count_matches(
    predictor: &Predictor,
    recording: &Recording,
    steps: usize,
    mut add: impl FnMut(usize, u64),
) {
    let words = recording.words();
    let whole_blocks = steps / BLOCK_STEPS;
    let last_steps = steps % BLOCK_STEPS;
    let mut lanes = Lanes::at_start();
    let mut matches = Matches::default();
    let mut places = [Place::default(); LANES];
    let mut next = Blocks {
        inputs: [0; LANES],
        starting: 0,
        first_steps: last_steps,
    };
    // Lanes that have a robot, and those of them whose next block is the last, incomplete one.
    let (mut busy, mut ending) = (0_u32, 0_u32);
    // Robots are assigned to lanes in order.
    let mut waiting = 0..recording.robots();
    let mut take = |place: &mut Place| {
        let robot = waiting.next()?;
        let word = robot * recording.blocks();
        *place = Place {
            robot,
            word,
            end: word + whole_blocks,
            matched: 0,
        };
        Some(words[word])
    };
    for (lane, place) in places.iter_mut().enumerate() {
        if let Some(inputs) = take(place) {
            next.inputs[lane] = inputs;
            busy |= 1 << lane;
        }
    }
    next.starting = busy;
    if whole_blocks == 0 {
        ending = busy;
    }
    while busy != 0 {
        // A robot's first prediction does not come from its network, so its first block cannot be
        // repeated.
        let unchanged = predictor.run_block(&mut lanes, &next, &mut matches) & !next.starting;
        next.starting = 0;

        // Every lane counts its matches and moves to the next block.
        let (mut at_end, mut alike) = (0, 0);
        for (lane, place) in places.iter_mut().enumerate() {
            place.matched += u64::from(matches.block[lane]);
            place.word += 1;
            at_end |= u32::from(place.word >= place.end) << lane;
            let inputs = words.get(place.word).copied().unwrap_or(0);
            alike |= u32::from(inputs == next.inputs[lane]) << lane;
            next.inputs[lane] = inputs;
        }

        // Some lanes skip blocks or reach the end.
        for lane in ones(busy & (at_end | unchanged & alike)) {
            let place = &mut places[lane];
            if ending >> lane & 1 == 1 {
                ending ^= 1 << lane;
                place.matched -= u64::from(matches.block[lane]);
                place.matched += u64::from(matches.first_steps[lane]);
            } else {
                if place.word < place.end {
                    let left = &words[place.word..place.end];
                    let skipped = alike_at_start(left, next.inputs[lane]);
                    place.matched += skipped as u64 * u64::from(matches.block[lane]);
                    place.word += skipped;
                    next.inputs[lane] = words.get(place.word).copied().unwrap_or(0);
                }
                if place.word < place.end {
                    continue;
                }
                if last_steps > 0 {
                    ending |= 1 << lane;
                    continue;
                }
            }
            add(place.robot, place.matched);
            match take(place) {
                Some(inputs) => {
                    next.inputs[lane] = inputs;
                    next.starting |= 1 << lane;
                    ending |= u32::from(whole_blocks == 0) << lane;
                    lanes.restart(lane);
                }
                None => busy ^= 1 << lane,
            }
        }
    }
}

/// The position of a lane.
#[derive(Clone, Copy, Default)]
struct Place {
    robot: usize,
    /// Index of the next block among all recorded blocks.
    word: usize,
    /// End of the robot's complete blocks.
    end: usize,
    matched: u64,
}

/// Iterates over the indices of the bits that are set.
fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lowest = (bits != 0).then(|| bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        lowest
    })
}

/// Counts the leading blocks that equal `block`.
fn alike_at_start(blocks: &[u64], block: u64) -> usize {
    let (chunks, _) = blocks.as_chunks::<8>();
    let all_alike = |chunk: &&[u64; 8]| chunk.iter().fold(0, |d, &b| d | (b ^ block)) == 0;
    let alike = 8 * chunks.iter().take_while(all_alike).count();
    let rest = blocks[alike..].iter();
    alike + rest.take_while(|&&b| b == block).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_of_every_length_are_measured() {
        for length in 0..40 {
            let mut blocks = vec![7; length];
            assert_eq!(alike_at_start(&blocks, 7), length);
            blocks.extend([8, 7, 7]);
            assert_eq!(alike_at_start(&blocks, 7), length);
        }
    }

    #[test]
    fn ones_are_listed_from_the_lowest() {
        assert_eq!(ones(0b1001_0010).collect::<Vec<_>>(), [1, 4, 7]);
        assert_eq!(ones(u32::MAX).count(), 32);
    }
}
