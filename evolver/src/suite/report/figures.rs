//! The paper's figures as SVG, each with its data as CSV.
//!
//! In the report's page lines and letters have the colour of its text, so that a figure can be read
//! on a light and on a dark page; a file of its own is dark on white.

use super::gather::{Gathered, GatheredRun, Group, Resilient};
use super::numbers::{csv_text, plural};
use super::paper::PaperValues;
use super::statistics::quantile;
use minimal_surprise_sim::structures::{LineOrientation, Structure, classify};
use minimal_surprise_sim::{Grid, Heading, Pose};
use plotters::coord::Shift;
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::{
    ChartBuilder, Color, DrawingArea, IntoDrawingArea, IntoDynElement, PathElement, Polygon,
    RGBColor, Rectangle, SVGBackend, Text,
};
use serde::Serialize;

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files.
    pub id: String,
    /// Its number in the paper, if it is one of the paper's.
    pub number: Option<u32>,
    /// What it shows.
    pub title: String,
    /// The picture.
    pub svg: String,
    /// Its data.
    pub csv: String,
}

/// What is drawn of an experiment in the paper.
struct OfPaper {
    figure: u32,
    experiment: &'static str,
    label: &'static str,
    by: By,
}

/// What final states are shown one of each of.
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

impl Figure {
    /// The picture as a file of its own: dark on white, whatever the page that shows it is like.
    #[must_use]
    pub fn standalone(&self) -> String {
        let ground = "><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>";
        let on_ground = self.svg.replacen('>', ground, 1);
        on_ground.replace("currentColor", "#000000")
    }
}

/// A figure cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("figure {id}: {problem}")]
pub struct FigureError {
    id: String,
    problem: String,
}

const MEMBER: RGBColor = RGBColor(31, 119, 180);
const OTHER: RGBColor = RGBColor(140, 140, 140);
const MEDIAN: RGBColor = RGBColor(214, 39, 40);
const FONT: &str = "sans-serif";

/// All figures.
///
/// # Errors
/// [`FigureError`] names the figure.
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
                "Temperature over time: box plots at every even step, drawn as \
                 bands; extremes light, quartiles dark, medians red",
            ),
            &groups,
        )?);
        figures.push(best_fitness(
            name(
                6,
                "best",
                "Best fitness over generations; medians red, bands of quartiles and extremes grey",
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
    // In the paper's order; structures that it lacks stay in the suite's order.
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

/// Marks a run beyond the plan.
const BEYOND_PLAN: &str = "†";

/// What a figure is called.
struct Name {
    id: String,
    number: Option<u32>,
    title: String,
}

impl Name {
    /// With what the mark means, if it is there.
    fn explained(mut self, has_mark: bool) -> Self {
        if has_mark {
            self.title += &format!("; {BEYOND_PLAN} a run beyond the plan");
        }
        self
    }

    fn figure(self, svg: String, csv: String) -> Figure {
        let Self { id, number, title } = self;
        Figure {
            id,
            number,
            title,
            svg,
            csv,
        }
    }
}

/// The runs beyond the plan under a group's settings that have a structure that none of its own has.
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

/// The run of each structure (or way of lines) with the largest share in it, ties by seed.
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
    let title = format!("{}; robots in the structure are blue", name.title);
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
        "{prefix}removal of robots from {} of a {} on {grid}; robots in the structure are blue",
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

const CELL: i32 = 12;
const GAP: i32 = 22;

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
    let side = |cells: u16| i32::from(cells) * CELL;
    let panel_width = states
        .iter()
        .map(|s| side(s.grid.width()))
        .max()
        .unwrap_or(0)
        .max(180)
        + GAP;
    let panel_height = states
        .iter()
        .map(|s| side(s.grid.height()))
        .max()
        .unwrap_or(0)
        + 2 * GAP;
    let columns = columns.clamp(1, states.len().max(1));
    let lines = states.len().div_ceil(columns).max(1);
    let size = (
        panel_width * columns as i32 + GAP,
        panel_height * lines as i32,
    );
    let svg = draw(&name.id, size, |area| {
        for (index, state) in states.iter().enumerate() {
            let west = GAP / 2 + panel_width * (index % columns) as i32;
            let top = panel_height * (index / columns) as i32 + GAP;
            let found = classify(state.grid, state.poses).map_err(|error| error.to_string())?;
            text(area, &state.title, (west, top - 18), 14)?;
            let (width, height) = (side(state.grid.width()), side(state.grid.height()));
            let frame = [(west, top), (west + width, top + height)];
            put(area, Rectangle::new(frame, OTHER.stroke_width(1)))?;
            for (robot, pose) in state.poses.iter().enumerate() {
                let member = found.contains(state.structure, robot as u32);
                let x = west + i32::from(pose.x) * CELL + CELL / 2;
                let y = top + height - i32::from(pose.y) * CELL - CELL / 2;
                let colour = if member { MEMBER } else { OTHER };
                put(
                    area,
                    Polygon::new(
                        triangle((x, y), pose.heading, CELL / 2 - 1),
                        colour.filled(),
                    ),
                )?;
                rows.push(RobotRow {
                    state: &state.title,
                    robot,
                    x: pose.x,
                    y: pose.y,
                    heading: pose.heading.into(),
                    in_structure: member.into(),
                });
            }
            if let Some(cells) = state.area {
                let corner =
                    |x: u32, y: u32| (west + x as i32 * CELL, top + height - y as i32 * CELL);
                let frame = [
                    corner(cells.x0, cells.y1 + 1),
                    corner(cells.x1 + 1, cells.y0),
                ];
                put(area, Rectangle::new(frame, MEDIAN.stroke_width(2)))?;
            }
        }
        Ok(())
    })?;
    Ok(name.figure(svg, csv_of(&rows)))
}

/// A robot's triangle, its tip ahead.
fn triangle(middle: (i32, i32), heading: Heading, half: i32) -> Vec<(i32, i32)> {
    let (ahead_x, ahead_y) = heading.ahead();
    // On the screen y grows down.
    let at = |ahead: i32, left: i32| {
        (
            middle.0 + ahead * ahead_x - left * ahead_y,
            middle.1 - ahead * ahead_y - left * ahead_x,
        )
    };
    vec![at(half, 0), at(-half, half), at(-half, -half)]
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
    const SIDE: i32 = 40;
    const PANEL: i32 = 250;
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
    let columns = shown.len().clamp(1, 4) as i32;
    let lines = (shown.len() as i32 + columns - 1) / columns;
    let svg = draw(
        &name.id,
        (PANEL * columns, (PANEL + GAP) * lines.max(1)),
        |area| {
            for (index, (_, shown, group, run)) in shown.iter().enumerate() {
                let middle_x = PANEL * (index as i32 % columns) + PANEL / 2;
                let middle_y = (PANEL + GAP) * (index as i32 / columns) + GAP + PANEL / 2;
                text(
                    area,
                    shown,
                    (middle_x - 3 * SIDE + 20, middle_y - PANEL / 2 - 12),
                    14,
                )?;
                let robot = triangle((middle_x, middle_y), Heading::North, SIDE / 3);
                put(area, Polygon::new(robot, OTHER.filled()))?;
                let cells = group.settings.topology().model().cells();
                for (sensor, (cell, &average)) in cells
                    .iter()
                    .zip(&run.finished.average_prediction)
                    .enumerate()
                {
                    let x = middle_x - i32::from(cell.left) * SIDE;
                    let y = middle_y - i32::from(cell.ahead) * SIDE;
                    let half = SIDE / 2 - 1;
                    let corners = [(x - half, y - half), (x + half, y + half)];
                    put(
                        area,
                        Rectangle::new(corners, MEMBER.mix(0.7 * average).filled()),
                    )?;
                    put(area, Rectangle::new(corners, OTHER.stroke_width(1)))?;
                    text(area, &format!("{average:.2}"), (x - 13, y - 7), 13)?;
                    rows.push(PredictionRow {
                        state: shown,
                        sensor,
                        ahead: cell.ahead,
                        left: cell.left,
                        average_prediction: average,
                    });
                }
            }
            Ok(())
        },
    )?;
    Ok(name.figure(svg, csv_of(&rows)))
}

/// Runs whose values are shown together over time.
struct Panel {
    title: String,
    /// Of each run, its values.
    runs: Vec<Vec<f64>>,
    /// Every *k*-th value is shown.
    every: usize,
}

fn temperature(name: Name, groups: &[&Group]) -> Result<Figure, FigureError> {
    let mut panels = Vec::new();
    let panel = |title: String, group: &Group, is: &dyn Fn(&GatheredRun) -> bool| Panel {
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
    let panels: Vec<Panel> = groups
        .iter()
        .map(|group| Panel {
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

/// Medians with bands from quartile to quartile and from the least to the largest value.
fn bands(
    name: Name,
    (x_name, y_name): (&str, &str),
    panels: &[Panel],
) -> Result<Figure, FigureError> {
    const WIDTH: i32 = 620;
    const HEIGHT: i32 = 300;
    let columns = panels.len().clamp(1, 2);
    let lines = panels.len().div_ceil(columns).max(1);
    let values = panels
        .iter()
        .flat_map(|panel| panel.runs.iter().flatten().copied());
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let (low, high) = if low < high {
        (low, high)
    } else {
        (low - 0.5, low + 0.5)
    };
    let mut rows = Vec::new();
    let size = (WIDTH * columns as i32, HEIGHT * lines as i32);
    let svg = draw(&name.id, size, |root| {
        for (area, panel) in root.split_evenly((lines, columns)).iter().zip(panels) {
            let length = panel.runs.iter().map(Vec::len).max().unwrap_or(0);
            let mut chart = ChartBuilder::on(area)
                .caption(&panel.title, (FONT, 15))
                .margin(6)
                .margin_right(14)
                .x_label_area_size(34)
                .y_label_area_size(46)
                .build_cartesian_2d(-1.0..length as f64 + 1.0, low..high)
                .map_err(|error| error.to_string())?;
            chart
                .configure_mesh()
                .disable_mesh()
                .x_labels(6)
                .y_labels(6)
                .x_desc(x_name)
                .y_desc(y_name)
                .x_label_formatter(&|x| format!("{x:.0}"))
                .y_label_formatter(&|y| format!("{y:.2}"))
                .label_style((FONT, 12))
                .axis_desc_style((FONT, 13))
                .draw()
                .map_err(|error| error.to_string())?;
            let first = rows.len();
            for at in (0..length).step_by(panel.every) {
                let mut values: Vec<f64> = panel
                    .runs
                    .iter()
                    .filter_map(|run| run.get(at).copied())
                    .collect();
                values.sort_by(f64::total_cmp);
                let [minimum, lower_quartile, median, upper_quartile, maximum] =
                    [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| quantile(&values, share));
                rows.push(BandRow {
                    panel: &panel.title,
                    at,
                    runs: values.len(),
                    minimum,
                    lower_quartile,
                    median,
                    upper_quartile,
                    maximum,
                });
            }
            let rows = &rows[first..];
            let line = |of: fn(&BandRow<'_>) -> f64| rows.iter().map(move |r| (r.at as f64, of(r)));
            let band = |low, high, share| {
                let corners: Vec<_> = line(low).chain(line(high).rev()).collect();
                Polygon::new(corners, OTHER.mix(share).filled()).into_dyn()
            };
            let median = line(|row| row.median).collect::<Vec<_>>();
            let shapes = [
                band(|row| row.minimum, |row| row.maximum, 0.25),
                band(|row| row.lower_quartile, |row| row.upper_quartile, 0.5),
                PathElement::new(median, MEDIAN.stroke_width(2)).into_dyn(),
            ];
            chart
                .draw_series(shapes)
                .map_err(|error| error.to_string())?;
        }
        Ok(())
    })?;
    Ok(name.figure(svg, csv_of(&rows)))
}

type Paper<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// An SVG whose black is the colour of the text around it.
fn draw(
    id: &str,
    size: (i32, i32),
    onto: impl FnOnce(&Paper<'_>) -> Result<(), String>,
) -> Result<String, FigureError> {
    let mut svg = String::new();
    let size = (size.0.max(1) as u32, size.1.max(1) as u32);
    let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = onto(&area).and_then(|()| area.present().map_err(|error| error.to_string()));
    drop(area);
    match drawn {
        Ok(()) => Ok(svg.replace("#000000", "currentColor")),
        Err(problem) => Err(FigureError {
            id: id.to_owned(),
            problem,
        }),
    }
}

fn put<'a, E>(area: &Paper<'a>, element: E) -> Result<(), String>
where
    for<'b> &'b E: PointCollection<'b, (i32, i32)>,
    E: Drawable<SVGBackend<'a>>,
{
    area.draw(&element).map_err(|error| error.to_string())
}

fn text(area: &Paper<'_>, words: &str, at: (i32, i32), size: i32) -> Result<(), String> {
    put(area, Text::new(words.to_owned(), at, (FONT, size)))
}

fn csv_of(rows: &[impl Serialize]) -> String {
    csv_text(rows)
}
