//! The layout of a slot, and the bytes of its header and its commit record.

use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, CRC_32C};

/// Alignment of every part of a slot, in bytes. The layout is the same for every chip: words may
/// have 1, 2, 4, 8, 16 or 32 bytes.
pub const BLOCK_BYTES: usize = 32;
/// Offset of the commit record in a slot, in bytes. The header is at 0.
pub const COMMIT_AT: u32 = BLOCK_BYTES as u32;
/// Offset of the genome container in a slot, in bytes.
pub const CONTAINER_AT: u32 = 2 * BLOCK_BYTES as u32;
/// Space reserved for the container in a slot, in bytes, for any word size.
pub const ROOM_BYTES: usize = CONTAINER_BYTES_MAX.next_multiple_of(BLOCK_BYTES);
/// Size of a slot in bytes, before rounding up to whole erase units.
pub const SLOT_BYTES_MIN: usize = CONTAINER_AT as usize + ROOM_BYTES;
/// Largest write count for a slot that is written outside the robot: it leaves 2²⁴ updates, more
/// than any flash endures.
pub const MADE_WRITE_COUNT_MAX: u32 = u32::MAX - (1 << 24);
/// First bytes of a slot; the last one is the version of the layout.
pub const MAGIC: [u8; 4] = *b"MSS1";

/// One block, as stored in flash.
pub(crate) type Block = [u8; BLOCK_BYTES];
/// A block of erased flash.
pub(crate) const ERASED: Block = [0xff; BLOCK_BYTES];

/// Returns the size of a slot in bytes, for a chip that erases `erase_size` bytes at a time; a
/// multiple of `erase_size`.
///
/// The two slots are adjacent, so the chip needs twice this size.
#[must_use]
pub const fn slot_bytes(erase_size: usize) -> usize {
    SLOT_BYTES_MIN.next_multiple_of(erase_size)
}

/// The header of a slot, which describes its contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Header {
    /// Number of the genome among all genomes written so far, counted from 1; a larger number is
    /// newer.
    pub write_count: u32,
    /// Length of the container in bytes, 1 to [`CONTAINER_BYTES_MAX`].
    pub length: u16,
    /// The container's last four bytes, little-endian: its own CRC-32C.
    pub crc: u32,
}

impl Header {
    /// Returns the header's block; unused bytes stay erased.
    pub(crate) fn to_block(self) -> Block {
        let [m0, m1, m2, m3] = MAGIC;
        let [n0, n1, n2, n3] = self.write_count.to_le_bytes();
        let [l0, l1, l2, l3] = u32::from(self.length).to_le_bytes();
        let [c0, c1, c2, c3] = self.crc.to_le_bytes();
        let header = [
            m0, m1, m2, m3, n0, n1, n2, n3, l0, l1, l2, l3, c0, c1, c2, c3,
        ];
        block_of(header)
    }

    /// Returns the bytes before the container in a committed slot: the header and its commit
    /// record. Use this to write a whole slot at once.
    #[must_use]
    pub fn front(self) -> [u8; CONTAINER_AT as usize] {
        let mut front = [0xff; CONTAINER_AT as usize];
        let bytes = self.to_block().into_iter().chain(self.commit_block());
        for (place, byte) in front.iter_mut().zip(bytes) {
            *place = byte;
        }
        front
    }

    /// Parses the header in a block; `None` if the block does not contain a header.
    pub(crate) fn from_block(block: &Block) -> Option<Self> {
        let (magic, rest) = block.split_first_chunk()?;
        let (write_count, rest) = rest.split_first_chunk()?;
        let (length, rest) = rest.split_first_chunk()?;
        let (crc, _) = rest.split_first_chunk()?;
        let length = u16::try_from(u32::from_le_bytes(*length)).ok()?;
        let header = Self {
            write_count: u32::from_le_bytes(*write_count),
            length,
            crc: u32::from_le_bytes(*crc),
        };
        let lengths = 1..=CONTAINER_BYTES_MAX;
        (*magic == MAGIC && lengths.contains(&usize::from(length))).then_some(header)
    }

    /// Returns the block of the commit record for this header: a CRC-32C of the header, and its
    /// complement, so that erased flash is never a commit record.
    pub(crate) fn commit_block(self) -> Block {
        let header = self.to_block();
        let (fields, _) = header.split_at(HEADER_BYTES);
        let crc = CRC_32C.checksum(fields);
        let [c0, c1, c2, c3] = crc.to_le_bytes();
        block_of([c0, c1, c2, c3, !c0, !c1, !c2, !c3])
    }
}

/// Size of the header's fields, in bytes.
const HEADER_BYTES: usize = 16;
/// Size of the commit record, in bytes.
const COMMIT_BYTES: usize = 8;

/// Returns the size of the header in flash, in bytes, for words of `word` bytes.
pub(crate) const fn header_bytes(word: usize) -> usize {
    HEADER_BYTES.next_multiple_of(word)
}

/// Returns the size of the commit record in flash, in bytes, for words of `word` bytes.
pub(crate) const fn commit_bytes(word: usize) -> usize {
    COMMIT_BYTES.next_multiple_of(word)
}

/// Creates an erased block that starts with the given bytes.
fn block_of<const N: usize>(bytes: [u8; N]) -> Block {
    let mut block = ERASED;
    for (place, byte) in block.iter_mut().zip(bytes) {
        *place = byte;
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: Header = Header {
        write_count: 0x0102_0304,
        length: 0x0506,
        crc: 0x0708_090a,
    };

    #[test]
    fn value_stability_header_and_commit_record() {
        let mut header = [0xff; 32];
        header[..16].copy_from_slice(b"MSS1\x04\x03\x02\x01\x06\x05\0\0\x0a\x09\x08\x07");
        assert_eq!(HEADER.to_block(), header);
        assert_eq!(Header::from_block(&header), Some(HEADER));
        let mut commit = [0xff; 32];
        commit[..8].copy_from_slice(&COMMIT);
        assert_eq!(HEADER.commit_block(), commit);
        assert_eq!(HEADER.front().as_slice(), [header, commit].concat());
    }

    /// Commit record computed by a different program.
    const COMMIT: [u8; 8] = [0x96, 0x80, 0xce, 0xd7, 0x69, 0x7f, 0x31, 0x28];

    #[test]
    fn blocks_with_an_impossible_container_length_are_not_headers() {
        for length in [0, CONTAINER_BYTES_MAX as u16 + 1, u16::MAX] {
            let header = Header { length, ..HEADER };
            assert_eq!(Header::from_block(&header.to_block()), None, "{length}");
        }
        let mut block = HEADER.to_block();
        block[10] = 1;
        assert_eq!(Header::from_block(&block), None);
        assert_eq!(Header::from_block(&ERASED), None);
    }

    #[test]
    fn a_slot_made_outside_the_robot_leaves_sixteen_million_updates() {
        assert_eq!(u32::MAX - MADE_WRITE_COUNT_MAX, 16_777_216);
    }

    #[test]
    fn slots_are_whole_erase_units() {
        assert_eq!(
            [1, 256, 4096, 128 << 10].map(slot_bytes),
            [SLOT_BYTES_MIN, 1536, 4096, 128 << 10]
        );
    }
}
