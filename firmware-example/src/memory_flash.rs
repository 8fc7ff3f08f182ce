//! Flash emulated in RAM, as fast as memory-mapped flash.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Size of two slots, in bytes.
const BYTES: usize = 2 * MemoryFlash::ERASE_SIZE;

/// Flash in RAM.
#[derive(Debug)]
pub struct MemoryFlash {
    bytes: [u8; BYTES],
}

impl MemoryFlash {
    /// Creates a flash in its factory state.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0xff; BYTES],
        }
    }
}

impl Default for MemoryFlash {
    fn default() -> Self {
        Self::new()
    }
}

impl ErrorType for MemoryFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for MemoryFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        check_read(self, offset, bytes.len())?;
        let from = offset as usize;
        bytes.copy_from_slice(&self.bytes[from..from + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for MemoryFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        check_erase(self, from, to)?;
        self.bytes[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        check_write(self, offset, bytes.len())?;
        let from = offset as usize;
        self.bytes[from..from + bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}
