//! Every reader of external bytes, as a function of arbitrary bytes.
//!
//! A target panics if one of these properties does not hold: the reader accepts or rejects any
//! bytes without failing; accepted values are within their ranges; values that are written and read
//! again are unchanged. If a reader verifies a checksum that nearly all bytes would fail, the
//! target also tests the bytes with a correct checksum.

use firmware_example::range_bearing::RangeBearing;
use minimal_surprise_controller::codec::{self, CRC_32C, CRC_BYTES, PREFIX_BYTES};
use minimal_surprise_controller::neighbours::{CellSize, Neighbours};
use minimal_surprise_controller::{Controller, EncodedGenome, SensorBits, SensorModel, Topology};
use minimal_surprise_evolution::checkpoint;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::lock::Holder;
use minimal_surprise_evolution::settings::{Overrides, Settings};
use minimal_surprise_evolution::text::{is_hidden, path_of_text, text_of_path};
use minimal_surprise_evolver::suite::Suite;
use minimal_surprise_link::{Client, FRAME_BYTES_MAX, Request, Server, decode_reply};
use minimal_surprise_sim::drawing;
use minimal_surprise_sim::exchange::{Trajectory, import_genome, read_agents, read_genomes};
use minimal_surprise_sim::world::check_poses;
use minimal_surprise_slots::{
    BLOCK_BYTES, Buffer, CONTAINER_AT, Header, SLOT_BYTES_MIN, Slot, SlotState, Slots, UpdateError,
};
use robot_support::flash::MockFlash;
use robot_support::link_robot::LinkRobot;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A reader: its name, and the function that returns whether it accepted the bytes.
pub(crate) type Target = (&'static str, fn(&[u8]) -> bool);

/// All targets.
pub(crate) const TARGETS: [Target; 20] = [
    ("genome", genome),
    ("checkpoint", checkpoint),
    ("run-config", |bytes| run_file("config.toml", bytes)),
    ("run-meta", |bytes| run_file("meta.json", bytes)),
    ("run-generations", |bytes| {
        run_file("generations.csv", bytes)
    }),
    ("run-genome", |bytes| run_file("best.genome", bytes)),
    ("run-time", |bytes| run_file("time.json", bytes)),
    ("run-final", |bytes| run_file("final.json", bytes)),
    ("run-done", |bytes| run_file("DONE", bytes)),
    ("lock", lock),
    ("path", path),
    ("settings", settings),
    ("suite", suite),
    ("trajectory", trajectory),
    ("agents", agents),
    ("genome-text", genome_text),
    ("drawing", drawing),
    ("link-robot", link_robot),
    ("link-host", link_host),
    ("slots", slots),
];

/// Maximum memory that a reader may use at once: a constant plus an amount per byte of input.
const MEMORY: (u64, u64) = (2 << 20, 500);
/// Maximum memory that a reader may allocate in total, as a measure of its work.
const WORK: (u64, u64) = (8 << 20, 20_000);

/// Runs a target and returns whether it accepted the bytes.
///
/// # Panics
/// If a property does not hold, or the reader uses too much memory for the size of its input.
pub(crate) fn check((name, target): Target, bytes: &[u8]) -> bool {
    let mut accepted = false;
    let used = allocation_counter::measure(|| accepted = target(bytes));
    let most = |(base, per_byte): (u64, u64)| base + per_byte * bytes.len() as u64;
    assert!(
        used.bytes_max <= most(MEMORY) && used.bytes_total <= most(WORK),
        "{name}: {} bytes at once, {} altogether, for {} bytes",
        used.bytes_max,
        used.bytes_total,
        bytes.len()
    );
    accepted
}

fn genome(bytes: &[u8]) -> bool {
    let accepted = one_genome(bytes);
    one_genome(&with_checksum(bytes)) || accepted
}

/// Returns the bytes as a container with the correct length and checksum.
fn with_checksum(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let Some(body) = bytes.len().checked_sub(CRC_BYTES)
        && body >= PREFIX_BYTES
    {
        let length = (bytes.len() as u16).to_le_bytes();
        bytes[6..8].copy_from_slice(&length);
        let crc = CRC_32C.checksum(&bytes[..body]);
        bytes[body..].copy_from_slice(&crc.to_le_bytes());
    }
    bytes
}

fn one_genome(bytes: &[u8]) -> bool {
    let Ok(encoded) = EncodedGenome::decode(bytes) else {
        return false;
    };
    assert_eq!(codec::container_length(bytes), Ok(bytes.len()));
    let genome = encoded.to_genome();
    let mut buffer = [0; codec::CONTAINER_BYTES_MAX];
    let again = codec::encode(&genome, encoded.provenance(), &mut buffer).unwrap();
    assert_eq!(again, bytes, "equal contents have equal containers");
    let controller = Controller::new(&genome);
    let mut state = minimal_surprise_controller::State::new(&controller);
    controller.step(&mut state, SensorBits::new(0xffff));
    true
}

/// Settings of the checkpoints in the corpus.
pub(crate) const CHECKPOINT_SETTINGS: &str = "grid = \"5x5\"\nrobots = 4\nsensor-model = \"b\"\n\
    noise = 0.0\npopulation = 3\ngenerations = 4\nrepetitions = 2\nsteps = 5\nmutation = 0.1\n\
    seed = 1\n";

thread_local! {
    static SETTINGS: Settings =
        read_settings(CHECKPOINT_SETTINGS.as_bytes()).expect("they are settings");
    /// A complete run in which one file is replaced.
    static RUN: TempDir = copy_of_run();
    /// Folder of the file for readers that take a path.
    static FOLDER: TempDir = tempfile::tempdir().unwrap();
}

fn checkpoint(bytes: &[u8]) -> bool {
    let decode = |bytes: &[u8]| {
        let settings = SETTINGS.with(Clone::clone);
        checkpoint::decode(bytes, settings, CHECKPOINT_SETTINGS).ok()
    };
    let with_checksum = bytes.split_last_chunk::<4>().map(|(body, _)| {
        let crc = CRC_32C.checksum(body).to_le_bytes();
        [body, &crc].concat()
    });
    let experiments = [Some(bytes.to_vec()), with_checksum].into_iter().flatten();
    let experiments = experiments.filter_map(|bytes| decode(&bytes));
    let mut accepted = false;
    for experiment in experiments {
        let written = checkpoint::encode(&experiment, CHECKPOINT_SETTINGS);
        let again = decode(&written).expect("written bytes can be read");
        assert_eq!(checkpoint::encode(&again, CHECKPOINT_SETTINGS), written);
        accepted = true;
    }
    accepted
}

/// Returns the folder of the files that the targets use.
pub(crate) fn tests_folder() -> PathBuf {
    // The path must be the same in this package and in the package for coverage-guided fuzzing.
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap().join("tests")
}

fn copy_of_run() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in fs::read_dir(tests_folder().join("fixtures/noisy-run-v1")).unwrap() {
        let file = file.unwrap();
        fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
    }
    folder
}

fn run_file(name: &str, bytes: &[u8]) -> bool {
    RUN.with(|run| {
        let path = run.path().join(name);
        let good = fs::read(&path).unwrap();
        fs::write(&path, bytes).unwrap();
        let read = FinishedRun::read(run.path());
        if let Err(error) = &read {
            assert!(error.to_string().contains("/"), "no path in {error}");
        }
        if let Ok(finished) = &read {
            // The check repeats all steps, so only files that can make it fail are checked.
            if ["best.genome", "final.json"].contains(&name) {
                let _ = FinishedRun::read_and_check(run.path());
            }
            assert!(
                finished
                    .best_fitness
                    .iter()
                    .all(|f| (0.0..=1.0).contains(f))
            );
        }
        fs::write(&path, good).unwrap();
        read.is_ok()
    })
}

/// Writes the bytes to a file, for a reader that takes a path.
fn as_file<T>(bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    FOLDER.with(|folder| {
        let path = folder.path().join("file");
        fs::write(&path, bytes).unwrap();
        read(&path)
    })
}

fn read_settings(bytes: &[u8]) -> Option<Settings> {
    let mut given = Overrides::default();
    as_file(bytes, |path| given.file(path)).ok()?;
    given.remove("from");
    Settings::resolve(&given, || 7).ok()
}

fn settings(bytes: &[u8]) -> bool {
    let Some(settings) = read_settings(bytes) else {
        return false;
    };
    let written = settings.toml();
    assert_eq!(read_settings(written.as_bytes()), Some(settings));
    true
}

fn lock(bytes: &[u8]) -> bool {
    let Some(holder) = Holder::read(bytes) else {
        return false;
    };
    assert!(!holder.to_string().chars().any(is_hidden), "{holder:?}");
    let written = format!("{} {}\n", holder.host, holder.process);
    assert_eq!(Holder::read(written.as_bytes()), Some(holder));
    true
}

fn path(bytes: &[u8]) -> bool {
    let Some(text) = text(bytes) else {
        return false;
    };
    let path = path_of_text(text);
    let again = path_of_text(&text_of_path(&path));
    assert!(again == path || Ok(again) == std::path::absolute(&path).map_err(drop));
    true
}

fn suite(bytes: &[u8]) -> bool {
    as_file(bytes, |path| Suite::read(path).is_ok())
}

fn text(bytes: &[u8]) -> Option<&str> {
    str::from_utf8(bytes).ok()
}

fn trajectory(bytes: &[u8]) -> bool {
    let Some(read) = text(bytes).and_then(|text| Trajectory::read(text).ok()) else {
        return false;
    };
    let mut written = Vec::new();
    read.write(&mut written).unwrap();
    assert_eq!(Trajectory::read(text(&written).unwrap()), Ok(read));
    true
}

fn agents(bytes: &[u8]) -> bool {
    let Some(generations) = text(bytes).and_then(|text| read_agents(text).ok()) else {
        return false;
    };
    for agents in generations {
        assert_eq!(check_poses(agents.grid, &agents.starts), Ok(()));
        assert_eq!(check_poses(agents.grid, &agents.finals), Ok(()));
        assert!(agents.fitness.is_finite());
    }
    true
}

fn genome_text(bytes: &[u8]) -> bool {
    let Some(generations) = text(bytes).and_then(|text| read_genomes(text).ok()) else {
        return false;
    };
    for rows in &generations {
        for topology in Topology::ALL {
            let Ok(imported) = import_genome(topology, rows, Some(rows)) else {
                continue;
            };
            assert!(imported.rounding_error_max <= 1.0 / 8192.0);
            for lost in imported.saturated {
                assert_eq!(imported.genome.weights()[lost.index], lost.weight_q3_12);
            }
        }
    }
    true
}

fn drawing(bytes: &[u8]) -> bool {
    let Some((grid, poses)) = text(bytes).and_then(|text| drawing::parse(text).ok()) else {
        return false;
    };
    assert_eq!(check_poses(grid, &poses), Ok(()));
    let drawn = drawing::draw(grid, &poses);
    assert_eq!(drawing::parse(&drawn), Ok((grid, poses)));
    true
}

/// Splits bytes into messages; each consists of one byte with the message's length, followed by the
/// message.
fn messages(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    core::iter::from_fn(move || {
        let (&length, rest) = bytes.split_first()?;
        let (message, rest) = rest.split_at(rest.len().min(length.into()));
        bytes = rest;
        Some(message)
    })
}

/// Encodes a message as a frame on the line.
fn framed(message: &[u8]) -> Vec<u8> {
    let crc = CRC_32C.checksum(message).to_le_bytes();
    let mut wire = vec![0; message.len() + FRAME_BYTES_MAX];
    let length = cobs::encode(&[message, &crc].concat(), &mut wire[1..]);
    wire.truncate(length + 2);
    wire
}

/// Feeds bytes to a robot and returns its replies.
fn answers(server: &mut Server, robot: &mut LinkRobot, bytes: &[u8]) -> Vec<Vec<u8>> {
    let answer = |&byte: &u8| server.feed(byte, robot).map(<[u8]>::to_vec);
    bytes.iter().filter_map(answer).collect()
}

/// Decodes a frame and returns its message.
fn payload(frame: &[u8]) -> Vec<u8> {
    let mut decoder = minimal_surprise_link::Decoder::new();
    let complete = frame.iter().filter(|&&byte| decoder.feed(byte)).count();
    assert_eq!(complete, 1, "one frame");
    decoder.payload().to_vec()
}

fn link_robot(bytes: &[u8]) -> bool {
    let mut scans = RangeBearing::new();
    let mut neighbours = Neighbours::<20>::new();
    let cell = CellSize::from_mm(100.0).unwrap();
    let mut server = Server::new();
    let mut robot = LinkRobot::start(MockFlash::new());
    for answer in answers(&mut server, &mut robot, bytes) {
        decode_reply(&payload(&answer)).expect("a reply");
    }
    let mut accepted = false;
    for message in messages(bytes) {
        let frame = framed(message);
        let first = answers(&mut server, &mut robot, &frame);
        let done = robot.done;
        assert_eq!(
            answers(&mut server, &mut robot, &frame),
            first,
            "a repeated request gets the same reply"
        );
        assert_eq!(robot.done, done, "a repeated request is executed only once");
        for answer in &first {
            decode_reply(&payload(answer)).expect("a reply");
        }
        accepted |= !first.is_empty();
        for byte in frame {
            scans.feed(byte, &mut neighbours);
        }
        for model in SensorModel::ALL {
            let bits = neighbours.sensor_bits(model, cell).bits();
            assert_eq!(bits & !model.mask().bits(), 0);
        }
    }
    accepted
}

/// Session ID in the replies in the corpus.
pub(crate) const SESSION: u32 = 7;

fn link_host(bytes: &[u8]) -> bool {
    let requests = [Request::Telemetry, Request::Commit, Request::Reset];
    let requests = [Request::Identify]
        .into_iter()
        .chain(requests.into_iter().cycle());
    let mut requests = requests.map(Some);
    let mut client = Client::new(SESSION, 2);
    let mut accepted = false;
    let mut feed = |byte: u8, pending: &mut bool| {
        if !*pending {
            let request = requests.next().flatten().expect("an endless sequence");
            client.request(&request).expect("nothing is pending");
            *pending = true;
        }
        if client.feed(byte).is_some() {
            *pending = false;
            accepted = true;
        }
    };
    let mut pending = false;
    for &byte in bytes {
        feed(byte, &mut pending);
    }
    for byte in messages(bytes).flat_map(framed) {
        feed(byte, &mut pending);
    }
    accepted
}

type Flash = MockFlash<4, 4096>;

fn slots(bytes: &[u8]) -> bool {
    let accepted = flash_image(bytes);
    let mut bytes = bytes.to_vec();
    for slot in bytes.chunks_mut(SLOT_BYTES_MIN) {
        make_consistent(slot);
    }
    flash_image(&bytes) || accepted
}

/// Makes a slot's header consistent with its container.
fn make_consistent(slot: &mut [u8]) -> Option<()> {
    let front = slot.first_chunk::<BLOCK_BYTES>()?;
    let write_count = u32::from_le_bytes(*front[4..].first_chunk()?);
    let length = u16::from_le_bytes(*front[8..].first_chunk()?);
    let container = CONTAINER_AT as usize..CONTAINER_AT as usize + usize::from(length);
    let bytes = with_checksum(slot.get(container.clone())?);
    let header = Header {
        write_count,
        length,
        crc: bytes.last_chunk().map_or(0, |crc| u32::from_le_bytes(*crc)),
    };
    slot[container].copy_from_slice(&bytes);
    slot[..CONTAINER_AT as usize].copy_from_slice(&header.front());
    Some(())
}

fn flash_image(bytes: &[u8]) -> bool {
    let mut flash = Flash::new();
    let slot_bytes = Slots::<Flash>::SLOT_BYTES as u32;
    for (slot, bytes) in (0..2).zip(bytes.chunks(SLOT_BYTES_MIN)) {
        for (at, byte) in (Flash::OFFSET + slot * slot_bytes..).zip(bytes) {
            // The slot was erased.
            flash.damage(at, byte ^ 0xff);
        }
    }
    let room = &mut Buffer::new();
    let mut slots = Slots::open(flash, Flash::OFFSET, room).expect("there is room");
    let newest = slots.newest();
    let counts = Slot::ALL.map(|slot| match slots.state(slot) {
        SlotState::Committed(header) | SlotState::Damaged(header, _) => header.write_count,
        _ => 0,
    });
    assert_eq!(slots.write_count(), counts[0].max(counts[1]));
    let _ = slots.in_use(room).controller();

    let mut buffer = [0; codec::CONTAINER_BYTES_MAX];
    let genome = minimal_surprise_controller::Genome::zeroed(Topology::ALL[0]);
    let container = codec::encode(&genome, Default::default(), &mut buffer).unwrap();
    let before = slots.write_count();
    match slots.write(container, room) {
        Ok(count) => assert_eq!(Some(count), before.checked_add(1)),
        Err(error) => {
            assert_eq!(error, UpdateError::CountExhausted);
            assert_eq!(before, u32::MAX);
            assert_eq!(slots.newest(), newest);
        }
    }
    let after = slots.newest();
    let slots = Slots::open(slots.release(), Flash::OFFSET, room).expect("there is room");
    assert_eq!(slots.newest(), after, "the same after a restart");
    newest.is_some()
}
