//! Errors of a slot location, a slot and an update.

use minimal_surprise_controller::DecodeError;
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;

/// Two slots cannot be placed there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PlaceError {
    /// The offset is not aligned to the chip's erase units.
    #[error("slots at {offset}: not a multiple of the {erase_size} bytes erased at a time")]
    NotAligned {
        /// The byte address asked for.
        offset: u32,
        /// Bytes that the chip erases at a time.
        erase_size: usize,
    },
    /// The second slot does not fit into the flash.
    #[error("two slots of {slot_bytes} bytes at {offset} do not fit a flash of {capacity}")]
    OutOfBounds {
        /// The byte address asked for.
        offset: u32,
        /// Bytes of one slot.
        slot_bytes: usize,
        /// Bytes of the flash.
        capacity: usize,
    },
}

/// A slot was committed, but its genome cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Defect {
    /// The flash reports an error when it is read.
    #[error("the flash cannot be read")]
    Unreadable,
    /// The container is not the one that was announced.
    #[error("the container's CRC-32C is {found:08x}; {announced:08x} was announced")]
    OtherContainer {
        /// The container's last four bytes, little-endian.
        found: u32,
        /// What the header says.
        announced: u32,
    },
    /// The container is not a genome that this controller runs.
    #[error(transparent)]
    Refused(#[from] DecodeError),
}

/// An update failed. The genome in use stays in use, also after a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateError<E: core::fmt::Debug> {
    /// The chip reports an error. The update is over; begin again.
    #[error("flash error: {0:?}")]
    Flash(E),
    /// No container has this length.
    #[error("a container of {found} bytes; containers have 1 to {CONTAINER_BYTES_MAX}")]
    ImpossibleLength {
        /// The length announced.
        found: usize,
    },
    /// The write count has reached its maximum, after 2³² − 1 updates.
    #[error("no more updates can be counted")]
    CountExhausted,
    /// No update is in progress.
    #[error("no update has begun")]
    NotBegun,
    /// Chunks must arrive in order, without gaps. The update continues.
    #[error("a chunk for offset {found}; the next one starts at {expected}")]
    WrongOffset {
        /// Offset of the chunk, in bytes.
        found: u16,
        /// Bytes received so far.
        expected: u16,
    },
    /// The chunk exceeds the length announced. The update continues.
    #[error("{excess} bytes beyond the {length} announced")]
    TooMuch {
        /// Number of surplus bytes.
        excess: usize,
        /// The length announced.
        length: u16,
    },
    /// The container is incomplete. The update continues.
    #[error("{taken} of {length} bytes have arrived")]
    Incomplete {
        /// Bytes received so far.
        taken: u16,
        /// The length announced.
        length: u16,
    },
    /// The flash does not hold what was written. The update is over; begin again.
    #[error("the flash does not hold what was written")]
    NotWritten,
    /// The flash does not hold a genome that can be run. The update is over.
    #[error(transparent)]
    Defect(#[from] Defect),
}
