//! Hardware in the loop: a simulated swarm whose robot 0 may be a real robot.
//!
//! The hash of a run is the SHA-256 of a fixed text; the number of robots in 64 bits; the robots'
//! starting poses; for every step and every robot, its reading in 16 bits, action and turn in 8
//! bits each, prediction in 16 bits, and pose after the step; and at the end, the numbers of robot
//! 0's mispredicted and seen bits in 64 bits each. A pose is x and y in 16 bits each and the
//! heading in 8 bits. All numbers are little-endian.

use minimal_surprise_controller::{Controller, Decision, SensorBits, State, Surprise};
use minimal_surprise_evolution::text::hex;
use minimal_surprise_link::Stepped;
use minimal_surprise_sim::{Scenario, Trial, World, WorldError};
use sha2::{Digest, Sha256};
use std::fmt;

/// The text at the start of the hash.
const START: &[u8] = b"minimal surprise hil, version 1";

/// Everything that a run depends on.
#[derive(Clone, Debug)]
pub struct HilTrial {
    /// The robots' controller.
    pub controller: Controller,
    /// Grid, swarm size, steps, noise.
    pub scenario: Scenario,
    /// Starting poses and noise.
    pub trial: Trial,
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HilRun {
    /// The hash of the run.
    pub hash: HilHash,
    /// Robot 0's decision in every step.
    pub decisions: Vec<Decision>,
    /// Robot 0's surprise.
    pub surprise: Surprise,
}

/// The hash of all events in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HilHash([u8; 32]);

impl fmt::Display for HilHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex(&self.0))
    }
}

/// An error that ended a run with a real robot early.
#[derive(Debug, thiserror::Error)]
pub enum HilError<E> {
    /// Starting poses that do not fit the grid.
    #[error(transparent)]
    World(WorldError),
    /// Failure of the robot to perform a step.
    #[error(transparent)]
    Robot(E),
}

impl HilTrial {
    /// Runs the swarm with all robots simulated.
    ///
    /// # Errors
    /// [`WorldError`] if the starting poses do not fit the grid.
    pub fn simulate(&self) -> Result<HilRun, WorldError> {
        let mut world = self.world()?;
        let mut noise = self.trial.noise.clone();
        let mut record = Record::of(&world);
        for _ in 0..self.scenario.steps() {
            world.step(&self.controller, &mut noise);
            record.step(&world);
        }
        let surprise = world.states().first().map(State::surprise);
        Ok(record.end(surprise.unwrap_or_default()))
    }

    /// Runs the swarm with a real robot 0: `step` sends it a reading and returns its decision.
    ///
    /// # Errors
    /// [`HilError`] if the starting poses do not fit the grid or `step` fails.
    pub fn with_robot<E>(
        &self,
        mut step: impl FnMut(SensorBits) -> Result<Stepped, E>,
    ) -> Result<HilRun, HilError<E>> {
        let mut world = self.world().map_err(HilError::World)?;
        let mut noise = self.trial.noise.clone();
        let mut record = Record::of(&world);
        let mut others = world.states()[1..].to_vec();
        let mut surprise = Surprise::default();
        for _ in 0..self.scenario.steps() {
            let mut failed = None;
            world.step_with(&mut noise, |readings| {
                let own = step(readings[0]).map(|stepped| {
                    surprise = stepped.surprise;
                    stepped.decision
                });
                // The world requires a decision even after a failure; this step is the last.
                let own = own.unwrap_or_else(|error| {
                    failed = Some(error);
                    Decision {
                        action: Default::default(),
                        turn: Default::default(),
                        prediction: SensorBits::NONE,
                    }
                });
                let others = others.iter_mut().zip(&readings[1..]);
                let others = others.map(|(state, &reading)| self.controller.step(state, reading));
                std::iter::once(own).chain(others).collect()
            });
            if let Some(error) = failed {
                return Err(HilError::Robot(error));
            }
            record.step(&world);
        }
        Ok(record.end(surprise))
    }

    fn world(&self) -> Result<World, WorldError> {
        World::new(self.scenario.grid(), &self.trial.starts, &self.controller)
    }
}

impl HilRun {
    /// Returns the first step, counted from 1, in which robot 0's decisions in the two runs differ.
    #[must_use]
    pub fn first_difference(&self, there: &Self) -> Option<usize> {
        let pairs = self.decisions.iter().zip(&there.decisions);
        pairs
            .zip(1..)
            .find_map(|((here, there), step)| (here != there).then_some(step))
    }
}

/// A run in progress.
struct Record {
    hash: Sha256,
    decisions: Vec<Decision>,
}

impl Record {
    fn of(world: &World) -> Self {
        let mut hash = Sha256::new_with_prefix(START);
        hash.update((world.poses().len() as u64).to_le_bytes());
        for &pose in world.poses() {
            hash.update(pose.bytes());
        }
        Self {
            hash,
            decisions: Vec::new(),
        }
    }

    fn step(&mut self, world: &World) {
        let robots = world.readings().iter().zip(world.decisions());
        for ((reading, decision), &pose) in robots.zip(world.poses()) {
            self.hash.update(reading.bits().to_le_bytes());
            self.hash
                .update([decision.action as u8, decision.turn as u8]);
            self.hash.update(decision.prediction.bits().to_le_bytes());
            self.hash.update(pose.bytes());
        }
        self.decisions.extend(world.decisions().first());
    }

    fn end(mut self, surprise: Surprise) -> HilRun {
        self.hash.update(surprise.mispredicted_bits.to_le_bytes());
        self.hash.update(surprise.seen_bits.to_le_bytes());
        HilRun {
            hash: HilHash(self.hash.finalize().into()),
            decisions: self.decisions,
            surprise,
        }
    }
}
