//! The last two sectors of the chip's flash, for genome slots.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};
use firmware_example::stm32f4::{FLASH_ADDRESS, SECTOR_BYTES, SLOT_0_ADDRESS, SLOTS_BYTES};
use stm32f4xx_hal::flash::{Error, FlashExt};
use stm32f4xx_hal::pac::FLASH;

/// Offset of the slots in the chip's flash, in bytes.
const SLOTS_AT: u32 = SLOT_0_ADDRESS - FLASH_ADDRESS;

/// The slots' sectors. Offset 0 is the address of slot 0. The processor stalls while the flash
/// erases or writes.
pub(crate) struct SlotFlash {
    chip: FLASH,
}

/// Error of the slots' flash.
#[derive(Debug)]
pub(crate) enum SlotFlashError {
    /// The access is out of bounds or not aligned.
    Place(NorFlashErrorKind),
    /// The chip reports an error.
    Chip(Error),
}

impl NorFlashError for SlotFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place(kind) => *kind,
            Self::Chip(error) => error.kind(),
        }
    }
}

impl From<NorFlashErrorKind> for SlotFlashError {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self::Place(kind)
    }
}

impl SlotFlash {
    pub(crate) fn new(chip: FLASH) -> Self {
        Self { chip }
    }

    /// Clears the chip's error flags; while one is set, the chip rejects further operations.
    fn clear_errors(&mut self) {
        self.chip.sr().write(|w| {
            w.pgserr().clear_bit_by_one();
            w.pgperr().clear_bit_by_one();
            w.pgaerr().clear_bit_by_one();
            w.wrperr().clear_bit_by_one();
            w.operr().clear_bit_by_one()
        });
    }

    /// Clears the processor's data cache, which is not updated when the flash is erased.
    fn clear_cache(&mut self) {
        let acr = self.chip.acr();
        acr.modify(|_, w| w.dcen().clear_bit());
        acr.modify(|_, w| w.dcrst().set_bit());
        acr.modify(|_, w| w.dcrst().clear_bit());
        acr.modify(|_, w| w.dcen().set_bit());
    }
}

impl ErrorType for SlotFlash {
    type Error = SlotFlashError;
}

impl ReadNorFlash for SlotFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), SlotFlashError> {
        check_read(self, offset, bytes.len())?;
        let from = (SLOTS_AT + offset) as usize;
        let stored = FlashExt::read(&self.chip).get(from..from + bytes.len());
        let stored = stored.ok_or(NorFlashErrorKind::OutOfBounds)?;
        bytes.copy_from_slice(stored);
        Ok(())
    }

    /// Returns the size in bytes; 0 if the chip has less flash than expected.
    fn capacity(&self) -> usize {
        let end = (SLOTS_AT + SLOTS_BYTES) as usize;
        if self.chip.len() >= end {
            SLOTS_BYTES as usize
        } else {
            0
        }
    }
}

impl NorFlash for SlotFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), SlotFlashError> {
        check_erase(self, from, to)?;
        self.clear_errors();
        let mut unlocked = self.chip.unlocked();
        let erased = NorFlash::erase(&mut unlocked, SLOTS_AT + from, SLOTS_AT + to);
        drop(unlocked);
        self.clear_cache();
        erased.map_err(SlotFlashError::Chip)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), SlotFlashError> {
        check_write(self, offset, bytes.len())?;
        self.clear_errors();
        let mut unlocked = self.chip.unlocked();
        NorFlash::write(&mut unlocked, SLOTS_AT + offset, bytes).map_err(SlotFlashError::Chip)
    }
}
