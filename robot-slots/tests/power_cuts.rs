//! Cuts the power at every moment of an update of the genome slots, and again at every moment of
//! the recovery.
//!
//! Power is cut at every byte of a write, at the end of a write before the chip reports it, and
//! during an erase, which can then end in five ways. Every first cut is tested. With `TEST_ALL=1`
//! in a release build, every second cut after each first cut is tested too; otherwise, only a
//! sample of the second cuts. `POWER_CUT=write_size:erase_size:first:second` tests one pair of
//! cuts; a failure prints the pair.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, CRC_32C, Provenance, encode};
use minimal_surprise_controller::{EncodedGenome, Genome, Topology};
use minimal_surprise_slots::{
    BLOCK_BYTES, Buffer, COMMIT_AT, CONTAINER_AT, Defect, Header, InPlace, InUse, PlaceError, Slot,
    SlotState, Slots, UpdateError, crc_of, slot_bytes,
};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use robot_support::flash::{MockFlash, PowerCut};
use robot_support::full::all_cases;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Seed of the random genomes.
const SEED: u64 = 5;
/// Strides of the reduced run: it continues after every *n*-th first cut and then tests every
/// *m*-th second cut.
const REDUCED: Strides = Strides {
    first: 5,
    second: 601,
};
/// Strides of the full run: every second cut after every first cut.
const ALL: Strides = Strides {
    first: 1,
    second: 1,
};

/// Stride of the second cuts after which the update is repeated to completion.
const THIRD_STRIDE: u64 = 16;

/// Creates a genome container that differs in every part from those of other generations.
fn container(topology: Topology, generation: u32) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + u64::from(generation));
    let genome = Genome::random(topology, &mut rng);
    let provenance = Provenance {
        seed: Some(SEED),
        generation,
        ..Provenance::default()
    };
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    encode(&genome, provenance, &mut buffer).unwrap().to_vec()
}

/// Creates two containers that differ in topology and length.
fn old_and_new() -> [Vec<u8>; 2] {
    [
        container(Topology::ALL[7], 1),
        container(Topology::default(), 2),
    ]
}

/// The genome that the robot runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Runs {
    Old,
    New,
}

/// The genomes before and after an update.
struct Genomes<'a> {
    old_container: &'a [u8],
    new_container: &'a [u8],
    old: EncodedGenome<'a>,
    new: EncodedGenome<'a>,
}

impl<'a> Genomes<'a> {
    fn new([old_container, new_container]: &'a [Vec<u8>; 2]) -> Self {
        Self {
            old_container,
            new_container,
            old: EncodedGenome::decode(old_container).unwrap(),
            new: EncodedGenome::decode(new_container).unwrap(),
        }
    }

    /// Restarts the robot and returns the genome that it runs.
    fn after_restart<const W: usize, const E: usize>(
        &self,
        flash: &mut MockFlash<W, E>,
        room: &mut Buffer,
    ) -> Runs {
        flash.restore_power();
        let mut slots = Slots::open(flash, MockFlash::<W, E>::OFFSET, room).unwrap();
        match slots.in_use(room) {
            InUse::Slot { genome, .. } if genome == self.old => Runs::Old,
            InUse::Slot { genome, .. } if genome == self.new => Runs::New,
            InUse::Slot { header, .. } => panic!("neither the old nor the new genome: {header:?}"),
            InUse::BuiltIn => panic!("no genome: {slots:?}"),
        }
    }

    /// Restarts the robot and writes the new genome in chunks, as they arrive over the line.
    fn update<const W: usize, const E: usize>(
        &self,
        flash: &mut MockFlash<W, E>,
        room: &mut Buffer,
    ) -> Result<u32, UpdateError<PowerCut>> {
        let mut slots = Slots::open(flash, MockFlash::<W, E>::OFFSET, room).unwrap();
        let length = self.new_container.len() as u16;
        slots.begin(length, crc_of(self.new_container).unwrap())?;
        for (index, chunk) in self.new_container.chunks(100).enumerate() {
            slots.chunk(100 * index as u16, chunk)?;
        }
        slots.commit(room)
    }

    /// Creates a chip with the old genome in one slot and an even older genome in the other.
    fn flash<const W: usize, const E: usize>(&self, room: &mut Buffer) -> MockFlash<W, E> {
        let mut flash = MockFlash::<W, E>::new();
        let mut slots = Slots::open(&mut flash, MockFlash::<W, E>::OFFSET, room).unwrap();
        let oldest = container(Topology::default(), 0);
        assert_eq!(slots.write(&oldest, room), Ok(1));
        assert_eq!(slots.write(self.old_container, room), Ok(2));
        flash
    }
}

/// One pair of cuts, printed if its test fails.
struct Case {
    write_size: usize,
    erase_size: usize,
    first: u64,
    second: Option<u64>,
}

impl Drop for Case {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let Self {
                write_size,
                erase_size,
                first,
                ..
            } = self;
            let second = self.second.map_or("-".into(), |second| second.to_string());
            eprintln!(
                "genome seed {SEED}; to repeat this case: \
                 POWER_CUT={write_size}:{erase_size}:{first}:{second} cargo test -p minimal-surprise-slots --test power_cuts"
            );
        }
    }
}

/// Selection of the second cuts to test.
#[derive(Clone, Copy)]
struct Strides {
    first: u64,
    second: u64,
}

/// Selection of the cuts to test.
#[derive(Clone, Copy)]
enum Cuts {
    /// Every first cut and some second cuts.
    Every(Strides),
    /// One first cut and possibly one second cut.
    One(u64, Option<u64>),
}

/// Tests the cuts on one kind of chip and returns their number.
fn cut_updates<const W: usize, const E: usize>(cuts: Cuts) -> u64 {
    let containers = old_and_new();
    let genomes = Genomes::new(&containers);
    let room = &mut Buffer::new();
    let before = genomes.flash::<W, E>(room);
    let firsts = {
        let mut flash = before.clone();
        assert_eq!(genomes.update(&mut flash, room), Ok(3));
        assert_eq!(genomes.after_restart(&mut flash, room), Runs::New);
        0..flash.counts.moments - before.counts.moments
    };
    let firsts = match cuts {
        Cuts::Every(_) => firsts,
        Cuts::One(first, _) => {
            assert!(firsts.contains(&first), "first cuts are {firsts:?}");
            first..first + 1
        }
    };
    let mut made = 0;
    for first in firsts {
        let mut case = Case {
            write_size: W,
            erase_size: E,
            first,
            second: None,
        };
        let mut flash = before.clone();
        flash.cut_power_after(first, first);
        genomes.update(&mut flash, room).expect_err("power fails");
        made += 1;
        let after_first = genomes.after_restart(&mut flash, room);

        if matches!(cuts, Cuts::Every(strides) if !first.is_multiple_of(strides.first)) {
            continue;
        }
        let mut unharmed = flash.clone();
        let expected_count = if after_first == Runs::New { 4 } else { 3 };
        assert_eq!(genomes.update(&mut unharmed, room), Ok(expected_count));
        assert_eq!(genomes.after_restart(&mut unharmed, room), Runs::New);
        let seconds = 0..unharmed.counts.moments - flash.counts.moments;
        let (seconds, stride) = match cuts {
            // The second cuts differ from one first cut to the next.
            Cuts::Every(strides) => (first % strides.second..seconds.end, strides.second),
            Cuts::One(_, None) => (0..0, 1),
            Cuts::One(_, Some(second)) => {
                assert!(seconds.contains(&second), "second cuts are {seconds:?}");
                (second..second + 1, 1)
            }
        };
        for second in seconds.step_by(stride as usize) {
            case.second = Some(second);
            let mut flash = flash.clone();
            flash.cut_power_after(second, first << 32 | second);
            genomes.update(&mut flash, room).expect_err("power fails");
            made += 1;
            let after_second = genomes.after_restart(&mut flash, room);
            if after_first == Runs::New {
                assert_eq!(after_second, Runs::New, "the new genome was already in use");
            }
            if second % THIRD_STRIDE == first % THIRD_STRIDE {
                genomes.update(&mut flash, room).expect("power is on");
                assert_eq!(genomes.after_restart(&mut flash, room), Runs::New);
            }
        }
    }
    made
}

/// A kind of chip: its write size and erase size in bytes, and the function that tests it.
type Chip = (usize, usize, fn(Cuts) -> u64);

const CHIPS: [Chip; 12] = [
    (1, 256, cut_updates::<1, 256>),
    (4, 256, cut_updates::<4, 256>),
    (8, 256, cut_updates::<8, 256>),
    (32, 256, cut_updates::<32, 256>),
    (1, 4 << 10, cut_updates::<1, { 4 << 10 }>),
    (4, 4 << 10, cut_updates::<4, { 4 << 10 }>),
    (8, 4 << 10, cut_updates::<8, { 4 << 10 }>),
    (32, 4 << 10, cut_updates::<32, { 4 << 10 }>),
    (1, 128 << 10, cut_updates::<1, { 128 << 10 }>),
    (4, 128 << 10, cut_updates::<4, { 128 << 10 }>),
    (8, 128 << 10, cut_updates::<8, { 128 << 10 }>),
    (32, 128 << 10, cut_updates::<32, { 128 << 10 }>),
];

/// Parses `write_size:erase_size:first:second`; `-` stands for no second cut.
fn replayed_case(text: &str) -> Option<(Chip, Cuts)> {
    let mut parts = text.split(':');
    let write_size: usize = parts.next()?.parse().ok()?;
    let erase_size: usize = parts.next()?.parse().ok()?;
    let first = parts.next()?.parse().ok()?;
    let second = match parts.next()? {
        "-" => None,
        second => Some(second.parse().ok()?),
    };
    let chip = CHIPS
        .iter()
        .find(|chip| (chip.0, chip.1) == (write_size, erase_size))?;
    Some((*chip, Cuts::One(first, second)))
}

#[test]
fn a_robot_runs_the_old_or_the_new_genome_whenever_its_power_fails() {
    if let Ok(text) = std::env::var("POWER_CUT") {
        let (chip, cuts) = replayed_case(&text).expect("POWER_CUT=1:256:17:4 or 1:256:17:-");
        println!("{} cuts made", chip.2(cuts));
        return;
    }
    let strides = match (all_cases(), cfg!(debug_assertions)) {
        (true, false) => ALL,
        (true, true) => {
            println!("testing all second cuts requires a release build: cargo test --release");
            REDUCED
        }
        (false, _) => REDUCED,
    };
    let started = Instant::now();
    let next = AtomicUsize::new(0);
    let work = || {
        let mut sum = 0;
        while let Some((write_size, erase_size, test)) =
            CHIPS.get(next.fetch_add(1, Ordering::Relaxed))
        {
            let made = test(Cuts::Every(strides));
            println!(
                "words of {write_size:2} bytes, {erase_size:6} erased at a time: {made:8} cuts"
            );
            sum += made;
        }
        sum
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let made: u64 = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        workers.into_iter().map(|w| w.join().unwrap()).sum()
    });
    println!("{made} power cuts in {:.1?}", started.elapsed());
    assert!(made > 12 * 1300, "every byte is cut at least once");
}

#[test]
fn the_first_genome_of_a_robot_is_complete_or_absent() {
    type Flash = MockFlash<4, 256>;
    let room = &mut Buffer::new();
    let genome = container(Topology::default(), 1);
    let write = |flash: &mut Flash, room: &mut Buffer| {
        Slots::open(flash, Flash::OFFSET, room)
            .unwrap()
            .write(&genome, room)
    };
    let mut flash = Flash::new();
    assert_eq!(write(&mut flash, room), Ok(1));
    let moments = flash.counts.moments;
    let mut built_in = 0;
    for moment in 0..moments {
        let mut flash = Flash::new();
        flash.cut_power_after(moment, moment);
        write(&mut flash, room).expect_err("power fails");
        flash.restore_power();
        let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
        match slots.in_use(room) {
            InUse::Slot { genome: found, .. } => {
                assert_eq!(EncodedGenome::decode(&genome), Ok(found), "moment {moment}");
            }
            InUse::BuiltIn => built_in += 1,
        }
        slots.write(&genome, room).expect("power is on");
    }
    // The last byte can be correct although its write was interrupted.
    assert!(built_in >= moments - 9 && built_in < moments, "{built_in}");
}

#[test]
fn slots_alternate_and_count_the_genomes_written() {
    type Flash = MockFlash<8, 4096>;
    let room = &mut Buffer::new();
    let mut flash = Flash::new();
    for count in 1..=9 {
        let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
        assert_eq!(slots.write_count(), count - 1);
        let genome = container(Topology::ALL[count as usize], count);
        assert_eq!(slots.write(&genome, room), Ok(count));
        let (slot, header) = slots.newest().unwrap();
        assert_eq!(u32::from(slot.index()), (count - 1) % 2);
        assert_eq!(header.write_count, count);
        assert_eq!(usize::from(header.length), genome.len());
        assert_eq!(Some(header.crc), crc_of(&genome));
        assert_eq!(flash.counts.erases, u64::from(count));
    }
}

#[test]
fn a_damaged_genome_is_replaced_by_the_older_one_and_two_by_the_built_in_one() {
    type Flash = MockFlash<4, 4096>;
    let room = &mut Buffer::new();
    let mut flash = Genomes::new(&old_and_new()).flash::<4, 4096>(room);
    for (damaged, left) in [(1, Some(1)), (0, None)] {
        let at = Flash::OFFSET + damaged * slot_bytes(4096) as u32 + CONTAINER_AT + 99;
        flash.damage(at, 0x10);
        let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
        let count = slots.newest().map(|(_, header)| header.write_count);
        assert_eq!(count, left);
        let faults = Slot::ALL
            .map(|slot| matches!(slots.state(slot), SlotState::Damaged(_, Defect::Refused(_))));
        assert_eq!(faults, [damaged == 0, true]);
        assert_eq!(slots.in_use(room) == InUse::BuiltIn, left.is_none());
        assert_eq!(slots.write_count(), 2, "the write count is kept");
    }
    let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
    let genome = container(Topology::default(), 7);
    assert_eq!(slots.write(&genome, room), Ok(3));
    assert_eq!(slots.newest().map(|(slot, _)| slot.index()), Some(0));
}

#[test]
fn of_two_damaged_genomes_the_older_one_is_replaced() {
    type Flash = MockFlash<4, 4096>;
    let room = &mut Buffer::new();
    let mut flash = Flash::new();
    for count in 1..=3 {
        let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
        let genome = container(Topology::default(), count);
        assert_eq!(slots.write(&genome, room), Ok(count));
    }
    for slot in Slot::ALL {
        let slot_at = Flash::OFFSET + u32::from(slot.index()) * slot_bytes(4096) as u32;
        flash.damage(slot_at + CONTAINER_AT + 99, 0x10);
    }
    let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
    assert_eq!(slots.newest(), None);
    let genome = container(Topology::default(), 4);
    assert_eq!(slots.write(&genome, room), Ok(4));
    assert_eq!(slots.newest().map(|(slot, _)| slot), Some(Slot::Second));
    assert!(
        matches!(slots.state(Slot::First), SlotState::Damaged(header, _) if header.write_count == 3)
    );
}

#[test]
fn of_two_genomes_with_equal_write_counts_the_first_slots_is_used() {
    type Flash = MockFlash<4, 4096>;
    let room = &mut Buffer::new();
    let mut flash = Flash::new();
    let genomes = old_and_new();
    for (slot, genome) in Slot::ALL.into_iter().zip(&genomes) {
        let header = Header {
            write_count: 7,
            length: genome.len() as u16,
            crc: crc_of(genome).unwrap(),
        };
        let at = Flash::OFFSET + u32::from(slot.index()) * slot_bytes(4096) as u32;
        flash.write(at, &header.front()).unwrap();
        let mut words = genome.clone();
        words.resize(genome.len().next_multiple_of(4), 0xff);
        flash.write(at + CONTAINER_AT, &words).unwrap();
    }
    let mut slots = Slots::open(flash, Flash::OFFSET, room).unwrap();
    assert_eq!(slots.newest().map(|(slot, _)| slot), Some(Slot::First));
    assert_eq!(slots.write(&genomes[1], room), Ok(8));
    assert_eq!(slots.newest().map(|(slot, _)| slot), Some(Slot::Second));
}

/// Ways in which a chip mishandles a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Treatment {
    /// Reports success but writes nothing.
    Forgets,
    /// Writes all bytes but reports an error.
    Misreports,
}

struct Unreliable {
    flash: MockFlash<4, 256>,
    /// Number of writes before the mishandled one.
    writes_before: usize,
    treatment: Treatment,
}

impl ErrorType for Unreliable {
    type Error = PowerCut;
}

impl ReadNorFlash for Unreliable {
    const READ_SIZE: usize = 4;

    fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        self.flash.read(at, bytes)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for Unreliable {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 256;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        self.flash.erase(from, to)
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        let now = self.writes_before == 0;
        self.writes_before = self.writes_before.wrapping_sub(1);
        match self.treatment {
            Treatment::Forgets if now => Ok(()),
            Treatment::Misreports if now => self.flash.write(at, bytes).and(Err(PowerCut)),
            _ => self.flash.write(at, bytes),
        }
    }
}

#[test]
fn the_bytes_in_flash_count_more_than_what_a_chip_reports_of_a_write() {
    let room = &mut Buffer::new();
    let containers = old_and_new();
    let [old, new] = &containers;
    let offset = MockFlash::<4, 256>::OFFSET;
    let mut before = MockFlash::new();
    let mut slots = Slots::open(&mut before, offset, room).unwrap();
    assert_eq!(slots.write(old, room), Ok(1));
    // The header, the container in blocks of 32 bytes, the commit record.
    let writes = 1 + new.len().div_ceil(32) + 1;
    for treatment in [Treatment::Forgets, Treatment::Misreports] {
        for writes_before in 0..=writes {
            let flash = Unreliable {
                flash: before.clone(),
                writes_before,
                treatment,
            };
            let mut slots = Slots::open(flash, offset, room).unwrap();
            let outcome = slots.write(new, room);
            let is_header_or_commit = writes_before == 0 || writes_before == writes - 1;
            match treatment {
                _ if writes_before == writes => assert_eq!(outcome, Ok(2)),
                Treatment::Forgets if is_header_or_commit => {
                    assert_eq!(outcome, Err(UpdateError::NotWritten));
                }
                Treatment::Forgets => assert!(
                    matches!(outcome, Err(UpdateError::Defect(Defect::Refused(_)))),
                    "{outcome:?}"
                ),
                Treatment::Misreports if writes_before == writes - 1 => {
                    assert_eq!(outcome, Ok(2), "the commit record is in flash");
                }
                Treatment::Misreports => {
                    assert_eq!(outcome, Err(UpdateError::Flash(PowerCut)));
                }
            }
            let newest = if outcome.is_ok() { new } else { old };
            assert_eq!(slots.taken(), None, "no update is in progress");
            let flash = slots.release();
            let mut slots = Slots::open(flash, offset, room).unwrap();
            match slots.in_use(room) {
                InUse::Slot { genome, .. } => {
                    assert_eq!(EncodedGenome::decode(newest), Ok(genome));
                }
                InUse::BuiltIn => panic!("{treatment:?} write {writes_before}: no genome"),
            }
        }
    }
}

#[test]
fn empty_interrupted_and_unreadable_slots_are_distinguished() {
    type Flash = MockFlash<4, 256>;
    let room = &mut Buffer::new();
    let states = |flash: &mut Flash| {
        let slots = Slots::open(flash, Flash::OFFSET, &mut Buffer::new()).unwrap();
        assert_eq!(slots.newest(), None);
        Slot::ALL.map(|slot| slots.state(slot))
    };
    let mut blank = Flash::new();
    assert_eq!(states(&mut blank), [SlotState::Empty; 2]);

    let mut begun = blank.clone();
    let mut slots = Slots::open(&mut begun, Flash::OFFSET, room).unwrap();
    slots.begin(100, 7).unwrap();
    let expected = [SlotState::Unfinished, SlotState::Empty];
    assert_eq!(Slot::ALL.map(|slot| slots.state(slot)), expected);
    assert_eq!(states(&mut begun), expected);

    // Words written by a different program in place of the header and the commit record.
    for at in [0, COMMIT_AT] {
        let mut strange = blank.clone();
        strange.write(Flash::OFFSET + at, b"ELF!").unwrap();
        assert_eq!(states(&mut strange), expected, "at {at}");
    }

    blank.cut_power_after(0, 0);
    blank.write(0, &[0; 4]).expect_err("power fails");
    assert_eq!(states(&mut blank), [SlotState::Unreadable; 2]);
    let mut slots = Slots::open(&mut blank, Flash::OFFSET, room).unwrap();
    assert_eq!(slots.begin(100, 7), Err(UpdateError::Flash(PowerCut)));
    assert_eq!(slots.taken(), None);
}

#[test]
fn a_genome_written_in_chunks_equals_the_genome_written_at_once() {
    type Flash = MockFlash<8, 256>;
    let room = &mut Buffer::new();
    let genome = container(Topology::default(), 1);
    let (length, crc) = (genome.len() as u16, crc_of(&genome).unwrap());
    for size in [1, 7, 31, 32, 33, 64, 100, 128, genome.len()] {
        let mut flash = Flash::new();
        let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
        slots.begin(length, crc).unwrap();
        for (index, chunk) in genome.chunks(size).enumerate() {
            let offset = (index * size) as u16;
            assert_eq!(slots.taken(), Some(offset));
            slots.chunk(offset, chunk).unwrap();
        }
        assert_eq!(slots.commit(room), Ok(1), "chunks of {size}");
        assert_eq!(slots.commit(room), Err(UpdateError::NotBegun));
        let whole = {
            let mut flash = Flash::new();
            let mut slots = Slots::open(&mut flash, Flash::OFFSET, room).unwrap();
            slots.write(&genome, room).unwrap();
            flash
        };
        let [mut a, mut b] = [vec![0; whole_bytes(&whole)], vec![0; whole_bytes(&whole)]];
        flash.read(0, &mut a).unwrap();
        whole.clone().read(0, &mut b).unwrap();
        assert_eq!(a, b, "chunks of {size}");
    }
}

fn whole_bytes(flash: &impl NorFlash) -> usize {
    flash.capacity()
}

#[test]
fn chunks_at_a_wrong_offset_are_refused_and_the_update_continues() {
    type Flash = MockFlash<4, 256>;
    let room = &mut Buffer::new();
    let genome = container(Topology::default(), 1);
    let length = genome.len() as u16;
    let mut slots = Slots::open(Flash::new(), Flash::OFFSET, room).unwrap();
    assert_eq!(slots.chunk(0, &[1]), Err(UpdateError::NotBegun));
    for found in [0, CONTAINER_BYTES_MAX + 1] {
        let refused = slots.begin(found as u16, 0);
        assert_eq!(refused, Err(UpdateError::ImpossibleLength { found }));
    }
    for longest_or_shortest in [CONTAINER_BYTES_MAX as u16, 1] {
        assert_eq!(slots.begin(longest_or_shortest, 0), Ok(()));
    }
    slots.begin(length, crc_of(&genome).unwrap()).unwrap();
    slots.chunk(0, &genome[..50]).unwrap();
    for found in [0, 49, 51] {
        let wrong = UpdateError::WrongOffset {
            found,
            expected: 50,
        };
        assert_eq!(slots.chunk(found, &genome[..9]), Err(wrong));
    }
    let too_much = UpdateError::TooMuch { excess: 50, length };
    assert_eq!(slots.chunk(50, &genome), Err(too_much));
    let incomplete = UpdateError::Incomplete { taken: 50, length };
    assert_eq!(slots.commit(room), Err(incomplete));
    slots.chunk(50, &[]).unwrap();
    slots.chunk(50, &genome[50..]).unwrap();
    assert_eq!(slots.commit(room), Ok(1));

    assert_eq!(slots.chunk(0, &genome), Err(UpdateError::NotBegun));
    assert_eq!(
        slots.newest().map(|(_, header)| header.write_count),
        Some(1)
    );
}

#[test]
fn a_genome_other_than_the_announced_one_is_never_committed() {
    type Flash = MockFlash<4, 256>;
    let room = &mut Buffer::new();
    let genome = container(Topology::default(), 1);
    let mut slots = Slots::open(Flash::new(), Flash::OFFSET, room).unwrap();
    slots.begin(genome.len() as u16, 1).unwrap();
    slots.chunk(0, &genome).unwrap();
    let refused = slots.commit(room);
    let found = crc_of(&genome).unwrap();
    let announced = 1;
    let other = Defect::OtherContainer { found, announced };
    assert_eq!(refused, Err(UpdateError::Defect(other)));

    let mut damaged = genome.clone();
    damaged[40] ^= 1;
    let before = slots.newest();
    slots.begin(genome.len() as u16, found).unwrap();
    slots.chunk(0, &damaged).unwrap();
    let refused = slots.commit(room);
    assert!(matches!(
        refused,
        Err(UpdateError::Defect(Defect::Refused(_)))
    ));
    assert_eq!(slots.newest(), before);

    let flash = slots.release();
    let erases = flash.counts.erases;
    let mut slots = Slots::open(flash, Flash::OFFSET, room).unwrap();
    assert!(matches!(
        slots.write(&damaged, room),
        Err(UpdateError::Defect(Defect::Refused(_)))
    ));
    assert_eq!(slots.release().counts.erases, erases, "no slot was erased");
}

#[test]
fn a_container_takes_one_write_per_block_and_no_empty_write() {
    type Flash = MockFlash<4, 4096>;
    let room = &mut Buffer::new();
    let mut whole_blocks = 0;
    for topology in Topology::ALL {
        for bits in 0..64 {
            let provenance = Provenance {
                seed: Some(1 << bits),
                matched_bits: 1 << bits,
                ..Provenance::default()
            };
            let mut buffer = [0; CONTAINER_BYTES_MAX];
            let genome = encode(&Genome::zeroed(topology), provenance, &mut buffer).unwrap();
            whole_blocks += u32::from(genome.len().is_multiple_of(BLOCK_BYTES));
            let mut slots = Slots::open(Flash::new(), Flash::OFFSET, room).unwrap();
            assert_eq!(slots.write(genome, room), Ok(1));
            let blocks = genome.len().div_ceil(BLOCK_BYTES) as u64;
            // One more write for the header before them, and one for the commit record after them.
            assert_eq!(slots.release().counts.writes, 1 + blocks + 1);
        }
    }
    assert!(whole_blocks > 0);
}

#[test]
fn a_container_ends_with_the_checksum_of_what_comes_before() {
    let genome = container(Topology::default(), 1);
    let (body, _) = genome.split_at(genome.len() - 4);
    assert_eq!(crc_of(&genome), Some(CRC_32C.checksum(body)));
    assert_eq!(crc_of(&[9, 4, 3, 2, 1]), Some(0x0102_0304));
    assert_eq!(crc_of(&[1, 2, 3]), None);
}

#[test]
fn mapped_flash_is_read_in_place() {
    type Flash = MockFlash<4, 256>;
    let genome = container(Topology::default(), 1);
    let mut slots = Slots::open(Flash::new(), Flash::OFFSET, &mut InPlace).unwrap();
    assert_eq!(slots.in_use(&mut InPlace), InUse::BuiltIn);
    assert_eq!(slots.write(&genome, &mut InPlace), Ok(1));
    match slots.in_use(&mut InPlace) {
        InUse::Slot { genome: found, .. } => assert_eq!(Ok(found), EncodedGenome::decode(&genome)),
        InUse::BuiltIn => panic!("the genome was written"),
    }
}

#[test]
fn slots_that_do_not_fit_are_refused() {
    type Flash = MockFlash<4, 256>;
    let open = |offset| Slots::open(Flash::new(), offset, &mut InPlace).map(|_| ());
    assert_eq!(open(0), Ok(()));
    assert_eq!(open(256), Ok(()));
    assert_eq!(
        open(100),
        Err(PlaceError::NotAligned {
            offset: 100,
            erase_size: 256
        })
    );
    for offset in [512, 1 << 31, u32::MAX - 255] {
        let refused = PlaceError::OutOfBounds {
            offset,
            slot_bytes: 1536,
            capacity: 13 * 256,
        };
        assert_eq!(open(offset), Err(refused));
    }
}
