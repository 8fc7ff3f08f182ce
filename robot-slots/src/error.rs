//! What can be wrong with a place for slots, with a slot, with an update.

use minimal_surprise_controller::DecodeError;
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;

/// There is no place for two slots there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PlaceError {
    /// Slots start where an erase unit does.
    #[error("slots at {offset}: not a multiple of the {erase_size} bytes erased at a time")]
    NotAligned {
        /// The byte address asked for.
        offset: u32,
        /// Bytes that the chip erases at a time.
        erase_size: usize,
    },
    /// The chip ends before the second slot does.
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

/// A slot was committed, but what is in it cannot be run.
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

/// An update was not carried out. The genome in use stays in use, and stays after a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateError<E: core::fmt::Debug> {
    /// The chip reports an error. The update is over; begin again.
    #[error("flash error: {0:?}")]
    Flash(E),
    /// No container is that long.
    #[error("a container of {found} bytes; they have 1 to {CONTAINER_BYTES_MAX}")]
    ImpossibleLength {
        /// The length announced.
        found: usize,
    },
    /// The write count has reached its end, after 2³² − 1 updates.
    #[error("no more updates can be counted")]
    CountExhausted,
    /// There is no update to go on with.
    #[error("no update has begun")]
    NotBegun,
    /// Chunks come in order, without gaps. The update goes on.
    #[error("a chunk for offset {found}; the next one starts at {expected}")]
    WrongOffset {
        /// Offset of the chunk, in bytes.
        found: u16,
        /// Bytes taken so far.
        expected: u16,
    },
    /// The chunk goes beyond the length announced. The update goes on.
    #[error("{excess} bytes beyond the {length} announced")]
    TooMuch {
        /// Bytes too many.
        excess: usize,
        /// The length announced.
        length: u16,
    },
    /// Not all of the container has arrived. The update goes on.
    #[error("{taken} of {length} bytes have arrived")]
    Incomplete {
        /// Bytes taken so far.
        taken: u16,
        /// The length announced.
        length: u16,
    },
    /// What is in flash is not what was written. The update is over; begin again.
    #[error("the flash does not hold what was written")]
    NotWritten,
    /// What is in flash is not a genome to run. The update is over.
    #[error(transparent)]
    Defect(#[from] Defect),
}
