//! The paper's figures as SVG, each with its data as CSV.

use super::gather::{Gathered, GatheredRun, Group, Resilient};
use super::numbers::{csv_text, plural};
use super::paper::PaperValues;
use minimal_surprise_evolution::statistics::quantile;
use minimal_surprise_replay::palette::LIGHT;
use minimal_surprise_replay::pictures::{Chart, Content, Panel, PictureError, sheet};
use minimal_surprise_replay::scene::{Ink, Scene};
use minimal_surprise_sim::structures::{LineOrientation, Structure};
use minimal_surprise_sim::{Grid, Pose};
use serde::Serialize;

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of the figure's files.
    pub id: String,
    /// Number of the figure in the paper; `None` if it is not in the paper.
    pub number: Option<u32>,
    /// Title of the figure.
    pub title: String,
    /// The picture as SVG.
    pub svg: String,
    /// The data of the figure, as CSV.
    pub csv: String,
}

/// The final states of an experiment that a figure of the paper shows.
struct OfPaper {
    figure: u32,
    experiment: &'static str,
    label: &'static str,
    by: By,
}

/// Property by which final states are chosen: one state per value is shown.
#[derive(Clone, Copy, PartialEq, Eq)]
enum By {
    Structure,
    Orientation,
}

const STATES_OF_PAPER: [OfPaper; 6] = [
    states_of(7, "densities", "C, 15x15", By::Structure),
    states_of(8, "densities", "C, 20x20", By::Structure),
    states_of(
        10,
        "predefined",
        "C, 15x15, line predefined",
        By::Orientation,
    ),
    states_of(
        10,
        "predefined",
        "C, 20x20, line predefined",
        By::Orientation,
    ),
    states_of(11, "geometry", "C, 25x8, line predefined", By::Orientation),
    states_of(12, "geometry", "C, 11x18, line predefined", By::Orientation),
];

const fn states_of(figure: u32, experiment: &'static str, label: &'static str, by: By) -> OfPaper {
    OfPaper {
        figure,
        experiment,
        label,
        by,
    }
}

/// A figure could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("figure {id}")]
pub struct FigureError {
    id: String,
    #[source]
    source: PictureError,
}

/// Draws all figures.
///
/// # Errors
/// [`FigureError`] if a figure cannot be drawn.
pub fn all(gathered: &Gathered, paper: &PaperValues) -> Result<Vec<Figure>, FigureError> {
    let is_paper = !paper.distributions.is_empty();
    let mut figures = Vec::new();
    for experiment in gathered.experiments() {
        if is_paper && experiment != "densities" {
            continue;
        }
        let groups: Vec<&Group> = gathered
            .groups
            .iter()
            .filter(|group| group.experiment == experiment && !group.runs.is_empty())
            .collect();
        if groups.is_empty() {
            continue;
        }
        let name = |number: u32, id: &str, what: &str| {
            if is_paper {
                Name {
                    id: format!("figure-{number}"),
                    number: Some(number),
                    title: format!("Fig. {number}: {what}"),
                }
            } else {
                Name {
                    id: format!("{experiment}-{id}"),
                    number: None,
                    title: format!("{experiment}: {what}"),
                }
            }
        };
        figures.push(temperature(
            name(
                5,
                "temperature",
                "Temperature over time: medians, with bands of quartiles and extremes, at every \
                 even step",
            ),
            &groups,
        )?);
        figures.push(best_fitness(
            name(
                6,
                "best",
                "Best fitness over generations: medians, with bands of quartiles and extremes",
            ),
            &groups,
        )?);
        figures.push(predictions(
            name(9, "predictions", "Predictions of the robot's surroundings, averaged over robots and steps, a run of each structure; the robot heads up"),
            &groups,
            gathered,
        )?);
    }
    if is_paper {
        for of in &STATES_OF_PAPER {
            let group = gathered.group(of.experiment, of.label);
            if let Some(group) = group.filter(|group| !group.runs.is_empty()) {
                let grid = group.settings.scenario().grid();
                figures.push(final_states(
                    Name {
                        id: format!("figure-{}-{grid}", of.figure),
                        number: Some(of.figure),
                        title: format!(
                            "Fig. {}: final states on {grid}, {}",
                            of.figure, of.experiment
                        ),
                    },
                    (group, of.by),
                    gathered,
                )?);
            }
        }
    } else {
        for (index, group) in gathered.groups.iter().enumerate() {
            if !group.runs.is_empty() {
                let name = Name {
                    id: format!("{}-states-{}", group.experiment, index + 1),
                    number: None,
                    title: format!("{}, {}: final states", group.experiment, group.label),
                };
                figures.push(final_states(name, (group, By::Structure), gathered)?);
            }
        }
    }
    // In the paper's order; structures that are not in the paper stay in the suite's order.
    figures.sort_by_key(|figure| figure.number.unwrap_or(u32::MAX));
    let numbers = ["Fig. 13: ", "Fig. 14: "];
    for (index, resilient) in gathered.resiliences.iter().enumerate() {
        let prefix = if is_paper {
            numbers.get(index).copied().unwrap_or("")
        } else {
            ""
        };
        figures.extend(damage(prefix, resilient)?);
    }
    Ok(figures)
}

/// Mark that denotes a run beyond the plan.
const BEYOND_PLAN: &str = "*";

/// The names of a figure.
struct Name {
    id: String,
    number: Option<u32>,
    title: String,
}

impl Name {
    /// Adds the meaning of the mark to the title if the figure contains the mark.
    fn explained(mut self, has_mark: bool) -> Self {
        if has_mark {
            self.title += &format!("; {BEYOND_PLAN} a run beyond the plan");
        }
        self
    }

    /// Draws panels as a figure, `columns` per row.
    fn figure(
        self,
        panels: &[Panel<'_>],
        columns: usize,
        rows: &[impl Serialize],
    ) -> Result<Figure, FigureError> {
        let Self { id, number, title } = self;
        match sheet(&title, panels, columns, &LIGHT) {
            Ok(drawing) => Ok(Figure {
                id,
                number,
                title,
                svg: drawing.svg(),
                csv: csv_text(rows),
            }),
            Err(source) => Err(FigureError { id, source }),
        }
    }
}

/// Returns runs beyond the plan with a group's settings: one for each structure that a damage
/// experiment needs but no run of the group has.
fn beyond_plan<'a>(
    gathered: &'a Gathered,
    group: &Group,
) -> Vec<(String, Structure, &'a GatheredRun)> {
    let further = gathered.further_of(group);
    let mut found = further.map_or(Vec::new(), |group| one_of_each(group, By::Structure));
    found.retain(|(_, structure, _)| {
        group.runs.iter().all(|run| run.name() != Some(*structure))
            && gathered
                .resiliences
                .iter()
                .any(|r| r.structure == *structure)
    });
    found
}

/// Returns, for each structure or line orientation, the run with the largest share in the
/// structure; ties go to the lowest seed.
fn one_of_each(group: &Group, by: By) -> Vec<(String, Structure, &GatheredRun)> {
    let best = |structure: Structure, is: &dyn Fn(&&GatheredRun) -> bool| {
        group.runs.iter().filter(is).reduce(|best, next| {
            if next.share(structure) > best.share(structure) {
                next
            } else {
                best
            }
        })
    };
    match by {
        By::Structure => Structure::ALL
            .into_iter()
            .filter_map(|s| {
                Some((
                    s.name().to_owned(),
                    s,
                    best(s, &|run| run.name() == Some(s))?,
                ))
            })
            .collect(),
        By::Orientation => LineOrientation::ALL
            .into_iter()
            .filter_map(|o| {
                let is = |run: &&GatheredRun| run.lines.orientation() == Some(o);
                Some((
                    o.name().to_owned(),
                    Structure::Line,
                    best(Structure::Line, &is)?,
                ))
            })
            .collect(),
    }
}

/// A swarm to be drawn.
struct State<'a> {
    title: String,
    grid: Grid,
    poses: &'a [Pose],
    structure: Structure,
    area: Option<super::damage_areas::Rectangle>,
}

fn final_states(
    name: Name,
    (group, by): (&Group, By),
    gathered: &Gathered,
) -> Result<Figure, FigureError> {
    let mut shown: Vec<_> = one_of_each(group, by)
        .into_iter()
        .map(|of| ("", of))
        .collect();
    let planned = shown.len();
    if by == By::Structure {
        let further = beyond_plan(gathered, group).into_iter();
        shown.extend(further.map(|of| (BEYOND_PLAN, of)));
    }
    let has_mark = shown.len() > planned;
    let states: Vec<State<'_>> = shown
        .into_iter()
        .map(|(mark, (name, structure, run))| State {
            title: format!("{name}{mark} (seed {})", run.finished.settings.seed()),
            grid: group.settings.scenario().grid(),
            poses: &run.finished.final_poses,
            structure,
            area: None,
        })
        .collect();
    let name = name.explained(has_mark);
    let title = format!(
        "{}; robots in the structure are blue, those in another structure orange, the others hollow",
        name.title
    );
    draw_states(Name { title, ..name }, &states, 3)
}

fn damage(prefix: &str, resilient: &Resilient) -> Result<Option<Figure>, FigureError> {
    let Some(damaged) = &resilient.damaged else {
        return Ok(None);
    };
    if damaged.areas.is_empty() {
        return Ok(None);
    }
    let grid = damaged.run.finished.settings.scenario().grid();
    let mut states = Vec::new();
    for after in [false, true] {
        for area in &damaged.areas {
            let when = if after { "after the run" } else { "removed" };
            states.push(State {
                title: format!("area {}, {when}", area.name),
                grid,
                poses: if after { &area.after } else { &area.before },
                structure: resilient.structure,
                area: Some(area.rectangle),
            });
        }
    }
    let title = format!(
        "{prefix}removal of robots from {} of a {} on {grid}; robots in the structure are blue, those in another structure orange, the others hollow",
        plural(damaged.areas.len(), "area"),
        resilient.structure
    );
    let name = Name {
        id: resilient.asked.name.clone(),
        number: None,
        title,
    };
    draw_states(name, &states, damaged.areas.len()).map(Some)
}

#[derive(Serialize)]
struct RobotRow<'a> {
    state: &'a str,
    robot: usize,
    x: u16,
    y: u16,
    heading: u8,
    in_structure: u8,
}

fn draw_states(name: Name, states: &[State<'_>], columns: usize) -> Result<Figure, FigureError> {
    let mut rows = Vec::new();
    let mut panels = Vec::new();
    for state in states {
        let mut scene = Scene::of_swarm(state.grid, state.poses, Some(state.structure));
        if let Some(area) = state.area {
            let cells = (area.y0..=area.y1).flat_map(|y| (area.x0..=area.x1).map(move |x| [x, y]));
            scene.area = cells.map(|cell| cell.map(|at| at as u16)).collect();
        }
        for (robot, drawn) in scene.robots.iter().enumerate() {
            rows.push(RobotRow {
                state: &state.title,
                robot,
                x: drawn.x,
                y: drawn.y,
                heading: drawn.heading,
                in_structure: (drawn.ink == Ink::Named).into(),
            });
        }
        panels.push(Panel {
            title: state.title.clone(),
            content: Content::Swarm(scene),
        });
    }
    name.figure(&panels, columns, &rows)
}

#[derive(Serialize)]
struct PredictionRow<'a> {
    state: &'a str,
    sensor: usize,
    ahead: i8,
    left: i8,
    average_prediction: f64,
}

fn predictions(name: Name, groups: &[&Group], gathered: &Gathered) -> Result<Figure, FigureError> {
    let shown: Vec<(bool, String, &Group, &GatheredRun)> = groups
        .iter()
        .flat_map(|group| {
            let grid = group.settings.scenario().grid();
            let planned = one_of_each(group, By::Structure).into_iter();
            let further = beyond_plan(gathered, group).into_iter();
            planned
                .map(|(name, _, run)| (false, format!("{grid}: {name}"), *group, run))
                .chain(further.map(|(name, _, run)| {
                    (true, format!("{grid}: {name}{BEYOND_PLAN}"), *group, run)
                }))
                .collect::<Vec<_>>()
        })
        .collect();
    let name = name.explained(shown.iter().any(|(is_beyond_plan, ..)| *is_beyond_plan));
    let mut rows = Vec::new();
    let mut panels = Vec::new();
    for (_, title, group, run) in &shown {
        let model = group.settings.topology().model();
        let averages = &run.finished.average_prediction;
        for (sensor, (cell, &average)) in model.cells().iter().zip(averages).enumerate() {
            rows.push(PredictionRow {
                state: title,
                sensor,
                ahead: cell.ahead,
                left: cell.left,
                average_prediction: average,
            });
        }
        panels.push(Panel {
            title: title.clone(),
            content: Content::Predictions { model, averages },
        });
    }
    name.figure(&panels, 4, &rows)
}

/// Runs whose values are shown together over time.
struct Values {
    title: String,
    /// The values of each run.
    runs: Vec<Vec<f64>>,
    /// Interval *k*: every *k*-th value is shown.
    every: usize,
}

fn temperature(name: Name, groups: &[&Group]) -> Result<Figure, FigureError> {
    let mut panels = Vec::new();
    let panel = |title: String, group: &Group, is: &dyn Fn(&GatheredRun) -> bool| Values {
        title,
        runs: group
            .runs
            .iter()
            .filter(|run| is(run))
            .map(|run| run.finished.temperature.clone())
            .collect(),
        every: 2,
    };
    let dispersed = |run: &GatheredRun| run.name() == Some(Structure::RandomDispersion);
    for group in groups {
        panels.push(panel(group.label.clone(), group, &|_| true));
    }
    for group in groups {
        let some = group.runs.iter().any(dispersed);
        if some && !group.runs.iter().all(dispersed) {
            let label = &group.label;
            panels.push(panel(
                format!("{label}, random dispersion"),
                group,
                &dispersed,
            ));
            panels.push(panel(format!("{label}, others"), group, &|run| {
                !dispersed(run)
            }));
        }
    }
    bands(name, ("time step", "temperature"), &panels)
}

fn best_fitness(name: Name, groups: &[&Group]) -> Result<Figure, FigureError> {
    let panels: Vec<Values> = groups
        .iter()
        .map(|group| Values {
            title: group.label.clone(),
            runs: group
                .runs
                .iter()
                .map(|run| run.finished.best_fitness.clone())
                .collect(),
            every: 1,
        })
        .collect();
    bands(name, ("generation", "best fitness"), &panels)
}

#[derive(Serialize)]
struct BandRow<'a> {
    panel: &'a str,
    at: usize,
    runs: usize,
    minimum: f64,
    lower_quartile: f64,
    median: f64,
    upper_quartile: f64,
    maximum: f64,
}

/// Draws medians with bands between the quartiles and between the minimum and the maximum.
fn bands(
    name: Name,
    (x, y): (&'static str, &'static str),
    values: &[Values],
) -> Result<Figure, FigureError> {
    let all = values
        .iter()
        .flat_map(|values| values.runs.iter().flatten());
    let (low, high) = all.fold((f64::MAX, f64::MIN), |(low, high), &value| {
        (low.min(value), high.max(value))
    });
    let y_range = if low < high {
        (low, high)
    } else {
        (low - 0.5, low + 0.5)
    };
    let mut rows = Vec::new();
    let mut panels = Vec::new();
    for values in values {
        let length = values.runs.iter().map(Vec::len).max().unwrap_or(0);
        let first = rows.len();
        for at in (0..length).step_by(values.every) {
            let of_runs = values.runs.iter().filter_map(|run| run.get(at).copied());
            let mut of_runs: Vec<f64> = of_runs.collect();
            of_runs.sort_by(f64::total_cmp);
            let [minimum, lower_quartile, median, upper_quartile, maximum] =
                [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| quantile(&of_runs, share));
            rows.push(BandRow {
                panel: &values.title,
                at,
                runs: of_runs.len(),
                minimum,
                lower_quartile,
                median,
                upper_quartile,
                maximum,
            });
        }
        let shown = &rows[first..];
        let band = |of: fn(&BandRow<'_>) -> (f64, f64)| {
            let band = shown.iter().map(move |row| {
                let (low, high) = of(row);
                (row.at as f64, low, high)
            });
            band.collect()
        };
        let chart = Chart {
            x,
            y,
            x_range: (-1.0, length as f64 + 1.0),
            y_range,
            decimals: 2,
            bands: vec![
                band(|row| (row.minimum, row.maximum)),
                band(|row| (row.lower_quartile, row.upper_quartile)),
            ],
            line: shown
                .iter()
                .map(|row| (row.at as f64, row.median))
                .collect(),
        };
        panels.push(Panel {
            title: values.title.clone(),
            content: Content::Chart(chart),
        });
    }
    name.figure(&panels, 2, &rows)
}
