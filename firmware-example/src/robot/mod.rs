//! The firmware of a robot: the control loop, and the replies to the host.
//!
//! Once per control period, the loop reads the neighbours, encodes them as sensor bits, steps the
//! controller, acts and reports. Between periods, the robot replies to its host. The robot does not
//! move until the host starts it.
//!
//! **Safety.** Whatever the genome decides, the robot
//!
//! - never drives into a cell that its sensors report as occupied, or about which they have
//!   reported nothing since the robot moved;
//! - stops while its newest neighbour data is older than [`DATA_PERIODS_MAX`] periods;
//! - stops its motors before it writes to flash, since a write may stall the chip;
//! - is restarted by the watchdog if it does not reach the end of its loop, and then does not move.

mod board;

pub use board::{Board, Motion, NEIGHBOURS_MAX};

use embedded_storage::nor_flash::NorFlash;
use minimal_surprise_controller::neighbours::{CellSize, InvalidCellSize, Neighbours};
use minimal_surprise_controller::{
    Action, Controller, Decision, KERNEL_ID, SensorBits, State, Turn,
};
use minimal_surprise_link::{
    Faults, GenomeInUse, Handler, Identity, Refusal, Report, Server, Stepped, WIRE_BYTES_MAX,
};
use minimal_surprise_slots::{Buffer, Defect, PlaceError, Slot, SlotState, Slots, UpdateError};

/// Maximum age of neighbour data that the robot acts on, in control periods.
pub const DATA_PERIODS_MAX: u32 = 2;

/// Number of periods between two log lines of a running robot.
const LOG_PERIODS: u32 = 100;

/// The sensor of the cell straight ahead, in every sensor model.
const AHEAD: u16 = 1;

/// The reason why a robot cannot start: its board or the location of its slots is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartError {
    /// The slots do not fit the flash.
    Place(PlaceError),
    /// [`Board::CELL_MM`] is not a positive number.
    Cell(InvalidCellSize),
}

/// A robot, with its electronics, its genomes and its line to the host.
#[derive(Debug)]
pub struct Robot<B, F> {
    server: Server,
    body: Body<B, F>,
    /// The reply being sent.
    outgoing: [u8; WIRE_BYTES_MAX],
    /// Length of the reply, in bytes.
    length: usize,
    /// Number of bytes already sent.
    sent: usize,
}

/// The parts of a robot other than the line.
#[derive(Debug)]
struct Body<B, F> {
    board: B,
    cell: CellSize,
    neighbours: Neighbours<NEIGHBOURS_MAX>,
    /// The newest reading.
    sensors: SensorBits,
    /// Age of the newest reading, in periods.
    data_periods: u32,
    slots: Slots<F>,
    room: Buffer,
    controller: Controller,
    state: State,
    report: Report,
    /// Faults that persist until the next restart.
    lasting: Faults,
    periods_to_log: u32,
}

impl<B: Board, F: NorFlash> Robot<B, F> {
    /// Starts a robot whose genome slots are at `offset` in `flash`.
    ///
    /// # Errors
    /// [`StartError`] if the board or the location of the slots is invalid.
    pub fn start(mut board: B, flash: F, offset: u32) -> Result<Self, StartError> {
        board.drive(Motion::Stop);
        let cell = CellSize::from_mm(B::CELL_MM).map_err(StartError::Cell)?;
        let mut room = Buffer::new();
        let mut slots = Slots::open(flash, offset, &mut room).map_err(StartError::Place)?;
        let controller = slots.in_use(&mut room).controller();
        let lasting = if board.restarted_by_watchdog() {
            Faults::WATCHDOG
        } else {
            Faults::NONE
        };
        let mut body = Body {
            board,
            cell,
            neighbours: Neighbours::new(),
            sensors: SensorBits::NONE,
            data_periods: DATA_PERIODS_MAX,
            slots,
            room,
            state: State::new(&controller),
            controller,
            report: Report::default(),
            lasting,
            periods_to_log: 0,
        };
        let report = body.telemetry();
        body.board.log(&report);
        Ok(Self {
            server: Server::new(),
            body,
            outgoing: [0; WIRE_BYTES_MAX],
            length: 0,
            sent: 0,
        })
    }

    /// Runs the loop forever.
    pub fn run(&mut self) -> ! {
        loop {
            self.go_round();
        }
    }

    /// Runs one pass of the loop.
    pub fn go_round(&mut self) {
        let idle = self.talk();
        if self.body.board.period_begun() {
            self.body.period();
            self.body.board.feed_watchdog();
        } else if idle {
            self.body.board.sleep();
        }
    }

    /// Returns the board.
    pub fn board(&mut self) -> &mut B {
        &mut self.body.board
    }

    /// Receives a byte from the line and sends bytes; returns true if there was nothing to do.
    fn talk(&mut self) -> bool {
        let answer = self.outgoing.get(self.sent..self.length).unwrap_or(&[]);
        for &byte in answer {
            if !self.body.board.send(byte) {
                // No byte is received until the reply has been sent, since the host waits for the
                // reply.
                return false;
            }
            self.sent += 1;
        }
        let Some(byte) = self.body.board.receive() else {
            return true;
        };
        if let Some(answer) = self.server.feed(byte, &mut self.body) {
            self.length = 0;
            self.sent = 0;
            for (place, byte) in self.outgoing.iter_mut().zip(answer) {
                *place = *byte;
                self.length += 1;
            }
        }
        false
    }
}

impl<B: Board, F: NorFlash> Body<B, F> {
    /// Runs one control period.
    fn period(&mut self) {
        self.neighbours.clear();
        if self.board.detect(&mut self.neighbours) {
            let model = self.controller.topology().model();
            self.sensors = self.neighbours.sensor_bits(model, self.cell);
            self.data_periods = 0;
        } else {
            self.data_periods = self.data_periods.saturating_add(1);
        }
        if !self.report.running {
            return;
        }
        if self.data_periods > DATA_PERIODS_MAX {
            self.board.drive(Motion::Stop);
        } else {
            let decision = self.controller.step(&mut self.state, self.sensors);
            self.count(decision);
            let motion = self.guarded(decision);
            self.board.drive(motion);
        }
        self.periods_to_log = match self.periods_to_log.checked_sub(1) {
            Some(periods) => periods,
            None => {
                let report = self.telemetry();
                self.board.log(&report);
                LOG_PERIODS - 1
            }
        };
    }

    /// Returns the motion for a decision: the decided one, unless it might cause a collision. The
    /// cell ahead counts as occupied unless the data of this period reports it as free: the robot
    /// has moved since older data was measured.
    fn guarded(&mut self, decision: Decision) -> Motion {
        match (decision.action, decision.turn) {
            (Action::Straight, _) if self.data_periods > 0 || self.sensors.bits() & AHEAD != 0 => {
                count(&mut self.report.held_back);
                Motion::Stop
            }
            (Action::Straight, _) => Motion::Ahead,
            (Action::Turn, Turn::CounterClockwise) => Motion::Left,
            (Action::Turn, Turn::Clockwise) => Motion::Right,
        }
    }

    fn count(&mut self, decision: Decision) {
        count(match (decision.action, decision.turn) {
            (Action::Straight, _) => &mut self.report.straight,
            (Action::Turn, Turn::CounterClockwise) => &mut self.report.turned_left,
            (Action::Turn, Turn::Clockwise) => &mut self.report.turned_right,
        });
    }

    fn faults(&self) -> Faults {
        let mut faults = self.lasting;
        if self.slots.newest().is_none() {
            faults = faults.and(Faults::NO_GENOME);
        }
        for slot in Slot::ALL {
            faults = match self.slots.state(slot) {
                SlotState::Damaged(_, Defect::Unreadable) => faults.and(Faults::FLASH),
                SlotState::Damaged(..) => faults.and(Faults::SLOT_DAMAGED),
                _ => faults,
            };
        }
        if self.report.running && self.data_periods > DATA_PERIODS_MAX {
            faults = faults.and(Faults::NEIGHBOURS_STALE);
        }
        faults
    }

    fn standing(&self) -> Result<(), Refusal> {
        if self.report.running {
            Err(Refusal::Running)
        } else {
            Ok(())
        }
    }

    /// Returns the refusal for a failed update; if the flash failed, also records the fault.
    fn refusal(&mut self, error: UpdateError<F::Error>) -> Refusal {
        let refusal = refusal(&error);
        if refusal == Refusal::Flash {
            self.lasting = self.lasting.and(Faults::FLASH);
        }
        refusal
    }
}

/// Returns the refusal for a failed update.
#[must_use]
pub fn refusal<E: core::fmt::Debug>(error: &UpdateError<E>) -> Refusal {
    match *error {
        UpdateError::ImpossibleLength { .. } => Refusal::ImpossibleLength,
        UpdateError::NotBegun => Refusal::NotBegun,
        UpdateError::WrongOffset { expected, .. } => Refusal::WrongOffset { expected },
        UpdateError::TooMuch { .. } | UpdateError::Incomplete { .. } => Refusal::OtherLength,
        UpdateError::Defect(Defect::OtherContainer { .. } | Defect::Refused(_)) => {
            Refusal::BadGenome
        }
        UpdateError::CountExhausted => Refusal::CountExhausted,
        UpdateError::Flash(_)
        | UpdateError::NotWritten
        | UpdateError::Defect(Defect::Unreadable) => Refusal::Flash,
    }
}

/// Returns the genome that the robot runs, as reported to a host.
#[must_use]
pub fn genome_in_use<F: NorFlash>(slots: &Slots<F>) -> GenomeInUse {
    match slots.newest() {
        None => GenomeInUse::BuiltIn,
        Some((slot, header)) => GenomeInUse::Slot {
            slot: slot.index(),
            write_count: header.write_count,
            length: header.length,
            crc: header.crc,
        },
    }
}

/// Adds one to a counter, saturating.
fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

impl<B: Board, F: NorFlash> Handler for Body<B, F> {
    fn identify(&mut self) -> Identity<'_> {
        Identity {
            firmware: "robot",
            version: env!("CARGO_PKG_VERSION"),
            kernel: KERNEL_ID,
            genome: genome_in_use(&self.slots),
            running: self.report.running,
            faults: self.faults(),
        }
    }

    fn begin(&mut self, length: u16, crc: u32) -> Result<(), Refusal> {
        self.standing()?;
        // The chip may stall for seconds, during which the wheels would keep turning.
        self.board.drive(Motion::Stop);
        let begun = self.slots.begin(length, crc);
        begun.map_err(|error| self.refusal(error))
    }

    fn chunk(&mut self, offset: u16, data: &[u8]) -> Result<(), Refusal> {
        self.standing()?;
        let taken = self.slots.chunk(offset, data);
        taken.map_err(|error| self.refusal(error))
    }

    fn commit(&mut self) -> Result<u32, Refusal> {
        self.standing()?;
        let committed = self.slots.commit(&mut self.room);
        let write_count = committed.map_err(|error| self.refusal(error))?;
        self.controller = self.slots.in_use(&mut self.room).controller();
        self.state = State::new(&self.controller);
        // Sensor bits have a different meaning in each sensor model.
        self.data_periods = DATA_PERIODS_MAX;
        self.sensors = SensorBits::NONE;
        Ok(write_count)
    }

    fn step(&mut self, sensors: SensorBits) -> Result<Stepped, Refusal> {
        self.standing()?;
        let decision = self.controller.step(&mut self.state, sensors);
        self.count(decision);
        Ok(Stepped {
            decision,
            surprise: self.state.surprise(),
        })
    }

    fn reset(&mut self) -> Result<(), Refusal> {
        self.standing()?;
        self.state = State::new(&self.controller);
        self.report = Report::default();
        Ok(())
    }

    fn start(&mut self) -> Result<(), Refusal> {
        self.report.running = true;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), Refusal> {
        self.board.drive(Motion::Stop);
        self.report.running = false;
        Ok(())
    }

    fn telemetry(&mut self) -> Report {
        Report {
            surprise: self.state.surprise(),
            faults: self.faults(),
            ..self.report
        }
    }
}
