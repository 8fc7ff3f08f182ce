//! Neighbours from a range-and-bearing module on a serial line.
//!
//! No standard protocol exists for such modules; builders can implement this one in a few lines.
//! After each scan the module sends one frame, with the same framing as on the host's serial line
//! (`00`, COBS of message and CRC-32C, `00`; see `docs/link-protocol.md`). The message is
//!
//! | bytes | contents |
//! |---|---|
//! | 1 | number of neighbours found, 0 to 36 |
//! | 2 each | range in mm between the centres of the two robots, unsigned, little-endian |
//! | 2 each | bearing in 1/65536 turn, signed, little-endian; counter-clockwise from straight ahead |
//!
//! where each neighbour's bearing follows its range. Scans without neighbours are also sent: if the
//! module sends nothing, the robot treats it as broken and stops.

use core::f32::consts::PI;
use minimal_surprise_controller::neighbours::{Detection, Neighbours};
use minimal_surprise_link::Decoder;

/// Number of bearing units per half turn.
const HALF_TURN: f32 = 32768.0;

/// Receiver that finds scans in the bytes from a module.
#[derive(Debug, Default)]
pub struct RangeBearing {
    decoder: Decoder,
}

impl RangeBearing {
    /// Creates a receiver that has received nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
        }
    }

    /// Processes a byte. If the byte completes a scan, replaces `neighbours` with the neighbours
    /// found by the scan and returns true.
    pub fn feed<const N: usize>(&mut self, byte: u8, neighbours: &mut Neighbours<N>) -> bool {
        if !self.decoder.feed(byte) {
            return false;
        }
        let Some((&count, rest)) = self.decoder.payload().split_first() else {
            return false;
        };
        let (found, left) = rest.as_chunks();
        if found.len() != usize::from(count) || !left.is_empty() {
            return false;
        }
        neighbours.clear();
        for &[r0, r1, b0, b1] in found {
            let bearing = i16::from_le_bytes([b0, b1]);
            neighbours.push(Detection {
                range_mm: u16::from_le_bytes([r0, r1]).into(),
                bearing_rad: f32::from(bearing) * (PI / HALF_TURN),
            });
        }
        true
    }
}
