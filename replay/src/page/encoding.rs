//! Encoding of a recording's states as text for a page: bytes, deflated, in base64.
//!
//! Only the robots' actions, predictions and structures are stored. The page recomputes readings
//! from poses and the noise key, and poses from moves.
//!
//! | content | bytes |
//! |---|---|
//! | x, then y of the starting poses | two per robot |
//! | headings of the starting poses | one per robot |
//! | mispredicted bits in each step; robots that moved in each step | four per step |
//! | robots in the dominant structure in each state | four per state |
//! | blocks of [`BLOCK`] steps (see below) | |
//!
//! A block has `n` steps and their `n + 1` states; its last state is the first of the next block.
//! A block consists of planes: one byte per robot and step (or state), robot by robot. A plane of
//! states stores the first state, then the exclusive or of each state with the previous one.
//! Numbers are little-endian.
//!
//! | plane of a block | one byte per | present for |
//! |---|---|---|
//! | move: bit 0 action, bit 1 turn, bit 2 set if the robot moved | step | runs |
//! | prediction, low byte | state | runs |
//! | prediction, high byte | state | runs with more than 8 sensors |
//! | x low, x high, y low, y high, heading | state | trajectories |
//! | structures | state | both |

use crate::recording::Recording;
use data_encoding::BASE64;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use minimal_surprise_sim::Pose;
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;

/// Steps per block: the page decodes one block at a time.
pub const BLOCK: usize = 128;

/// The parameters that the page needs to decode the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Layout {
    /// Number of robots.
    pub robots: usize,
    /// Number of steps; the number of states is one more.
    pub steps: usize,
    /// Steps per block.
    pub block: usize,
    /// True if the recording contains more than poses.
    pub has_controller: bool,
    /// Bytes per prediction.
    pub prediction_bytes: usize,
}

/// Encodes a recording; returns the layout and the encoded text.
#[must_use]
pub fn encode(recording: &Recording) -> (Layout, String) {
    let layout = Layout {
        robots: recording.robots(),
        steps: recording.steps(),
        block: BLOCK,
        has_controller: recording.controller.is_some(),
        prediction_bytes: sensors(recording).div_ceil(8),
    };
    let mut bytes = Vec::new();
    let starts = recording.poses(0);
    bytes.extend(starts.iter().flat_map(|pose| pose.x.to_le_bytes()));
    bytes.extend(starts.iter().flat_map(|pose| pose.y.to_le_bytes()));
    bytes.extend(starts.iter().map(|pose| pose.heading as u8));
    for count in counts(recording) {
        bytes.extend(count.to_le_bytes());
    }
    let firsts: Vec<usize> = (0..layout.steps).step_by(BLOCK).collect();
    let blocks: Vec<Vec<u8>> = firsts
        .par_iter()
        .map(|&first| block(recording, layout, first))
        .collect();
    (layout, packed(&[&[bytes][..], &blocks].concat()))
}

/// Compresses bytes to text: deflated with a zlib header, in base64.
#[must_use]
pub fn packed(parts: &[Vec<u8>]) -> String {
    let mut deflate = ZlibEncoder::new(Vec::new(), Compression::default());
    for part in parts {
        // Writing to a vector cannot fail.
        let _ = deflate.write_all(part);
    }
    BASE64.encode(&deflate.finish().unwrap_or_default())
}

fn sensors(recording: &Recording) -> usize {
    recording
        .controller
        .as_ref()
        .map_or(0, |data| data.topology.sensors())
}

/// Returns the number of mispredicted bits for each step, then the number of robots that moved for
/// each step, then the number of robots in the dominant structure for each state.
fn counts(recording: &Recording) -> impl Iterator<Item = u32> {
    let steps = 0..recording.steps();
    let mispredicted = steps.clone().map(move |t| {
        let bits = (0..recording.robots()).filter_map(move |robot| {
            let sensed = recording.sensed(t, robot)?;
            Some(sensed.differing(recording.predicted(t, robot)?))
        });
        bits.sum()
    });
    let moved = steps.map(move |t| {
        let (from, to) = (recording.poses(t), recording.poses(t + 1));
        let moved = from.iter().zip(to).filter(|&(&a, &b)| has_moved(a, b));
        moved.count() as u32
    });
    let members = (0..=recording.steps()).map(move |t| recording.in_structure(t) as u32);
    mispredicted.chain(moved).chain(members)
}

fn has_moved(from: Pose, to: Pose) -> bool {
    (from.x, from.y) != (to.x, to.y)
}

/// Encodes the block that starts with step `first`.
fn block(recording: &Recording, layout: Layout, first: usize) -> Vec<u8> {
    let steps = BLOCK.min(layout.steps - first);
    let mut bytes = Vec::new();
    if layout.has_controller {
        bytes.extend(per_step(layout, first, steps, |t, robot| {
            move_code(recording, t, robot)
        }));
        let predicted = |t, robot| {
            let bits = recording.predicted(t, robot);
            bits.map_or([0; 2], |bits| bits.bits().to_le_bytes())
        };
        for byte in 0..layout.prediction_bytes {
            bytes.extend(per_state(layout, first, steps, |t, robot| {
                predicted(t, robot)[byte]
            }));
        }
    } else {
        for part in 0..5 {
            bytes.extend(per_state(layout, first, steps, |t, robot| {
                let pose = recording.poses(t)[robot];
                pose.bytes()[part]
            }));
        }
    }
    bytes.extend(per_state(layout, first, steps, |t, robot| {
        recording.members[t][robot].bits()
    }));
    bytes
}

fn move_code(recording: &Recording, t: usize, robot: usize) -> u8 {
    let decision = recording.trace.steps[t].decisions[robot];
    let moved = has_moved(recording.poses(t)[robot], recording.poses(t + 1)[robot]);
    decision.action as u8 | (decision.turn as u8) << 1 | u8::from(moved) << 2
}

/// Encodes a plane of steps.
fn per_step(
    layout: Layout,
    first: usize,
    steps: usize,
    value: impl Fn(usize, usize) -> u8,
) -> Vec<u8> {
    let robots = 0..layout.robots;
    let value = &value;
    robots
        .flat_map(|robot| (first..first + steps).map(move |t| value(t, robot)))
        .collect()
}

/// Encodes a plane of states.
fn per_state(
    layout: Layout,
    first: usize,
    steps: usize,
    value: impl Fn(usize, usize) -> u8,
) -> Vec<u8> {
    per_step(layout, first, steps + 1, |t, robot| {
        let now = value(t, robot);
        if t == first {
            now
        } else {
            now ^ value(t - 1, robot)
        }
    })
}
