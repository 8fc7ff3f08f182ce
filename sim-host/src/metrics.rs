//! Measures of a run: the accuracy of a swarm's predictions, its movement, and the share of an
//! earlier structure that it preserves.
//!
//! [`Measures`] observes a run step by step and keeps a few numbers per step and per robot, so that
//! a million robots need no trace; [`Measures::of_trace`] computes the same numbers for a recorded
//! run. N is the number of robots present, R the number of sensors, T the number of steps seen. All
//! counts are integers; the only divisions are in the functions that return a measure.

use crate::torus::{Grid, Pose};
use crate::trace::Trace;
use crate::world::World;
use minimal_surprise_controller::sensor::MAX_SENSORS;
use minimal_surprise_controller::{Action, Decision, SensorBits, SensorModel, Topology};
use std::collections::BTreeSet;

/// Movement and intended movement of the robots of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Motion {
    grid: Grid,
    robots: u32,
    /// Number of robots that moved, per step.
    moved: Vec<u32>,
    /// Number of robots that chose to go straight, per step.
    straight: Vec<u32>,
}

impl Motion {
    /// Creates the motion of a run of `robots` robots before its first step.
    #[must_use]
    pub fn new(grid: Grid, robots: u32) -> Self {
        Self {
            grid,
            robots,
            moved: Vec::new(),
            straight: Vec::new(),
        }
    }

    /// Adds a step: the number of robots that moved, and the number that chose to go straight,
    /// including blocked robots.
    pub fn add_step(&mut self, moved: u32, straight: u32) {
        self.moved.push(moved);
        self.straight.push(straight);
    }

    /// Returns the number of steps seen, T.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.moved.len() as u32
    }

    /// Returns the temperature T(t) = Mₓ(t) + M_y(t) of each step, with Mₓ(t) = 1/N Σₙ |xₙ(t) −
    /// xₙ(t+1)|, in cells per step per robot, from 0 to 1. A move across the edge is one cell
    /// (paper, Eqs. 2–3).
    #[must_use]
    pub fn temperature(&self) -> Vec<f64> {
        let moved = self.moved.iter();
        moved
            .map(|&n| ratio(n.into(), self.robots.into()))
            .collect()
    }

    /// Returns the robot movement M = 1/τ Σ T(t) over the last τ steps, in cells per step and
    /// robot, from 0 to 1 (paper, Eq. 4). τ is [`Motion::period`].
    #[must_use]
    pub fn movement(&self) -> f64 {
        self.mean_over_period(&self.moved)
    }

    /// Returns the intended robot movement I = 1/(N·τ) Σₙ Σₜ aₙ(t) over the last τ steps, in cells
    /// per step per robot, from 0 to 1 (paper, Eq. 5). aₙ(t) is 1 if robot n chose to go straight,
    /// blocked or not; the networks' action value is then 0. I ≥ M. τ is [`Motion::period`].
    #[must_use]
    pub fn intended_movement(&self) -> f64 {
        self.mean_over_period(&self.straight)
    }

    /// Returns τ = ⌈Lx·Ly / 2⌉ steps, but not more than the steps seen (paper, Sec. 2.1).
    #[must_use]
    pub fn period(&self) -> u32 {
        self.grid.cells().div_ceil(2).min(self.steps())
    }

    /// Returns the mean over robots and the last τ steps.
    fn mean_over_period(&self, robots_of_steps: &[u32]) -> f64 {
        let period = self.period();
        let first = robots_of_steps.len() - period as usize;
        let sum: u64 = robots_of_steps[first..].iter().map(|&n| u64::from(n)).sum();
        ratio(sum, u64::from(self.robots) * u64::from(period))
    }
}

/// The measures of a run after the steps observed so far.
///
/// ```
/// use minimal_surprise_controller::{Controller, Genome, Topology};
/// use minimal_surprise_sim::{Grid, Measures, NoiseRate, Scenario, SeedTree, run};
///
/// let topology = Topology::default();
/// let controller = Controller::new(&Genome::zeroed(topology));
/// let scenario = Scenario::new(Grid::new(15, 15)?, 100, 50, NoiseRate::NONE)?;
/// let trial = scenario.trial(SeedTree::new(1), 0, 0);
///
/// let mut measures = Measures::starting_from(scenario.grid(), topology, &trial.starts);
/// let outcome = run(&controller, &scenario, &trial, |world| measures.observe(world))?;
/// assert_eq!(measures.fitness(), outcome.fitness());
/// // A zeroed genome only turns.
/// assert_eq!(measures.movement(), 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Measures {
    grid: Grid,
    model: SensorModel,
    poses: Vec<Pose>,
    predictions: Vec<SensorBits>,
    motion: Motion,
    /// Number of bits mispredicted, per step.
    mispredicted: Vec<u64>,
    mispredicted_so_far: u64,
    /// Number of times that each sensor was predicted to be occupied.
    predicted_occupied: [u64; MAX_SENSORS],
    /// Number of times that each sensor read occupied.
    read_occupied: [u64; MAX_SENSORS],
}

impl Measures {
    /// Creates the measures of a run before its first step, with these starting poses.
    #[must_use]
    pub fn starting_from(grid: Grid, topology: Topology, starts: &[Pose]) -> Self {
        Self {
            grid,
            model: topology.model(),
            poses: starts.to_vec(),
            predictions: vec![topology.fixed(); starts.len()],
            motion: Motion::new(grid, starts.len() as u32),
            mispredicted: Vec::new(),
            mispredicted_so_far: 0,
            predicted_occupied: [0; MAX_SENSORS],
            read_occupied: [0; MAX_SENSORS],
        }
    }

    /// Adds the step that the world has just run.
    ///
    /// # Panics
    /// If the world has a different number of robots.
    pub fn observe(&mut self, world: &World) {
        self.take_in(world.poses(), world.readings(), world.decisions());
    }

    /// Computes the measures of a recorded run.
    ///
    /// # Panics
    /// If the number of robots changes during the run.
    #[must_use]
    pub fn of_trace(grid: Grid, topology: Topology, trace: &Trace) -> Self {
        let starts = trace.steps.first().map_or(&trace.final_poses, |s| &s.poses);
        let mut measures = Self::starting_from(grid, topology, starts);
        let after = trace.steps.iter().skip(1).map(|step| &step.poses);
        let after = after.chain([&trace.final_poses]);
        for (step, poses) in trace.steps.iter().zip(after) {
            measures.take_in(poses, &step.readings, &step.decisions);
        }
        measures
    }

    /// Adds one step: the poses after it, and its readings and decisions.
    fn take_in(&mut self, poses: &[Pose], readings: &[SensorBits], decisions: &[Decision]) {
        let robots = self.poses.len();
        assert!(
            [poses.len(), readings.len(), decisions.len()] == [robots; 3],
            "the number of robots must not change during a run"
        );
        // A robot moves by at most one cell per step, so the distance is 0 or 1, even across the
        // edge.
        let moved = self.poses.iter().zip(poses);
        let moved = moved.filter(|(from, to)| (from.x, from.y) != (to.x, to.y));
        let straight = decisions.iter().filter(|d| d.action == Action::Straight);
        self.motion
            .add_step(moved.count() as u32, straight.count() as u32);
        self.poses.copy_from_slice(poses);

        let mut mispredicted = 0;
        for (prediction, &reading) in self.predictions.iter().zip(readings) {
            mispredicted += u64::from(prediction.differing(reading));
            let counts = self.predicted_occupied.iter_mut();
            let counts = counts.zip(&mut self.read_occupied).enumerate();
            for (sensor, (predicted, read)) in counts {
                *predicted += u64::from(prediction.get(sensor));
                *read += u64::from(reading.get(sensor));
            }
        }
        self.mispredicted.push(mispredicted);
        self.mispredicted_so_far += mispredicted;
        for (prediction, decision) in self.predictions.iter_mut().zip(decisions) {
            *prediction = decision.prediction;
        }
    }

    /// Returns the number of steps seen, T.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.motion.steps()
    }

    /// Returns the poses after the last step seen.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Returns the fitness F = 1/(N·T·R) Σₜ Σₙ Σᵣ (1 − |pₙʳ(t) − sₙʳ(t)|), from 0 (every bit
    /// mispredicted) to 1 (no bit mispredicted); 0 before the first step. pₙʳ(t) is the prediction
    /// made at t − 1; at t = 0 it is the template, or 0 (paper, Eq. 1).
    #[must_use]
    pub fn fitness(&self) -> f64 {
        let bits = self.bits_per_step() * u64::from(self.steps());
        ratio(bits - self.mispredicted_so_far, bits)
    }

    /// Returns the average prediction of each sensor, 1/(N·T) Σₜ Σₙ pₙʳ(t), from 0 (always empty)
    /// to 1 (always occupied), over the predictions that count towards fitness (paper, Fig. 9).
    #[must_use]
    pub fn average_prediction(&self) -> Vec<f64> {
        let readings = self.robots() * u64::from(self.steps());
        let counts = &self.predicted_occupied[..self.model.sensors()];
        counts.iter().map(|&count| ratio(count, readings)).collect()
    }

    /// Returns the average reading of each sensor, 1/(N·T) Σₜ Σₙ sₙʳ(t), with noise, from 0 (always
    /// empty) to 1 (always occupied).
    #[must_use]
    pub fn average_reading(&self) -> Vec<f64> {
        let readings = self.robots() * u64::from(self.steps());
        let counts = &self.read_occupied[..self.model.sensors()];
        counts.iter().map(|&count| ratio(count, readings)).collect()
    }

    /// Returns the motion: temperature, movement and intended movement.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Returns [`Motion::temperature`].
    #[must_use]
    pub fn temperature(&self) -> Vec<f64> {
        self.motion.temperature()
    }

    /// Returns [`Motion::movement`].
    #[must_use]
    pub fn movement(&self) -> f64 {
        self.motion.movement()
    }

    /// Returns [`Motion::intended_movement`].
    #[must_use]
    pub fn intended_movement(&self) -> f64 {
        self.motion.intended_movement()
    }

    /// Returns [`Motion::period`].
    #[must_use]
    pub fn period(&self) -> u32 {
        self.motion.period()
    }

    /// Returns the surprise of the swarm in each step, 1/(N·R) Σₙ Σᵣ |pₙʳ(t) − sₙʳ(t)|, from 0 to
    /// 1. One minus its mean over the steps is the fitness.
    #[must_use]
    pub fn surprise(&self) -> Vec<f64> {
        let bits = self.bits_per_step();
        self.mispredicted.iter().map(|&n| ratio(n, bits)).collect()
    }

    fn robots(&self) -> u64 {
        self.poses.len() as u64
    }

    /// Returns N·R.
    fn bits_per_step(&self) -> u64 {
        self.robots() * self.model.sensors() as u64
    }
}

/// Condition for a robot in one state to match a robot in a different state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Match {
    /// The same cell and heading.
    Pose,
    /// The same cell only: for triangular lattices, whose robots keep turning.
    Cell,
}

/// Computes the similarity S = 1/N Σ m(pᵢ) over the robots of the later state, from 0 to 1: m is 1
/// if the earlier state (the final state before the damage) has a robot on the same cell and, with
/// [`Match::Pose`], with the same heading. N is the number of robots of the earlier state, so that
/// removed robots lower S; 0 if the earlier state has no robots (paper, Eqs. 6–7).
#[must_use]
pub fn similarity(after: &[Pose], before: &[Pose], matching: Match) -> f64 {
    let key = |pose: &Pose| {
        let heading = match matching {
            Match::Pose => Some(pose.heading as u8),
            Match::Cell => None,
        };
        (pose.x, pose.y, heading)
    };
    let earlier: BTreeSet<_> = before.iter().map(key).collect();
    let matches = after.iter().filter(|pose| earlier.contains(&key(pose)));
    ratio(matches.count() as u64, before.len() as u64)
}

/// Returns a quotient; 0 if the divisor is 0.
fn ratio(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::parse;
    use crate::evaluation::run;
    use crate::noise::{NoiseRate, NoiseStream};
    use crate::scenario::Scenario;
    use crate::seed::{Purpose, SeedTree};
    use minimal_surprise_controller::{Controller, Genome, Prediction, Template, Turn};

    fn topology(prediction: Prediction) -> Topology {
        Topology::new(SensorModel::A, prediction).unwrap()
    }

    /// Runs a drawn world with the given decisions: one row per step, one decision per robot.
    fn driven(drawing: &str, topology: Topology, steps: &[Vec<Decision>]) -> (Measures, Trace) {
        let (grid, starts) = parse(drawing).unwrap();
        let controller = Controller::new(&Genome::zeroed(topology));
        let mut world = World::new(grid, &starts, &controller).unwrap();
        let stream = SeedTree::new(0).stream(Purpose::Noise, 0, 0);
        let mut noise = NoiseStream::new(stream, NoiseRate::NONE);
        let mut measures = Measures::starting_from(grid, topology, &starts);
        let mut trace = Trace::starting_from(&world);
        for decisions in steps {
            world.step_with(&mut noise, |_| decisions.clone());
            measures.observe(&world);
            trace.record(&world);
        }
        assert_eq!(Measures::of_trace(grid, topology, &trace), measures);
        (measures, trace)
    }

    fn decision(action: Action, prediction: u16) -> Decision {
        Decision {
            action,
            turn: Turn::CounterClockwise,
            prediction: SensorBits::new(prediction),
        }
    }

    /// Runs two robots that face each other and go straight. Each senses one robot, directly ahead
    /// (bit 0 of the eight bits of model A), in both steps. Only the first robot predicts it at t =
    /// 1.
    fn facing_pair(prediction: Prediction) -> (Measures, Trace) {
        let step = vec![
            decision(Action::Straight, 0b1),
            decision(Action::Straight, 0b0),
        ];
        let drawing = "·····\n·····\n·▶◀··\n·····\n·····";
        driven(drawing, topology(prediction), &[step.clone(), step])
    }

    #[test]
    fn fitness_is_the_share_of_correctly_predicted_bits() {
        // At t = 0 nothing is predicted, so each robot has 7 of 8 bits right; at t = 1: 8 and 7.
        // F = (7 + 7 + 8 + 7) / (2 robots · 2 steps · 8 sensors) = 29/32.
        let (measures, _) = facing_pair(Prediction::Free);
        assert_eq!(measures.fitness(), 29.0 / 32.0);
        // With the pair predefined, bit 0 is predicted at t = 0: (8 + 8 + 8 + 7) / 32.
        let (measures, _) = facing_pair(Prediction::Predefined(Template::Pair));
        assert_eq!(measures.fitness(), 31.0 / 32.0);
    }

    #[test]
    fn average_prediction_covers_the_scored_predictions() {
        // Bit 0 is predicted by neither robot at t = 0 and by one at t = 1: 1 of 4. The predictions
        // made in the last step are never compared.
        let (measures, _) = facing_pair(Prediction::Free);
        let expected = [0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(measures.average_prediction(), expected);
        let (measures, _) = facing_pair(Prediction::Predefined(Template::Pair));
        assert_eq!(measures.average_prediction()[0], 0.75);
    }

    #[test]
    fn average_reading_counts_how_often_each_sensor_read_occupied() {
        let (measures, trace) = facing_pair(Prediction::Free);
        let readings: Vec<_> = trace.steps.iter().flat_map(|step| &step.readings).collect();
        let expected = (0..8).map(|sensor| {
            let read = readings.iter().filter(|reading| reading.get(sensor));
            read.count() as f64 / readings.len() as f64
        });
        let expected: Vec<f64> = expected.collect();
        assert_eq!(measures.average_reading(), expected);
        assert!(expected.iter().any(|&read| read > 0.0) && expected.contains(&0.0));
    }

    #[test]
    fn surprise_is_the_share_of_mispredicted_bits() {
        // At t = 0, one of 8 bits for each robot; at t = 1, none for the first, one for the second.
        let (measures, _) = facing_pair(Prediction::Free);
        // 2/16, then 1/16; 1 − their mean is the fitness 29/32.
        assert_eq!(measures.surprise(), [0.125, 0.0625]);
        let mean = (0.125 + 0.0625) / 2.0;
        assert_eq!(1.0 - mean, measures.fitness());
    }

    /// Runs four robots on 3 × 3 cells for 7 steps: robot 0 moves around the southern row, across
    /// the edge; robot 1 turns three times (north, west, south, east), then moves around the middle
    /// row; robots 2 and 3 in the northern row block each other.
    fn busy() -> Measures {
        let steps: Vec<Vec<Decision>> = (0..7)
            .map(|t| {
                let second = if t < 3 {
                    Action::Turn
                } else {
                    Action::Straight
                };
                [Action::Straight, second, Action::Straight, Action::Straight]
                    .map(|action| decision(action, 0))
                    .to_vec()
            })
            .collect();
        driven("▶◀·\n·▲·\n▶··", Topology::default(), &steps).0
    }

    #[test]
    fn temperature_is_the_share_of_robots_that_moved() {
        // Of the four robots, robot 0 moves at t = 0 to 2, and robots 0 and 1 from t = 3.
        let expected = [0.25, 0.25, 0.25, 0.5, 0.5, 0.5, 0.5];
        assert_eq!(busy().temperature(), expected);
    }

    #[test]
    fn movement_is_the_mean_temperature_over_half_as_many_steps_as_cells() {
        // τ = ⌈9/2⌉ = 5, t = 2 to 6: M = (0.25 + 4 · 0.5) / 5 = 0.45.
        let measures = busy();
        assert_eq!(measures.period(), 5);
        assert_eq!(measures.movement(), 0.45);
    }

    #[test]
    fn intended_movement_counts_blocked_robots_too() {
        // Straight at t = 2 to 6: robots 0, 2 and 3 five times each, robot 1 four times.
        // I = 19 / (4 robots · 5 steps) = 0.95.
        assert_eq!(busy().intended_movement(), 0.95);
    }

    #[test]
    fn the_period_is_that_of_the_paper_and_at_most_the_run_length() {
        let period = |side, steps: usize| {
            let grid = Grid::new(side, side).unwrap();
            let mut measures = Measures::starting_from(grid, Topology::default(), &[]);
            for _ in 0..steps {
                measures.take_in(&[], &[], &[]);
            }
            measures.period()
        };
        assert_eq!((period(15, 500), period(20, 500)), (113, 200));
        assert_eq!((period(20, 50), period(20, 0)), (50, 0));
    }

    #[test]
    fn before_the_first_step_and_without_robots_every_measure_is_zero() {
        let (grid, starts) = parse("▶◀·\n···\n···").unwrap();
        for starts in [&starts[..], &[]] {
            let measures = Measures::starting_from(grid, Topology::default(), starts);
            let all = [
                measures.fitness(),
                measures.movement(),
                measures.intended_movement(),
                measures.average_prediction()[0],
            ];
            assert_eq!(all, [0.0; 4]);
        }
    }

    #[test]
    fn similarity_is_the_share_of_the_original_robots_that_are_found_again() {
        let before = parse("▶▶◀·\n····\n▲··▼").unwrap().1;
        // Of five robots, two in the south and one of the line are unchanged, one has turned, and
        // one is gone: 3/5 with headings, 4/5 without.
        let after = parse("▶▲··\n····\n▲··▼").unwrap().1;
        assert_eq!(similarity(&after, &before, Match::Pose), 0.6);
        assert_eq!(similarity(&after, &before, Match::Cell), 0.8);
        assert_eq!(similarity(&before, &before, Match::Pose), 1.0);
        // The order of the robots does not matter.
        let renumbered: Vec<Pose> = before.iter().rev().copied().collect();
        assert_eq!(similarity(&renumbered, &before, Match::Pose), 1.0);
        assert_eq!(similarity(&[], &before, Match::Cell), 0.0);
    }

    #[test]
    fn fitness_and_average_predictions_are_those_of_the_evaluation() {
        let grid = Grid::new(9, 7).unwrap();
        let scenario = Scenario::new(grid, 20, 40, NoiseRate::new(0.1).unwrap()).unwrap();
        let seeds = SeedTree::new(3);
        for (index, topology) in (0..).zip(Topology::ALL) {
            let mut stream = seeds.stream(Purpose::InitialGenome, 0, index);
            let controller = Controller::new(&Genome::random(topology, &mut stream));
            let trial = scenario.trial(seeds, 0, index);
            let mut measures = Measures::starting_from(grid, topology, &trial.starts);
            let outcome = run(&controller, &scenario, &trial, |world| {
                measures.observe(world);
            });
            let outcome = outcome.unwrap();
            assert_eq!(measures.fitness(), outcome.fitness());
            assert_eq!(measures.average_prediction(), outcome.average_prediction());
            assert_eq!(measures.poses(), outcome.final_poses);
        }
    }
}
