//! The columns and rows of each table.

use super::{Cell, Column, ExportError, ExportedRun, Kind, Table};
use Kind::{Integer, Number, String as Text};
use minimal_surprise_controller::{Action, Turn};
use minimal_surprise_evolution::baseline::FitnessBaselines;
use minimal_surprise_evolution::settings::{SETTINGS, Scalar, Setting};
use minimal_surprise_sim::structures::{Structure, classify};

/// Number of weights of the largest genome: sensor model C without fixed predictions.
pub(super) const WEIGHTS_MAX: usize = 166 + 450;

type Row = Vec<Cell>;

fn column(name: &str, kind: Kind, unit: &'static str, meaning: &str) -> Column {
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

/// Returns the type of a setting's values.
fn kind_of(setting: &str) -> Kind {
    match setting {
        "robots" | "population" | "generations" | "repetitions" | "steps" | "seed" => Integer,
        "noise" | "mutation" | "crossover" => Number,
        _ => Text,
    }
}

fn column_of_structure(structure: Structure) -> Column {
    Column {
        name: format!("share_{}", structure.name().replace(' ', "_")),
        kind: Number,
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
                    Number,
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
                        Number,
                        "cells/step/robot",
                        "share of robots that move in the step, 0 to 1",
                    ),
                    column(
                        "surprise",
                        Number,
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

    /// Returns the rows of a run.
    ///
    /// # Errors
    /// [`ExportError`] if the run cannot be repeated.
    pub(super) fn rows(self, run: &ExportedRun, weights: usize) -> Result<Vec<Row>, ExportError> {
        match self {
            Self::Runs => Ok(vec![runs_row(run)?]),
            Self::Generations => {
                let fitness = run.finished.best_fitness.iter().enumerate();
                let rows = fitness.map(|(generation, &best)| {
                    vec![id(run), (generation as u64).into(), best.into()]
                });
                Ok(rows.collect())
            }
            Self::Steps => steps_rows(run),
            Self::Robots => robots_rows(run),
            Self::Genomes => {
                let genome = run.finished.genome.weights().iter();
                let mut row = vec![id(run)];
                row.extend(genome.map(|&weight| Cell::Text(weight.to_string())));
                row.resize(1 + weights, Cell::Missing);
                Ok(vec![row])
            }
        }
    }
}

fn id(run: &ExportedRun) -> Cell {
    run.id.as_str().into()
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
        column(&name, kind_of(setting.name), "", &meaning)
    }));
    columns.extend([
        column("width", Integer, "cells", "width of the grid"),
        column("height", Integer, "cells", "height of the grid"),
        column(
            "density",
            Number,
            "robots/cell",
            "swarm size divided by the number of cells",
        ),
        column(
            "fitness",
            Number,
            "share of bits",
            "fitness of the best genome, 0 to 1",
        ),
        column(
            "constant_fitness",
            Number,
            "share of bits",
            "fitness F₀ of the best constant prediction on random states",
        ),
        column(
            "constant_fitness_of_readings",
            Number,
            "share of bits",
            "fitness F₁ of the best constant prediction on the final run's readings",
        ),
        column(
            "ceiling",
            Number,
            "share of bits",
            "highest possible fitness with this noise",
        ),
        column(
            "skill",
            Number,
            "",
            "(fitness − F₀) / (ceiling − F₀); empty if undefined",
        ),
        column(
            "model_gain",
            Number,
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
        column("movement", Number, "cells/step/robot", "movement M, 0 to 1"),
        column(
            "intended_movement",
            Number,
            "1/step/robot",
            "intended movement I, 0 to 1",
        ),
        column(
            "last_temperature",
            Number,
            "cells/step/robot",
            "temperature in the last step, 0 to 1",
        ),
        column(
            "mean_surprise",
            Number,
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

fn runs_row(run: &ExportedRun) -> Result<Row, ExportError> {
    let finished = &run.finished;
    let scenario = finished.settings.scenario();
    let grid = scenario.grid();
    let measures = finished.measures()?;
    let baselines = FitnessBaselines::of_run(scenario, &measures);
    let found = classify(grid, &finished.final_poses)?;
    let names: Vec<&str> = found.names().iter().map(|name| name.name()).collect();
    let lines = found.line_counts();
    let mut row: Row = vec![
        run.experiment.as_str().into(),
        run.setting.as_str().into(),
        id(run),
    ];
    row.extend(
        settings().map(|setting| match finished.settings.value(setting.name) {
            // A setting that is not written has its default.
            None if setting.default.is_empty() => Cell::Missing,
            None => setting.default.into(),
            Some(Scalar::Text(text)) => Cell::Text(text),
            Some(Scalar::Integer(value)) => Cell::Integer(value),
            Some(Scalar::Float(value)) => Cell::Number(value),
        }),
    );
    row.extend([
        u32::from(grid.width()).into(),
        u32::from(grid.height()).into(),
        (f64::from(scenario.robots()) / f64::from(grid.cells())).into(),
        measures.fitness().into(),
        baselines.constant_fitness.into(),
        baselines.constant_fitness_of_readings.into(),
        baselines.ceiling.into(),
        baselines.skill.into(),
        baselines.model_gain.into(),
        Cell::Text(names.join(";")),
    ]);
    row.extend(Structure::ALL.map(|structure| Cell::Number(found.share(structure))));
    row.extend([
        measures.movement().into(),
        measures.intended_movement().into(),
        measures.temperature().last().copied().into(),
        (1.0 - measures.fitness()).into(),
        lines.horizontal.into(),
        lines.vertical.into(),
        lines.spanning.into(),
        lines
            .orientation()
            .map(|orientation| orientation.name())
            .into(),
        finished.hash.as_str().into(),
        finished.program.as_str().into(),
    ]);
    Ok(row)
}

fn steps_rows(run: &ExportedRun) -> Result<Vec<Row>, ExportError> {
    let grid = run.finished.settings.scenario().grid();
    let measures = run.finished.measures()?;
    let (temperature, surprise) = (measures.temperature(), measures.surprise());
    let mut states = vec![run.finished.starts.clone()];
    run.finished
        .replay(|world| states.push(world.poses().to_vec()))?;
    let steps = states
        .iter()
        .zip(temperature.iter().zip(&surprise))
        .enumerate();
    steps
        .map(|(step, (poses, (&temperature, &surprise)))| {
            let found = classify(grid, poses)?;
            let mut row = vec![
                id(run),
                (step as u64).into(),
                temperature.into(),
                surprise.into(),
            ];
            row.extend(Structure::ALL.map(|structure| Cell::Number(found.share(structure))));
            Ok(row)
        })
        .collect()
}

fn robots_rows(run: &ExportedRun) -> Result<Vec<Row>, ExportError> {
    let trace = run.finished.trace()?;
    let mut rows = Vec::new();
    for (step, of_step) in trace.steps.iter().enumerate() {
        let robots = of_step
            .poses
            .iter()
            .zip(&of_step.readings)
            .zip(&of_step.decisions);
        for (robot, ((pose, reading), decision)) in robots.enumerate() {
            let action = match (decision.action, decision.turn) {
                (Action::Straight, _) => "straight",
                (Action::Turn, Turn::CounterClockwise) => "left",
                (Action::Turn, Turn::Clockwise) => "right",
            };
            rows.push(vec![
                id(run),
                (step as u64).into(),
                (robot as u64).into(),
                u32::from(pose.x).into(),
                u32::from(pose.y).into(),
                (pose.heading as u32).into(),
                action.into(),
                u32::from(reading.bits()).into(),
                u32::from(decision.prediction.bits()).into(),
            ]);
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_controller::{Prediction, SensorModel, Topology};
    use minimal_surprise_evolution::settings::Settings;

    #[test]
    fn the_type_of_each_setting_is_that_of_its_default_value() {
        let defaults = Settings::builder().build().unwrap();
        for setting in settings() {
            let kind = match defaults.value(setting.name) {
                None => continue,
                Some(Scalar::Text(_)) => Text,
                Some(Scalar::Integer(_)) => Integer,
                Some(Scalar::Float(_)) => Number,
            };
            assert_eq!(kind_of(setting.name), kind, "{}", setting.name);
        }
    }

    #[test]
    fn the_columns_of_weights_are_enough_for_every_topology() {
        let largest =
            SensorModel::ALL.map(|model| Topology::new(model, Prediction::Free).unwrap().weights());
        assert_eq!(largest.into_iter().max(), Some(WEIGHTS_MAX));
    }
}
