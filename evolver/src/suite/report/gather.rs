//! The data of a report: the finished runs of a plan, their re-evaluations and damage experiments.

use super::damage_areas::{Rectangle, smallest_apart};
use super::numbers::plural;
use crate::suite::plan::{Plan, PlannedExperiment, PlannedRun, PlannedSettings, RUNS};
use crate::suite::search::{Search, look};
use crate::suite::{Reevaluation, Resilience, Suite};
use minimal_surprise_controller::Controller;
use minimal_surprise_evolution::baseline::{Chance, GENOMES, skill};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::FileError;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::reevaluation::{ResilienceRow, after_damage, rerun, resilience};
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_evolution::statistics::mean;
use minimal_surprise_evolution::text::hex;
use minimal_surprise_sim::evaluation::run;
use minimal_surprise_sim::structures::{LineCounts, LineOrientation, Structure, classify};
use minimal_surprise_sim::{Area, Damage, DamageError, Pose, SeedTree, WorldError};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// The reason why runs cannot be read or executed again.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GatherError {
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A final state is invalid.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A structure cannot be damaged.
    #[error(transparent)]
    Damage(#[from] DamageError),
    /// The suite names an unknown structure.
    #[error("structure = {name:?}: expected one of: {}", Structure::ALL.map(Structure::name).join(", "))]
    UnknownStructure {
        /// The name.
        name: String,
    },
}

/// A finished run with its structures and lines.
#[derive(Clone, Debug)]
pub struct GatheredRun {
    /// Run ID.
    pub id: String,
    /// The contents of the run's directory.
    pub finished: FinishedRun,
    /// The dominant structures, in the paper's order; several if tied, empty if no robot is in a
    /// structure.
    pub names: Vec<Structure>,
    /// Share of robots in each structure at the end, in the order of [`Structure::ALL`].
    pub shares: [f64; 8],
    /// Numbers of lines, by direction.
    pub lines: LineCounts,
}

impl GatheredRun {
    /// Returns the fitness of the last generation's best genome.
    #[must_use]
    pub fn fitness(&self) -> f64 {
        self.finished.best_fitness.last().copied().unwrap_or(0.0)
    }

    /// Returns the skill of the fitness beyond a constant prediction; `None` if it is undefined.
    #[must_use]
    pub fn skill(&self) -> Option<f64> {
        skill(self.fitness(), self.finished.settings.scenario())
    }

    /// Returns the structure that the run counts for in tests; ties go to the first in the paper's
    /// order.
    #[must_use]
    pub fn name(&self) -> Option<Structure> {
        self.names.first().copied()
    }

    /// Returns the share of robots in a structure at the end.
    #[must_use]
    pub fn share(&self, structure: Structure) -> f64 {
        let place = Structure::ALL.iter().position(|&s| s == structure);
        place.map_or(0.0, |place| self.shares[place])
    }

    /// Returns the share of robots in the dominant structure.
    #[must_use]
    pub fn named_share(&self) -> f64 {
        self.name().map_or(0.0, |name| self.share(name))
    }
}

/// The finished runs with the same settings.
#[derive(Clone, Debug)]
pub struct Group {
    /// The experiment.
    pub experiment: String,
    /// Label of the settings.
    pub label: String,
    /// True if the runs are beyond the plan.
    pub is_beyond_plan: bool,
    /// The settings, including the first seed.
    pub settings: Settings,
    /// Number of planned runs.
    pub planned: usize,
    /// The finished runs, by seed.
    pub runs: Vec<GatheredRun>,
    /// What chance gives under these settings; `None` without finished runs, for runs beyond the
    /// plan, and for swarms of more than [`ROBOTS_MAX`](minimal_surprise_evolution::baseline::ROBOTS_MAX) robots.
    pub chance: Option<GroupChance>,
}

/// What chance gives under the settings of a group.
#[derive(Clone, Debug)]
pub struct GroupChance {
    /// Random placements.
    pub placements: Chance,
    /// Random genomes.
    pub genomes: Chance,
}

impl GroupChance {
    /// Draws the baselines of settings. The draws do not depend on the seeds of the runs.
    fn draw(settings: &Settings) -> Result<Option<Self>, WorldError> {
        let scenario = settings.scenario();
        let placements = Chance::of_default_placements(scenario.grid(), scenario.robots())?;
        let Some(placements) = placements else {
            return Ok(None);
        };
        let (topology, repetitions) = (settings.topology(), settings.repetitions());
        let seeds = SeedTree::new(0);
        let genomes = Chance::of_genomes(topology, scenario, repetitions, seeds, GENOMES)?;
        Ok(Some(Self {
            placements,
            genomes,
        }))
    }

    /// Returns both kinds of draws, each with its name.
    #[must_use]
    pub fn kinds(&self) -> [(&'static str, &Chance); 2] {
        [
            ("random placements", &self.placements),
            ("random genomes", &self.genomes),
        ]
    }
}

impl Group {
    /// Returns whether every planned run is finished.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.runs.len() == self.planned
    }

    /// Returns the label of the settings, marked if the runs are beyond the plan.
    #[must_use]
    pub fn setting(&self) -> String {
        let beyond = if self.is_beyond_plan {
            ", beyond the plan"
        } else {
            ""
        };
        format!("{}{beyond}", self.label)
    }

    /// Describes the number of finished runs.
    #[must_use]
    pub fn counted(&self) -> String {
        if self.is_complete() {
            plural(self.planned, "run")
        } else {
            format!("{} of {} runs", self.runs.len(), self.planned)
        }
    }

    /// Computes one number per run.
    pub fn values(&self, of: impl Fn(&GatheredRun) -> f64) -> Vec<f64> {
        self.runs.iter().map(of).collect()
    }
}

/// Result of a genome from a new start.
#[derive(Clone, Debug)]
pub struct NewStart {
    /// Fitness, 0 to 1.
    pub fitness: f64,
    /// Orientation of the lines; `None` if no lines formed.
    pub orientation: Option<LineOrientation>,
    /// The dominant structures.
    pub names: Vec<Structure>,
}

/// Results of a group's best genomes from new starts.
#[derive(Clone, Debug)]
pub struct Reevaluated {
    /// Name of the re-evaluation.
    pub name: String,
    /// Number of new starts per genome.
    pub starts: u32,
    /// The experiment.
    pub experiment: String,
    /// Label of the settings.
    pub label: String,
    /// For each genome, one result per new start.
    pub genomes: Vec<Vec<NewStart>>,
    /// SHA-256 of all fitnesses and final poses, in order.
    pub hash: String,
}

impl Reevaluated {
    /// Returns the orientation that each genome forms in more than half of its starts.
    #[must_use]
    pub fn orientations(&self) -> Vec<Option<LineOrientation>> {
        let of_genome = |starts: &Vec<NewStart>| {
            let orientations: Vec<_> = starts.iter().map(|start| start.orientation).collect();
            LineOrientation::of_most(&orientations)
        };
        self.genomes.iter().map(of_genome).collect()
    }
}

/// An area that was damaged.
#[derive(Clone, Debug)]
pub struct DamagedArea {
    /// Name of the area: A, B, C, …
    pub name: char,
    /// The cells.
    pub rectangle: Rectangle,
    /// Poses after the removal, before the run continues.
    pub before: Vec<Pose>,
    /// Poses at the end of the continued run.
    pub after: Vec<Pose>,
    /// The result of removing robots.
    pub removed: ResilienceRow,
    /// The result of repositioning robots.
    pub repositioned: ResilienceRow,
}

/// A run whose structure was damaged.
#[derive(Clone, Debug)]
pub struct Damaged {
    /// Label of the settings that the run evolved with.
    pub label: String,
    /// The run.
    pub run: GatheredRun,
    /// Results of the run as evolved.
    pub initial: ResilienceRow,
    /// Results from new starts.
    pub new_starts: ResilienceRow,
    /// The damaged areas.
    pub areas: Vec<DamagedArea>,
}

impl Damaged {
    /// Returns the number of runs from new starts and after damage.
    #[must_use]
    pub fn repetitions(&self) -> usize {
        let rows = self.rows();
        rows.iter().skip(1).map(|(_, row)| row.fitness.len()).sum()
    }

    /// Returns the SHA-256 of the outcomes of these runs, in order.
    #[must_use]
    pub fn hash(&self) -> String {
        let mut hash = Sha256::new();
        for (_, row) in self.rows() {
            add_row(&mut hash, row);
        }
        hex(&hash.finalize())
    }

    /// Returns every row with its name.
    #[must_use]
    pub fn rows(&self) -> Vec<(String, &ResilienceRow)> {
        let mut rows = vec![
            ("initial run".to_owned(), &self.initial),
            ("new starts".to_owned(), &self.new_starts),
        ];
        rows.extend(
            self.areas
                .iter()
                .map(|area| (format!("remove area {}", area.name), &area.removed)),
        );
        rows.extend(
            self.areas
                .iter()
                .map(|area| (format!("reposition area {}", area.name), &area.repositioned)),
        );
        rows
    }
}

/// The result of applying the same damage to all runs of the structure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overall {
    /// Number of runs after damage.
    pub repetitions: usize,
    /// SHA-256 of the outcomes, in order.
    pub hash: String,
    /// Number of areas, summed over all runs.
    pub areas: usize,
    /// Number of areas for which, after removal, the share at the end was at least the share at the
    /// start.
    pub removal_holds: usize,
    /// Number of areas for which, after repositioning, the mean share at the end was at least the
    /// mean share at the start.
    pub repositioning_holds: usize,
    /// Mean gain in share from start to end after removal, as a fraction.
    pub removal_gain: f64,
    /// Mean gain in share from start to end after repositioning, as a fraction.
    pub repositioning_gain: f64,
}

/// A resilience experiment.
#[derive(Clone, Debug)]
pub struct Resilient {
    /// The experiment, as described in the suite.
    pub asked: Resilience,
    /// The structure.
    pub structure: Structure,
    /// Number of finished runs that were searched.
    pub looked_through: usize,
    /// Number of runs that the structure dominates.
    pub named: usize,
    /// Number of runs beyond the plan that were searched because no planned run has the structure.
    pub further: u32,
    /// The damaged run; `None` if no run has the structure.
    pub damaged: Option<Damaged>,
    /// Results of damage to all planned runs that the structure dominates.
    pub overall: Overall,
}

/// The complete data of a report.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// The evolutions.
    pub groups: Vec<Group>,
    /// The runs beyond the plan that were searched for a structure, by settings.
    pub further: Vec<Group>,
    /// The re-evaluations.
    pub reevaluations: Vec<Reevaluated>,
    /// The resilience experiments.
    pub resiliences: Vec<Resilient>,
    /// Damaged runs, which are left out.
    pub damaged: DamagedRuns,
}

impl Gathered {
    /// Reads the finished runs of a plan, and executes the suite's re-evaluations and damage
    /// experiments.
    ///
    /// # Errors
    /// [`GatherError`] if a finished run cannot be read or executed again.
    pub fn read(plan: &Plan, suite: &Suite, directory: &Path) -> Result<Self, GatherError> {
        let (mut groups, mut damaged) = (Vec::new(), DamagedRuns::default());
        for experiment in &plan.experiments {
            for settings in experiment.settings() {
                groups.push(read_group(
                    &experiment.name,
                    settings,
                    directory,
                    &mut damaged,
                )?);
            }
        }
        let mut reevaluations = Vec::new();
        for asked in &suite.reevaluations {
            let wanted = |group: &&Group| asked.of.contains(&group.experiment);
            for group in groups.iter().filter(wanted) {
                reevaluations.push(reevaluate(asked, group)?);
            }
        }
        let mut resiliences: Vec<Resilient> = Vec::new();
        for asked in &suite.resiliences {
            if plan.experiments.iter().any(|e| e.name == asked.of) {
                resiliences.push(damage(asked, &groups, plan, directory, &mut damaged)?);
            }
        }
        let mut further = Vec::new();
        for experiment in &plan.experiments {
            // Two searches through the same experiment share the experiment's runs.
            let searched = resiliences.iter().filter(|r| r.asked.of == experiment.name);
            let number = searched.map(|r| r.further).max().unwrap_or(0);
            further.extend(read_further(
                experiment,
                number as usize,
                directory,
                &mut damaged,
            )?);
        }
        Ok(Self {
            groups,
            further,
            reevaluations,
            resiliences,
            damaged,
        })
    }

    /// Returns the group of an experiment's runs with these settings; `None` if the plan has no
    /// such runs.
    #[must_use]
    pub fn group(&self, experiment: &str, label: &str) -> Option<&Group> {
        self.groups
            .iter()
            .find(|group| group.experiment == experiment && group.label == label)
    }

    /// Returns the runs beyond the plan with the same settings as a group, if any exist.
    #[must_use]
    pub fn further_of(&self, group: &Group) -> Option<&Group> {
        self.further.iter().find(|further| {
            (&further.experiment, &further.label) == (&group.experiment, &group.label)
        })
    }

    /// Returns the directories of the planned runs that are complete, in the suite's directory.
    #[must_use]
    pub fn directories(&self, suite: &Path) -> Vec<PathBuf> {
        let runs = self.groups.iter().flat_map(|group| &group.runs);
        runs.map(|run| suite.join(RUNS).join(&run.id)).collect()
    }

    /// Returns the names of the experiments, in order.
    #[must_use]
    pub fn experiments(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.groups.iter().map(|g| g.experiment.as_str()).collect();
        names.dedup();
        names
    }
}

fn read_group(
    experiment: &str,
    settings: PlannedSettings,
    directory: &Path,
    damaged: &mut DamagedRuns,
) -> Result<Group, GatherError> {
    let mut runs = Vec::new();
    for planned in settings.runs() {
        runs.extend(read_run(&planned, &planned.directory(directory), damaged)?);
    }
    let chance = match runs.is_empty() {
        true => None,
        false => GroupChance::draw(&settings.settings)?,
    };
    Ok(Group {
        experiment: experiment.to_owned(),
        label: settings.label,
        is_beyond_plan: false,
        settings: settings.settings,
        planned: settings.number as usize,
        runs,
        chance,
    })
}

/// Reads an experiment's first `number` runs beyond the plan, and groups them by settings.
fn read_further(
    experiment: &PlannedExperiment,
    number: usize,
    directory: &Path,
    damaged: &mut DamagedRuns,
) -> Result<Vec<Group>, GatherError> {
    let mut groups: Vec<Group> = Vec::new();
    for planned in experiment.further().take(number) {
        let Some(run) = read_run(&planned, &planned.directory(directory), damaged)? else {
            continue;
        };
        let label = planned.label.clone();
        match groups.iter_mut().find(|group| group.label == label) {
            Some(group) => {
                group.planned += 1;
                group.runs.push(run);
            }
            None => groups.push(Group {
                experiment: experiment.name.clone(),
                label,
                is_beyond_plan: true,
                settings: planned.settings.clone(),
                planned: 1,
                runs: vec![run],
                chance: None,
            }),
        }
    }
    Ok(groups)
}

/// Reads a run; `None` if it is not finished or is damaged.
fn read_run(
    planned: &PlannedRun,
    directory: &Path,
    damaged: &mut DamagedRuns,
) -> Result<Option<GatheredRun>, GatherError> {
    let Some(finished) = damaged.read(directory) else {
        return Ok(None);
    };
    let found = classify(finished.settings.scenario().grid(), &finished.final_poses)?;
    Ok(Some(GatheredRun {
        id: planned.id.clone(),
        names: found.names(),
        shares: Structure::ALL.map(|structure| found.share(structure)),
        lines: found.line_counts(),
        finished,
    }))
}

fn reevaluate(asked: &Reevaluation, group: &Group) -> Result<Reevaluated, GatherError> {
    let mut genomes = Vec::new();
    let mut hash = Sha256::new();
    for run in &group.runs {
        let settings = &run.finished.settings;
        let seeds = SeedTree::new(settings.seed());
        let reruns = rerun(
            &run.finished.genome,
            settings.scenario(),
            seeds,
            asked.starts,
        )?;
        for rerun in &reruns {
            hash.update(rerun.fitness.to_bits().to_le_bytes());
            add_poses(&mut hash, &rerun.final_poses);
        }
        let starts = reruns.into_iter().map(|rerun| NewStart {
            fitness: rerun.fitness,
            orientation: rerun.orientation,
            names: rerun.names,
        });
        genomes.push(starts.collect());
    }
    Ok(Reevaluated {
        name: asked.name.clone(),
        starts: asked.starts,
        experiment: group.experiment.clone(),
        label: group.label.clone(),
        genomes,
        hash: hex(&hash.finalize()),
    })
}

fn add_poses(hash: &mut Sha256, poses: &[Pose]) {
    for pose in poses {
        hash.update(pose.bytes());
    }
}

fn add_row(hash: &mut Sha256, row: &ResilienceRow) {
    let columns = [
        &row.robots,
        &row.fitness,
        &row.share_start,
        &row.share_end,
        &row.similarity,
    ];
    for value in columns.into_iter().flatten() {
        hash.update(value.to_bits().to_le_bytes());
    }
}

/// Looks up a structure by its name in files.
pub(super) fn structure_named(name: &str) -> Option<Structure> {
    let spaced = name.replace('-', " ");
    Structure::ALL.into_iter().find(|s| s.name() == spaced)
}

fn damage(
    asked: &Resilience,
    groups: &[Group],
    plan: &Plan,
    directory: &Path,
    damaged_runs: &mut DamagedRuns,
) -> Result<Resilient, GatherError> {
    let structure = asked
        .structure()
        .ok_or_else(|| GatherError::UnknownStructure {
            name: asked.structure.clone(),
        })?;
    let all: Vec<(&Group, &GatheredRun)> = groups
        .iter()
        .filter(|group| group.experiment == asked.of)
        .flat_map(|group| group.runs.iter().map(move |run| (group, run)))
        .collect();
    let named: Vec<(&Group, &GatheredRun)> = all
        .iter()
        .copied()
        .filter(|(_, run)| run.names.contains(&structure))
        .collect();
    // Choose the run with the largest share; ties go to the lowest seed, then to the first in the
    // plan.
    let chosen = named.iter().copied().reduce(|best, next| {
        let key = |run: &GatheredRun| (run.share(structure), run.finished.settings.seed());
        let ((best_share, best_seed), (share, seed)) = (key(best.1), key(next.1));
        if share > best_share || (share == best_share && seed < best_seed) {
            next
        } else {
            best
        }
    });
    let (damaged, further) = match chosen {
        Some((group, run)) => (Some(damage_run(asked, structure, &group.label, run)?), 0),
        None => match look(plan, asked, directory, 0, damaged_runs) {
            Search::Found(found, further) => {
                let run = read_run(&found, &found.directory(directory), damaged_runs)?;
                let damaged = run.map(|run| damage_run(asked, structure, &found.label, &run));
                (damaged.transpose()?, further)
            }
            Search::Next(_, next) => (None, next - 1),
            Search::NotFound(further) => (None, further),
            Search::NotNeeded | Search::Waits => (None, 0),
        },
    };
    Ok(Resilient {
        asked: asked.clone(),
        structure,
        looked_through: all.len(),
        named: named.len(),
        further,
        damaged,
        overall: overall(asked, structure, named.iter().map(|(_, run)| *run))?,
    })
}

fn overall<'a>(
    asked: &Resilience,
    structure: Structure,
    runs: impl Iterator<Item = &'a GatheredRun>,
) -> Result<Overall, GatherError> {
    let mut all = Overall::default();
    let mut hash = Sha256::new();
    for run in runs {
        let finished = &run.finished;
        let grid = finished.settings.scenario().grid();
        let found = smallest_apart(grid, &finished.final_poses, &asked.robots_in_areas);
        for Rectangle { x0, y0, x1, y1 } in found.into_iter().flatten() {
            let area = Area::new(grid, x0, y0, x1, y1)?;
            let mut gain = |damage| {
                let row = after_damage(finished, structure, damage, asked.repeat)?;
                all.repetitions += row.fitness.len();
                add_row(&mut hash, &row);
                Ok::<_, GatherError>(regained(&row))
            };
            let removal = gain(Damage::Remove(area))?;
            let repositioning = gain(Damage::Reposition(area))?;
            all.areas += 1;
            all.removal_holds += usize::from(removal >= 0.0);
            all.repositioning_holds += usize::from(repositioning >= 0.0);
            all.removal_gain += removal;
            all.repositioning_gain += repositioning;
        }
    }
    let areas = all.areas.max(1) as f64;
    all.removal_gain /= areas;
    all.repositioning_gain /= areas;
    all.hash = hex(&hash.finalize());
    Ok(all)
}

fn damage_run(
    asked: &Resilience,
    structure: Structure,
    label: &str,
    of: &GatheredRun,
) -> Result<Damaged, GatherError> {
    let finished = &of.finished;
    let conditions = finished.settings.scenario();
    let grid = conditions.grid();
    let seeds = SeedTree::new(finished.settings.seed());
    let rows = |damage, repeat| resilience(finished, structure, damage, repeat);
    let mut initial = None;
    let mut areas = Vec::new();
    let found = smallest_apart(grid, &finished.final_poses, &asked.robots_in_areas);
    for (name, rectangle) in ('A'..='Z').zip(found) {
        let Some(rectangle) = rectangle else { continue };
        let Rectangle { x0, y0, x1, y1 } = rectangle;
        let area = Area::new(grid, x0, y0, x1, y1)?;
        let (scenario, trial) =
            Damage::Remove(area).trial(conditions, &finished.final_poses, seeds, 0)?;
        let outcome = run(
            &Controller::new(&finished.genome),
            &scenario,
            &trial,
            |_| {},
        )?;
        let [first, starts, removed] = three(rows(Damage::Remove(area), asked.repeat)?);
        let [.., repositioned] = three(rows(Damage::Reposition(area), asked.repeat)?);
        initial.get_or_insert((first, starts));
        areas.push(DamagedArea {
            name,
            rectangle,
            before: trial.starts,
            after: outcome.final_poses,
            removed,
            repositioned,
        });
    }
    let (initial, new_starts) = match initial {
        Some(rows) => rows,
        None => {
            // No area has the requested number of robots; rows that need no area are still shown.
            let nowhere = Damage::Remove(Area::new(grid, 0, 0, 0, 0)?);
            let [first, starts, _] = three(rows(nowhere, asked.repeat)?);
            (first, starts)
        }
    };
    Ok(Damaged {
        label: label.to_owned(),
        run: of.clone(),
        initial,
        new_starts,
        areas,
    })
}

fn three(rows: Vec<ResilienceRow>) -> [ResilienceRow; 3] {
    rows.try_into()
        .expect("three rows: as evolved, from new starts, after damage")
}

/// Returns the mean share at the end minus the mean share at the start.
#[must_use]
pub fn regained(row: &ResilienceRow) -> f64 {
    mean(&row.share_end) - mean(&row.share_start)
}

impl Resilient {
    /// Describes the number of runs searched.
    pub(super) fn counted(&self) -> String {
        match self.further {
            0 => plural(self.looked_through, "run"),
            further => format!(
                "{} and {further} beyond the plan",
                plural(self.looked_through, "run")
            ),
        }
    }

    /// Describes the result for all planned runs of the structure; `None` if there were no areas to
    /// damage.
    pub(super) fn all_damaged(&self) -> Option<String> {
        let all = &self.overall;
        let damaged = match self.named {
            1 => "The only run damaged".to_owned(),
            more => format!("All {more} runs damaged in the same way"),
        };
        (all.areas > 0).then(|| {
            format!(
                "{damaged}, {}: the share at the end is at least the share at the start after removal \
                 from {} (mean change {:+.1} points) and after repositioning from {} ({:+.1} points)",
                plural(all.areas, "area"),
                all.removal_holds,
                100.0 * all.removal_gain,
                all.repositioning_holds,
                100.0 * all.repositioning_gain
            )
        })
    }
}
