//! Recorded runs: every state, and the readings, actions and predictions of the robots.
//!
//! State `t` is the swarm after `t` steps, `t` = 0 to T. In step `t`, from state `t` to `t + 1`,
//! every robot takes a reading, compares it with its prediction from the previous step, acts, and
//! predicts the next reading.

use minimal_surprise_controller::{Controller, Genome, SensorBits, State, Topology};
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_evolution::steps_hash::{RecordedHash, StepsHash, Version};
use minimal_surprise_sim::damage::{Damage, DamageError};
use minimal_surprise_sim::evaluation::run;
use minimal_surprise_sim::exchange::Trajectory;
use minimal_surprise_sim::metrics::Measures;
use minimal_surprise_sim::noise::NoiseStream;
use minimal_surprise_sim::structures::{Membership, Structure, classify};
use minimal_surprise_sim::{Area, Grid, Pose, Scenario, Trace, TraceStep, Trial, WorldError};
use rayon::prelude::*;

/// A run to be shown.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The torus.
    pub grid: Grid,
    /// Every step, and the final poses. A trajectory has neither readings nor decisions.
    pub trace: Trace,
    /// Sensors, predictions and fitness; `None` for a trajectory.
    pub controller: Option<ControllerData>,
    /// The structures that each robot belongs to, by state and robot.
    pub members: Vec<Vec<Membership>>,
    /// The run's dominant structures: those of its final state or, if it was damaged, of the state
    /// before the damage; several if tied.
    pub names: Vec<Structure>,
    /// Temperature of every step, 0 to 1 (paper, Eqs. 2–3).
    pub temperature: Vec<f64>,
    /// Hash of the steps, computed from this recording.
    pub steps_hash: Option<StepsHash>,
    /// Origin of the recording.
    pub origin: Origin,
}

/// Sensors, predictions and fitness of the robots in a run.
#[derive(Clone, Debug)]
pub struct ControllerData {
    /// Sensor model and fixed predictions.
    pub topology: Topology,
    /// The prediction that every robot's first reading is compared with.
    pub first_prediction: SensorBits,
    /// The sensor noise.
    pub noise: NoiseStream,
    /// Fitness after every step, 0 to 1 (paper, Eq. 1, over the steps so far).
    pub fitness: Vec<f64>,
    /// Average prediction of every sensor over the run, 0 to 1.
    pub average_prediction: Vec<f64>,
}

/// Origin of a recording.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    /// Path of the file or directory, as given by the user.
    pub name: String,
    /// Seed of the evolution.
    pub seed: Option<u64>,
    /// Hash of the evolution.
    pub run_hash: Option<String>,
    /// Steps hash recorded by the run, for comparison.
    pub steps_hash: Option<RecordedHash>,
    /// Sensor noise: the probability that a bit is flipped.
    pub noise: f64,
    /// Best fitness of every generation; empty if unknown.
    pub evolution: Vec<f64>,
    /// The damage, if the swarm was damaged before the first step.
    pub damage: Option<Damaged>,
}

/// A swarm that was damaged before the first step.
#[derive(Clone, Debug)]
pub struct Damaged {
    /// The kind of damage and its area.
    pub damage: Damage,
    /// Poses before the damage.
    pub before: Vec<Pose>,
}

impl Recording {
    /// Records the final run of an evolution.
    ///
    /// # Errors
    /// [`WorldError`] if the starting poses do not fit the grid.
    pub fn of_run(
        name: &str,
        finished: &FinishedRun,
        after_step: &dyn Fn(),
    ) -> Result<Self, WorldError> {
        let origin = Origin {
            steps_hash: finished.steps_hash.clone(),
            ..origin(name, finished)
        };
        let scenario = finished.settings.scenario();
        Self::of_trial(
            &finished.genome,
            scenario,
            &finished.trial(),
            origin,
            after_step,
        )
    }

    /// Damages the final state of an evolution, and records the run that follows.
    ///
    /// # Errors
    /// [`DamageError`] if the damage cannot be applied, or no robot is left to run.
    pub fn of_damage(
        name: &str,
        finished: &FinishedRun,
        damage: Damage,
        after_step: &dyn Fn(),
    ) -> Result<Self, DamageError> {
        let settings: &Settings = &finished.settings;
        let seeds = minimal_surprise_sim::SeedTree::new(settings.seed());
        let before = finished.final_poses.clone();
        let (scenario, trial) = damage.trial(settings.scenario(), &before, seeds, 0)?;
        let origin = Origin {
            damage: Some(Damaged { damage, before }),
            ..origin(name, finished)
        };
        let names = classify(scenario.grid(), &finished.final_poses)?.names();
        let recording = Self::of_trial(&finished.genome, &scenario, &trial, origin, after_step)?;
        Ok(Self { names, ..recording })
    }

    /// Records a run of a genome with the given settings.
    ///
    /// # Errors
    /// [`WorldError`] if the starting poses do not fit the grid.
    pub fn of_trial(
        genome: &Genome,
        scenario: &Scenario,
        trial: &Trial,
        origin: Origin,
        after_step: &dyn Fn(),
    ) -> Result<Self, WorldError> {
        let controller = Controller::new(genome);
        let grid = scenario.grid();
        let topology = controller.topology();
        let mut measures = Measures::starting_from(grid, topology, &trial.starts);
        let recorded = origin.steps_hash.as_ref();
        let version = recorded.map_or_else(Version::default, |recorded| recorded.version);
        let mut hash = StepsHash::new(version, trial, topology.model());
        let mut fitness = Vec::new();
        let mut trace = Trace {
            steps: Vec::new(),
            final_poses: trial.starts.clone(),
        };
        run(&controller, scenario, trial, |world| {
            after_step();
            trace.record(world);
            hash.observe(world);
            measures.observe(world);
            fitness.push(measures.fitness());
        })?;
        let controller = ControllerData {
            topology,
            noise: trial.noise.clone(),
            first_prediction: State::new(&controller).prediction(),
            fitness,
            average_prediction: measures.average_prediction(),
        };
        let temperature = measures.temperature();
        let recording = Self::of_trace(grid, trace, temperature, origin)?;
        Ok(Self {
            controller: Some(controller),
            steps_hash: Some(hash),
            ..recording
        })
    }

    /// Records the poses of another program's trajectory.
    ///
    /// # Errors
    /// [`WorldError`] if poses do not fit the grid.
    pub fn of_trajectory(name: &str, trajectory: &Trajectory) -> Result<Self, WorldError> {
        let grid = trajectory.grid();
        let states = trajectory.states();
        let steps = states[..states.len().saturating_sub(1)].iter();
        let trace = Trace {
            steps: steps
                .map(|poses| TraceStep {
                    poses: poses.clone(),
                    readings: Vec::new(),
                    decisions: Vec::new(),
                })
                .collect(),
            final_poses: trajectory.final_poses().to_vec(),
        };
        let temperature = states.windows(2).map(|pair| {
            let moved = pair[0].iter().zip(&pair[1]);
            let moved = moved.filter(|(a, b)| (a.x, a.y) != (b.x, b.y)).count();
            moved as f64 / pair[0].len().max(1) as f64
        });
        let origin = Origin {
            name: name.to_owned(),
            ..Origin::default()
        };
        let temperature = temperature.collect();
        Self::of_trace(grid, trace, temperature, origin)
    }

    fn of_trace(
        grid: Grid,
        trace: Trace,
        temperature: Vec<f64>,
        origin: Origin,
    ) -> Result<Self, WorldError> {
        let last = [&trace.final_poses];
        let states: Vec<&Vec<Pose>> = trace.steps.iter().map(|s| &s.poses).chain(last).collect();
        let members = states
            .par_iter()
            .map(|poses| classify(grid, poses).map(|found| found.memberships()))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            names: classify(grid, &trace.final_poses)?.names(),
            grid,
            trace,
            controller: None,
            members,
            temperature,
            steps_hash: None,
            origin,
        })
    }

    /// Returns the number of steps, T; the number of states is T + 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.trace.steps.len()
    }

    /// Returns the number of robots.
    #[must_use]
    pub fn robots(&self) -> usize {
        self.trace.final_poses.len()
    }

    /// Returns the poses of state `t`; beyond the last state, the final poses.
    #[must_use]
    pub fn poses(&self, t: usize) -> &[Pose] {
        self.trace
            .steps
            .get(t)
            .map_or(&self.trace.final_poses, |step| &step.poses)
    }

    /// Returns a robot's reading in step `t` with noise; `None` in the last state and for a
    /// trajectory.
    #[must_use]
    pub fn sensed(&self, t: usize, robot: usize) -> Option<SensorBits> {
        self.trace.steps.get(t)?.readings.get(robot).copied()
    }

    /// Returns a robot's prediction for state `t`; `None` for a trajectory.
    #[must_use]
    pub fn predicted(&self, t: usize, robot: usize) -> Option<SensorBits> {
        match t.checked_sub(1) {
            None => self.controller.as_ref().map(|data| data.first_prediction),
            Some(before) => {
                let step = self.trace.steps.get(before)?;
                step.decisions.get(robot).map(|d| d.prediction)
            }
        }
    }

    /// Checks whether a robot belongs to a structure in state `t`.
    #[must_use]
    pub fn is_member(&self, t: usize, robot: usize, structure: Structure) -> bool {
        let members = self.members.get(t).and_then(|robots| robots.get(robot));
        members.is_some_and(|members| members.contains(structure))
    }

    /// Returns the run's dominant structure; if tied, the first in the paper's order.
    #[must_use]
    pub fn name(&self) -> Option<Structure> {
        self.names.first().copied()
    }

    /// Returns the number of robots in the run's dominant structure in state `t`.
    #[must_use]
    pub fn in_structure(&self, t: usize) -> usize {
        self.name().map_or(0, |name| {
            let robots = 0..self.robots();
            robots
                .filter(|&robot| self.is_member(t, robot, name))
                .count()
        })
    }

    /// Returns the damaged area.
    #[must_use]
    pub fn damaged_area(&self) -> Option<Area> {
        self.origin.damage.as_ref().map(|damaged| {
            let (Damage::Remove(area) | Damage::Reposition(area)) = damaged.damage;
            area
        })
    }
}

fn origin(name: &str, finished: &FinishedRun) -> Origin {
    Origin {
        name: name.to_owned(),
        seed: Some(finished.settings.seed()),
        run_hash: Some(finished.hash.clone()),
        noise: finished.settings.noise(),
        evolution: finished.best_fitness.clone(),
        ..Origin::default()
    }
}
