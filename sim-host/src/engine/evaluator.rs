//! Evaluations with either engine.

use super::actions::ActionTable;
use super::every_step::Groups;
use super::fixed_predictions;
use super::flips::{Drawer, FlipSource};
use super::lanes::BLOCK_STEPS;
use super::network::{PredictionWeights, expected_empty_at_start};
use super::path::EnginePath;
use super::predictor::Predictor;
use super::recording::{Recorder, Recording};
use super::robot_word::{self, ACTION, POSITION, ROBOTS_AT_ONCE};
use super::skipping;
use super::swarm::{Behaviour, Swarm};
use super::window::WindowOrder;
use crate::evaluation::{self, Evaluation};
use crate::metrics::Motion;
use crate::scenario::{Scenario, Trial};
use crate::torus::Pose;
use crate::world::check_poses;
use minimal_surprise_controller::{Controller, Genome, SensorModel};
use std::sync::OnceLock;

/// Maximum length of a recording that is stored as a whole, in words of four robot-steps: 8 MB.
const RECORDING_WORDS_MAX: usize = 1 << 20;
/// Approximate size of the parts of longer recordings, in words, so that a part stays in the cache.
const PART_WORDS: usize = 1 << 15;
/// Minimum length of a part: with shorter ones, prediction states would be moved in and out of the
/// cache too often.
const PART_BLOCKS_MIN: usize = 4;
/// Number of robots of small swarms that are processed together.
const ROBOTS_TOGETHER: usize = 1 << 12;
/// Maximum number of flips stored for a trial: 8 MB.
const FLIPS_MAX: usize = 1 << 22;

/// The engine that evaluates. All engines give the same results.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Engine {
    /// The reference engine: [`evaluation::evaluate`].
    Plain,
    /// The fast engine, implemented in this module.
    #[default]
    Fast,
}

/// The trials of a generation, and data that the fast engine prepares once for all genomes. Can be
/// shared between threads.
#[derive(Debug)]
pub struct TrialSet {
    scenario: Scenario,
    trials: Vec<Trial>,
    order: WindowOrder,
    flips: Vec<OnceLock<Vec<u16>>>,
}

impl TrialSet {
    /// Prepares trials for genomes of the given sensor model.
    ///
    /// # Panics
    /// If `trials` is empty, or a trial's poses do not match the scenario's number of robots or its
    /// grid.
    #[must_use]
    pub fn new(scenario: Scenario, model: SensorModel, trials: Vec<Trial>) -> Self {
        assert!(!trials.is_empty(), "`trials` is not empty");
        for trial in &trials {
            assert_eq!(trial.starts.len(), scenario.robots() as usize);
            check_poses(scenario.grid(), &trial.starts)
                .expect("trials are drawn on the scenario's grid");
        }
        Self {
            scenario,
            order: WindowOrder::new(model),
            flips: trials.iter().map(|_| OnceLock::new()).collect(),
            trials,
        }
    }

    /// Returns the scenario.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Returns the trials.
    #[must_use]
    pub fn trials(&self) -> &[Trial] {
        &self.trials
    }

    fn robots(&self) -> usize {
        self.scenario.robots() as usize
    }

    fn steps(&self) -> usize {
        self.scenario.steps() as usize
    }

    fn flips(&self, repetition: usize) -> FlipSource<'_> {
        let noise = &self.trials[repetition].noise;
        if noise.rate().is_none() {
            return FlipSource::None;
        }
        let drawer = Drawer::new(noise, &self.order);
        if self.robots() * self.steps() > FLIPS_MAX {
            return FlipSource::Drawn(Box::new(drawer));
        }
        FlipSource::Known(
            self.flips[repetition].get_or_init(|| drawer.draw_all(self.steps(), self.robots())),
        )
    }
}

/// Evaluates genomes and keeps buffers between evaluations. Use one evaluator per thread.
pub struct Evaluator {
    engine: Engine,
    skips_repeats: bool,
    actions: ActionTable,
    recorder: Recorder,
    recording: Recording,
    swarms: Vec<Swarm>,
    groups: Groups,
    matches: Vec<u64>,
}

impl Evaluator {
    /// Creates an evaluator that uses the given path; the plain engine ignores the path.
    #[must_use]
    pub fn new(engine: Engine, path: EnginePath) -> Self {
        Self {
            engine,
            skips_repeats: true,
            actions: ActionTable::new(),
            recorder: Recorder::new(path),
            recording: Recording::default(),
            swarms: Vec::new(),
            groups: Groups::default(),
            matches: Vec::new(),
        }
    }

    /// Sets whether the engine skips computation once a world, or a robot in it, repeats a state.
    /// On by default; does not change results.
    #[must_use]
    pub fn with_repeats_skipped(mut self, skips: bool) -> Self {
        self.skips_repeats = skips;
        self
    }

    /// Returns a genome's fitness over all trials, as returned by [`evaluation::evaluate`].
    ///
    /// # Panics
    /// If the trials are for a different sensor model.
    pub fn evaluate(&mut self, genome: &Genome, trials: &TrialSet) -> Evaluation {
        if self.engine == Engine::Plain {
            return evaluation::evaluate(genome, &trials.scenario, &trials.trials);
        }
        self.count_matches(genome, trials);
        let (worst_repetition, &matches) = (0..)
            .zip(&self.matches)
            .min_by_key(|&(_, matches)| matches)
            .expect("`trials` is not empty");
        Evaluation {
            matches,
            worst_repetition,
        }
    }

    /// Returns the motion of the robots in one repetition, and their final poses, as returned by
    /// [`evaluation::motion`]. The fast engine runs only the world, without predictions.
    ///
    /// # Panics
    /// If the trials are for a different sensor model, or `repetition` is out of range.
    pub fn motion(
        &mut self,
        genome: &Genome,
        trials: &TrialSet,
        repetition: u32,
    ) -> (Motion, Vec<Pose>) {
        if self.engine == Engine::Plain {
            let trial = &trials.trials[repetition as usize];
            return evaluation::motion(genome, &trials.scenario, trial);
        }
        let order = &trials.order;
        let controller = Controller::new(genome);
        assert_eq!(genome.topology().model(), order.model());
        self.actions.prepare(self.recorder.path, &controller, order);
        let mut behaviour = Behaviour {
            controller: &controller,
            order,
            actions: &mut self.actions,
        };
        let (robots, grid) = (trials.robots(), trials.scenario.grid());
        let mut swarm = Swarm::default();
        swarm.reset(grid, &trials.trials[repetition as usize].starts);
        let mut flips = trials.flips(repetition as usize);
        let mut inputs = vec![0; robots.next_multiple_of(ROBOTS_AT_ONCE)];
        let mut motion = Motion::new(grid, robots as u32);
        let mut before = swarm.state().to_vec();
        for step in 0..trials.steps() {
            let flips = flips.row(step, robots);
            swarm.step(self.recorder.path, &mut behaviour, flips, &mut inputs);
            let steps = before.iter().zip(swarm.state());
            let moved = steps.filter(|(from, to)| (*from ^ *to) & POSITION != 0);
            let moved = moved.count() as u32;
            let straight = swarm.state().iter().filter(|word| *word & ACTION == 0);
            motion.add_step(moved, straight.count() as u32);
            before.copy_from_slice(swarm.state());
        }
        (motion, before.into_iter().map(robot_word::pose).collect())
    }

    fn count_matches(&mut self, genome: &Genome, trials: &TrialSet) {
        let order = &trials.order;
        assert_eq!(
            genome.topology().model(),
            order.model(),
            "trials are for the genome's sensor model"
        );
        let controller = Controller::new(genome);
        let predictor = PredictionWeights::new(&controller, order)
            .map(|weights| Predictor::new(self.recorder.path, &weights));
        self.actions.prepare(self.recorder.path, &controller, order);
        self.matches.clear();
        self.matches.resize(trials.trials.len(), 0);

        let blocks = trials.steps().div_ceil(BLOCK_STEPS);
        let noisy = trials.trials.iter().any(|t| !t.noise.rate().is_none());
        let words = blocks * trials.robots();
        let mut run = Run {
            evaluator: self,
            controller: &controller,
            predictor: predictor.as_ref(),
            trials,
        };
        if run.evaluator.skips_repeats && !noisy && words <= RECORDING_WORDS_MAX {
            run.whole(RECORDING_WORDS_MAX / words);
        } else {
            run.in_parts((ROBOTS_TOGETHER / trials.robots()).max(1));
        }
    }
}

/// The evaluation of one genome.
struct Run<'a> {
    evaluator: &'a mut Evaluator,
    controller: &'a Controller,
    predictor: Option<&'a Predictor>,
    trials: &'a TrialSet,
}

impl Run<'_> {
    /// Records a few repetitions as a whole, then counts their matches.
    fn whole(&mut self, repetitions_at_once: usize) {
        let (robots, steps) = (self.trials.robots(), self.trials.steps());
        let Evaluator {
            actions,
            recorder,
            recording,
            swarms,
            matches,
            ..
        } = &mut *self.evaluator;
        let order = &self.trials.order;
        let expected_empty = expected_empty_at_start(self.controller.topology(), order);
        let mut behaviour = Behaviour {
            controller: self.controller,
            order,
            actions,
        };
        swarms.resize_with(swarms.len().max(1), Swarm::default);
        for (trials, matches) in self
            .trials
            .trials
            .chunks(repetitions_at_once)
            .zip(matches.chunks_mut(repetitions_at_once))
        {
            recording.reset(trials.len() * robots, steps.div_ceil(BLOCK_STEPS));
            for (place, trial) in trials.iter().enumerate() {
                swarms[0].reset(self.trials.scenario.grid(), &trial.starts);
                recorder.record_until_it_repeats(
                    &mut swarms[0],
                    &mut behaviour,
                    steps,
                    recording,
                    place * robots,
                );
            }
            let add = |robot: usize, matched| matches[robot / robots] += matched;
            match self.predictor {
                Some(predictor) => {
                    skipping::count_matches(predictor, recording, steps, add);
                }
                None => {
                    let sensors = order.sensors();
                    fixed_predictions::count_matches(
                        recording,
                        steps,
                        expected_empty,
                        sensors,
                        add,
                    );
                }
            }
        }
    }

    /// Records a few repetitions in parts of several steps, and counts the matches of each part.
    fn in_parts(&mut self, repetitions_at_once: usize) {
        let (robots, steps) = (self.trials.robots(), self.trials.steps());
        let Evaluator {
            actions,
            recorder,
            recording,
            swarms,
            matches,
            groups,
            ..
        } = &mut *self.evaluator;
        let order = &self.trials.order;
        let expected_empty = expected_empty_at_start(self.controller.topology(), order);
        let mut behaviour = Behaviour {
            controller: self.controller,
            order,
            actions,
        };
        let repetitions: Vec<usize> = (0..self.trials.trials.len()).collect();
        for (repetitions, matches) in repetitions
            .chunks(repetitions_at_once)
            .zip(matches.chunks_mut(repetitions_at_once))
        {
            let together = repetitions.len() * robots;
            let part_blocks = (PART_WORDS / together).max(PART_BLOCKS_MIN);
            let part_steps = part_blocks * BLOCK_STEPS;
            swarms.resize_with(repetitions.len(), Swarm::default);
            let mut flips = Vec::with_capacity(repetitions.len());
            for (swarm, &repetition) in swarms.iter_mut().zip(repetitions) {
                let trial = &self.trials.trials[repetition];
                swarm.reset(self.trials.scenario.grid(), &trial.starts);
                flips.push(self.trials.flips(repetition));
            }
            groups.reset(together);
            for start in (0..steps).step_by(part_steps) {
                let part = start..steps.min(start + part_steps);
                recording.reset(together, part.len().div_ceil(BLOCK_STEPS));
                for (place, (swarm, flips)) in swarms.iter_mut().zip(&mut flips).enumerate() {
                    recorder.record_steps(
                        swarm,
                        &mut behaviour,
                        flips,
                        part.clone(),
                        recording,
                        place * robots,
                    );
                }
                match self.predictor {
                    Some(predictor) => groups.advance(predictor, recording, part.len()),
                    None => fixed_predictions::count_matches(
                        recording,
                        part.len(),
                        expected_empty,
                        order.sensors(),
                        |robot, matched| matches[robot / robots] += matched,
                    ),
                }
            }
            if self.predictor.is_some() {
                let matched = groups.matched().chunks(robots);
                for (total, matched) in matches.iter_mut().zip(matched) {
                    *total += matched.iter().sum::<u64>();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::NoiseRate;
    use crate::torus::Grid;
    use crate::{Purpose, SeedTree};
    use minimal_surprise_controller::Topology;

    #[test]
    fn the_plain_engine_moves_the_plain_world_and_prepares_nothing_of_the_fast_one() {
        let (seeds, topology) = (SeedTree::new(1), Topology::default());
        let noise = NoiseRate::new(0.1).unwrap();
        let scenario = Scenario::new(Grid::new(9, 8).unwrap(), 20, 30, noise).unwrap();
        let genome = Genome::random(topology, &mut seeds.stream(Purpose::InitialGenome, 0, 0));
        let trials = TrialSet::new(
            scenario,
            topology.model(),
            vec![scenario.trial(seeds, 0, 0)],
        );
        let plain = Evaluator::new(Engine::Plain, EnginePath::best()).motion(&genome, &trials, 0);
        assert!(trials.flips[0].get().is_none());
        let fast = Evaluator::new(Engine::Fast, EnginePath::best()).motion(&genome, &trials, 0);
        assert!(trials.flips[0].get().is_some());
        assert_eq!(plain, fast);
    }
}
