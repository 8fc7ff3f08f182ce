//! Ways to read the bytes of a container: into a buffer, or directly from memory-mapped flash.

use crate::layout::ROOM_BYTES;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

/// Access to the bytes of a container in flash.
pub trait Room<F: ReadNorFlash> {
    /// Returns the `length` bytes at `at`, or `None` if they cannot be read. `at` is a byte
    /// address, a multiple of the flash's read size; `length` is at most the maximum size of a
    /// container.
    fn container<'a>(&'a mut self, flash: &'a mut F, at: u32, length: usize) -> Option<&'a [u8]>;
}

/// Memory for one container, 1.3 KB. Place it in a `static`, because it is large for a stack.
#[derive(Clone, Debug)]
pub struct Buffer {
    bytes: [u8; ROOM_BYTES],
}

impl Buffer {
    /// Creates an empty buffer.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0; ROOM_BYTES],
        }
    }
}

impl Default for Buffer {
    fn default() -> Self {
        Self::new()
    }
}

impl<F: ReadNorFlash> Room<F> for Buffer {
    fn container<'a>(&'a mut self, flash: &'a mut F, at: u32, length: usize) -> Option<&'a [u8]> {
        let whole_words = length.checked_next_multiple_of(F::READ_SIZE)?;
        flash.read(at, self.bytes.get_mut(..whole_words)?).ok()?;
        self.bytes.get(..length)
    }
}

/// A chip whose flash the processor can address like memory.
pub trait MappedFlash: NorFlash {
    /// Returns the current contents of the whole flash, starting at its byte address 0.
    fn bytes(&self) -> &[u8];
}

/// Direct access to containers in memory-mapped flash, without copying.
#[derive(Clone, Copy, Debug, Default)]
pub struct InPlace;

impl<F: MappedFlash> Room<F> for InPlace {
    fn container<'a>(&'a mut self, flash: &'a mut F, at: u32, length: usize) -> Option<&'a [u8]> {
        let at = usize::try_from(at).ok()?;
        flash.bytes().get(at..at.checked_add(length)?)
    }
}
