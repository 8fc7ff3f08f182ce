//! Evaluation: the accuracy of a swarm's predictions, in one run and over the repetitions of a
//! generation.
//!
//! Fitness (paper, Eq. 1) is stored as the number of matches: bits that were predicted correctly
//! one step earlier. A genome's fitness is that of its worst repetition.

use crate::metrics::{Measures, Motion};
use crate::scenario::{Scenario, Trial};
use crate::torus::Pose;
use crate::world::{World, WorldError};
use minimal_surprise_controller::sensor::MAX_SENSORS;
use minimal_surprise_controller::{Controller, Genome};

/// A genome's fitness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evaluation {
    /// Number of matches of the worst repetition.
    pub matches: u64,
    /// The worst repetition; the first if tied.
    pub worst_repetition: u32,
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Number of bits predicted correctly.
    pub matches: u64,
    /// Number of bits sensed.
    pub scored_bits: u64,
    /// Number of times that each sensor was predicted to be occupied, counting only scored
    /// predictions.
    pub predicted_occupied: Vec<u64>,
    /// Poses at the end.
    pub final_poses: Vec<Pose>,
}

impl Outcome {
    /// Returns the fitness F of Eq. 1, 0 to 1.
    #[must_use]
    pub fn fitness(&self) -> f64 {
        self.matches as f64 / self.scored_bits as f64
    }

    /// Returns the average prediction per sensor (paper, Fig. 9), 0 to 1: the mean over robots and
    /// steps of the predictions that were scored.
    #[must_use]
    pub fn average_prediction(&self) -> Vec<f64> {
        let sensors = self.predicted_occupied.len() as f64;
        let readings = self.scored_bits as f64 / sensors;
        self.predicted_occupied
            .iter()
            .map(|&count| count as f64 / readings)
            .collect()
    }
}

/// Runs a genome from a trial's start for the scenario's steps, calling `observe` after every step.
///
/// # Errors
/// [`WorldError`] if the trial's poses do not fit the grid.
pub fn run(
    controller: &Controller,
    scenario: &Scenario,
    trial: &Trial,
    mut observe: impl FnMut(&World),
) -> Result<Outcome, WorldError> {
    let mut world = World::new(scenario.grid(), &trial.starts, controller)?;
    let mut noise = trial.noise.clone();
    let mut occupied = [0_u64; MAX_SENSORS];
    for _ in 0..scenario.steps() {
        for state in world.states() {
            let prediction = state.prediction();
            for (sensor, count) in occupied.iter_mut().enumerate() {
                *count += u64::from(prediction.get(sensor));
            }
        }
        world.step(controller, &mut noise);
        observe(&world);
    }
    let (matches, scored_bits) = matches_of(&world);
    Ok(Outcome {
        matches,
        scored_bits,
        predicted_occupied: occupied[..controller.topology().sensors()].to_vec(),
        final_poses: world.poses().to_vec(),
    })
}

/// Returns the motion of the robots in one trial, and their final poses.
///
/// # Panics
/// If the trial's poses do not fit the grid.
#[must_use]
pub fn motion(genome: &Genome, scenario: &Scenario, trial: &Trial) -> (Motion, Vec<Pose>) {
    let mut measures = Measures::starting_from(scenario.grid(), genome.topology(), &trial.starts);
    let outcome = run(&Controller::new(genome), scenario, trial, |world| {
        measures.observe(world);
    })
    .expect("trials are drawn on the scenario's grid");
    (measures.motion().clone(), outcome.final_poses)
}

/// Returns a genome's fitness over all trials.
///
/// # Panics
/// If `trials` is empty, or a trial's poses do not fit the grid.
#[must_use]
pub fn evaluate(genome: &Genome, scenario: &Scenario, trials: &[Trial]) -> Evaluation {
    let controller = Controller::new(genome);
    let matches = trials.iter().map(|trial| {
        let mut world = World::new(scenario.grid(), &trial.starts, &controller)
            .expect("trials are drawn on the scenario's grid");
        let mut noise = trial.noise.clone();
        for _ in 0..scenario.steps() {
            world.step(&controller, &mut noise);
        }
        matches_of(&world).0
    });
    let (worst_repetition, matches) = (0..)
        .zip(matches)
        .min_by_key(|&(_, matches)| matches)
        .expect("`trials` is not empty");
    Evaluation {
        matches,
        worst_repetition,
    }
}

/// Returns the matches and scored bits of the whole swarm so far.
#[must_use]
pub fn matches_of(world: &World) -> (u64, u64) {
    world
        .states()
        .iter()
        .fold((0, 0), |(matches, seen), state| {
            let surprise = state.surprise();
            (
                matches + surprise.seen_bits - surprise.mispredicted_bits,
                seen + surprise.seen_bits,
            )
        })
}
