//! Evaluations of a generation, distributed over the threads.
//!
//! Every thread takes the next task as soon as it is free. Evaluation times differ between genomes,
//! so a thread may have to wait for another one at the end. Therefore, the repetitions of the last
//! genomes are split in half. Results do not depend on which thread executes which task.

use minimal_surprise_controller::{Genome, Topology};
use minimal_surprise_sim::{Engine, EnginePath, Evaluation, Evaluator, Scenario, Trial, TrialSet};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of genomes whose repetitions are split in half.
const HALVED: usize = 8;

/// The evaluations of a generation.
#[derive(Debug)]
pub struct GenerationWork<'a> {
    genomes: &'a [Genome],
    whole: TrialSet,
    /// The same trials in two parts, each with the number of its first repetition.
    halves: Vec<(u32, TrialSet)>,
    tasks: Vec<Task>,
}

/// A genome and the trials to evaluate it on.
#[derive(Clone, Copy, Debug)]
struct Task {
    slot: usize,
    half: Option<usize>,
}

impl<'a> GenerationWork<'a> {
    /// Prepares the evaluation of a generation's genomes on shared trials.
    ///
    /// # Panics
    /// If `trials` is empty.
    #[must_use]
    pub fn new(
        scenario: &Scenario,
        topology: Topology,
        trials: Vec<Trial>,
        genomes: &'a [Genome],
    ) -> Self {
        let set = |trials: &[Trial]| TrialSet::new(*scenario, topology.model(), trials.to_vec());
        // Noise is prepared once for every trial set, and evens out the evaluation times.
        let halves = if scenario.noise().is_none() && trials.len() > 1 {
            let middle = trials.len() / 2;
            let (first, second) = trials.split_at(middle);
            vec![(0, set(first)), (middle as u32, set(second))]
        } else {
            Vec::new()
        };
        let whole_genomes = match halves.len() {
            0 => genomes.len(),
            _ => genomes.len().saturating_sub(HALVED),
        };
        let whole = (0..whole_genomes).map(|slot| Task { slot, half: None });
        let halved = (whole_genomes..genomes.len()).flat_map(|slot| {
            [0, 1].map(|half| Task {
                slot,
                half: Some(half),
            })
        });
        Self {
            genomes,
            whole: set(&trials),
            tasks: whole.chain(halved).collect(),
            halves,
        }
    }

    /// Returns all trials.
    #[must_use]
    pub fn trials(&self) -> &TrialSet {
        &self.whole
    }

    /// Evaluates all genomes on the threads of the current pool; returns the evaluations by slot,
    /// or `None` if `stop` was set before the end.
    #[must_use]
    pub fn evaluate(
        &self,
        engine: Engine,
        path: EnginePath,
        stop: &AtomicBool,
    ) -> Option<Vec<Evaluation>> {
        let next = AtomicUsize::new(0);
        let done = rayon::broadcast(|_| {
            let mut evaluator = Evaluator::new(engine, path);
            let mut done = Vec::new();
            while !stop.load(Ordering::Relaxed) {
                let place = next.fetch_add(1, Ordering::Relaxed);
                let Some(task) = self.tasks.get(place) else {
                    break;
                };
                done.push((*task, self.do_task(*task, &mut evaluator)));
            }
            done
        });
        let mut evaluations: Vec<[Option<Evaluation>; 2]> = vec![[None; 2]; self.genomes.len()];
        for (task, evaluation) in done.into_iter().flatten() {
            evaluations[task.slot][task.half.unwrap_or(0)] = Some(evaluation);
        }
        let tasks_of = |slot| self.tasks.iter().filter(move |task| task.slot == slot);
        evaluations
            .into_iter()
            .enumerate()
            .map(|(slot, parts)| {
                let all_done = parts.iter().flatten().count() == tasks_of(slot).count();
                all_done.then(|| worst(parts)).flatten()
            })
            .collect()
    }

    fn do_task(&self, task: Task, evaluator: &mut Evaluator) -> Evaluation {
        let genome = &self.genomes[task.slot];
        match task.half {
            None => evaluator.evaluate(genome, &self.whole),
            Some(half) => {
                let (first_repetition, trials) = &self.halves[half];
                let evaluation = evaluator.evaluate(genome, trials);
                Evaluation {
                    worst_repetition: first_repetition + evaluation.worst_repetition,
                    ..evaluation
                }
            }
        }
    }
}

/// Returns the part with the fewest matches; ties go to the first.
fn worst(parts: [Option<Evaluation>; 2]) -> Option<Evaluation> {
    parts.into_iter().flatten().min_by_key(|part| part.matches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_sim::{Grid, NoiseRate, Purpose, SeedTree, evaluate};

    #[test]
    fn genomes_dealt_in_halves_are_evaluated_as_a_whole() {
        let grid = Grid::new(6, 5).unwrap();
        let topology = Topology::default();
        let seeds = SeedTree::new(8);
        let genomes: Vec<Genome> = (0..11)
            .map(|slot| {
                Genome::random(topology, &mut seeds.stream(Purpose::InitialGenome, 0, slot))
            })
            .collect();
        for (noise, repetitions) in [(0.0, 1), (0.0, 2), (0.0, 7), (0.2, 4)] {
            let noise = NoiseRate::new(noise).unwrap();
            let scenario = Scenario::new(grid, 9, 30, noise).unwrap();
            let trials: Vec<Trial> = (0..repetitions)
                .map(|repetition| scenario.trial(seeds, 0, repetition))
                .collect();
            let expected: Vec<Evaluation> = genomes
                .iter()
                .map(|genome| evaluate(genome, &scenario, &trials))
                .collect();
            let work = GenerationWork::new(&scenario, topology, trials, &genomes);
            let go_on = AtomicBool::new(false);
            let evaluations = work.evaluate(Engine::Fast, EnginePath::best(), &go_on);
            assert_eq!(evaluations, Some(expected));
            let stop = AtomicBool::new(true);
            assert_eq!(work.evaluate(Engine::Fast, EnginePath::best(), &stop), None);
        }
    }
}
