#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

mod error;
mod layout;
mod room;

pub use error::{Defect, PlaceError, UpdateError};
pub use layout::{
    BLOCK_BYTES, COMMIT_AT, CONTAINER_AT, Header, MADE_WRITE_COUNT_MAX, MAGIC, ROOM_BYTES,
    SLOT_BYTES_MIN, slot_bytes,
};
pub use room::{Buffer, InPlace, MappedFlash, Room};

use embedded_storage::nor_flash::NorFlash;
use layout::{Block, ERASED, commit_bytes, header_bytes};
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;
use minimal_surprise_controller::{Controller, EncodedGenome, Prediction, SensorModel, Topology};

/// Topology of the built-in controller: model C; the network predicts every sensor.
pub const BUILT_IN_TOPOLOGY: Topology = match Topology::new(SensorModel::C, Prediction::Free) {
    Ok(topology) => topology,
    Err(_) => panic!("model C exists"),
};

/// Returns the controller of a robot without a genome: it turns clockwise on the spot, whatever it
/// senses.
#[must_use]
pub fn built_in_controller() -> Controller {
    Controller::zeroed(BUILT_IN_TOPOLOGY)
}

/// One of the two slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Slot {
    /// The slot at the lower address.
    First,
    /// The slot at the higher address.
    Second,
}

impl Slot {
    /// Both slots, in the order of their addresses.
    pub const ALL: [Self; 2] = [Self::First, Self::Second];

    /// Returns the other slot.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }

    /// Returns 0 for the first slot and 1 for the second.
    #[must_use]
    pub const fn index(self) -> u8 {
        match self {
            Self::First => 0,
            Self::Second => 1,
        }
    }
}

/// Contents of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SlotState {
    /// No contents: header and commit record read as erased.
    Empty,
    /// An update that was never committed. Not a fault.
    Unfinished,
    /// A committed genome. The genome of the slot in use has been checked.
    Committed(Header),
    /// A committed genome that cannot be run. A fault.
    Damaged(Header, Defect),
    /// The flash reports an error when header and commit record are read. A fault, unless an update
    /// was interrupted: on chips with error correction, half-written words cannot be read.
    Unreadable,
}

impl SlotState {
    /// Returns the header of a slot that was committed.
    fn header(self) -> Option<Header> {
        match self {
            Self::Committed(header) | Self::Damaged(header, _) => Some(header),
            Self::Empty | Self::Unfinished | Self::Unreadable => None,
        }
    }

    /// Returns the write count; 0 if nothing was committed.
    fn write_count(self) -> u32 {
        self.header().map_or(0, |header| header.write_count)
    }
}

/// The genome that the robot must run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InUse<'a> {
    /// The newest genome.
    Slot {
        /// The slot that holds the genome.
        slot: Slot,
        /// The header of the slot.
        header: Header,
        /// The genome.
        genome: EncodedGenome<'a>,
    },
    /// [`built_in_controller`], because no slot holds a genome that can be run. A fault to report.
    BuiltIn,
}

impl InUse<'_> {
    /// Returns the controller to run.
    #[must_use]
    pub fn controller(&self) -> Controller {
        match self {
            Self::Slot { genome, .. } => Controller::from_encoded(genome),
            Self::BuiltIn => built_in_controller(),
        }
    }
}

/// An update that has begun and is not committed yet.
#[derive(Clone, Copy, Debug)]
struct Update {
    slot: Slot,
    header: Header,
    /// Number of bytes of the container received so far.
    taken: u16,
    /// The bytes that do not fill a block yet; the rest of the block is erased.
    block: Block,
}

/// Two slots in a flash.
///
/// ```
/// use minimal_surprise_controller::{Genome, Provenance, Topology, codec};
/// use minimal_surprise_slots::{Buffer, InUse, Slots};
/// # use robot_support::link_robot::Flash;
///
/// # let (flash, offset) = (Flash::new(), Flash::OFFSET);
/// let mut buffer = Buffer::new();
/// let mut slots = Slots::open(flash, offset, &mut buffer)?;
/// assert_eq!(slots.in_use(&mut buffer), InUse::BuiltIn);
///
/// let genome = Genome::zeroed(Topology::default());
/// let mut container = [0; codec::CONTAINER_BYTES_MAX];
/// let container = codec::encode(&genome, Provenance::default(), &mut container)?;
/// let write_count = slots.write(container, &mut buffer)?;
/// assert_eq!(write_count, 1);
///
/// // After a restart, the new genome is in use.
/// let mut slots = Slots::open(slots.release(), offset, &mut buffer)?;
/// assert_eq!(slots.in_use(&mut buffer).controller().topology(), genome.topology());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Slots<F> {
    flash: F,
    offset: u32,
    states: [SlotState; 2],
    in_use: Option<(Slot, Header)>,
    /// The largest write count found or assigned.
    write_count: u32,
    update: Option<Update>,
}

impl<F: NorFlash> Slots<F> {
    /// Size of one slot of this chip, in bytes.
    pub const SLOT_BYTES: usize = slot_bytes(F::ERASE_SIZE);

    /// Words must divide blocks and erase units; other chips are rejected at compile time.
    const CHIP_FITS: () = assert!(
        BLOCK_BYTES.is_multiple_of(F::WRITE_SIZE)
            && BLOCK_BYTES.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(F::WRITE_SIZE)
            && F::ERASE_SIZE.is_multiple_of(F::READ_SIZE)
            && slot_bytes(F::ERASE_SIZE) <= u32::MAX as usize / 2,
        "read and write sizes must be powers of two up to 32 that divide the erase size"
    );

    /// Finds the newest genome in the slots at `offset`, a byte address in `flash`. Writes nothing.
    /// Unreadable flash is reported as a [`SlotState`], not as an error.
    ///
    /// # Errors
    /// [`PlaceError`] if two slots cannot be placed at `offset`.
    pub fn open(flash: F, offset: u32, room: &mut impl Room<F>) -> Result<Self, PlaceError> {
        let () = Self::CHIP_FITS;
        let erase_size = F::ERASE_SIZE;
        if !(offset as usize).is_multiple_of(erase_size) {
            return Err(PlaceError::NotAligned { offset, erase_size });
        }
        let capacity = flash.capacity();
        let needed = u64::from(offset) + 2 * Self::SLOT_BYTES as u64;
        if needed > capacity.min(u32::MAX as usize) as u64 {
            return Err(PlaceError::OutOfBounds {
                offset,
                slot_bytes: Self::SLOT_BYTES,
                capacity,
            });
        }
        let mut slots = Self {
            flash,
            offset,
            states: [SlotState::Empty; 2],
            in_use: None,
            write_count: 0,
            update: None,
        };
        for slot in Slot::ALL {
            *slots.state_mut(slot) = slots.read_state(slot);
        }
        let [first, second] = slots.states.map(SlotState::write_count);
        slots.write_count = first.max(second);
        let newest = if first >= second {
            Slot::First
        } else {
            Slot::Second
        };
        for slot in [newest, newest.other()] {
            if slots.in_use.is_none()
                && let SlotState::Committed(header) = slots.state(slot)
            {
                match slots.check(slot, header, room) {
                    Ok(()) => slots.in_use = Some((slot, header)),
                    Err(defect) => *slots.state_mut(slot) = SlotState::Damaged(header, defect),
                }
            }
        }
        Ok(slots)
    }

    /// Returns the genome to run and its slot. Reads and checks the container again.
    pub fn in_use<'a>(&'a mut self, room: &'a mut impl Room<F>) -> InUse<'a> {
        let Some((slot, header)) = self.in_use else {
            return InUse::BuiltIn;
        };
        let at = self.address(slot, CONTAINER_AT);
        match container(&mut self.flash, room, at, header) {
            Ok(genome) => InUse::Slot {
                slot,
                header,
                genome,
            },
            Err(_) => InUse::BuiltIn,
        }
    }

    /// Returns the slot in use and its header; `None` if the built-in controller is in use.
    #[must_use]
    pub fn newest(&self) -> Option<(Slot, Header)> {
        self.in_use
    }

    /// Returns the current state of a slot.
    #[must_use]
    pub fn state(&self, slot: Slot) -> SlotState {
        let [first, second] = self.states;
        match slot {
            Slot::First => first,
            Slot::Second => second,
        }
    }

    /// Returns the largest write count in the slots. This is the number of genomes committed to
    /// these slots, as far as the slots record it.
    #[must_use]
    pub fn write_count(&self) -> u32 {
        self.write_count
    }

    /// Returns the flash.
    pub fn release(self) -> F {
        self.flash
    }

    /// Begins an update: erases the slot that is not in use and writes the header. `crc` is the
    /// last four bytes of the container, little-endian. Aborts an update in progress.
    ///
    /// The chip may stall while it erases, for seconds if erase units are large: stop motors first.
    ///
    /// # Errors
    /// [`UpdateError::ImpossibleLength`], [`UpdateError::CountExhausted`] or [`UpdateError::Flash`]
    /// if the update cannot begin.
    pub fn begin(&mut self, length: u16, crc: u32) -> Result<(), UpdateError<F::Error>> {
        self.update = None;
        let found = usize::from(length);
        if found == 0 || found > CONTAINER_BYTES_MAX {
            return Err(UpdateError::ImpossibleLength { found });
        }
        let write_count = self.write_count.checked_add(1);
        let header = Header {
            write_count: write_count.ok_or(UpdateError::CountExhausted)?,
            length,
            crc,
        };
        let slot = self.slot_to_write();
        let from = self.address(slot, 0);
        let to = self.address(slot, Self::SLOT_BYTES as u32);
        *self.state_mut(slot) = SlotState::Unfinished;
        self.flash.erase(from, to).map_err(UpdateError::Flash)?;
        self.write_block(from, &header.to_block(), header_bytes(F::WRITE_SIZE))?;
        self.update = Some(Update {
            slot,
            header,
            taken: 0,
            block: ERASED,
        });
        Ok(())
    }

    /// Writes the next bytes of the container; `offset` is the number of bytes before them.
    ///
    /// # Errors
    /// [`UpdateError::NotBegun`], [`UpdateError::WrongOffset`], [`UpdateError::TooMuch`] or
    /// [`UpdateError::Flash`] if the bytes cannot be written.
    pub fn chunk(&mut self, offset: u16, data: &[u8]) -> Result<(), UpdateError<F::Error>> {
        let update = self.update.ok_or(UpdateError::NotBegun)?;
        if offset != update.taken {
            return Err(UpdateError::WrongOffset {
                found: offset,
                expected: update.taken,
            });
        }
        let length = update.header.length;
        let excess = data
            .len()
            .saturating_sub(usize::from(length - update.taken));
        if excess > 0 {
            return Err(UpdateError::TooMuch { excess, length });
        }
        // A failed write ends the update.
        self.update = None;
        self.update = Some(self.take_bytes(update, data)?);
        Ok(())
    }

    /// Completes the update: reads the container back, checks it and commits it. Returns the write
    /// count. The new genome is then in use, even after a restart.
    ///
    /// # Errors
    /// [`UpdateError::NotBegun`], [`UpdateError::Incomplete`], [`UpdateError::NotWritten`],
    /// [`UpdateError::Defect`] or [`UpdateError::Flash`] if the genome cannot be committed.
    pub fn commit(&mut self, room: &mut impl Room<F>) -> Result<u32, UpdateError<F::Error>> {
        let update = self.update.ok_or(UpdateError::NotBegun)?;
        let Update {
            slot,
            header,
            taken,
            block,
        } = update;
        if taken != header.length {
            return Err(UpdateError::Incomplete {
                taken,
                length: header.length,
            });
        }
        self.update = None;
        let rest = usize::from(taken) % BLOCK_BYTES;
        if rest > 0 {
            let at = self.address(slot, CONTAINER_AT + u32::from(taken) - rest as u32);
            self.write_block(at, &block, rest.next_multiple_of(F::WRITE_SIZE))?;
        }
        self.check_block(self.address(slot, 0), &header.to_block())?;
        self.check(slot, header, room)?;

        let at = self.address(slot, COMMIT_AT);
        let commit = header.commit_block();
        let written = self.write_block(at, &commit, commit_bytes(F::WRITE_SIZE));
        // Only the bytes in flash matter, whatever the chip reported: after a restart, only they
        // are read.
        match self.check_block(at, &commit) {
            Ok(()) => {
                *self.state_mut(slot) = SlotState::Committed(header);
                self.in_use = Some((slot, header));
                self.write_count = header.write_count;
                Ok(header.write_count)
            }
            Err(unlike) => Err(written.err().unwrap_or(unlike)),
        }
    }

    /// Returns the number of bytes of the container received so far; `None` if no update is in
    /// progress.
    #[must_use]
    pub fn taken(&self) -> Option<u16> {
        self.update.map(|update| update.taken)
    }

    /// Performs a whole update. Before erasing anything, rejects bytes that are not a runnable
    /// genome; then begins, writes and commits. Returns the write count.
    ///
    /// # Errors
    /// [`UpdateError::ImpossibleLength`], [`UpdateError::CountExhausted`],
    /// [`UpdateError::NotWritten`], [`UpdateError::Defect`] or [`UpdateError::Flash`] if the genome
    /// is invalid or cannot be stored.
    pub fn write(
        &mut self,
        bytes: &[u8],
        room: &mut impl Room<F>,
    ) -> Result<u32, UpdateError<F::Error>> {
        EncodedGenome::decode(bytes).map_err(Defect::Refused)?;
        let found = bytes.len();
        let impossible = UpdateError::ImpossibleLength { found };
        let length = u16::try_from(found).map_err(|_| impossible)?;
        self.begin(length, crc_of(bytes).unwrap_or(0))?;
        self.chunk(0, bytes)?;
        self.commit(room)
    }

    fn take_bytes(
        &mut self,
        mut update: Update,
        data: &[u8],
    ) -> Result<Update, UpdateError<F::Error>> {
        for &byte in data {
            let place = usize::from(update.taken) % BLOCK_BYTES;
            if let Some(place) = update.block.get_mut(place) {
                *place = byte;
            }
            update.taken += 1;
            if place + 1 == BLOCK_BYTES {
                let behind = CONTAINER_AT + u32::from(update.taken);
                let at = self.address(update.slot, behind - BLOCK_BYTES as u32);
                self.write_block(at, &update.block, BLOCK_BYTES)?;
                update.block = ERASED;
            }
        }
        Ok(update)
    }

    /// Returns the slot that is not in use; if neither is in use, the slot with the older contents.
    fn slot_to_write(&self) -> Slot {
        let [first, second] = self.states.map(SlotState::write_count);
        match self.in_use {
            Some((slot, _)) => slot.other(),
            None if first <= second => Slot::First,
            None => Slot::Second,
        }
    }

    fn read_state(&mut self, slot: Slot) -> SlotState {
        let at = self.address(slot, 0);
        let commit_at = self.address(slot, COMMIT_AT);
        let (Ok(header), Ok(commit)) = (self.read_block(at), self.read_block(commit_at)) else {
            return SlotState::Unreadable;
        };
        match Header::from_block(&header) {
            Some(fields) if fields.to_block() == header && fields.commit_block() == commit => {
                SlotState::Committed(fields)
            }
            None if header == ERASED && commit == ERASED => SlotState::Empty,
            _ => SlotState::Unfinished,
        }
    }

    fn check(&mut self, slot: Slot, header: Header, room: &mut impl Room<F>) -> Result<(), Defect> {
        let at = self.address(slot, CONTAINER_AT);
        container(&mut self.flash, room, at, header).map(|_| ())
    }

    fn read_block(&mut self, at: u32) -> Result<Block, F::Error> {
        let mut block = ERASED;
        self.flash.read(at, &mut block)?;
        Ok(block)
    }

    /// Writes the first bytes of a block.
    fn write_block(
        &mut self,
        at: u32,
        block: &Block,
        bytes: usize,
    ) -> Result<(), UpdateError<F::Error>> {
        let words = block.get(..bytes).unwrap_or(block);
        self.flash.write(at, words).map_err(UpdateError::Flash)
    }

    fn check_block(&mut self, at: u32, block: &Block) -> Result<(), UpdateError<F::Error>> {
        match self.read_block(at) {
            Ok(found) if found == *block => Ok(()),
            Ok(_) => Err(UpdateError::NotWritten),
            Err(error) => Err(UpdateError::Flash(error)),
        }
    }

    /// Returns the address in flash of an offset in a slot.
    fn address(&self, slot: Slot, place: u32) -> u32 {
        let slots_before = u32::from(slot.index());
        self.offset + slots_before * Self::SLOT_BYTES as u32 + place
    }

    fn state_mut(&mut self, slot: Slot) -> &mut SlotState {
        let [first, second] = &mut self.states;
        match slot {
            Slot::First => first,
            Slot::Second => second,
        }
    }
}

/// Returns the genome at `at` if it is valid and its CRC matches the header.
fn container<'a, F: NorFlash>(
    flash: &'a mut F,
    room: &'a mut impl Room<F>,
    at: u32,
    header: Header,
) -> Result<EncodedGenome<'a>, Defect> {
    let bytes = room.container(flash, at, usize::from(header.length));
    let bytes = bytes.ok_or(Defect::Unreadable)?;
    let genome = EncodedGenome::decode(bytes)?;
    match crc_of(bytes) {
        Some(crc) if crc == header.crc => Ok(genome),
        found => Err(Defect::OtherContainer {
            found: found.unwrap_or(0),
            announced: header.crc,
        }),
    }
}

/// Returns the CRC-32C at the end of a container.
#[must_use]
pub fn crc_of(container: &[u8]) -> Option<u32> {
    let crc = container.last_chunk()?;
    Some(u32::from_le_bytes(*crc))
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_controller::{Action, SensorBits, State, Turn};

    #[test]
    fn the_built_in_controller_never_goes_straight() {
        let controller = built_in_controller();
        let mut inputs = 0;
        for bits in 0..=controller.topology().model().mask().bits() {
            for last in [Action::Straight, Action::Turn] {
                let (action, turn) = controller.decide(SensorBits::new(bits), last);
                assert_eq!((action, turn), (Action::Turn, Turn::Clockwise), "{bits:#x}");
                inputs += 1;
            }
        }
        assert_eq!(inputs, 32_768);
        let mut state = State::new(&controller);
        for bits in 0..=u16::MAX {
            let decision = controller.step(&mut state, SensorBits::new(bits));
            assert_eq!(decision.action, Action::Turn);
        }
    }
}
