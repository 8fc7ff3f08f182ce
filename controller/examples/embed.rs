//! The code that a robot maker writes: ten lines for the controller, plus the functions that access
//! the robot's sensors and motors.
//!
//! Builds for the host and, unchanged, for a microcontroller:
//! `cargo build -p minimal-surprise-controller --example embed --features neighbours`.
#![no_std]

use minimal_surprise_controller::neighbours::{CellSize, InvalidCellSize, Neighbours};
use minimal_surprise_controller::{Action, Controller, DecodeError, EncodedGenome, State, Turn};

/// The robot's hardware, as three functions.
pub trait Robot {
    /// Adds the neighbours detected since the last step.
    fn detect(&mut self, neighbours: &mut Neighbours<16>);
    /// Drives one cell ahead, unless that cell is occupied.
    fn drive_ahead(&mut self);
    /// Turns by 90 degrees.
    fn turn(&mut self, turn: Turn);
}

/// Reason why the robot did not start.
pub enum StartError {
    /// The controller cannot run the genome.
    Genome(DecodeError),
    /// The cell size is not a positive number.
    CellSize(InvalidCellSize),
}

/// Runs the genome in `flash` forever, on a grid whose cells are `cell_mm` wide.
pub fn control_loop(robot: &mut impl Robot, flash: &[u8], cell_mm: f32) -> Result<(), StartError> {
    let genome = EncodedGenome::decode(flash).map_err(StartError::Genome)?;
    let cell = CellSize::from_mm(cell_mm).map_err(StartError::CellSize)?;
    let model = genome.topology().model();
    let controller = Controller::from_encoded(&genome);
    let mut state = State::new(&controller);
    let mut neighbours = Neighbours::new();
    loop {
        neighbours.clear();
        robot.detect(&mut neighbours);
        let decision = controller.step(&mut state, neighbours.sensor_bits(model, cell));
        match decision.action {
            Action::Straight => robot.drive_ahead(),
            Action::Turn => robot.turn(decision.turn),
        }
    }
}
