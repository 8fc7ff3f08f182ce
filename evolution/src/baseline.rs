//! Baselines: the fitness and the structures that chance gives, to be read beside every result.
//!
//! | baseline | what it is | computed |
//! |---|---|---|
//! | [`constant_fitness`] | best fixed prediction, on random states | exactly |
//! | [`ceiling`] | highest fitness possible with this noise | exactly |
//! | [`constant_fitness_of_readings`] | best fixed prediction, on the readings of a run | from the readings |
//! | [`Chance::of_placements`] | structures of uniformly random states | by random draws |
//! | [`Chance::of_genomes`] | fitness and final states of random genomes | by random draws |
//!
//! Draws come from named streams of a seed tree, so that they are the same on every machine.

use crate::generation_work::GenerationWork;
use crate::population::Population;
use minimal_surprise_controller::{Controller, Topology};
use minimal_surprise_sim::evaluation::run;
use minimal_surprise_sim::scenario::random_poses;
use minimal_surprise_sim::structures::{Structure, classify};
use minimal_surprise_sim::{
    Engine, EnginePath, Grid, Measures, NoiseRate, Pose, Purpose, Scenario, SeedTree, Trial,
    WorldError,
};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// Random placements drawn unless a number is given.
pub const PLACEMENTS: u32 = 1000;

/// Random genomes drawn unless a number is given.
pub const GENOMES: u32 = 200;

/// Swarm size up to which [`PLACEMENTS`] are drawn without being asked for.
pub const ROBOTS_MAX: u32 = 1000;

/// The least distance between ceiling and constant predictor at which [`skill`] is defined.
pub const LEAST_ROOM: f64 = 0.01;

/// Returns F₀, 0.5 to 1: the fitness of the best constant prediction on uniformly random states.
///
/// A sensor's cell is occupied with q = (N − 1) / (cells − 1); with noise η its bit is 1 with
/// p = q·(1 − η) + (1 − q)·η; F₀ = max(p, 1 − p).
#[must_use]
pub fn constant_fitness(scenario: &Scenario) -> f64 {
    let others = f64::from(scenario.grid().cells() - 1);
    let occupied = match scenario.robots() {
        1 => 0.0,
        robots => f64::from(robots - 1) / others,
    };
    let noise = noise(scenario.noise());
    let set = occupied * (1.0 - noise) + (1.0 - occupied) * noise;
    set.max(1.0 - set)
}

/// Returns the highest possible fitness, 0.5 to 1, because no prediction can foresee flipped bits:
/// 1 − η; with noise η above one half, η, by predicting the opposite.
#[must_use]
pub fn ceiling(scenario: &Scenario) -> f64 {
    let noise = noise(scenario.noise());
    noise.max(1.0 - noise)
}

fn noise(rate: NoiseRate) -> f64 {
    f64::from(rate.per_65_536()) / 65_536.0
}

/// Returns the fitness, 0.5 to 1, of the best constant prediction on readings in which each sensor's
/// bit is 1 in this share of all readings.
///
/// # Panics
/// If `average_readings` is empty.
#[must_use]
pub fn constant_fitness_of_readings(average_readings: &[f64]) -> f64 {
    assert!(!average_readings.is_empty(), "no sensor");
    let best = average_readings.iter().map(|&set| set.max(1.0 - set));
    best.sum::<f64>() / average_readings.len() as f64
}

/// Returns the skill of a fitness F, (F − F₀) / (C − F₀) with the [`ceiling`] C: 1 for perfect prediction, 0 for the
/// fitness F₀ of the constant prediction, negative below. `None` if C exceeds F₀ by no more than
/// [`LEAST_ROOM`], because the ratio of such small differences is arbitrary.
#[must_use]
pub fn skill(fitness: f64, scenario: &Scenario) -> Option<f64> {
    gain(fitness, constant_fitness(scenario), ceiling(scenario))
}

fn gain(fitness: f64, constant_fitness: f64, ceiling: f64) -> Option<f64> {
    let room = ceiling - constant_fitness;
    (room > LEAST_ROOM).then(|| (fitness - constant_fitness) / room)
}

/// The fitness of constant predictions in a run, and the highest possible fitness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FitnessBaselines {
    /// [`constant_fitness`], 0.5 to 1.
    pub constant_fitness: f64,
    /// [`constant_fitness_of_readings`] of the run, 0.5 to 1.
    pub constant_fitness_of_readings: f64,
    /// [`ceiling`], 0.5 to 1.
    pub ceiling: f64,
    /// [`skill`] of the fitness.
    pub skill: Option<f64>,
    /// Like [`skill`], but beyond the constant prediction on the run's own readings: how much the
    /// prediction network improves on it. `None` like [`skill`].
    pub model_gain: Option<f64>,
}

impl FitnessBaselines {
    /// Computes the baselines of a run from its measures.
    #[must_use]
    pub fn of_run(scenario: &Scenario, measures: &Measures) -> Self {
        let fitness = measures.fitness();
        let of_readings = constant_fitness_of_readings(&measures.average_reading());
        Self {
            constant_fitness: constant_fitness(scenario),
            constant_fitness_of_readings: of_readings,
            ceiling: ceiling(scenario),
            skill: skill(fitness, scenario),
            model_gain: gain(fitness, of_readings, ceiling(scenario)),
        }
    }
}

/// A state drawn at random.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnState {
    /// Dominant structures; several if tied.
    pub names: Vec<Structure>,
    /// Share of robots in each structure, 0 to 1, as [`Structure::ALL`].
    pub shares: [f64; Structure::ALL.len()],
}

/// States and fitness drawn at random under one setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Chance {
    /// The states.
    pub states: Vec<DrawnState>,
    /// Fitness of each genome, 0 to 1; empty for placements.
    pub fitness: Vec<f64>,
}

impl Chance {
    /// Draws uniformly random states of a swarm and classifies them.
    ///
    /// # Errors
    /// [`WorldError`] if a state does not fit the grid, which drawn states always do.
    pub fn of_placements(
        grid: Grid,
        robots: u32,
        seeds: SeedTree,
        draws: u32,
    ) -> Result<Self, WorldError> {
        let drawn = (0..draws).into_par_iter().map(|draw| {
            let mut stream = seeds.stream(Purpose::Placement, 0, draw);
            classified(grid, &random_poses(grid, robots, &mut stream))
        });
        Ok(Self {
            states: drawn.collect::<Result<_, _>>()?,
            fitness: Vec::new(),
        })
    }

    /// Draws [`PLACEMENTS`] with seed 0, for comparison with results of any seed. Returns `None` for
    /// more than [`ROBOTS_MAX`] robots, because the draws would take long.
    ///
    /// # Errors
    /// See [`Chance::of_placements`].
    pub fn of_default_placements(grid: Grid, robots: u32) -> Result<Option<Self>, WorldError> {
        match robots {
            ..=ROBOTS_MAX => {
                Self::of_placements(grid, robots, SeedTree::new(0), PLACEMENTS).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// Draws random genomes, as a first population does, and evaluates each on `repetitions` starts
    /// that all share. Fitness and final state are those of the genome's worst repetition.
    ///
    /// # Errors
    /// [`WorldError`] if a start does not fit the grid, which drawn starts always do.
    ///
    /// # Panics
    /// If `repetitions` is 0.
    pub fn of_genomes(
        topology: Topology,
        scenario: &Scenario,
        repetitions: u32,
        seeds: SeedTree,
        draws: u32,
    ) -> Result<Self, WorldError> {
        let population = Population::random(topology, draws, seeds);
        let trials = (0..repetitions).map(|repetition| scenario.trial(seeds, 0, repetition));
        let trials: Vec<Trial> = trials.collect();
        let work = GenerationWork::new(scenario, topology, trials.clone(), population.ask());
        let path = EnginePath::best();
        let evaluations = work.evaluate(Engine::Fast, path, &AtomicBool::new(false));
        let evaluations = evaluations.unwrap_or_default();
        let bits = scenario.scored_bits(topology.sensors()) as f64;
        let outcomes = population.ask().par_iter().zip(&evaluations);
        let states = outcomes.map(|(genome, evaluation)| {
            let trial = &trials[evaluation.worst_repetition as usize];
            let outcome = run(&Controller::new(genome), scenario, trial, |_| {})?;
            classified(scenario.grid(), &outcome.final_poses)
        });
        let fitness = evaluations.iter().map(|one| one.matches as f64 / bits);
        Ok(Self {
            states: states.collect::<Result<_, _>>()?,
            fitness: fitness.collect(),
        })
    }

    /// Returns the number of draws.
    #[must_use]
    pub fn draws(&self) -> usize {
        self.states.len()
    }

    /// Returns the share of states, 0 to 1, in which one of the structures dominates; a tie of k
    /// structures counts 1/k for each.
    #[must_use]
    pub fn named(&self, structures: &[Structure]) -> f64 {
        let of_state = |state: &DrawnState| {
            let named = state.names.iter().filter(|name| structures.contains(name));
            named.count() as f64 / state.names.len().max(1) as f64
        };
        self.states.iter().map(of_state).sum::<f64>() / self.draws().max(1) as f64
    }

    /// Returns the fitness of each genome, in ascending order.
    #[must_use]
    pub fn sorted_fitness(&self) -> Vec<f64> {
        let mut fitness = self.fitness.clone();
        fitness.sort_by(f64::total_cmp);
        fitness
    }

    /// Returns the shares of robots in a structure, in ascending order.
    #[must_use]
    pub fn sorted_shares(&self, structure: Structure) -> Vec<f64> {
        let index = Structure::ALL.iter().position(|&one| one == structure);
        let mut shares: Vec<f64> = index.map_or(Vec::new(), |index| {
            self.states
                .iter()
                .map(|state| state.shares[index])
                .collect()
        });
        shares.sort_by(f64::total_cmp);
        shares
    }

    /// Returns the probability, 0 to 1, that chance gives a share of robots in a structure at least
    /// this large: (1 + draws as large) / (1 + draws), which is never 0.
    #[must_use]
    pub fn p_of_share(&self, structure: Structure, share: f64) -> f64 {
        let shares = self.sorted_shares(structure);
        let as_large = shares.iter().filter(|&&drawn| drawn >= share).count();
        (1 + as_large) as f64 / (1 + shares.len()) as f64
    }
}

fn classified(grid: Grid, poses: &[Pose]) -> Result<DrawnState, WorldError> {
    let found = classify(grid, poses)?;
    Ok(DrawnState {
        names: found.names(),
        shares: Structure::ALL.map(|structure| found.share(structure)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(width: u32, height: u32, robots: u32, noise: f64) -> Scenario {
        let noise = NoiseRate::new(noise).unwrap();
        Scenario::new(Grid::new(width, height).unwrap(), robots, 30, noise).unwrap()
    }

    #[test]
    fn the_constant_predictor_has_the_fitness_of_the_formula() {
        let of = |width, height, noise| constant_fitness(&scenario(width, height, 100, noise));
        assert!((of(15, 15, 0.0) - (1.0 - 99.0 / 224.0)).abs() < 1e-15);
        assert!((of(20, 20, 0.0) - (1.0 - 99.0 / 399.0)).abs() < 1e-15);
        // Half of all bits flipped leaves nothing to predict.
        assert_eq!(of(20, 20, 0.5), 0.5);
        // More than half of the cells occupied: the best constant is "occupied".
        assert!((of(10, 11, 0.0) - 99.0 / 109.0).abs() < 1e-15);
        assert_eq!(constant_fitness(&scenario(5, 5, 1, 0.0)), 1.0);
    }

    #[test]
    fn the_formula_agrees_with_random_states() {
        let scenario = scenario(9, 7, 20, 0.1);
        let topology = Topology::default();
        let controller = Controller::new(&minimal_surprise_controller::Genome::zeroed(topology));
        let mut bits = (0_u64, 0_u64);
        for start in 0..200 {
            let trial = scenario.reevaluation(SeedTree::new(1), start);
            let one_step = Scenario::new(scenario.grid(), 20, 1, scenario.noise()).unwrap();
            run(&controller, &one_step, &trial, |world| {
                for reading in world.readings() {
                    bits.0 += u64::from(reading.bits().count_ones());
                    bits.1 += topology.sensors() as u64;
                }
            })
            .unwrap();
        }
        let empty = 1.0 - bits.0 as f64 / bits.1 as f64;
        assert!(
            (empty - constant_fitness(&scenario)).abs() < 0.01,
            "{empty}"
        );
    }

    #[test]
    fn skill_is_one_at_the_ceiling_zero_at_the_constant_and_undefined_without_room() {
        assert_eq!(gain(0.9, 0.6, 0.9), Some(1.0));
        assert_eq!(gain(0.6, 0.6, 0.9), Some(0.0));
        assert!(gain(0.5, 0.6, 0.9).unwrap() < 0.0);
        assert_eq!(gain(0.5, 0.495, 0.5), None);
        let scenario = scenario(15, 15, 100, 0.0);
        assert_eq!(skill(1.0, &scenario), Some(1.0));
        assert_eq!(skill(constant_fitness(&scenario), &scenario), Some(0.0));
        let inverted = self::scenario(15, 15, 100, 0.75);
        assert_eq!(ceiling(&inverted), 0.75);
    }

    #[test]
    fn chance_is_the_same_for_the_same_seed_and_any_number_of_threads() {
        let scenario = scenario(9, 9, 30, 0.05);
        let draw = || {
            let seeds = SeedTree::new(3);
            let placements = Chance::of_placements(scenario.grid(), 30, seeds, 40).unwrap();
            let genomes = Chance::of_genomes(Topology::default(), &scenario, 3, seeds, 12).unwrap();
            (placements, genomes)
        };
        let alone = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let drawn = draw();
        assert_eq!(drawn, alone.install(draw));
        let (placements, genomes) = drawn;
        assert_eq!((placements.draws(), genomes.draws()), (40, 12));
        assert_eq!((placements.fitness.len(), genomes.fitness.len()), (0, 12));
        let all: f64 = Structure::ALL
            .iter()
            .map(|&one| genomes.named(&[one]))
            .sum();
        let nothing = genomes
            .states
            .iter()
            .filter(|state| state.names.is_empty())
            .count();
        assert!((all + nothing as f64 / 12.0 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_p_value_of_a_share_counts_draws_that_are_as_large() {
        let chance = Chance {
            states: [0.0, 0.5, 0.25]
                .map(|share| DrawnState {
                    names: Vec::new(),
                    shares: [share; 8],
                })
                .to_vec(),
            fitness: Vec::new(),
        };
        let p = |share| chance.p_of_share(Structure::Line, share);
        assert_eq!((p(0.6), p(0.5), p(0.3), p(0.0)), (0.25, 0.5, 0.5, 1.0));
    }
}
