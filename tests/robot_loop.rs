//! The robot's control loop on a mock board: the robot is safe even without a host.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use firmware_example::memory_flash::MemoryFlash;
use firmware_example::robot::{Board, DATA_PERIODS_MAX, Motion, NEIGHBOURS_MAX, Robot};
use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, Provenance, encode};
use minimal_surprise_controller::neighbours::{Detection, Neighbours};
use minimal_surprise_controller::{Genome, Topology};
use minimal_surprise_link::{CHUNK_BYTES_MAX, Client, Faults, Reply, Report, Request};
use minimal_surprise_slots::{Buffer, Slots, crc_of};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// An operation that the robot performs on its board or its flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    Drive(Motion),
    Erase,
    Write,
    FeedWatchdog,
}

type Events = Rc<RefCell<Vec<Event>>>;

#[derive(Debug, Default)]
struct TestBoard {
    /// Detector reading of the next period: true if a robot is ahead; `None` if there is no
    /// reading.
    reading: Option<bool>,
    arriving: VecDeque<u8>,
    period: bool,
    motion: Option<Motion>,
    sent: Vec<u8>,
    watchdog: bool,
    events: Events,
}

impl TestBoard {
    /// Returns the events since the last call.
    fn events(&mut self) -> Vec<Event> {
        self.events.take()
    }
}

impl Board for TestBoard {
    const CELL_MM: f32 = 100.0;

    fn detect(&mut self, neighbours: &mut Neighbours<NEIGHBOURS_MAX>) -> bool {
        if self.reading == Some(true) {
            neighbours.push(Detection {
                range_mm: 100.0,
                bearing_rad: 0.0,
            });
        }
        self.reading.is_some()
    }

    fn drive(&mut self, motion: Motion) {
        self.motion = Some(motion);
        self.events.borrow_mut().push(Event::Drive(motion));
    }

    fn receive(&mut self) -> Option<u8> {
        self.arriving.pop_front()
    }

    fn send(&mut self, byte: u8) -> bool {
        self.sent.push(byte);
        true
    }

    fn period_begun(&mut self) -> bool {
        std::mem::take(&mut self.period)
    }

    fn sleep(&mut self) {}

    fn feed_watchdog(&mut self) {
        self.events.borrow_mut().push(Event::FeedWatchdog);
    }

    fn restarted_by_watchdog(&self) -> bool {
        self.watchdog
    }

    fn log(&mut self, _: &Report) {}
}

/// A flash that records erases and writes.
#[derive(Debug, Default)]
struct TestFlash {
    memory: MemoryFlash,
    events: Events,
}

impl ErrorType for TestFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for TestFlash {
    const READ_SIZE: usize = MemoryFlash::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.memory.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.memory.capacity()
    }
}

impl NorFlash for TestFlash {
    const WRITE_SIZE: usize = MemoryFlash::WRITE_SIZE;
    const ERASE_SIZE: usize = MemoryFlash::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.events.borrow_mut().push(Event::Erase);
        self.memory.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.events.borrow_mut().push(Event::Write);
        self.memory.write(offset, bytes)
    }
}

type TestRobot = Robot<TestBoard, TestFlash>;

fn start(memory: MemoryFlash) -> TestRobot {
    let board = TestBoard::default();
    let events = Rc::clone(&board.events);
    Robot::start(board, TestFlash { memory, events }, 0).unwrap()
}

/// Returns the container of a genome that makes a robot always go straight: all action weights make
/// the output negative.
fn straight() -> Vec<u8> {
    let topology = Topology::default();
    let shape = topology.action_shape();
    let (inputs, hidden) = (shape.inputs(), shape.hidden());
    let weights = (0..topology.weights()).map(|index| {
        let outputs = 2 * inputs + hidden * shape.hidden_row();
        match index {
            // Thresholds of −1 make every input neuron positive for all readings.
            index if index < 2 * inputs => [0, -4096][index % 2],
            index if index < outputs => 4096,
            index if index < outputs + hidden => -4096,
            _ => 0,
        }
    });
    let genome = Genome::from_weights(topology, weights.collect::<Vec<i16>>().as_slice()).unwrap();
    let mut container = [0; CONTAINER_BYTES_MAX];
    let bytes = encode(&genome, Provenance::default(), &mut container).unwrap();
    bytes.to_vec()
}

fn robot_that_goes_straight() -> TestRobot {
    let mut room = Buffer::new();
    let mut slots = Slots::open(MemoryFlash::new(), 0, &mut room).unwrap();
    slots.write(&straight(), &mut room).unwrap();
    start(slots.release())
}

/// Returns a robot without a genome; such a robot turns clockwise.
fn robot_that_turns() -> TestRobot {
    start(MemoryFlash::new())
}

/// Sends requests in a new session.
fn ask(robot: &mut TestRobot, session: u32, requests: &[Request<'_>]) {
    for index in 0..=requests.len() {
        let mut client = Client::new(session, 1);
        let mut frame = client.request(&Request::Identify).unwrap().to_vec();
        for request in &requests[..index] {
            let _ = client.timed_out();
            frame = client.request(request).unwrap().to_vec();
        }
        robot.board().arriving.extend(frame);
        while !robot.board().arriving.is_empty() {
            robot.go_round();
        }
        robot.go_round();
    }
}

fn period(robot: &mut TestRobot, reading: Option<bool>) -> Option<Motion> {
    let board = robot.board();
    board.reading = reading;
    board.period = true;
    robot.go_round();
    robot.board().motion
}

#[test]
fn a_robot_stands_until_it_is_started_and_after_it_is_stopped() {
    let mut robot = robot_that_goes_straight();
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Stop));
    ask(&mut robot, 1, &[Request::Start]);
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Ahead));
    ask(&mut robot, 2, &[Request::Stop]);
    assert_eq!(robot.board().motion, Some(Motion::Stop));
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Stop));
}

#[test]
fn a_robot_never_drives_into_an_occupied_or_unknown_cell() {
    let mut robot = robot_that_goes_straight();
    ask(&mut robot, 1, &[Request::Start]);
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Ahead));
    assert_eq!(period(&mut robot, Some(true)), Some(Motion::Stop));
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Ahead));
    for _ in 0..2 * DATA_PERIODS_MAX {
        assert_eq!(period(&mut robot, None), Some(Motion::Stop));
    }
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Ahead));
}

#[test]
fn a_turning_robot_also_stands_once_its_data_are_older_than_two_periods() {
    let mut robot = robot_that_turns();
    ask(&mut robot, 1, &[Request::Start]);
    for _ in 0..3 {
        assert_eq!(period(&mut robot, Some(true)), Some(Motion::Right));
        for _ in 0..DATA_PERIODS_MAX {
            assert_eq!(period(&mut robot, None), Some(Motion::Right));
        }
        for _ in 0..3 {
            assert_eq!(period(&mut robot, None), Some(Motion::Stop));
        }
    }
}

#[test]
fn the_motors_are_stopped_before_an_erase_and_stay_stopped_during_writes() {
    let container = straight();
    let begin = Request::Begin {
        length: container.len().try_into().unwrap(),
        crc: crc_of(&container).unwrap(),
    };
    let mut requests = vec![begin];
    for (index, data) in container.chunks(CHUNK_BYTES_MAX).enumerate() {
        let offset = (index * CHUNK_BYTES_MAX) as u16;
        requests.push(Request::Chunk { offset, data });
    }
    requests.push(Request::Commit);

    let mut robot = robot_that_turns();
    ask(&mut robot, 1, &[Request::Start]);
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Right));
    robot.board().events();
    // Rejected because the robot is running.
    ask(&mut robot, 2, &requests);
    assert_eq!(robot.board().events(), []);

    ask(&mut robot, 3, &[Request::Stop]);
    assert_eq!(robot.board().events(), [Event::Drive(Motion::Stop)]);
    ask(&mut robot, 4, &requests);
    let events = robot.board().events();
    assert_eq!(events[..2], [Event::Drive(Motion::Stop), Event::Erase]);
    let written = &events[2..];
    assert!(written.len() > requests.len(), "{written:?}");
    assert!(
        written.iter().all(|event| *event == Event::Write),
        "{written:?}"
    );
    // The update has installed the genome that goes straight.
    ask(&mut robot, 5, &[Request::Start]);
    assert_eq!(period(&mut robot, Some(false)), Some(Motion::Ahead));
}

#[test]
fn the_watchdog_is_fed_at_the_end_of_a_period_and_not_in_between() {
    let mut robot = robot_that_goes_straight();
    ask(&mut robot, 1, &[Request::Start]);
    robot.board().events();
    for _ in 0..4 {
        period(&mut robot, Some(false));
        let expected = [Event::Drive(Motion::Ahead), Event::FeedWatchdog];
        assert_eq!(robot.board().events(), expected);
        robot.go_round();
        robot.go_round();
        assert_eq!(robot.board().events(), []);
    }
}

#[test]
fn communication_does_not_feed_the_watchdog() {
    let mut robot = robot_that_goes_straight();
    robot.board().events();
    for session in 1..20 {
        let requests = [Request::Identify, Request::Reset, Request::Telemetry];
        ask(&mut robot, session, &requests);
    }
    assert_eq!(robot.board().events(), []);
}

/// Returns the faults in the robot's identity and the faults in its telemetry.
fn faults(robot: &mut TestRobot) -> [Faults; 2] {
    let mut client = Client::new(1, 1);
    [Request::Identify, Request::Telemetry].map(|request| {
        let frame = client.request(&request).unwrap().to_vec();
        robot.board().arriving.extend(frame);
        while !robot.board().arriving.is_empty() {
            robot.go_round();
        }
        robot.go_round();
        let sent = std::mem::take(&mut robot.board().sent);
        let said = sent.into_iter().find_map(|byte| match client.feed(byte)? {
            Reply::Identity(identity) => Some(identity.faults),
            Reply::Telemetry { report, .. } => Some(report.faults),
            _ => None,
        });
        said.expect("a reply")
    })
}

#[test]
fn a_robot_restarted_by_the_watchdog_stands_and_says_so() {
    for watchdog in [false, true] {
        let board = TestBoard {
            watchdog,
            ..TestBoard::default()
        };
        let events = Rc::clone(&board.events);
        let memory = MemoryFlash::new();
        let mut robot = Robot::start(board, TestFlash { memory, events }, 0).unwrap();
        assert_eq!(robot.board().motion, Some(Motion::Stop));
        assert_eq!(period(&mut robot, Some(false)), Some(Motion::Stop));
        for faults in faults(&mut robot) {
            assert_eq!(faults.contains(Faults::WATCHDOG), watchdog);
        }
    }
}
