//! A robot without wheels on a serial line; it consists of slots in a mock flash and a controller.

use crate::flash::MockFlash;
use firmware_example::robot::{genome_in_use, refusal};
use minimal_surprise_controller::{
    Action, Controller, Decision, KERNEL_ID, KernelId, SensorBits, State, Turn,
};
use minimal_surprise_link::{Faults, GenomeInUse, Handler, Identity, Refusal, Report, Stepped};
use minimal_surprise_slots::{Buffer, Slots};

/// Flash of the robot.
pub type Flash = MockFlash<4, 4096>;

/// The robot.
#[derive(Debug)]
pub struct LinkRobot {
    /// Slots with the robot's genomes.
    pub slots: Slots<Flash>,
    room: Buffer,
    controller: Controller,
    state: State,
    report: Report,
    /// Kernel that the robot reports.
    pub kernel: KernelId,
    /// The step in which the controller makes an error, counted from 0 since the last reset.
    pub errs_in_step: Option<u32>,
    /// A deliberately wrong genome that the robot reports as in use, if any.
    pub claims_genome: Option<GenomeInUse>,
    /// A deliberately wrong report that the robot returns, if any; the robot's steps return the
    /// same surprise.
    pub claims_report: Option<Report>,
    /// The number of the request that the robot rejects, counted among executed requests, and the
    /// refusal.
    pub refuses: Option<(u64, Refusal)>,
    /// Number of executed requests, excluding identification and telemetry.
    pub done: u64,
}

impl LinkRobot {
    /// Starts the robot.
    ///
    /// # Panics
    /// If the flash is too small for the slots.
    #[must_use]
    pub fn start(flash: Flash) -> Self {
        let mut room = Buffer::new();
        let mut slots = Slots::open(flash, Flash::OFFSET, &mut room).expect("there is room");
        let controller = slots.in_use(&mut room).controller();
        let state = State::new(&controller);
        Self {
            slots,
            room,
            controller,
            state,
            report: Report::default(),
            kernel: KERNEL_ID,
            errs_in_step: None,
            claims_genome: None,
            claims_report: None,
            refuses: None,
            done: 0,
        }
    }

    /// Stops the robot and returns its flash.
    #[must_use]
    pub fn stop(self) -> Flash {
        self.slots.release()
    }

    /// Runs one period of the control loop, if the loop is running.
    pub fn period(&mut self, sensors: SensorBits) {
        if self.report.running {
            let decision = self.controller.step(&mut self.state, sensors);
            self.count(decision);
        }
    }

    fn faults(&self) -> Faults {
        match self.slots.newest() {
            Some(_) => Faults::NONE,
            None => Faults::NO_GENOME,
        }
    }

    fn standing(&mut self) -> Result<(), Refusal> {
        if self.report.running {
            return Err(Refusal::Running);
        }
        self.done += 1;
        match self.refuses {
            Some((request, refusal)) if request == self.done => Err(refusal),
            _ => Ok(()),
        }
    }

    fn count(&mut self, decision: Decision) {
        let counter = match (decision.action, decision.turn) {
            (Action::Straight, _) => &mut self.report.straight,
            (Action::Turn, Turn::CounterClockwise) => &mut self.report.turned_left,
            (Action::Turn, Turn::Clockwise) => &mut self.report.turned_right,
        };
        *counter += 1;
    }
}

impl Handler for LinkRobot {
    fn identify(&mut self) -> Identity<'_> {
        Identity {
            firmware: "robot",
            version: "0.1.0",
            kernel: self.kernel,
            genome: (self.claims_genome).unwrap_or_else(|| genome_in_use(&self.slots)),
            running: self.report.running,
            faults: self.faults(),
        }
    }

    fn begin(&mut self, length: u16, crc: u32) -> Result<(), Refusal> {
        self.standing()?;
        self.slots
            .begin(length, crc)
            .map_err(|error| refusal(&error))
    }

    fn chunk(&mut self, offset: u16, data: &[u8]) -> Result<(), Refusal> {
        self.standing()?;
        self.slots
            .chunk(offset, data)
            .map_err(|error| refusal(&error))
    }

    fn commit(&mut self) -> Result<u32, Refusal> {
        self.standing()?;
        let count = self
            .slots
            .commit(&mut self.room)
            .map_err(|error| refusal(&error))?;
        self.controller = self.slots.in_use(&mut self.room).controller();
        self.state = State::new(&self.controller);
        Ok(count)
    }

    fn step(&mut self, sensors: SensorBits) -> Result<Stepped, Refusal> {
        self.standing()?;
        let steps = self.report.straight + self.report.turned_left + self.report.turned_right;
        let mut decision = self.controller.step(&mut self.state, sensors);
        self.count(decision);
        if self.errs_in_step == Some(steps) {
            decision.prediction = SensorBits::new(decision.prediction.bits() ^ 1);
        }
        Ok(Stepped {
            decision,
            surprise: (self.claims_report).map_or(self.state.surprise(), |claim| claim.surprise),
        })
    }

    fn reset(&mut self) -> Result<(), Refusal> {
        self.standing()?;
        self.state = State::new(&self.controller);
        self.report = Report::default();
        Ok(())
    }

    fn start(&mut self) -> Result<(), Refusal> {
        self.done += 1;
        self.report.running = true;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), Refusal> {
        self.done += 1;
        self.report.running = false;
        Ok(())
    }

    fn telemetry(&mut self) -> Report {
        if let Some(claim) = self.claims_report {
            return claim;
        }
        Report {
            surprise: self.state.surprise(),
            faults: self.faults(),
            ..self.report
        }
    }
}
