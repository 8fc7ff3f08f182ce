//! The robot's control loop on a board that only remembers: it is safe by itself.

use firmware_example::memory_flash::MemoryFlash;
use firmware_example::robot::{Board, DATA_PERIODS_MAX, Motion, NEIGHBOURS_MAX, Robot};
use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, Provenance, encode};
use minimal_surprise_controller::neighbours::{Detection, Neighbours};
use minimal_surprise_controller::{Genome, Topology};
use minimal_surprise_link::{Client, Report, Request};
use minimal_surprise_slots::{Buffer, Slots};
use std::collections::VecDeque;

#[derive(Debug, Default)]
struct TestBoard {
    /// What the next period's detector delivers: nothing, or whether there is a robot ahead.
    reading: Option<bool>,
    arriving: VecDeque<u8>,
    period: bool,
    motion: Option<Motion>,
    feeds: u32,
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
    }

    fn receive(&mut self) -> Option<u8> {
        self.arriving.pop_front()
    }

    fn send(&mut self, _: u8) -> bool {
        true
    }

    fn period_begun(&mut self) -> bool {
        std::mem::take(&mut self.period)
    }

    fn sleep(&mut self) {}

    fn feed_watchdog(&mut self) {
        self.feeds += 1;
    }

    fn restarted_by_watchdog(&self) -> bool {
        false
    }

    fn log(&mut self, _: &Report) {}
}

/// A robot whose genome always goes straight: all action weights pull the output below zero.
fn robot_that_goes_straight() -> Robot<TestBoard, MemoryFlash> {
    let topology = Topology::default();
    let shape = topology.action_shape();
    let (inputs, hidden) = (shape.inputs(), shape.hidden());
    let weights = (0..topology.weights()).map(|index| {
        let outputs = 2 * inputs + hidden * shape.hidden_row();
        match index {
            // Thresholds of −1 make every input neuron positive, whatever it senses.
            index if index < 2 * inputs => [0, -4096][index % 2],
            index if index < outputs => 4096,
            index if index < outputs + hidden => -4096,
            _ => 0,
        }
    });
    let genome = Genome::from_weights(topology, weights.collect::<Vec<i16>>().as_slice()).unwrap();
    let mut container = [0; CONTAINER_BYTES_MAX];
    let bytes = encode(&genome, Provenance::default(), &mut container).unwrap();
    let mut room = Buffer::new();
    let mut slots = Slots::open(MemoryFlash::new(), 0, &mut room).unwrap();
    slots.write(bytes, &mut room).unwrap();
    Robot::start(TestBoard::default(), slots.release(), 0).unwrap()
}

/// Sends requests of a new session.
fn ask(robot: &mut Robot<TestBoard, MemoryFlash>, session: u32, requests: &[Request<'_>]) {
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

fn period(robot: &mut Robot<TestBoard, MemoryFlash>, reading: Option<bool>) -> Option<Motion> {
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
fn a_robot_never_drives_into_an_occupied_cell_or_one_it_knows_nothing_about() {
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
fn the_watchdog_is_fed_once_a_period_and_not_in_between() {
    let mut robot = robot_that_goes_straight();
    for fed in 1..5 {
        period(&mut robot, Some(false));
        robot.go_round();
        robot.go_round();
        assert_eq!(robot.board().feeds, fed);
    }
}
