//! The world: a swarm on a torus, one step at a time.
//!
//! In a step, every robot senses the occupancy at time t; then each robot, in index order, decides
//! and acts. A robot going straight moves if the cell ahead was empty at time t and no robot with a
//! lower index has taken it; a cell vacated in this step is still blocked. Noise affects only the
//! readings of a robot, not its ability to move.

use crate::noise::NoiseStream;
use crate::torus::{Grid, Heading, Pose};
use minimal_surprise_controller::sensor::MAX_SENSORS;
use minimal_surprise_controller::{Action, Controller, Decision, SensorBits, SensorModel, State};
use std::collections::HashMap;

/// Maximum distance of a sensed cell, in cells: the width of the border around the board.
const REACH: usize = 2;

/// Reason why the poses do not fit the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// A robot is outside the grid.
    #[error("robot {robot} is at ({x}, {y}), outside the {grid} grid")]
    OutsideGrid {
        /// Index of the robot.
        robot: usize,
        /// The x coordinate of the robot.
        x: u16,
        /// The y coordinate of the robot.
        y: u16,
        /// The grid.
        grid: Grid,
    },
    /// Two robots share a cell.
    #[error("robot {robot} is at ({x}, {y}), which robot {other} already occupies")]
    Overlap {
        /// Index of the robot.
        robot: usize,
        /// Index of the robot that occupies the cell already.
        other: usize,
        /// The x coordinate of both robots.
        x: u16,
        /// The y coordinate of both robots.
        y: u16,
    },
}

/// Checks that every robot is on the grid and no two share a cell.
///
/// # Errors
/// [`WorldError`] if a robot is outside the grid or two share a cell; the error describes the first
/// such robot.
pub fn check_poses(grid: Grid, poses: &[Pose]) -> Result<(), WorldError> {
    // Memory and time depend only on the number of robots: a file with few robots may specify any
    // grid size.
    let mut cells = Vec::with_capacity(poses.len());
    for (robot, &Pose { x, y, .. }) in poses.iter().enumerate() {
        if x >= grid.width() || y >= grid.height() {
            check_overlap(grid, &poses[..robot], &mut cells)?;
            return Err(WorldError::OutsideGrid { robot, x, y, grid });
        }
        cells.push(grid.cell(x, y));
    }
    check_overlap(grid, poses, &mut cells)
}

/// Checks that no two robots share a cell; sorts `cells`, the cells of the robots.
fn check_overlap(grid: Grid, poses: &[Pose], cells: &mut [u32]) -> Result<(), WorldError> {
    cells.sort_unstable();
    if cells.is_sorted_by(|a, b| a < b) {
        return Ok(());
    }
    let mut taken = HashMap::with_capacity(poses.len());
    for (robot, &Pose { x, y, .. }) in poses.iter().enumerate() {
        if let Some(other) = taken.insert(grid.cell(x, y), robot) {
            return Err(WorldError::Overlap { robot, other, x, y });
        }
    }
    Ok(())
}

/// A swarm on a torus.
///
/// ```
/// use minimal_surprise_controller::{Controller, Genome, Topology};
/// use minimal_surprise_sim::{Grid, NoiseRate, Scenario, SeedTree, World};
///
/// let controller = Controller::new(&Genome::zeroed(Topology::default()));
/// let scenario = Scenario::new(Grid::new(15, 15)?, 100, 500, NoiseRate::NONE)?;
/// let mut trial = scenario.trial(SeedTree::new(1), 0, 0);
///
/// let mut world = World::new(scenario.grid(), &trial.starts, &controller)?;
/// for _ in 0..4 {
///     world.step(&controller, &mut trial.noise);
/// }
/// // A zeroed genome only turns: after four quarter turns every robot faces its first heading.
/// assert_eq!(world.poses(), trial.starts);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct World {
    grid: Grid,
    board: Board,
    offsets: [[isize; MAX_SENSORS]; 4],
    model: SensorModel,
    poses: Vec<Pose>,
    states: Vec<State>,
    readings: Vec<SensorBits>,
    decisions: Vec<Decision>,
    vacated: Vec<(u16, u16)>,
    step: u32,
}

impl World {
    /// Creates a swarm before its first step.
    ///
    /// # Errors
    /// [`WorldError`] if a robot is outside the grid or two share a cell.
    pub fn new(grid: Grid, starts: &[Pose], controller: &Controller) -> Result<Self, WorldError> {
        check_poses(grid, starts)?;
        let mut board = Board::empty(grid);
        for pose in starts {
            board.set(pose.x, pose.y, true);
        }
        let model = controller.topology().model();
        Ok(Self {
            grid,
            offsets: Heading::ALL.map(|heading| board.offsets(model, heading)),
            board,
            model,
            poses: starts.to_vec(),
            states: vec![State::new(controller); starts.len()],
            readings: vec![SensorBits::NONE; starts.len()],
            decisions: Vec::with_capacity(starts.len()),
            vacated: Vec::new(),
            step: 0,
        })
    }

    /// Runs one step of all robots.
    pub fn step(&mut self, controller: &Controller, noise: &mut NoiseStream) {
        self.sense(noise);
        self.decisions.clear();
        for (state, &reading) in self.states.iter_mut().zip(&self.readings) {
            self.decisions.push(controller.step(state, reading));
        }
        self.act();
    }

    /// Runs one step like [`World::step`], with decisions from a different source: a recording, or
    /// a robot on a serial line. The robots' network states do not change.
    ///
    /// # Panics
    /// If the number of decisions differs from the number of robots.
    pub fn step_with(
        &mut self,
        noise: &mut NoiseStream,
        decide: impl FnOnce(&[SensorBits]) -> Vec<Decision>,
    ) {
        self.sense(noise);
        self.decisions = decide(&self.readings);
        assert_eq!(
            self.decisions.len(),
            self.poses.len(),
            "one decision per robot"
        );
        self.act();
    }

    fn sense(&mut self, noise: &mut NoiseStream) {
        let sensors = self.model.sensors();
        for (pose, reading) in self.poses.iter().zip(&mut self.readings) {
            let offsets = &self.offsets[pose.heading as usize];
            let bits = self.board.sense(pose.x, pose.y, &offsets[..sensors]);
            *reading = SensorBits::new(bits);
        }
        noise.flip(self.step, self.model.mask(), &mut self.readings);
    }

    /// Moves and turns all robots. Cells are taken immediately and vacated at the end of the step.
    fn act(&mut self) {
        for (pose, decision) in self.poses.iter_mut().zip(&self.decisions) {
            match decision.action {
                Action::Turn => pose.heading = pose.heading.turned(decision.turn),
                Action::Straight => {
                    let (dx, dy) = pose.heading.ahead();
                    let (x, y) = self.grid.moved(pose.x, pose.y, dx, dy);
                    if !self.board.occupied(x, y) {
                        self.board.set(x, y, true);
                        self.vacated.push((pose.x, pose.y));
                        (pose.x, pose.y) = (x, y);
                    }
                }
            }
        }
        for (x, y) in self.vacated.drain(..) {
            self.board.set(x, y, false);
        }
        self.step += 1;
    }

    /// Returns the grid.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Returns the current poses, in index order.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Returns the current network states, in index order.
    #[must_use]
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// Returns the sensor readings of the latest step, including noise; bits beyond the model's
    /// sensors are zero.
    #[must_use]
    pub fn readings(&self) -> &[SensorBits] {
        &self.readings
    }

    /// Returns the robots' decisions in the latest step; empty before the first step.
    #[must_use]
    pub fn decisions(&self) -> &[Decision] {
        &self.decisions
    }

    /// Returns the number of steps completed.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.step
    }
}

/// Occupancy, one byte per cell, with a border that repeats the cells across the edge, so that
/// sensing is a load at a fixed offset.
#[derive(Clone, Debug)]
struct Board {
    grid: Grid,
    stride: usize,
    cells: Vec<u8>,
}

impl Board {
    fn empty(grid: Grid) -> Self {
        let stride = usize::from(grid.width()) + 2 * REACH;
        let rows = usize::from(grid.height()) + 2 * REACH;
        Self {
            grid,
            stride,
            cells: vec![0; stride * rows],
        }
    }

    fn index(&self, x: u16, y: u16) -> usize {
        (usize::from(y) + REACH) * self.stride + usize::from(x) + REACH
    }

    fn occupied(&self, x: u16, y: u16) -> bool {
        self.cells[self.index(x, y)] != 0
    }

    /// Sets the cell and its copies in the border.
    fn set(&mut self, x: u16, y: u16, occupied: bool) {
        for row in places(y, self.grid.height()) {
            for column in places(x, self.grid.width()) {
                self.cells[row * self.stride + column] = occupied.into();
            }
        }
    }

    fn offsets(&self, model: SensorModel, heading: Heading) -> [isize; MAX_SENSORS] {
        let mut offsets = [0; MAX_SENSORS];
        for (offset, &cell) in offsets.iter_mut().zip(model.cells()) {
            let (dx, dy) = heading.offset(cell);
            *offset = dy as isize * self.stride as isize + dx as isize;
        }
        offsets
    }

    #[inline]
    fn sense(&self, x: u16, y: u16, offsets: &[isize]) -> u16 {
        let centre = self.index(x, y);
        let mut bits = 0;
        for (sensor, &offset) in offsets.iter().enumerate() {
            bits |= u16::from(self.cells[centre.wrapping_add_signed(offset)]) << sensor;
        }
        bits
    }
}

/// Returns the indices of a coordinate on the board along one axis: its own index and up to two in
/// the border.
fn places(at: u16, side: u16) -> impl Iterator<Item = usize> {
    let (at, side) = (usize::from(at), usize::from(side));
    let own = at + REACH;
    let above = (at < REACH).then_some(own + side);
    let below = (at + REACH >= side).then(|| own.wrapping_sub(side));
    core::iter::once(own).chain(above).chain(below)
}
