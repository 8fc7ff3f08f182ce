//! Errors for invalid slot locations, invalid slots and failed updates.

use minimal_surprise_controller::DecodeError;
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;

/// Error: the location cannot hold two slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PlaceError {
    /// The offset is not aligned to the chip's erase units.
    #[error("slots at {offset}, which is not a multiple of the erase size of {erase_size} bytes")]
    NotAligned {
        /// The byte address requested.
        offset: u32,
        /// Number of bytes that the chip erases at a time.
        erase_size: usize,
    },
    /// The second slot does not fit into the flash.
    #[error(
        "two slots of {slot_bytes} bytes at {offset} do not fit in a flash of {capacity} bytes"
    )]
    OutOfBounds {
        /// The byte address requested.
        offset: u32,
        /// Size of one slot, in bytes.
        slot_bytes: usize,
        /// Size of the flash, in bytes.
        capacity: usize,
    },
}

/// Reason why the genome of a committed slot cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Defect {
    /// The flash reports an error when it is read.
    #[error("the flash cannot be read")]
    Unreadable,
    /// The container does not match the CRC in the header.
    #[error("the container's CRC-32C is {found:08x}; the header states {announced:08x}")]
    OtherContainer {
        /// The container's last four bytes, little-endian.
        found: u32,
        /// The CRC in the header.
        announced: u32,
    },
    /// The container is not a genome that this controller can run.
    #[error(transparent)]
    Refused(#[from] DecodeError),
}

/// Error of an update. The genome in use stays in use, even after a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateError<E: core::fmt::Debug> {
    /// The chip reports an error. The update is aborted; begin a new one.
    #[error("flash error: {0:?}")]
    Flash(E),
    /// The length is not valid for a container.
    #[error("a container of {found} bytes; containers have 1 to {CONTAINER_BYTES_MAX}")]
    ImpossibleLength {
        /// The length stated at the start of the update.
        found: usize,
    },
    /// The write count has reached its maximum, after 2³² − 1 updates.
    #[error("the write count has reached its maximum")]
    CountExhausted,
    /// No update is in progress.
    #[error("no update has begun")]
    NotBegun,
    /// The chunk is out of order or leaves a gap. The update continues.
    #[error("a chunk for offset {found}; the next one starts at {expected}")]
    WrongOffset {
        /// Offset of the chunk, in bytes.
        found: u16,
        /// Number of bytes received so far.
        expected: u16,
    },
    /// The chunk exceeds the stated length. The update continues.
    #[error("{excess} bytes beyond the stated length of {length}")]
    TooMuch {
        /// Number of surplus bytes.
        excess: usize,
        /// The length stated at the start of the update.
        length: u16,
    },
    /// The container is incomplete. The update continues.
    #[error("only {taken} of {length} bytes have arrived")]
    Incomplete {
        /// Number of bytes received so far.
        taken: u16,
        /// The length stated at the start of the update.
        length: u16,
    },
    /// The bytes read back differ from those written. The update is aborted; begin a new one.
    #[error("the flash does not hold the bytes written")]
    NotWritten,
    /// The flash does not hold a genome that can be run. The update is aborted.
    #[error(transparent)]
    Defect(#[from] Defect),
}
