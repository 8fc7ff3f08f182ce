//! A simulated flash chip that loses power on request and panics if it is misused.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use minimal_surprise_slots::{MappedFlash, SLOT_BYTES_MIN, slot_bytes};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// A chip with erase units of `E` bytes and words of `W` bytes, which are always read and written
/// as a whole.
///
/// The chip panics if it is misused: by unaligned operations, by writing a word twice between two
/// completed erases, or by an address out of bounds. If erase units are larger than a slot, only
/// the bytes that a slot needs are stored, and only these may be used.
#[derive(Clone, Debug)]
pub struct MockFlash<const W: usize, const E: usize> {
    bytes: Vec<u8>,
    /// For each word, true if the word may be written.
    erased: Vec<bool>,
    units: usize,
    cut: Option<Cut>,
    /// Counts of operations so far.
    pub counts: Counts,
    powered: bool,
}

/// Counts of a flash's operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of moments at which the power could have failed.
    pub moments: u64,
    /// Number of writes.
    pub writes: u64,
    /// Number of bytes written.
    pub written_bytes: u64,
    /// Number of erased units.
    pub erases: u64,
}

/// A future power cut.
#[derive(Clone, Copy, Debug)]
struct Cut {
    at_moment: u64,
    seed: u64,
}

/// Error: the flash has no power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowerCut;

impl NorFlashError for PowerCut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Possible results of an interrupted erase, in order of time.
const TORN_ERASES: [TornErase; 5] = [
    TornErase::Untouched,
    TornErase::HalfErased,
    TornErase::SomeBitsErased,
    TornErase::Random,
    TornErase::ErasedButUnreported,
];

#[derive(Clone, Copy, Debug)]
enum TornErase {
    Untouched,
    HalfErased,
    SomeBitsErased,
    Random,
    ErasedButUnreported,
}

impl<const W: usize, const E: usize> MockFlash<W, E> {
    /// Number of bytes stored per erase unit.
    const KEPT: usize = if E < SLOT_BYTES_MIN {
        E
    } else {
        SLOT_BYTES_MIN
    };
    /// Address of the slots, after one erase unit of other data.
    pub const OFFSET: u32 = E as u32;

    /// Creates an erased chip with one erase unit before the two slots.
    #[must_use]
    pub fn new() -> Self {
        let units = 1 + 2 * slot_bytes(E) / E;
        let kept = units * Self::KEPT;
        Self {
            bytes: vec![0xff; kept],
            erased: vec![true; kept / W],
            units,
            cut: None,
            counts: Counts::default(),
            powered: true,
        }
    }

    /// Creates a chip like [`Self::new`], but with these bytes in the first slot.
    ///
    /// # Panics
    /// If `slot` is longer than a slot.
    #[must_use]
    pub fn with_slot(slot: &[u8]) -> Self {
        let mut words = slot.to_vec();
        words.resize(slot.len().next_multiple_of(W), 0xff);
        let mut flash = Self::new();
        flash.write(Self::OFFSET, &words).expect("it fits");
        flash
    }

    /// Cuts the power after this many more moments; `seed` determines which contents remain.
    pub fn cut_power_after(&mut self, moments: u64, seed: u64) {
        self.cut = Some(Cut {
            at_moment: self.counts.moments + moments,
            seed,
        });
    }

    /// Restores power.
    pub fn restore_power(&mut self) {
        self.powered = true;
        self.cut = None;
    }

    /// Flips bits, as can happen in ageing flash.
    pub fn damage(&mut self, at: u32, mask: u8) {
        let place = Self::place(at, 1);
        self.bytes[place] ^= mask;
    }

    /// Returns the index, within the stored bytes, of `length` bytes at an address.
    fn place(at: u32, length: usize) -> usize {
        let at = at as usize;
        let (unit, within) = (at / E, at % E);
        if Self::KEPT == E {
            return at;
        }
        let kept = Self::KEPT;
        assert!(
            within + length <= kept,
            "{length} bytes at {at} are outside the slots"
        );
        unit * kept + within
    }

    /// Checks whether the power fails at this moment; if so, returns the generator of the remaining
    /// contents.
    fn fails_now(&mut self) -> Option<ChaCha8Rng> {
        let moment = self.counts.moments;
        self.counts.moments += 1;
        let cut = self.cut.filter(|cut| cut.at_moment == moment)?;
        self.powered = false;
        Some(ChaCha8Rng::seed_from_u64(cut.seed))
    }

    fn erase_unit(&mut self, unit: usize) -> Result<(), PowerCut> {
        let kept = Self::KEPT;
        let range = unit * kept..(unit + 1) * kept;
        let words = range.start / W..range.end / W;
        self.erased[words.clone()].fill(false);
        for torn in TORN_ERASES {
            if let Some(mut rng) = self.fails_now() {
                let bytes = &mut self.bytes[range];
                match torn {
                    TornErase::Untouched => {}
                    TornErase::HalfErased => bytes[..kept / 2].fill(0xff),
                    TornErase::SomeBitsErased => {
                        bytes.iter_mut().for_each(|b| *b |= rng.next_u32() as u8);
                    }
                    TornErase::Random => rng.fill_bytes(bytes),
                    TornErase::ErasedButUnreported => bytes.fill(0xff),
                }
                return Err(PowerCut);
            }
        }
        self.bytes[range].fill(0xff);
        self.erased[words].fill(true);
        self.counts.erases += 1;
        Ok(())
    }

    /// Simulates a write interrupted at byte `whole` of a word: the bytes before it are written;
    /// the others have only some of their bits written, or contain arbitrary values.
    fn tear_word(word: &mut [u8], wanted: &[u8], whole: usize, rng: &mut ChaCha8Rng) {
        let anything = rng.next_u32() & 1 == 0;
        for (index, (byte, &wanted)) in word.iter_mut().zip(wanted).enumerate() {
            let random = rng.next_u32() as u8;
            *byte = match index < whole {
                true => wanted,
                false if anything => random,
                false => wanted | random,
            };
        }
    }
}

impl<const W: usize, const E: usize> Default for MockFlash<W, E> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const W: usize, const E: usize> ErrorType for MockFlash<W, E> {
    type Error = PowerCut;
}

impl<const W: usize, const E: usize> ReadNorFlash for MockFlash<W, E> {
    const READ_SIZE: usize = W;

    fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        assert!((at as usize).is_multiple_of(W), "reads at {at}");
        let length = bytes.len();
        assert!(length.is_multiple_of(W), "reads {length} bytes");
        if !self.powered {
            return Err(PowerCut);
        }
        let place = Self::place(at, length);
        bytes.copy_from_slice(&self.bytes[place..place + length]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.units * E
    }
}

impl<const W: usize, const E: usize> NorFlash for MockFlash<W, E> {
    const WRITE_SIZE: usize = W;
    const ERASE_SIZE: usize = E;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        let (from, to) = (from as usize, to as usize);
        assert!(from < to && to <= self.capacity(), "erases {from}..{to}");
        assert!(from.is_multiple_of(E), "erases from {from}");
        assert!(to.is_multiple_of(E), "erases to {to}");
        if !self.powered {
            return Err(PowerCut);
        }
        (from / E..to / E).try_for_each(|unit| self.erase_unit(unit))
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        assert!((at as usize).is_multiple_of(W), "writes at {at}");
        let length = bytes.len();
        assert!(length.is_multiple_of(W), "writes {length} bytes");
        if !self.powered {
            return Err(PowerCut);
        }
        self.counts.writes += 1;
        let place = Self::place(at, length);
        for (index, wanted) in bytes.chunks_exact(W).enumerate() {
            let place = place + index * W;
            let erased = &mut self.erased[place / W];
            assert!(*erased, "word at {place:#x} written twice between erases");
            *erased = false;
            for whole in 0..W {
                if let Some(mut rng) = self.fails_now() {
                    let word = &mut self.bytes[place..place + W];
                    Self::tear_word(word, wanted, whole, &mut rng);
                    return Err(PowerCut);
                }
            }
            self.bytes[place..place + W].copy_from_slice(wanted);
            self.counts.written_bytes += W as u64;
        }
        // The write has finished, but power may fail before its success is reported.
        self.fails_now().map_or(Ok(()), |_| Err(PowerCut))
    }
}

impl<const W: usize, const E: usize> MappedFlash for MockFlash<W, E> {
    fn bytes(&self) -> &[u8] {
        assert_eq!(Self::KEPT, E, "the whole unit is stored");
        &self.bytes
    }
}
