//! Traces: all states, readings and decisions of a run, step by step.

use crate::torus::Pose;
use crate::world::World;
use minimal_surprise_controller::{Decision, SensorBits};

/// One step: the state before it, and the robots' readings and decisions in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TraceStep {
    /// Poses before the step.
    pub poses: Vec<Pose>,
    /// The robots' sensor readings, including noise.
    pub readings: Vec<SensorBits>,
    /// The robots' decisions, including their new predictions.
    pub decisions: Vec<Decision>,
}

/// A recorded run: its steps and the poses after the last one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// The steps, in order.
    pub steps: Vec<TraceStep>,
    /// Poses after the last step.
    pub final_poses: Vec<Pose>,
}

impl Trace {
    /// Creates an empty trace that starts from the current state of the world.
    #[must_use]
    pub fn starting_from(world: &World) -> Self {
        Self {
            steps: Vec::new(),
            final_poses: world.poses().to_vec(),
        }
    }

    /// Adds the step that the world has just run.
    pub fn record(&mut self, world: &World) {
        let before = core::mem::replace(&mut self.final_poses, world.poses().to_vec());
        self.steps.push(TraceStep {
            poses: before,
            readings: world.readings().to_vec(),
            decisions: world.decisions().to_vec(),
        });
    }
}
