//! Seeds of the corpus: small files of the kinds that this program and the authors' program write.

use super::targets::{CHECKPOINT_SETTINGS, SESSION, tests_folder};
use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX, Provenance};
use minimal_surprise_controller::{Genome, SensorBits, Topology};
use minimal_surprise_evolution::checkpoint;
use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::settings::{Overrides, Settings};
use minimal_surprise_evolver::suite::PAPER;
use minimal_surprise_link::{
    Decoder, Direction, Envelope, PROTOCOL_VERSION, Refusal, Reply, Request, Server,
    WIRE_BYTES_MAX, encode,
};
use minimal_surprise_sim::drawing::draw;
use minimal_surprise_sim::exchange::Trajectory;
use minimal_surprise_slots::{Header, SLOT_BYTES_MIN};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use robot_support::flash::MockFlash;
use robot_support::link_robot::LinkRobot;
use std::fs;

type Seed = (&'static str, String, Vec<u8>);

/// Returns the target, name and bytes of every seed.
pub(crate) fn seeds() -> Vec<Seed> {
    let mut seeds = Vec::new();
    let mut add = |target, name: &str, bytes: Vec<u8>| seeds.push((target, name.to_owned(), bytes));
    let containers = Topology::ALL.map(container);
    for (number, container) in containers.iter().enumerate() {
        add("genome", &format!("topology-{number}"), container.clone());
    }
    add(
        "checkpoint",
        "start",
        checkpoint::encode(&experiment(), CHECKPOINT_SETTINGS),
    );

    let run = tests_folder().join("fixtures/noisy-run-v1");
    let files = [
        ("run-config", "config.toml"),
        ("run-meta", "meta.json"),
        ("run-generations", "generations.csv"),
        ("run-genome", "best.genome"),
        ("run-time", "time.json"),
        ("run-final", "final.json"),
        ("run-done", "DONE"),
    ];
    for (target, file) in files {
        add(target, file, fs::read(run.join(file)).unwrap());
    }
    add("settings", "checkpoint", CHECKPOINT_SETTINGS.into());
    let partly = "grid = \"20x20\"\npredefine-partly = \"line\"\nnoise = 1_0e-2\nout = 'a'\n";
    add("settings", "partly", partly.into());
    let marked = format!("\u{feff}{}", CHECKPOINT_SETTINGS.replace('\n', "\r\n"));
    add("settings", "marked", marked.into());
    add("suite", "paper", PAPER.into());
    add("lock", "held", "node-1.example 4711\n".into());
    add("lock", "longer-before", "a 1\nnode-1.example 4711\n".into());
    add("path", "plain", "runs/one two".into());
    add("path", "url", "file:///runs/%ff/one%20two".into());

    let c = tests_folder().join("fixtures/exchange/c");
    let read = |name: &str| fs::read_to_string(c.join(name)).unwrap();
    let whole = Trajectory::read(&read("agent_trajectory")).unwrap();
    let robots = whole.final_poses().len();
    let text = read("agent_trajectory");
    let states = text
        .lines()
        .take(3 + 3 * robots)
        .map(|line| format!("{line}\n"));
    add("trajectory", "authors", states.collect::<String>().into());
    let small = "Gen: 0\nGrid: 4, 3\nAgents: 1\n0: 0, 0, 1, 0\n1: 1, 0, 1, 0\n";
    add("trajectory", "one-robot", small.into());
    add(
        "drawing",
        "authors",
        draw(whole.grid(), whole.final_poses()).into(),
    );
    add("drawing", "hollow", "▶·◁\n·△·\n▽··\n".into());
    for (target, folder, file) in [
        ("agents", "b", "agents"),
        ("genome-text", "a", "action_genomes"),
        ("genome-text", "b", "prediction_genomes"),
        ("genome-text", "c-partly-predefined", "prediction_genomes"),
    ] {
        let path = tests_folder()
            .join("fixtures/exchange")
            .join(folder)
            .join(file);
        let text = fs::read_to_string(path).unwrap();
        add(
            target,
            &format!("{folder}-{file}"),
            first_generation(&text).into(),
        );
    }

    let (requests, replies) = conversation(&containers[0]);
    add("link-robot", "conversation", requests);
    add(
        "link-robot",
        "scan",
        message(&[2, 100, 0, 0, 0, 200, 0, 0, 64]),
    );
    add("link-host", "conversation", replies);
    add("slots", "one", slot(7, &containers[0]));
    let two = [slot(u32::MAX, &containers[1]), slot(3, &containers[2])].concat();
    add("slots", "two", two);
    add("slots", "erased", vec![0xff; 64]);
    seeds
}

fn container(topology: Topology) -> Vec<u8> {
    let genome = Genome::random(topology, &mut ChaCha8Rng::seed_from_u64(1));
    let provenance = Provenance {
        seed: Some(1),
        generation: 99,
        matched_bits: 300,
        scored_bits: 400,
    };
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    codec::encode(&genome, provenance, &mut buffer)
        .unwrap()
        .to_vec()
}

fn experiment() -> Experiment {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), CHECKPOINT_SETTINGS).unwrap();
    let mut given = Overrides::default();
    given.file(file.path()).unwrap();
    Experiment::new(Settings::resolve(&given, || 0).unwrap())
}

/// Returns the text before the second generation; that generation begins with a blank line or a
/// header.
fn first_generation(text: &str) -> String {
    let end = text.find("\n\n").map_or(text.len(), |end| end + 2);
    text[..end].to_owned()
}

fn message(payload: &[u8]) -> Vec<u8> {
    [&[payload.len() as u8], payload].concat()
}

/// Returns the requests for an update and some steps, and the robot's replies.
fn conversation(container: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let (mut requests, mut replies) = (Vec::new(), Vec::new());
    let mut robot = LinkRobot::start(MockFlash::new());
    let mut server = Server::new();
    let (_, crc) = container.split_last_chunk().unwrap();
    let begin = Request::Begin {
        length: container.len() as u16,
        crc: u32::from_le_bytes(*crc),
    };
    let chunks = (0..).step_by(128).zip(container.chunks(128));
    let chunks = chunks.map(|(offset, data)| Request::Chunk { offset, data });
    let sensors = SensorBits::new(5);
    let after = [
        Request::Commit,
        Request::Step { sensors },
        Request::Start,
        Request::Telemetry,
        Request::Stop,
        Request::Reset,
    ];
    let all = [Request::Identify, begin]
        .into_iter()
        .chain(chunks)
        .chain(after);
    for (sequence, body) in (0..).zip(all) {
        let envelope = Envelope {
            version: PROTOCOL_VERSION,
            direction: Direction::Request,
            session: SESSION,
            sequence,
            body,
        };
        let mut wire = [0; WIRE_BYTES_MAX];
        let length = encode(&envelope, &mut wire).unwrap();
        requests.extend(message(&payload(&wire[..length])));
        for &byte in &wire[..length] {
            if let Some(answer) = server.feed(byte, &mut robot) {
                replies.extend(message(&payload(answer)));
            }
        }
    }
    let refused = Envelope {
        version: PROTOCOL_VERSION,
        direction: Direction::Reply,
        session: SESSION,
        sequence: 3,
        body: Reply::Refused(Refusal::WrongOffset { expected: 9 }),
    };
    replies.extend(message(&postcard::to_allocvec(&refused).unwrap()));
    (requests, replies)
}

fn payload(frame: &[u8]) -> Vec<u8> {
    let mut decoder = Decoder::new();
    for &byte in frame {
        decoder.feed(byte);
    }
    decoder.payload().to_vec()
}

fn slot(write_count: u32, container: &[u8]) -> Vec<u8> {
    let (_, crc) = container.split_last_chunk().unwrap();
    let header = Header {
        write_count,
        length: container.len() as u16,
        crc: u32::from_le_bytes(*crc),
    };
    let mut slot = [&header.front(), container].concat();
    slot.resize(SLOT_BYTES_MIN, 0xff);
    slot
}
