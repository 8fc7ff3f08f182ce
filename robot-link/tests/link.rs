//! The line between robot and host: whatever bytes arrive, nothing invalid is accepted, no request
//! is executed twice, and a genome is transferred.
//!
//! The tests use 100,000 fuzzed frames, or a million with `TEST_ALL=1`. `LINK_SEED` replaces the
//! seed, which a failure prints.

use minimal_surprise_controller::codec::{
    CONTAINER_BYTES_MAX, Provenance, encode as encode_genome,
};
use minimal_surprise_controller::{
    Action, Controller, Decision, EncodedGenome, Genome, KERNEL_ID, SensorBits, State, Surprise,
    Topology, Turn,
};
use minimal_surprise_link::{
    CHUNK_BYTES_MAX, Client, Decoder, Direction, Envelope, FRAME_BYTES_MAX, Faults, GaveUp,
    GenomeInUse, Handler, Identity, LineCounters, LineErrors, MalformedMessage, PROTOCOL_VERSION,
    Refusal, Reply, Report, Request, RequestError, Server, Stepped, WIRE_BYTES_MAX, decode_reply,
    decode_request, encode,
};
use minimal_surprise_slots::{Buffer, InUse, crc_of};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use robot_support::full::all_cases;
use robot_support::link_robot::{Flash, LinkRobot};
use serde::Serialize;
use std::collections::VecDeque;

/// Default seed; `LINK_SEED` overrides it.
const SEED: u64 = 11;

/// Prints the command that repeats a failed test.
struct Replay {
    test: &'static str,
    seed: u64,
}

impl Replay {
    fn of(test: &'static str) -> Self {
        let seed = std::env::var("LINK_SEED").map_or(SEED, |seed| seed.parse().unwrap());
        Self { test, seed }
    }

    fn rng(&self) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(self.seed)
    }
}

impl Drop for Replay {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let Self { test, seed } = self;
            eprintln!(
                "to repeat: LINK_SEED={seed} cargo test -p minimal-surprise-link --test link {test}"
            );
        }
    }
}

/// Draws a number below `end`, uniform enough for a test.
fn below(rng: &mut ChaCha8Rng, end: usize) -> usize {
    ((u64::from(rng.next_u32()) * end as u64) >> 32) as usize
}

fn percent(rng: &mut ChaCha8Rng, share: usize) -> bool {
    below(rng, 100) < share
}

fn wire_of(message: &impl Serialize) -> Vec<u8> {
    let mut wire = [0; WIRE_BYTES_MAX];
    let length = encode(message, &mut wire).expect("the message fits");
    wire[..length].to_vec()
}

fn request(session: u32, sequence: u32, body: Request<'_>) -> Envelope<Request<'_>> {
    Envelope {
        version: PROTOCOL_VERSION,
        direction: Direction::Request,
        session,
        sequence,
        body,
    }
}

fn reply(sequence: u32, body: Reply<'_>) -> Envelope<Reply<'_>> {
    Envelope {
        version: PROTOCOL_VERSION,
        direction: Direction::Reply,
        session: 7,
        sequence,
        body,
    }
}

/// Computes CRC-32C bit by bit, as defined.
fn crc_32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc: u32, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            let feedback = if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
            crc >> 1 ^ feedback
        })
    })
}

/// Encodes a message with COBS, implemented from the paper that introduced it.
fn reference_cobs(message: &[u8]) -> Vec<u8> {
    let mut wire = vec![0];
    for (index, block) in message.split(|&byte| byte == 0).enumerate() {
        assert!(block.len() < 254 || index == 0 && message.len() < 254);
        wire.push(block.len() as u8 + 1);
        wire.extend(block);
    }
    wire.push(0);
    wire
}

/// Decodes bytes without zeros; returns their message if they are a frame.
fn reference_decode(stretch: &[u8]) -> Option<Vec<u8>> {
    let mut rest = stretch;
    let mut frame = Vec::new();
    while let Some((&code, tail)) = rest.split_first() {
        let block = tail.get(..usize::from(code) - 1)?;
        frame.extend(block);
        rest = &tail[block.len()..];
        if !rest.is_empty() && code < 255 {
            frame.push(0);
        }
    }
    let (payload, crc) = frame.split_last_chunk::<4>()?;
    let fits = frame.len() <= FRAME_BYTES_MAX && !payload.is_empty();
    (fits && u32::from_le_bytes(*crc) == crc_32c(payload)).then(|| payload.to_vec())
}

/// Encodes a message as a frame with a correct CRC.
fn frame_of(payload: &[u8]) -> Vec<u8> {
    let crc = crc_32c(payload).to_le_bytes();
    reference_cobs(&[payload, &crc[..]].concat())
}

fn any_bytes(rng: &mut ChaCha8Rng, end: usize) -> Vec<u8> {
    let mut bytes = vec![0; below(rng, end)];
    rng.fill_bytes(&mut bytes);
    bytes
}

/// Changes, removes, inserts or truncates bytes.
fn mutate(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    for _ in 0..1 + below(rng, 3) {
        if bytes.is_empty() {
            return;
        }
        let at = below(rng, bytes.len());
        match below(rng, 5) {
            0 => bytes[at] ^= 1 << below(rng, 8),
            1 => bytes[at] = rng.next_u32() as u8,
            2 => drop(bytes.remove(at)),
            3 => bytes.insert(at, rng.next_u32() as u8),
            _ => bytes.truncate(at),
        }
    }
}

/// Handler that records the requests received.
#[derive(Default)]
struct Recorder {
    /// `crc` of every `begin` request.
    begun: Vec<u32>,
    calls: u64,
}

impl Handler for Recorder {
    fn identify(&mut self) -> Identity<'_> {
        self.calls += 1;
        Identity {
            firmware: "recorder with a name that is much longer than fits a frame, ä, ö, ü",
            version: "0.1.0-with-more-than-fits",
            kernel: KERNEL_ID,
            genome: GenomeInUse::BuiltIn,
            running: false,
            faults: Faults::NO_GENOME,
        }
    }
    fn begin(&mut self, _: u16, crc: u32) -> Result<(), Refusal> {
        self.calls += 1;
        self.begun.push(crc);
        Ok(())
    }
    fn chunk(&mut self, _: u16, data: &[u8]) -> Result<(), Refusal> {
        self.calls += 1;
        assert!(data.len() <= CHUNK_BYTES_MAX);
        Err(Refusal::NotBegun)
    }
    fn commit(&mut self) -> Result<u32, Refusal> {
        self.calls += 1;
        Err(Refusal::NotBegun)
    }
    fn step(&mut self, _: SensorBits) -> Result<Stepped, Refusal> {
        self.calls += 1;
        Err(Refusal::Running)
    }
    fn reset(&mut self) -> Result<(), Refusal> {
        self.calls += 1;
        Ok(())
    }
    fn start(&mut self) -> Result<(), Refusal> {
        self.calls += 1;
        Ok(())
    }
    fn stop(&mut self) -> Result<(), Refusal> {
        self.calls += 1;
        Ok(())
    }
    fn telemetry(&mut self) -> Report {
        self.calls += 1;
        Report::default()
    }
}

/// Feeds all bytes; returns the frames sent in reply.
fn feed(server: &mut Server, handler: &mut impl Handler, bytes: &[u8]) -> Vec<Vec<u8>> {
    let answers = bytes.iter().filter_map(|&byte| {
        let answer = server.feed(byte, handler)?;
        Some(answer.to_vec())
    });
    answers.collect()
}

#[test]
fn fuzzed_frames_are_accepted_if_and_only_if_they_are_frames() {
    let replay = Replay::of("fuzzed_frames");
    let mut rng = replay.rng();
    let frames = if all_cases() { 1_000_000 } else { 100_000 };
    let mut decoder = Decoder::new();
    let mut client = Client::new(1, 1);
    client.request(&Request::Identify).unwrap();
    let (mut server, mut handler) = (Server::new(), Recorder::default());
    // The bytes received since the last zero.
    let mut stretch = Vec::new();
    // Messages that may arrive intact: those of the last eight frames, and their mutants. A frame
    // that has lost its last bytes is pending until the next zero.
    let mut known: VecDeque<Vec<u8>> = VecDeque::from(vec![vec![]; 16]);
    let mut earlier = Vec::new();
    let (mut accepted, mut well_formed) = (0_u64, 0_u64);
    for number in 0..frames {
        let data = any_bytes(&mut rng, CHUNK_BYTES_MAX + 1);
        // A session stays open for some frames; some frames belong to no session.
        let [session, sequence] = match below(&mut rng, 8) {
            0 => [0; 2].map(|_: i32| rng.next_u32() >> below(&mut rng, 32)),
            _ => [number as u32 / 32, number as u32 % 32],
        };
        let random = rng.next_u32();
        let (length, crc) = (random as u16, random);
        let sensors = SensorBits::new(random as u16);
        let body = match below(&mut rng, 6) {
            _ if sequence == 0 => Request::Identify,
            0 => Request::Identify,
            1 => Request::Begin { length, crc },
            2 | 3 => Request::Chunk {
                offset: length,
                data: &data,
            },
            4 => Request::Step { sensors },
            _ => Request::Telemetry,
        };
        let mut payload = vec![0; FRAME_BYTES_MAX];
        let envelope = request(session, sequence, body);
        let length = postcard::to_slice(&envelope, &mut payload).unwrap().len();
        payload.truncate(length);
        let mut wire = wire_of(&envelope);
        assert_eq!(wire, frame_of(&payload), "frame {number}");
        known.pop_front();
        known.push_back(payload.clone());
        let whole = wire.clone();
        match below(&mut rng, 8) {
            0 => {}
            1 => wire = any_bytes(&mut rng, 200),
            // The frame is sent twice, or an earlier frame is repeated.
            4 => wire = [&wire, &earlier, &wire[..]].concat(),
            // By definition a frame, but not necessarily a message.
            2 => {
                mutate(&mut payload, &mut rng);
                payload.truncate(FRAME_BYTES_MAX - 4);
                wire = frame_of(&payload);
            }
            3 => {
                payload = any_bytes(&mut rng, FRAME_BYTES_MAX - 4);
                if let [version, way, ..] = payload.as_mut_slice() {
                    (*version, *way) = (PROTOCOL_VERSION, *way & 1);
                }
                wire = frame_of(&payload);
            }
            _ => mutate(&mut wire, &mut rng),
        }
        known.pop_front();
        known.push_back(payload);
        for byte in wire {
            let expected = match byte {
                0 => reference_decode(&std::mem::take(&mut stretch)),
                _ => {
                    stretch.push(byte);
                    None
                }
            };
            let found = decoder.feed(byte).then(|| decoder.payload().to_vec());
            assert_eq!(found, expected, "frame {number}");
            let calls = handler.calls;
            let answer = server.feed(byte, &mut handler).map(<[u8]>::to_vec);
            assert_eq!(client.feed(byte), None, "frame {number}: no reply was sent");
            let Some(payload) = expected else {
                assert!(answer.is_none() && handler.calls == calls, "frame {number}");
                continue;
            };
            accepted += 1;
            assert!(known.contains(&payload), "frame {number} was not sent");
            match decode_request(&payload) {
                Err(_) => assert!(answer.is_none() && handler.calls == calls, "frame {number}"),
                Ok(message) => {
                    well_formed += 1;
                    assert!(handler.calls - calls <= 1, "frame {number}");
                    let again = wire_of(&message);
                    let again = reference_decode(&again[1..again.len() - 1]).unwrap();
                    assert_eq!(decode_request(&again), Ok(message), "frame {number}");
                }
            }
        }
        earlier = whole;
    }
    let counters = server.counters();
    println!("{frames} fuzzed frames: {accepted} accepted, {well_formed} of them requests");
    println!("{counters:?}");
    assert!(well_formed > frames / 8 && accepted > well_formed);
    assert!(counters.accepted > frames as u32 / 16 && counters.repeated > 0);
    assert_eq!(u64::from(counters.malformed), accepted - well_formed);
    let requests = counters.accepted + counters.repeated + counters.stale;
    assert_eq!(u64::from(requests), well_formed);
}

#[test]
fn repeated_and_late_requests_among_garbage_are_carried_out_once_and_in_order() {
    let replay = Replay::of("repeated_and_late");
    let mut rng = replay.rng();
    let (mut server, mut handler) = (Server::new(), Recorder::default());
    let session = 0xdead_beef;
    let mut sent = vec![wire_of(&request(session, 0, Request::Identify))];
    let mut answer = feed(&mut server, &mut handler, &sent[0]);
    assert_eq!(answer.len(), 1);
    let mut expected = LineCounters {
        accepted: 1,
        ..LineCounters::default()
    };
    let frames = if all_cases() { 200_000 } else { 20_000 };
    for _ in 0..frames {
        let last = sent.len() - 1;
        match below(&mut rng, 5) {
            0 => {
                let (sequence, crc) = (sent.len() as u32, sent.len() as u32);
                let begin = Request::Begin { length: 1, crc };
                sent.push(wire_of(&request(session, sequence, begin)));
                answer = feed(&mut server, &mut handler, &sent[last + 1]);
                assert_eq!(answer.len(), 1);
                expected.accepted += 1;
            }
            1 => {
                let again = feed(&mut server, &mut handler, &sent[last]);
                assert_eq!(again, answer, "the same reply again");
                expected.repeated += 1;
            }
            2 if last > 0 => {
                let late = below(&mut rng, last);
                let nothing = feed(&mut server, &mut handler, &sent[late]);
                assert!(nothing.is_empty(), "a late request gets no reply");
                expected.stale += 1;
            }
            3 => {
                // A different request with a number that was already used.
                let other = wire_of(&request(session, last as u32, Request::Identify));
                if other != sent[last] {
                    assert!(feed(&mut server, &mut handler, &other).is_empty());
                    expected.stale += 1;
                }
            }
            _ => {
                // The first half of a later frame.
                let half = &sent[last][..below(&mut rng, sent[last].len() - 1)];
                assert!(feed(&mut server, &mut handler, half).is_empty());
            }
        }
    }
    let counters = server.counters();
    let expected = LineCounters {
        no_frame: counters.no_frame,
        bad_crc: counters.bad_crc,
        ..expected
    };
    assert_eq!(counters, expected);
    assert!(counters.no_frame > 0);
    let once: Vec<u32> = (1..sent.len() as u32).collect();
    assert_eq!(handler.begun, once);
}

/// One direction of an unreliable line.
struct Line {
    on_the_way: VecDeque<Vec<u8>>,
    late: Option<Vec<u8>>,
}

impl Line {
    fn new() -> Self {
        Self {
            on_the_way: VecDeque::new(),
            late: None,
        }
    }

    /// Drops, damages, duplicates or delays one frame in three.
    fn send(&mut self, frame: &[u8], rng: &mut ChaCha8Rng) {
        let mut frame = frame.to_vec();
        match below(rng, 24) {
            0 | 1 => return,
            2 | 3 => mutate(&mut frame, rng),
            4 | 5 => self.on_the_way.push_back(frame.clone()),
            6 | 7 => {
                self.on_the_way.extend(self.late.replace(frame));
                return;
            }
            _ => {}
        }
        self.on_the_way.push_back(frame);
        if percent(rng, 50) {
            self.on_the_way.extend(self.late.take());
        }
    }
}

/// Host, robot, and the line between them.
struct Simulation {
    client: Client,
    server: Server,
    robot: LinkRobot,
    to_robot: Line,
    to_host: Line,
    rng: ChaCha8Rng,
    frames_sent: u64,
}

impl Simulation {
    fn new(flash: Flash, session: u32, rng: ChaCha8Rng) -> Self {
        Self {
            client: Client::new(session, 40),
            server: Server::new(),
            robot: LinkRobot::start(flash),
            to_robot: Line::new(),
            to_host: Line::new(),
            rng,
            frames_sent: 0,
        }
    }

    /// Sends a request until its reply arrives, and passes the reply to `check`.
    fn ask(&mut self, request: &Request<'_>, check: impl FnOnce(Reply<'_>)) {
        let frame = self.client.request(request).unwrap().to_vec();
        self.to_robot.send(&frame, &mut self.rng);
        loop {
            self.frames_sent += 1;
            while let Some(frame) = self.to_robot.on_the_way.pop_front() {
                for answer in feed(&mut self.server, &mut self.robot, &frame) {
                    self.to_host.send(&answer, &mut self.rng);
                }
            }
            let arrived: Vec<u8> = self.to_host.on_the_way.drain(..).flatten().collect();
            for byte in arrived {
                if let Some(reply) = self.client.feed(byte) {
                    // The remaining bytes belong to earlier requests.
                    return check(reply);
                }
            }
            let again = self.client.timed_out().expect("the request gets through");
            let again = again.to_vec();
            self.to_robot.send(&again, &mut self.rng);
        }
    }

    fn expect_done(&mut self, request: &Request<'_>) {
        self.ask(request, |reply| assert_eq!(reply, Reply::Done));
    }
}

fn container(seed: u64, topology: Topology) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let genome = Genome::random(topology, &mut rng);
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    encode_genome(&genome, Provenance::default(), &mut buffer)
        .unwrap()
        .to_vec()
}

#[test]
fn a_genome_gets_through_an_unreliable_line_and_is_written_once() {
    let replay = Replay::of("a_genome_gets_through");
    let runs = if all_cases() { 2_000 } else { 50 };
    let (mut frames_sent, mut needed) = (0, 0);
    for run in 0..runs {
        let rng = ChaCha8Rng::seed_from_u64(replay.seed + run);
        let topology = Topology::ALL[run as usize % Topology::ALL.len()];
        let genome = container(run, topology);
        let (length, crc) = (genome.len() as u16, crc_of(&genome).unwrap());
        let mut line = Simulation::new(Flash::new(), run as u32, rng);
        line.ask(&Request::Identify, |reply| {
            assert!(matches!(
                reply,
                Reply::Identity(Identity {
                    firmware: "robot",
                    genome: GenomeInUse::BuiltIn,
                    faults: Faults::NO_GENOME,
                    ..
                })
            ));
        });
        line.expect_done(&Request::Stop);
        line.expect_done(&Request::Begin { length, crc });
        for (index, data) in genome.chunks(100).enumerate() {
            let offset = index as u16 * 100;
            line.expect_done(&Request::Chunk { offset, data });
        }
        line.ask(&Request::Commit, |reply| {
            assert_eq!(reply, Reply::Committed { write_count: 1 });
        });

        // The new genome runs, and every step is executed once.
        let decoded = EncodedGenome::decode(&genome).unwrap();
        let controller = Controller::from_encoded(&decoded);
        let mut state = State::new(&controller);
        for step in 0..20 {
            let sensors = SensorBits::new(step * 797);
            let decision = controller.step(&mut state, sensors);
            let surprise = state.surprise();
            line.ask(&Request::Step { sensors }, |reply| {
                assert_eq!(reply, Reply::Stepped(Stepped { decision, surprise }));
            });
        }
        line.ask(&Request::Identify, |reply| {
            assert!(matches!(
                reply,
                Reply::Identity(Identity { genome: GenomeInUse::Slot { slot: 0, write_count: 1, length: l, crc: c }, .. })
                if (l, c) == (length, crc)
            ));
        });
        let requests = 3 + genome.len().div_ceil(100) as u64 + 20;
        assert_eq!(line.robot.done, requests, "run {run}");
        needed += requests + 2;
        frames_sent += line.frames_sent;

        let mut flash = line.robot.stop();
        assert_eq!(flash.counts.erases, 1, "run {run}");
        let words = |bytes: usize| bytes.next_multiple_of(4) as u64;
        let once = 16 + 8 + words(genome.len());
        assert_eq!(flash.counts.written_bytes, once, "run {run}");
        flash.restore_power();
        let mut robot = LinkRobot::start(flash);
        match robot.slots.in_use(&mut Buffer::new()) {
            InUse::Slot { genome, .. } => assert_eq!(genome, decoded, "run {run}"),
            InUse::BuiltIn => panic!("run {run}: no genome"),
        }
    }
    println!("{runs} genomes written: {needed} requests needed {frames_sent} frames");
    assert!(frames_sent > needed * 5 / 4, "the line lost too few frames");
}

#[test]
fn a_restarted_robot_reports_it_and_an_ended_session_stays_ended() {
    let mut handler = Recorder::default();
    let mut server = Server::new();
    let refused = |sequence, session| {
        wire_of(&Envelope {
            session,
            ..reply(sequence, Reply::Refused(Refusal::NoSession))
        })
    };
    let start = wire_of(&request(1, 5, Request::Start));
    let answer = feed(&mut server, &mut handler, &start);
    assert_eq!(answer, [refused(5, 1)]);
    let open = |session| wire_of(&request(session, 0, Request::Identify));
    assert_eq!(feed(&mut server, &mut handler, &open(1)).len(), 1);
    assert_eq!(feed(&mut server, &mut handler, &open(2)).len(), 1);
    assert_eq!(handler.calls, 2);
    // Late frames of the previous session.
    assert_eq!(feed(&mut server, &mut handler, &open(1)), [refused(0, 1)]);
    assert_eq!(feed(&mut server, &mut handler, &start), [refused(5, 1)]);
    assert_eq!(handler.calls, 2);
    let start = wire_of(&request(2, 1, Request::Start));
    let done = wire_of(&Envelope {
        session: 2,
        ..reply(1, Reply::Done)
    });
    for _ in 0..3 {
        let answers = feed(&mut server, &mut handler, &start);
        assert_eq!(answers, std::slice::from_ref(&done));
    }
    assert_eq!(handler.calls, 3);
}

#[test]
fn clients_take_only_the_reply_to_their_pending_request() {
    let mut client = Client::new(7, 2);
    let early = client.request(&Request::Stop).map(<[u8]>::to_vec);
    assert_eq!(early, Err(RequestError::IdentifyFirst));
    client.request(&Request::Identify).unwrap();
    assert_eq!(client.request(&Request::Stop), Err(RequestError::Pending));
    let take = |client: &mut Client, wire: &[u8]| -> Option<String> {
        let mut replies = wire
            .iter()
            .filter_map(|&b| client.feed(b).map(|r| format!("{r:?}")));
        replies.next()
    };
    let other_session = Envelope {
        session: 8,
        ..reply(0, Reply::Done)
    };
    let echo = request(7, 0, Request::Identify);
    let other_version = Envelope {
        version: 2,
        ..reply(0, Reply::Done)
    };
    for wire in [
        wire_of(&other_session),
        wire_of(&reply(1, Reply::Done)),
        wire_of(&echo),
        wire_of(&other_version),
    ] {
        assert_eq!(take(&mut client, &wire), None);
    }
    assert_eq!(client.strays(), 4);
    assert_eq!(
        client.last_malformed(),
        Some(MalformedMessage::OtherVersion { found: 2 })
    );
    let done = wire_of(&reply(0, Reply::Done));
    assert_eq!(take(&mut client, &done), Some("Done".into()));
    assert_eq!(take(&mut client, &done), None, "no request is pending");

    let first = client.request(&Request::Stop).unwrap().to_vec();
    assert_eq!(client.timed_out(), Ok(&first[..]));
    assert_eq!(client.timed_out(), Err(GaveUp { attempts: 2 }));
    let data = &[0; CHUNK_BYTES_MAX + 1];
    let too_long = client.request(&Request::Chunk { offset: 0, data });
    assert_eq!(too_long, Err(RequestError::ChunkTooLong { found: 129 }));
    let second = client.request(&Request::Stop).unwrap().to_vec();
    assert_ne!(first, second, "a new request has a new number");
}

#[test]
fn a_new_client_has_no_errors_and_no_request_to_give_up() {
    let mut client = Client::new(7, 1);
    assert_eq!(client.timed_out(), Err(GaveUp { attempts: 0 }));
    assert_eq!((client.strays(), client.last_malformed()), (0, None));
    assert_eq!(client.errors(), LineErrors::default());
    client.request(&Request::Identify).unwrap();
    assert_eq!(client.timed_out(), Err(GaveUp { attempts: 1 }));
}

#[test]
fn the_attempts_of_a_client_can_be_changed_while_a_request_is_pending() {
    let mut client = Client::new(7, 1);
    client.request(&Request::Identify).unwrap();
    client.set_attempts_max(3);
    assert!(client.timed_out().is_ok() && client.timed_out().is_ok());
    assert_eq!(client.timed_out(), Err(GaveUp { attempts: 3 }));
    client.request(&Request::Stop).unwrap();
    client.set_attempts_max(0);
    assert_eq!(client.timed_out(), Err(GaveUp { attempts: 1 }));
}

#[test]
fn a_client_counts_invalid_frames_by_kind() {
    let mut client = Client::new(7, 1);
    let mut wrong_crc = frame_of(&[PROTOCOL_VERSION, 1]);
    let last = wrong_crc.len() - 2;
    wrong_crc[last] ^= 0x40;
    let too_long = reference_cobs(&[1; FRAME_BYTES_MAX + 1]);
    // A block that ends before its stated length, and a frame without a message.
    let cut_off = vec![0, 5, 1, 0];
    let empty = reference_cobs(&crc_32c(&[]).to_le_bytes());
    for (wires, bad_crc, no_frame) in [
        (vec![wrong_crc.clone(), wrong_crc], 2, 0),
        (vec![too_long], 2, 1),
        (vec![cut_off], 2, 2),
        (vec![empty], 2, 3),
    ] {
        for byte in wires.concat() {
            assert_eq!(client.feed(byte), None);
        }
        let expected = LineErrors { bad_crc, no_frame };
        assert_eq!(client.errors(), expected);
    }
    assert_eq!(client.strays(), 0, "none of these was a message");
}

#[test]
fn a_decoder_returns_message_and_crc_from_the_last_byte_of_a_frame_until_the_next_byte() {
    let mut decoder = Decoder::new();
    let payload = [PROTOCOL_VERSION, 0, 7];
    let wire = frame_of(&payload);
    for _ in 0..2 {
        for (at, &byte) in wire.iter().enumerate() {
            let complete = decoder.feed(byte);
            assert_eq!(complete, at == wire.len() - 1);
            let shown = (decoder.payload(), decoder.crc());
            match complete {
                true => assert_eq!(shown, (&payload[..], crc_32c(&payload))),
                false => assert_eq!(shown, (&[][..], 0), "byte {at}"),
            }
        }
    }
}

#[test]
fn an_overlong_chunk_is_not_a_message_although_its_frame_is_intact() {
    let data = &[1; CHUNK_BYTES_MAX + 10];
    for length in [CHUNK_BYTES_MAX + 1, CHUNK_BYTES_MAX + 10] {
        let data = &data[..length];
        let wire = wire_of(&request(7, 2, Request::Chunk { offset: 0, data }));
        let payload = reference_decode(&wire[1..wire.len() - 1]).unwrap();
        let refused = decode_request(&payload);
        assert_eq!(refused, Err(MalformedMessage::NotAMessage), "{length}");
    }
}

#[test]
fn request_0_is_to_identify_and_nothing_else() {
    let (mut server, mut handler) = (Server::new(), Recorder::default());
    for body in [Request::Stop, Request::Begin { length: 1, crc: 2 }] {
        let wire = wire_of(&request(7, 0, body));
        let payload = reference_decode(&wire[1..wire.len() - 1]).unwrap();
        let refused = decode_request(&payload);
        assert_eq!(refused, Err(MalformedMessage::NotAMessage), "{body:?}");
        assert!(feed(&mut server, &mut handler, &wire).is_empty());
    }
    assert_eq!((handler.calls, server.counters().malformed), (0, 2));
}

#[test]
fn messages_in_the_wrong_direction_are_recognised_by_both_ends() {
    let payload = |wire: Vec<u8>| reference_decode(&wire[1..wire.len() - 1]).unwrap();
    let sensors = SensorBits::new(1);
    for body in [Request::Identify, Request::Step { sensors }, Request::Stop] {
        let echo = payload(wire_of(&request(7, 2, body)));
        assert_eq!(decode_reply(&echo), Err(MalformedMessage::WrongWay));
    }
    for body in [Reply::Done, Reply::Refused(Refusal::Running)] {
        let echo = payload(wire_of(&reply(2, body)));
        assert_eq!(decode_request(&echo), Err(MalformedMessage::WrongWay));
    }
}

#[test]
fn every_kind_of_fault_has_its_own_bit() {
    let kinds = [
        Faults::NO_GENOME,
        Faults::SLOT_DAMAGED,
        Faults::FLASH,
        Faults::NEIGHBOURS_STALE,
        Faults::WATCHDOG,
    ];
    assert_eq!(kinds.map(|kind| kind.0), [1, 2, 4, 8, 16]);
    for (index, &fault) in kinds.iter().enumerate() {
        assert!(fault.contains(Faults::NONE) && !Faults::NONE.contains(fault));
        assert_eq!(fault.and(fault), fault);
        for (other_index, &other) in kinds.iter().enumerate() {
            assert_eq!(fault.contains(other), index == other_index);
            let both = fault.and(other);
            assert!(both.contains(fault) && both.contains(other));
            assert_eq!(fault.contains(both), index == other_index);
        }
    }
}

#[test]
fn only_an_erase_takes_more_than_half_a_second() {
    let begin = Request::Begin { length: 1, crc: 2 };
    assert_eq!(begin.timeout_ms(), 10_000);
    for request in [Request::Identify, Request::Commit, Request::Telemetry] {
        assert_eq!(request.timeout_ms(), 500);
    }
}

#[test]
fn telemetry_counts_its_own_request_and_all_earlier_ones() {
    let (mut server, mut handler) = (Server::new(), Recorder::default());
    let identify = wire_of(&request(7, 0, Request::Identify));
    feed(&mut server, &mut handler, &identify);
    feed(&mut server, &mut handler, &identify);
    let mut late = wire_of(&request(6, 3, Request::Stop));
    feed(&mut server, &mut handler, &late);
    feed(&mut server, &mut handler, &frame_of(b"no message"));
    let last_of_crc = late.len() - 2;
    late[last_of_crc] ^= 0x40;
    feed(&mut server, &mut handler, &late);
    feed(&mut server, &mut handler, &[0, 9, 0]);
    let telemetry = wire_of(&request(7, 1, Request::Telemetry));
    let answer = feed(&mut server, &mut handler, &telemetry).remove(0);
    let payload = reference_decode(&answer[1..answer.len() - 1]).unwrap();
    let line = LineCounters {
        accepted: 2,
        repeated: 1,
        stale: 1,
        malformed: 1,
        bad_crc: 1,
        no_frame: 1,
    };
    let report = Report::default();
    let body = Reply::Telemetry { report, line };
    assert_eq!(decode_reply(&payload).map(|reply| reply.body), Ok(body));
    assert_eq!(server.counters(), line);
}

#[test]
fn the_longest_messages_fit_a_frame() {
    let text = "ä".repeat(40);
    let mut handler = Recorder::default();
    let mut server = Server::new();
    let open = wire_of(&request(u32::MAX, 0, Request::Identify));
    let answer = feed(&mut server, &mut handler, &open).remove(0);
    let payload = reference_decode(&answer[1..answer.len() - 1]).unwrap();
    let Reply::Identity(identity) = decode_reply(&payload).unwrap().body else {
        panic!("not an identity");
    };
    assert_eq!(identity.firmware, "recorder with a name that is muc");
    assert_eq!(identity.version, "0.1.0-with-more-");
    let all = u32::MAX;
    let surprise = Surprise {
        mispredicted_bits: u64::MAX,
        seen_bits: u64::MAX,
    };
    let faults = Faults(u16::MAX);
    let identity = Reply::Identity(Identity {
        firmware: &text[..32],
        version: &text[..16],
        kernel: KERNEL_ID,
        genome: GenomeInUse::Slot {
            slot: 255,
            write_count: all,
            length: u16::MAX,
            crc: all,
        },
        running: true,
        faults,
    });
    let telemetry = Reply::Telemetry {
        report: Report {
            running: true,
            surprise,
            straight: all,
            held_back: all,
            turned_left: all,
            turned_right: all,
            faults,
        },
        line: LineCounters {
            accepted: all,
            repeated: all,
            stale: all,
            malformed: all,
            bad_crc: all,
            no_frame: all,
        },
    };
    let stepped = Reply::Stepped(Stepped {
        decision: Decision {
            action: Action::Turn,
            turn: Turn::Clockwise,
            prediction: SensorBits::new(u16::MAX),
        },
        surprise,
    });
    for body in [identity, telemetry, stepped] {
        let longest = Envelope {
            session: all,
            ..reply(all, body)
        };
        println!("{} bytes", wire_of(&longest).len());
    }
    let data = &[1; CHUNK_BYTES_MAX];
    let offset = u16::MAX;
    let longest = request(all, all, Request::Chunk { offset, data });
    let chunk = wire_of(&longest);
    assert_eq!(chunk.len(), WIRE_BYTES_MAX);
    let payload = reference_decode(&chunk[1..chunk.len() - 1]).unwrap();
    assert_eq!(decode_request(&payload), Ok(longest));
    let mut client = Client::new(all, 1);
    client.request(&Request::Identify).unwrap();
    assert!(client.timed_out().is_err());
    assert!(client.request(&Request::Chunk { offset, data }).is_ok());
}

/// Formats the bytes of a message without CRC and COBS, in hexadecimal.
fn hex(bytes: &[u8]) -> String {
    let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    bytes.join(" ")
}

fn payload_of(message: &impl Serialize) -> String {
    let wire = wire_of(message);
    hex(&reference_decode(&wire[1..wire.len() - 1]).unwrap())
}

#[test]
fn value_stability_every_message() {
    let requests = [
        (Request::Identify, "01 00 07 02 00"),
        (
            Request::Begin {
                length: 1275,
                crc: 0x1234_5678,
            },
            "01 00 07 02 01 fb 09 f8 ac d1 91 01",
        ),
        (
            Request::Chunk {
                offset: 128,
                data: &[0, 1, 255],
            },
            "01 00 07 02 02 80 01 03 00 01 ff",
        ),
        (Request::Commit, "01 00 07 02 03"),
        (
            Request::Step {
                sensors: SensorBits::new(0x3001),
            },
            "01 00 07 02 04 81 60",
        ),
        (Request::Reset, "01 00 07 02 05"),
        (Request::Start, "01 00 07 02 06"),
        (Request::Stop, "01 00 07 02 07"),
        (Request::Telemetry, "01 00 07 02 08"),
    ];
    for (body, expected) in requests {
        assert_eq!(payload_of(&request(7, 2, body)), expected, "{body:?}");
    }
    let identity = Identity {
        firmware: "robot",
        version: "1.0",
        kernel: KERNEL_ID,
        genome: GenomeInUse::BuiltIn,
        running: true,
        faults: Faults::NO_GENOME.and(Faults::FLASH),
    };
    let in_slot = Identity {
        genome: GenomeInUse::Slot {
            slot: 1,
            write_count: 2,
            length: 1275,
            crc: 9,
        },
        ..identity
    };
    let surprise = Surprise {
        mispredicted_bits: 3,
        seen_bits: 140,
    };
    let decision = Decision {
        action: Action::Turn,
        turn: Turn::CounterClockwise,
        prediction: SensorBits::new(0x81),
    };
    let report = Report {
        running: false,
        surprise,
        straight: 1,
        held_back: 2,
        turned_left: 3,
        turned_right: 4,
        faults: Faults::WATCHDOG,
    };
    let line = LineCounters {
        accepted: 5,
        repeated: 6,
        stale: 7,
        malformed: 8,
        bad_crc: 9,
        no_frame: 10,
    };
    let kernel = "c5 c7 37 bb 39 3d e2 89";
    let name = "05 72 6f 62 6f 74 03 31 2e 30";
    let mut replies = vec![
        (
            Reply::Identity(identity),
            format!("00 {name} {kernel} 00 01 05"),
        ),
        (
            Reply::Identity(in_slot),
            format!("00 {name} {kernel} 01 01 02 fb 09 09 01 05"),
        ),
        (Reply::Done, "01".into()),
        (Reply::Committed { write_count: 300 }, "02 ac 02".into()),
        (
            Reply::Stepped(Stepped { decision, surprise }),
            "03 01 00 81 01 03 8c 01".into(),
        ),
        (
            Reply::Telemetry { report, line },
            "04 00 03 8c 01 01 02 03 04 10 05 06 07 08 09 0a".into(),
        ),
    ];
    let refusals = [
        (Refusal::NoSession, "05 00"),
        (Refusal::Running, "05 01"),
        (Refusal::NotBegun, "05 02"),
        (Refusal::WrongOffset { expected: 128 }, "05 03 80 01"),
        (Refusal::ImpossibleLength, "05 04"),
        (Refusal::OtherLength, "05 05"),
        (Refusal::BadGenome, "05 06"),
        (Refusal::Flash, "05 07"),
        (Refusal::Unsupported, "05 08"),
        (Refusal::CountExhausted, "05 09"),
    ];
    replies.extend(refusals.map(|(refusal, hex)| (Reply::Refused(refusal), hex.into())));
    for (body, expected) in replies {
        let expected = format!("01 01 07 02 {expected}");
        assert_eq!(payload_of(&reply(2, body)), expected, "{body:?}");
    }
}

#[test]
fn the_worked_example_of_the_protocol_document_is_what_is_sent() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/link-protocol.md");
    let document = std::fs::read_to_string(path).unwrap();
    let mut robot = LinkRobot::start(Flash::new());
    let mut server = Server::new();
    let mut client = Client::new(7, 5);
    let sensors = SensorBits::new(1);
    for asked in [Request::Identify, Request::Step { sensors }] {
        let frame = client.request(&asked).unwrap().to_vec();
        let answer = feed(&mut server, &mut robot, &frame).remove(0);
        for wire in [&frame, &answer] {
            println!("{asked:?}: {}", hex(wire));
        }
        for wire in [&frame, &answer] {
            assert!(document.contains(&hex(wire)), "{asked:?}: {}", hex(wire));
        }
        assert!(answer.iter().any(|&byte| client.feed(byte).is_some()));
    }
}
