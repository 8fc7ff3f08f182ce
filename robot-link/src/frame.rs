//! Frames: `00`, COBS of message and CRC-32C, `00`.

use cobs::{CobsEncoder, DecodeResult, DecoderState};
use minimal_surprise_controller::codec::CRC_32C;
use serde::Serialize;

/// Maximum size of a message, in bytes.
pub const PAYLOAD_BYTES_MAX: usize = 146;
/// Size of the CRC-32C after the message, in bytes; little-endian.
const CRC_BYTES: usize = 4;
/// Maximum size of a frame before COBS, in bytes.
pub const FRAME_BYTES_MAX: usize = PAYLOAD_BYTES_MAX + CRC_BYTES;
/// Maximum size of a frame on the line, in bytes: one zero before it, one byte added by COBS, and
/// one zero after it.
pub const WIRE_BYTES_MAX: usize = FRAME_BYTES_MAX + 3;

// One byte of overhead is enough for frames this short.
const _: () = assert!(FRAME_BYTES_MAX < 254);

/// Error: the message does not fit in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("a message of more than {PAYLOAD_BYTES_MAX} bytes")]
pub struct EncodeError;

/// Writes a message as a frame to `wire` and returns the number of bytes written.
///
/// # Errors
/// [`EncodeError`] if the message or the frame does not fit.
pub fn encode(message: &impl Serialize, wire: &mut [u8]) -> Result<usize, EncodeError> {
    let mut frame = [0; FRAME_BYTES_MAX];
    let payload = frame.get_mut(..PAYLOAD_BYTES_MAX).ok_or(EncodeError)?;
    let payload = postcard::to_slice(message, payload).map_err(|_| EncodeError)?;
    let crc = CRC_32C.checksum(payload).to_le_bytes();
    let (first, rest) = wire.split_first_mut().ok_or(EncodeError)?;
    let mut encoder = CobsEncoder::new(rest);
    encoder.push(payload).map_err(|_| EncodeError)?;
    encoder.push(&crc).map_err(|_| EncodeError)?;
    let length = encoder.finalize();
    *first = 0;
    *rest.get_mut(length).ok_or(EncodeError)? = 0;
    Ok(length + 2)
}

/// Counts of received data that was not a valid frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineErrors {
    /// Number of frames with a wrong CRC.
    pub bad_crc: u32,
    /// Number of byte sequences between two zeros that are not a frame: damaged, truncated or too
    /// long.
    pub no_frame: u32,
}

/// Detector of frames in a stream of bytes, some of which may be missing, wrong or extra.
#[derive(Debug)]
pub struct Decoder {
    cobs: DecoderState,
    bytes: [u8; FRAME_BYTES_MAX],
    length: usize,
    too_long: bool,
    complete: bool,
    errors: LineErrors,
}

impl Decoder {
    /// Creates a decoder that has received nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            cobs: DecoderState::Idle,
            bytes: [0; FRAME_BYTES_MAX],
            length: 0,
            too_long: false,
            complete: false,
            errors: LineErrors {
                bad_crc: 0,
                no_frame: 0,
            },
        }
    }

    /// Processes one byte; returns true if the byte completes a frame with a correct CRC. The
    /// message is in [`Decoder::payload`] until the next byte is fed.
    pub fn feed(&mut self, byte: u8) -> bool {
        if self.complete {
            self.start_over();
        }
        match self.cobs.feed(byte) {
            Ok(DecodeResult::NoData) => false,
            Ok(DecodeResult::DataContinue(byte)) => {
                match self.bytes.get_mut(self.length) {
                    Some(place) => {
                        *place = byte;
                        self.length += 1;
                    }
                    None => self.too_long = true,
                }
                false
            }
            Ok(DecodeResult::DataComplete) => {
                self.complete = self.check();
                if !self.complete {
                    self.start_over();
                }
                self.complete
            }
            Err(_) => {
                count(&mut self.errors.no_frame);
                self.start_over();
                false
            }
        }
    }

    /// Returns the message of the frame that the last byte completed; empty if it completed no
    /// frame.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        match self.frame() {
            Some((payload, _)) if self.complete => payload,
            _ => &[],
        }
    }

    /// Returns the CRC of the frame that the last byte completed; 0 if it completed no frame.
    #[must_use]
    pub fn crc(&self) -> u32 {
        match self.frame() {
            Some((_, crc)) if self.complete => crc,
            _ => 0,
        }
    }

    /// Returns the counts of received data that was not a valid frame.
    #[must_use]
    pub fn errors(&self) -> LineErrors {
        self.errors
    }

    /// Splits the frame received into message and CRC.
    fn frame(&self) -> Option<(&[u8], u32)> {
        let (payload, crc) = self.bytes.get(..self.length)?.split_last_chunk()?;
        Some((payload, u32::from_le_bytes(*crc)))
    }

    fn check(&mut self) -> bool {
        match self.frame() {
            Some((payload, crc)) if !self.too_long && !payload.is_empty() => {
                let good = CRC_32C.checksum(payload) == crc;
                if !good {
                    count(&mut self.errors.bad_crc);
                }
                good
            }
            _ => {
                count(&mut self.errors.no_frame);
                false
            }
        }
    }

    fn start_over(&mut self) {
        self.length = 0;
        self.too_long = false;
        self.complete = false;
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// Adds one to a counter, saturating.
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
