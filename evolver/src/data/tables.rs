//! The columns and rows of each table.

use ScalarKind::{Float, Integer, Text};
use clap::ValueEnum;
use minimal_surprise_controller::{Action, Prediction, SensorModel, Topology, Turn};
use minimal_surprise_evolution::baseline::FitnessBaselines;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::settings::{SETTINGS, Scalar, ScalarKind, Setting};
use minimal_surprise_sim::WorldError;
use minimal_surprise_sim::structures::{Structure, classify};

/// A table of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Table {
    /// One row per run: settings, outcomes, baselines.
    Runs,
    /// One row per generation of a run.
    Generations,
    /// One row per step of the final run of the best genome.
    Steps,
    /// One row per robot and step of that run.
    Robots,
    /// One row per run: the weights of the best genome.
    Genomes,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name in the header.
    pub name: String,
    /// Type.
    pub kind: ScalarKind,
    /// Unit; empty for numbers without a unit and for text.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: String,
}

/// A value of a row; `None` if it is missing. A number is printed as the shortest text that gives
/// the same 64-bit number.
pub type Cell = Option<Scalar>;

/// A run to be exported.
#[derive(Clone, Debug)]
pub struct ExportedRun {
    /// The experiment; empty for a single run.
    pub experiment: String,
    /// Label of the settings in a suite; empty for a single run.
    pub setting: String,
    /// Run ID in a suite, otherwise the run's directory name.
    pub id: String,
    /// The run.
    pub finished: FinishedRun,
}

impl Table {
    /// All tables, in the order of the document.
    pub const ALL: [Self; 5] = [
        Self::Runs,
        Self::Generations,
        Self::Steps,
        Self::Robots,
        Self::Genomes,
    ];

    /// Returns the table's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Generations => "generations",
            Self::Steps => "steps",
            Self::Robots => "robots",
            Self::Genomes => "genomes",
        }
    }

    pub(super) fn file_name(self) -> String {
        format!("{}.csv", self.name())
    }

    /// Describes the rows.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Runs => "One row per run: settings, outcomes and baselines.",
            Self::Generations => "One row per generation of a run.",
            Self::Steps => {
                "One row per step of the final run, in which the best genome runs again from the \
                 start that determined its fitness."
            }
            Self::Robots => "One row per robot and step of the final run.",
            Self::Genomes => {
                "One row per run: the weights of the best genome, in the order of the genome \
                 container. Genomes of smaller networks leave the last columns empty."
            }
        }
    }
}

/// Returns the number of weights of the largest genome.
pub(super) fn weights_max() -> usize {
    let free = SensorModel::ALL.map(|model| Topology::new(model, Prediction::Free));
    let weights = free.into_iter().flatten().map(Topology::weights);
    weights.max().unwrap_or(0)
}

/// The values of a row, in the order of the columns.
pub(super) type Row = Vec<Cell>;

fn cell(value: impl Into<Scalar>) -> Cell {
    Some(value.into())
}

fn column(name: &str, kind: ScalarKind, unit: &'static str, meaning: &str) -> Column {
    Column {
        name: name.to_owned(),
        kind,
        unit,
        meaning: meaning.to_owned(),
    }
}

/// Returns the settings that are part of a run's identity.
fn settings() -> impl Iterator<Item = &'static Setting> {
    let is_result_independent = |name| matches!(name, "threads" | "out");
    SETTINGS
        .iter()
        .filter(move |setting| !is_result_independent(setting.name))
}

fn column_of_structure(structure: Structure) -> Column {
    Column {
        name: format!("share_{}", structure.name().replace(' ', "_")),
        kind: Float,
        unit: "share of robots",
        meaning: format!("robots in the structure *{}*, 0 to 1", structure.name()),
    }
}

impl Table {
    /// Returns the columns; a genome has `weights` of them.
    #[must_use]
    pub fn columns(self, weights: usize) -> Vec<Column> {
        let run = column("run", Text, "", "run ID");
        match self {
            Self::Runs => runs_columns(),
            Self::Generations => vec![
                run,
                column("generation", Integer, "", "generation, from 0"),
                column(
                    "best_fitness",
                    Float,
                    "share of bits",
                    "fitness of the best genome, 0 to 1",
                ),
            ],
            Self::Steps => {
                let mut columns = vec![
                    run,
                    column(
                        "step",
                        Integer,
                        "steps",
                        "steps since the start; the row describes the next step",
                    ),
                    column(
                        "temperature",
                        Float,
                        "cells/step/robot",
                        "share of robots that move in the step, 0 to 1",
                    ),
                    column(
                        "surprise",
                        Float,
                        "share of bits",
                        "sensor bits mispredicted in the step, 0 to 1",
                    ),
                ];
                columns.extend(Structure::ALL.map(column_of_structure));
                columns
            }
            Self::Robots => vec![
                run,
                column("step", Integer, "steps", "steps since the start"),
                column("robot", Integer, "", "index of the robot"),
                column(
                    "x",
                    Integer,
                    "cells",
                    "cells from the west edge, before the step",
                ),
                column(
                    "y",
                    Integer,
                    "cells",
                    "cells from the south edge, before the step",
                ),
                column(
                    "heading",
                    Integer,
                    "quarter turns",
                    "0 east, 1 north, 2 west, 3 south, before the step",
                ),
                column("action", Text, "", "`straight`, `left` or `right`"),
                column(
                    "reading",
                    Integer,
                    "",
                    "sensor bits with noise, sensor 0 in the lowest bit",
                ),
                column(
                    "prediction",
                    Integer,
                    "",
                    "predicted bits of the next reading, in the same order",
                ),
            ],
            Self::Genomes => {
                let mut columns = vec![run];
                columns.extend((0..weights).map(|weight| {
                    column(
                        &format!("weight_{weight}"),
                        Integer,
                        "1/4096",
                        "weight in Q3.12, −32767 to 32767",
                    )
                }));
                columns
            }
        }
    }

    /// Passes the rows of a run to `add`, one at a time: a run may have too many for the memory.
    ///
    /// # Errors
    /// [`WorldError`] if the run cannot be repeated.
    pub(super) fn rows(
        self,
        run: &ExportedRun,
        add: &mut dyn FnMut(Row),
    ) -> Result<(), WorldError> {
        match self {
            Self::Runs => add(runs_row(run)?),
            Self::Generations => {
                for (generation, &best) in run.finished.best_fitness.iter().enumerate() {
                    add(vec![id(run), cell(generation as u64), cell(best)]);
                }
            }
            Self::Steps => steps_rows(run, add)?,
            Self::Robots => robots_rows(run, add)?,
            Self::Genomes => {
                let weights = run.finished.genome.weights().iter();
                let mut row = vec![id(run)];
                row.extend(weights.map(|&weight| cell(weight.to_string())));
                row.resize(1 + weights_max(), None);
                add(row);
            }
        }
        Ok(())
    }
}

fn id(run: &ExportedRun) -> Cell {
    cell(run.id.as_str())
}

fn runs_columns() -> Vec<Column> {
    let mut columns = vec![
        column(
            "experiment",
            Text,
            "",
            "experiment of the suite; empty for a single run",
        ),
        column(
            "setting",
            Text,
            "",
            "label of the settings in the suite; empty for a single run",
        ),
        column(
            "run",
            Text,
            "",
            "run ID in a suite, otherwise the name of the run's directory",
        ),
    ];
    columns.extend(settings().map(|setting| {
        let name = setting.name.replace('-', "_");
        let meaning = format!("setting: {}", setting.meaning());
        column(&name, setting.kind, "", &meaning)
    }));
    columns.extend([
        column("width", Integer, "cells", "width of the grid"),
        column("height", Integer, "cells", "height of the grid"),
        column(
            "density",
            Float,
            "robots/cell",
            "swarm size divided by the number of cells",
        ),
        column(
            "fitness",
            Float,
            "share of bits",
            "fitness of the best genome, 0 to 1",
        ),
        column(
            "constant_fitness",
            Float,
            "share of bits",
            "fitness F₀ of the best constant prediction on random states",
        ),
        column(
            "constant_fitness_of_readings",
            Float,
            "share of bits",
            "fitness F₁ of the best constant prediction on the final run's readings",
        ),
        column(
            "ceiling",
            Float,
            "share of bits",
            "highest possible fitness with this noise",
        ),
        column(
            "skill",
            Float,
            "",
            "(fitness − F₀) / (ceiling − F₀); empty if undefined",
        ),
        column(
            "model_gain",
            Float,
            "",
            "(fitness − F₁) / (ceiling − F₁); empty if undefined",
        ),
        column(
            "structures",
            Text,
            "",
            "dominant structures, separated by semicolons if tied",
        ),
    ]);
    columns.extend(Structure::ALL.map(column_of_structure));
    columns.extend([
        column("movement", Float, "cells/step/robot", "movement M, 0 to 1"),
        column(
            "intended_movement",
            Float,
            "1/step/robot",
            "intended movement I, 0 to 1",
        ),
        column(
            "last_temperature",
            Float,
            "cells/step/robot",
            "temperature in the last step, 0 to 1",
        ),
        column(
            "mean_surprise",
            Float,
            "share of bits",
            "mean surprise of the final run, 0 to 1",
        ),
        column(
            "horizontal_lines",
            Integer,
            "lines",
            "number of horizontal lines",
        ),
        column(
            "vertical_lines",
            Integer,
            "lines",
            "number of vertical lines",
        ),
        column(
            "spanning_lines",
            Integer,
            "lines",
            "number of lines around the torus",
        ),
        column(
            "line_orientation",
            Text,
            "",
            "orientation of the lines; empty without lines",
        ),
        column("hash", Text, "", "hash of the run"),
        column("program", Text, "", "program that executed the run"),
    ]);
    columns
}

fn runs_row(run: &ExportedRun) -> Result<Row, WorldError> {
    let finished = &run.finished;
    let scenario = finished.settings.scenario();
    let grid = scenario.grid();
    let measures = finished.measures()?;
    let baselines = FitnessBaselines::of_run(scenario, &measures);
    let found = classify(grid, &finished.final_poses)?;
    let names: Vec<&str> = found.names().iter().map(|name| name.name()).collect();
    let lines = found.line_counts();
    let mut row = vec![
        cell(run.experiment.as_str()),
        cell(run.setting.as_str()),
        id(run),
    ];
    row.extend(settings().map(|setting| {
        // A setting that is not written has its default.
        let default = || (!setting.default.is_empty()).then(|| setting.default.into());
        finished.settings.value(setting.name).or_else(default)
    }));
    row.extend([
        cell(u32::from(grid.width())),
        cell(u32::from(grid.height())),
        cell(f64::from(scenario.robots()) / f64::from(grid.cells())),
        cell(measures.fitness()),
        cell(baselines.constant_fitness),
        cell(baselines.constant_fitness_of_readings),
        cell(baselines.ceiling),
        baselines.skill.map(Scalar::from),
        baselines.model_gain.map(Scalar::from),
        cell(names.join(";")),
    ]);
    row.extend(Structure::ALL.map(|structure| cell(found.share(structure))));
    row.extend([
        cell(measures.movement()),
        cell(measures.intended_movement()),
        measures.temperature().last().copied().map(Scalar::from),
        cell(1.0 - measures.fitness()),
        cell(lines.horizontal),
        cell(lines.vertical),
        cell(lines.spanning),
        lines
            .orientation()
            .map(|orientation| orientation.name().into()),
        cell(finished.hash.as_str()),
        cell(finished.program.as_str()),
    ]);
    Ok(row)
}

fn steps_rows(run: &ExportedRun, add: &mut dyn FnMut(Row)) -> Result<(), WorldError> {
    let grid = run.finished.settings.scenario().grid();
    let measures = run.finished.measures()?;
    let (temperature, surprise) = (measures.temperature(), measures.surprise());
    let mut poses = run.finished.starts.clone();
    let mut step = 0;
    let mut added = Ok(());
    run.finished.replay(|world| {
        match classify(grid, &poses) {
            Ok(found) => {
                let mut row = vec![
                    id(run),
                    cell(step as u64),
                    cell(temperature[step]),
                    cell(surprise[step]),
                ];
                row.extend(Structure::ALL.map(|structure| cell(found.share(structure))));
                add(row);
            }
            Err(error) => added = Err(error),
        }
        poses.copy_from_slice(world.poses());
        step += 1;
    })?;
    added
}

fn robots_rows(run: &ExportedRun, add: &mut dyn FnMut(Row)) -> Result<(), WorldError> {
    let mut poses = run.finished.starts.clone();
    let mut step = 0_u64;
    run.finished.replay(|world| {
        let robots = poses.iter().zip(world.readings()).zip(world.decisions());
        for (robot, ((pose, reading), decision)) in robots.enumerate() {
            let action = match (decision.action, decision.turn) {
                (Action::Straight, _) => "straight",
                (Action::Turn, Turn::CounterClockwise) => "left",
                (Action::Turn, Turn::Clockwise) => "right",
            };
            add(vec![
                id(run),
                cell(step),
                cell(robot as u64),
                cell(u32::from(pose.x)),
                cell(u32::from(pose.y)),
                cell(pose.heading as u32),
                cell(action),
                cell(u32::from(reading.bits())),
                cell(u32::from(decision.prediction.bits())),
            ]);
        }
        poses.copy_from_slice(world.poses());
        step += 1;
    })
}
