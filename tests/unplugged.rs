//! The robot is unplugged during `evolver flash`: QEMU is killed at chosen flash operations and at
//! random moments. `TEST_ALL=1` kills QEMU more often.
//!
//! A failing test prints the number of the kill. A kill depends only on [`SEED`] and its number,
//! except for variations in timing on the host.

use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, Provenance, encode};
use minimal_surprise_controller::{
    Controller, EncodedGenome, Genome, KERNEL_ID, SensorBits, State, Topology,
};
use minimal_surprise_link::{GenomeInUse, Reply, Request};
use minimal_surprise_slots::{COMMIT_AT, CONTAINER_AT, crc_of, slot_bytes};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use tests::firmware::{self, Firmware};
use tests::full::all_cases;
use tests::program::{Evolver, Finished};
use tests::robot::{Line, QemuRobot};
use tests::tools::{Missing, require};

/// Seed of the genomes and of the kills.
const SEED: u64 = 11;
/// Number of kills, normally and with `TEST_ALL=1`.
const KILLS: u32 = 40;
const KILLS_ALL: u32 = 200;
/// Number of bytes per erase unit of the robot's flash, and per step of an erase.
const ERASE_BYTES: usize = 4096;
const ERASE_STEP_BYTES: usize = 512;
/// Number of bytes per word of the robot's flash.
const WORD_BYTES: usize = 4;
type Word = [u8; WORD_BYTES];
const ERASED: Word = [0xff; WORD_BYTES];
/// Offset of the write count in a slot's header.
const WRITE_COUNT_AT: usize = 4;
/// Maximum time to wait for a flash operation.
const OPERATION_WAIT: Duration = Duration::from_secs(20);

/// The moment at which QEMU is killed.
#[derive(Clone, Copy, Debug)]
enum Kill {
    /// As soon as this step of the slot's erase is done.
    Erased { step: usize },
    /// As soon as the word at this offset in the slot has been written.
    Written { at: usize },
    /// After this fraction of the duration of an update, in thousandths.
    After { thousandths: u32 },
}

/// The bytes in the flash file that belong to the slot being written.
struct SlotBytes {
    flash: File,
    start: u64,
    before: Vec<u8>,
}

impl SlotBytes {
    fn open(folder: &Path, start: u64) -> Self {
        let flash = File::open(folder.join("flash.bin")).unwrap();
        let mut before = vec![0; slot_bytes(ERASE_BYTES)];
        flash.read_exact_at(&mut before, start).unwrap();
        Self {
            flash,
            start,
            before,
        }
    }

    fn word(&self, at: usize) -> Word {
        let mut word = ERASED;
        let place = self.start + at as u64;
        self.flash.read_exact_at(&mut word, place).unwrap();
        word
    }

    /// Checks whether the word has changed since the start of the update.
    fn is_changed(&self, at: usize) -> bool {
        self.word(at) != self.before[at..at + WORD_BYTES]
    }

    /// Returns the offset of the last word erased by a step; for the step at the slot's start, the
    /// offset of the write count, because every header begins with the same word.
    fn last_word(&self, step: usize) -> usize {
        let from = step * ERASE_STEP_BYTES;
        let mut words = (from..from + ERASE_STEP_BYTES).step_by(WORD_BYTES);
        words
            .rfind(|&at| self.before[at..at + WORD_BYTES] != ERASED)
            .unwrap_or(WRITE_COUNT_AT)
    }
}

impl Kill {
    /// Chooses the moment of a kill. Every second kill occurs during a flash operation. These kills
    /// are spread evenly over an update: over the steps of the erase and the words of the header,
    /// the container and the commit record.
    fn choose(index: u32, kills: u32, container_bytes: usize) -> Self {
        if index % 2 == 1 {
            let mut rng = ChaCha8Rng::seed_from_u64(SEED + u64::from(index));
            return Self::After {
                thousandths: rng.next_u32() % 1000,
            };
        }
        let words = |from: u32, bytes: usize| {
            (from as usize..from as usize + bytes)
                .step_by(WORD_BYTES)
                .map(|at| Self::Written { at })
        };
        // Beyond the end of the container, an erase changes no bytes.
        let steps = (CONTAINER_AT as usize + container_bytes).div_ceil(ERASE_STEP_BYTES);
        let operations: Vec<Self> = (0..steps)
            .map(|step| Self::Erased { step })
            .chain(words(0, 16))
            // Only a sample of the container's words: all words are equally critical, and the
            // container has far more words than the other parts.
            .chain(words(CONTAINER_AT, container_bytes).step_by(16))
            .chain(words(COMMIT_AT, 8))
            .collect();
        let place = (index / 2) as usize * (operations.len() - 1) / (kills / 2 - 1) as usize;
        operations[place]
    }

    /// Waits until the moment of the kill.
    fn wait(self, slot: &SlotBytes, update: Duration) {
        let overdue = Instant::now() + OPERATION_WAIT;
        let until = |is_there: &dyn Fn() -> bool| {
            while !is_there() {
                assert!(Instant::now() < overdue, "timed out waiting for {self:?}");
            }
        };
        match self {
            Self::Erased { step } => {
                let at = slot.last_word(step);
                until(&|| slot.is_changed(at));
            }
            // The whole slot is erased before the first word of the header is written.
            Self::Written { at } => {
                until(&|| slot.is_changed(WRITE_COUNT_AT));
                if at >= WRITE_COUNT_AT {
                    until(&|| slot.word(WRITE_COUNT_AT) != ERASED);
                }
                until(&|| slot.word(at) != ERASED);
            }
            Self::After { thousandths } => thread::sleep(update * thousandths / 1000),
        }
    }
}

/// Prints the number of the kill if the test fails.
struct Failing(u32, Kill);

impl Drop for Failing {
    fn drop(&mut self) {
        if thread::panicking() {
            println!("seed {SEED}, kill {}: {:?}", self.0, self.1);
        }
    }
}

/// Returns the genome container of one generation, of any topology.
fn container(generation: u32) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED + u64::from(generation));
    // A network that predicts everything has the longest container; the kills are spread over its
    // length.
    let topology = match generation % 2 {
        0 => Topology::default(),
        _ => Topology::ALL[generation as usize / 2 % Topology::ALL.len()],
    };
    let genome = Genome::random(topology, &mut rng);
    let provenance = Provenance {
        seed: Some(SEED),
        generation,
        ..Provenance::default()
    };
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    encode(&genome, provenance, &mut buffer).unwrap().to_vec()
}

/// A running robot.
struct Robot {
    qemu: QemuRobot,
    /// The genome that the robot reported first.
    genome: GenomeInUse,
}

impl Robot {
    fn start(firmware: &Firmware, folder: &Path, rng: &mut ChaCha8Rng) -> Result<Self, Missing> {
        let qemu = QemuRobot::start(firmware, folder)?;
        let (_, genome) = identify(&qemu, rng, false);
        Ok(Self { qemu, genome })
    }

    /// Asserts that the robot makes the decisions of this genome.
    fn must_run(&self, container: &[u8], running: bool, rng: &mut ChaCha8Rng) {
        let (mut line, in_use) = identify(&self.qemu, rng, running);
        assert!(is_in_use(in_use, container), "{in_use:?}");
        let genome = EncodedGenome::decode(container).unwrap();
        let controller = Controller::from_encoded(&genome);
        let mut state = State::new(&controller);
        for request in [Request::Stop, Request::Reset] {
            line.ask(&request, |reply| assert_eq!(reply, Reply::Done))
                .unwrap();
        }
        for _ in 0..8 {
            let sensors = SensorBits::new(rng.next_u32() as u16);
            let expected = controller.step(&mut state, sensors);
            let stepped = line.ask(&Request::Step { sensors }, |reply| match reply {
                Reply::Stepped(stepped) => stepped,
                other => panic!("{other:?}"),
            });
            let stepped = stepped.unwrap();
            assert_eq!(
                (stepped.decision, stepped.surprise),
                (expected, state.surprise())
            );
        }
    }

    /// Writes a genome and returns the time taken.
    fn update(&self, evolver: &Evolver, container: &[u8]) -> Duration {
        let started = Instant::now();
        let flashed = flash(evolver, &self.qemu.port, container);
        assert_eq!(flashed.code, Some(0), "{flashed:?}");
        started.elapsed()
    }
}

/// Opens a session with a robot; returns the session and the genome in use.
fn identify(qemu: &QemuRobot, rng: &mut ChaCha8Rng, running: bool) -> (Line, GenomeInUse) {
    let mut line = Line::open(&qemu.port, rng.next_u32()).unwrap();
    let identified = line.ask(&Request::Identify, |reply| match reply {
        Reply::Identity(identity) => {
            assert_eq!((identity.firmware, identity.kernel), ("robot", KERNEL_ID));
            assert_eq!(identity.running, running);
            identity.genome
        }
        other => panic!("{other:?}"),
    });
    (line, identified.unwrap())
}

/// Runs `evolver flash` to completion.
fn flash(evolver: &Evolver, port: &str, container: &[u8]) -> Finished {
    evolver.write("new.genome", container);
    evolver.run(&["flash", "new.genome", "--port", port])
}

/// Returns the offset within the file of the slot that the robot writes next.
fn slot_to_write(genome: GenomeInUse) -> u64 {
    match genome {
        GenomeInUse::Slot { slot: 0, .. } => slot_bytes(ERASE_BYTES) as u64,
        GenomeInUse::Slot { .. } | GenomeInUse::BuiltIn => 0,
    }
}

/// Returns the number of errors printed by a program.
fn said(finished: &Finished) -> usize {
    let lines = finished.stderr.lines();
    lines.filter(|line| line.starts_with("error: ")).count()
}

/// Checks whether this genome is in use.
fn is_in_use(genome: GenomeInUse, container: &[u8]) -> bool {
    matches!(genome, GenomeInUse::Slot { crc, .. } if Some(crc) == crc_of(container))
}

#[test]
fn a_robot_killed_while_a_genome_is_written_runs_the_old_one_or_the_new_one() {
    let Some(firmware) = require(firmware::build()) else {
        return;
    };
    let kills = if all_cases() { KILLS_ALL } else { KILLS };
    let folder = tempfile::tempdir().unwrap();
    let evolver = Evolver::in_empty_folder();
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let Some(mut robot) = require(Robot::start(&firmware, folder.path(), &mut rng)) else {
        return;
    };
    assert_eq!(robot.genome, GenomeInUse::BuiltIn);
    let mut old = container(0);
    // Both slots are used before the first kill, so every update erases a slot.
    robot.update(&evolver, &container(u32::MAX));
    let mut update_time = robot.update(&evolver, &old);
    let mut slot = slot_bytes(ERASE_BYTES) as u64;

    let (mut olds, mut news, mut unheard) = (0, 0, 0);
    let started = Instant::now();
    for index in 0..kills {
        let new = container(index + 1);
        let kill = Kill::choose(index, kills, old.len().min(new.len()));
        let _failing = Failing(index, kill);
        slot = slot_bytes(ERASE_BYTES) as u64 - slot;
        let slot_bytes = SlotBytes::open(folder.path(), slot);
        let Robot { qemu, .. } = robot;
        let port = qemu.port.clone();
        let flashed = thread::scope(|scope| {
            let writer = scope.spawn(|| flash(&evolver, &port, &new));
            kill.wait(&slot_bytes, update_time);
            qemu.kill();
            writer.join().unwrap()
        });

        robot = Robot::start(&firmware, folder.path(), &mut rng).unwrap();
        let runs_new = is_in_use(robot.genome, &new);
        let runs_old = is_in_use(robot.genome, &old);
        assert!(runs_new || runs_old, "{:?}", robot.genome);
        robot.must_run(if runs_new { &new } else { &old }, false, &mut rng);
        match flashed.code {
            Some(0) => assert!(runs_new, "the acknowledged genome is lost"),
            Some(code @ (1 | 2)) => {
                assert_eq!(said(&flashed), 1, "one clear message: {flashed:?}");
                // Exit code 2 is correct only if the port disappeared before it was opened.
                let no_port = flashed.stderr.contains("no such port");
                assert_eq!(code == 2, no_port, "{flashed:?}");
                unheard += u32::from(runs_new);
            }
            _ => panic!("{flashed:?}"),
        }
        if runs_new {
            news += 1;
        } else {
            olds += 1;
        }

        slot = slot_to_write(robot.genome);
        update_time = robot.update(&evolver, &new);
        robot.must_run(&new, true, &mut rng);
        old = new;
    }
    println!(
        "{kills} kills in {:.0?}: {olds} times the old genome, {news} times the new one, \
         {unheard} of these unacknowledged; seed {SEED}",
        started.elapsed()
    );
    // Otherwise, the kills would have missed the update.
    assert!(olds > kills / 2 && news > 0, "{olds} {news}");
}
