//! Experiments: evolution and world together, one generation at a time.

use crate::generation_work::GenerationWork;
use crate::population::{Population, best_slot};
use crate::ranges;
use crate::run_hash::RunHash;
use crate::settings::Settings;
use crate::steps_hash::{StepsHash, Version};
use minimal_surprise_controller::{Controller, Genome, Provenance};
use minimal_surprise_sim::evaluation::{Outcome, run};
use minimal_surprise_sim::metrics::Measures;
use minimal_surprise_sim::structures::{Structures, classify};
use minimal_surprise_sim::{Engine, EnginePath, Evaluator, Pose, SeedTree, Trial, WorldError};
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// The result of a generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GenerationRecord {
    /// Generation number, counted from 0.
    pub generation: u32,
    /// Matches of the best genome.
    pub best_matches: u64,
    /// Sum of the matches of all genomes.
    pub total_matches: u64,
    /// Matches of the worst genome.
    pub worst_matches: u64,
    /// Slot of the best genome.
    pub best_slot: u32,
    /// The best genome's worst repetition, which determined the genome's fitness.
    pub worst_repetition: u32,
    /// Robot movement M in that repetition (paper, Eq. 4).
    #[serde(deserialize_with = "ranges::fraction")]
    pub movement: f64,
    /// Intended robot movement I in that repetition (paper, Eq. 5).
    #[serde(deserialize_with = "ranges::fraction")]
    pub intended_movement: f64,
    /// Structures that dominate the repetition's final state, separated by `;`.
    pub structure: String,
    /// Share of robots in each of these structures, 0 to 1.
    #[serde(deserialize_with = "ranges::fraction")]
    pub share: f64,
}

/// An evolution in progress.
#[derive(Clone, Debug)]
pub struct Experiment {
    settings: Settings,
    /// The next generation to evaluate; once the run is complete, the last generation.
    population: Population,
    history: Vec<GenerationRecord>,
    hash: RunHash,
    best: Option<Genome>,
}

/// The result of an evolution: the last generation's best genome, run once more from the start that
/// determined its fitness.
#[derive(Clone, Debug)]
pub struct EvolutionResult {
    /// The genome.
    pub genome: Genome,
    /// Provenance of the genome.
    pub provenance: Provenance,
    /// The repetition whose start was used.
    pub repetition: u32,
    /// Starting poses.
    pub starts: Vec<Pose>,
    /// The outcome of the run.
    pub outcome: Outcome,
    /// Measures of the run.
    pub measures: Measures,
    /// Hash of the run's steps.
    pub steps_hash: StepsHash,
    /// Structures formed by the swarm.
    pub structures: Structures,
    /// The run's hash.
    pub hash: RunHash,
}

impl EvolutionResult {
    /// Returns the share of robots in the run's dominant structure, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        share_of_named(&self.structures)
    }
}

/// Returns the share of robots in the dominant structure of a state; 0 if the state has none.
fn share_of_named(found: &Structures) -> f64 {
    let names = found.names();
    names.first().map_or(0.0, |&name| found.share(name))
}

impl Experiment {
    /// Creates an evolution before its first generation.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let seeds = SeedTree::new(settings.seed());
        let size = settings.population();
        let population = match settings.ancestor() {
            None => Population::random(settings.topology(), size, seeds),
            Some(ancestor) => {
                Population::mutants_of(ancestor, size, settings.variation().mutation, seeds)
            }
        };
        Self {
            settings,
            population,
            history: Vec::new(),
            hash: RunHash::default(),
            best: None,
        }
    }

    /// Restores a stored evolution.
    #[must_use]
    pub fn restored(
        settings: Settings,
        population: Population,
        history: Vec<GenerationRecord>,
        hash: RunHash,
        best: Option<Genome>,
    ) -> Self {
        Self {
            settings,
            population,
            history,
            hash,
            best,
        }
    }

    /// Evaluates a generation, in parallel, and advances to the next. Results do not depend on the
    /// number of threads, the engine or its path.
    ///
    /// Returns `None`, with nothing changed, if `stop` was set during the evaluation.
    pub fn advance(
        &mut self,
        engine: Engine,
        path: EnginePath,
        stop: &AtomicBool,
    ) -> Option<GenerationRecord> {
        let seeds = SeedTree::new(self.settings.seed());
        let generation = self.history.len() as u32;
        let scenario = self.settings.scenario();
        let trials: Vec<Trial> = (0..self.settings.repetitions())
            .map(|repetition| scenario.trial(seeds, generation, repetition))
            .collect();
        let work = GenerationWork::new(
            scenario,
            self.settings.topology(),
            trials,
            self.population.ask(),
        );
        let evaluations = work.evaluate(engine, path, stop)?;
        let matches: Vec<u64> = evaluations.iter().map(|e| e.matches).collect();
        let best = best_slot(&matches);
        let worst_repetition = evaluations[best].worst_repetition;
        let (motion, poses) = Evaluator::new(engine, path).motion(
            &self.population.ask()[best],
            work.trials(),
            worst_repetition,
        );
        let found = classify(scenario.grid(), &poses).expect("a world keeps its robots apart");
        let names = found.names();
        let record = GenerationRecord {
            generation,
            best_matches: matches[best],
            total_matches: matches.iter().sum(),
            worst_matches: matches.iter().copied().min().unwrap_or(0),
            best_slot: best as u32,
            worst_repetition,
            movement: motion.movement(),
            intended_movement: motion.intended_movement(),
            structure: names.iter().map(|n| n.name()).collect::<Vec<_>>().join(";"),
            share: share_of_named(&found),
        };
        self.hash = self.hash.generation(&matches);
        self.history.push(record.clone());
        self.best = Some(self.population.ask()[best].clone());
        if !self.is_finished() {
            self.population = self
                .population
                .tell(&matches, self.settings.variation(), seeds);
        }
        Some(record)
    }

    /// Returns whether every generation has been evaluated.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.history.len() as u64 >= u64::from(self.settings.generations())
    }

    /// Returns the result of the last generation evaluated; `None` before the first.
    ///
    /// # Errors
    /// [`WorldError`] if the trial's poses do not fit the grid.
    pub fn result(&self) -> Result<Option<EvolutionResult>, WorldError> {
        let (Some(record), Some(genome)) = (self.history.last(), &self.best) else {
            return Ok(None);
        };
        let seeds = SeedTree::new(self.settings.seed());
        let scenario = self.settings.scenario();
        let trial = scenario.trial(seeds, record.generation, record.worst_repetition);
        let mut measures =
            Measures::starting_from(scenario.grid(), self.settings.topology(), &trial.starts);
        let mut steps_hash =
            StepsHash::new(Version::default(), &trial, self.settings.topology().model());
        let outcome = run(&Controller::new(genome), scenario, &trial, |world| {
            measures.observe(world);
            steps_hash.observe(world);
        })?;
        Ok(Some(EvolutionResult {
            genome: genome.clone(),
            provenance: Provenance {
                seed: Some(self.settings.seed()),
                generation: record.generation,
                matched_bits: record.best_matches,
                scored_bits: self.settings.scored_bits(),
            },
            repetition: record.worst_repetition,
            starts: trial.starts,
            hash: self.hash.end(genome, &outcome.final_poses),
            structures: classify(scenario.grid(), &outcome.final_poses)?,
            measures,
            steps_hash,
            outcome,
        }))
    }

    /// Returns the settings.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the generation to evaluate next.
    #[must_use]
    pub fn population(&self) -> &Population {
        &self.population
    }

    /// Returns the evaluated generations, in order.
    #[must_use]
    pub fn history(&self) -> &[GenerationRecord] {
        &self.history
    }

    /// Returns the hash of the evaluated generations.
    #[must_use]
    pub fn hash(&self) -> RunHash {
        self.hash
    }

    /// Returns the best genome of the last generation evaluated.
    #[must_use]
    pub fn best(&self) -> Option<&Genome> {
        self.best.as_ref()
    }
}
