//! Re-evaluation of a genome from new starts, with the settings it evolved with or different ones,
//! and after damage (paper, Secs. 3.3.2 and 3.4).

use crate::finished_run::FinishedRun;
use minimal_surprise_controller::{Controller, Genome};
use minimal_surprise_sim::damage::{Damage, DamageError};
use minimal_surprise_sim::evaluation::run;
use minimal_surprise_sim::metrics::{Match, similarity};
use minimal_surprise_sim::structures::{LineOrientation, Pattern, Structure, classify};
use minimal_surprise_sim::{Pose, Scenario, SeedTree, Trial, WorldError};
use rayon::prelude::*;

/// The result of one run from a new start.
#[derive(Clone, Debug, PartialEq)]
pub struct Rerun {
    /// Fitness, 0 to 1.
    pub fitness: f64,
    /// Dominant structures of the final state.
    pub names: Vec<Structure>,
    /// Final share of robots in each structure, in the order of [`Structure::ALL`].
    pub shares: [f64; 8],
    /// Orientation of the lines; `None` without lines.
    pub orientation: Option<LineOrientation>,
    /// Final poses.
    pub final_poses: Vec<Pose>,
}

/// Runs a genome from this many new starts, in parallel.
///
/// # Errors
/// [`WorldError`] if the starting poses do not fit the grid; this cannot occur, because they are
/// drawn on the scenario's grid.
pub fn rerun(
    genome: &Genome,
    conditions: &Scenario,
    seeds: SeedTree,
    starts: u32,
) -> Result<Vec<Rerun>, WorldError> {
    let controller = Controller::new(genome);
    (0..starts)
        .into_par_iter()
        .map(|start| {
            let trial = conditions.reevaluation(seeds, start);
            let outcome = run(&controller, conditions, &trial, |_| {})?;
            let found = classify(conditions.grid(), &outcome.final_poses)?;
            Ok(Rerun {
                fitness: outcome.fitness(),
                names: found.names(),
                shares: Structure::ALL.map(|structure| found.share(structure)),
                orientation: found.line_counts().orientation(),
                final_poses: outcome.final_poses,
            })
        })
        .collect()
}

/// A row of the paper's Tables 7 and 8: one value per repetition in every column.
#[derive(Clone, Debug, PartialEq)]
pub struct ResilienceRow {
    /// Name of the condition.
    pub name: String,
    /// Number of robots present.
    pub robots: Vec<f64>,
    /// Fitness over the run, 0 to 1.
    pub fitness: Vec<f64>,
    /// Share of the robots present in the structure at the start, 0 to 1.
    pub share_start: Vec<f64>,
    /// Share of the robots present in the structure at the end, 0 to 1.
    pub share_end: Vec<f64>,
    /// Similarity of the state at the end to the undamaged final state, 0 to 1.
    pub similarity: Vec<f64>,
}

/// Computes the rows of Tables 7 and 8 for a run: as it evolved, from new starts, and after damage.
///
/// Without noise, every repetition of a removal gives the same result, so only one is run.
///
/// # Errors
/// [`DamageError`] if the damage cannot be applied, or no robot is left to run.
pub fn resilience(
    finished: &FinishedRun,
    structure: Structure,
    damage: Damage,
    repeat: u32,
) -> Result<Vec<ResilienceRow>, DamageError> {
    let conditions = finished.settings.scenario();
    let seeds = SeedTree::new(finished.settings.seed());
    let row = |name: &str, trials: Vec<(Scenario, Trial)>| {
        resilience_row(finished, structure, name, &trials)
    };
    let initial = row("initial run", vec![(*conditions, finished.trial())])?;
    let starts = (0..repeat)
        .map(|start| (*conditions, conditions.reevaluation(seeds, start)))
        .collect();
    let starts = row("new starts", starts)?;
    let damaged = after_damage(finished, structure, damage, repeat)?;
    Ok(vec![initial, starts, damaged])
}

/// Computes the row that [`resilience`] returns for the damaged swarm.
///
/// # Errors
/// [`DamageError`] if the damage cannot be applied, or no robot is left to run.
pub fn after_damage(
    finished: &FinishedRun,
    structure: Structure,
    damage: Damage,
    repeat: u32,
) -> Result<ResilienceRow, DamageError> {
    let conditions = finished.settings.scenario();
    let seeds = SeedTree::new(finished.settings.seed());
    let (name, times) = match damage {
        Damage::Remove(_) if conditions.noise().is_none() => ("remove", 1),
        Damage::Remove(_) => ("remove", repeat),
        Damage::Reposition(_) => ("reposition", repeat),
    };
    let damaged = (0..times)
        .map(|repetition| damage.trial(conditions, &finished.final_poses, seeds, repetition))
        .collect::<Result<Vec<_>, _>>()?;
    resilience_row(finished, structure, name, &damaged)
}

fn resilience_row(
    finished: &FinishedRun,
    structure: Structure,
    name: &str,
    trials: &[(Scenario, Trial)],
) -> Result<ResilienceRow, DamageError> {
    let controller = Controller::new(&finished.genome);
    let matching: Match = structure.matching();
    let values = trials
        .par_iter()
        .map(|(conditions, trial)| {
            let outcome = run(&controller, conditions, trial, |_| {})?;
            let share = |poses: &[Pose]| structure.share(conditions.grid(), poses);
            Ok([
                trial.starts.len() as f64,
                outcome.fitness(),
                share(&trial.starts)?,
                share(&outcome.final_poses)?,
                similarity(&outcome.final_poses, &finished.final_poses, matching),
            ])
        })
        .collect::<Result<Vec<_>, DamageError>>()?;
    let column = |index: usize| values.iter().map(|row| row[index]).collect();
    Ok(ResilienceRow {
        name: name.to_owned(),
        robots: column(0),
        fitness: column(1),
        share_start: column(2),
        share_end: column(3),
        similarity: column(4),
    })
}
