//! The text files of the program published by the paper's authors. This crate can read their data,
//! and their analysis scripts can read the files written by this crate.
//!
//! | file | module |
//! |---|---|
//! | `agent_trajectory` | [`trajectory`]: poses of every step of one run, read and written |
//! | `agents` | [`agents`]: starting and final poses of the best genome of each generation, read |
//! | `action_genomes`, `prediction_genomes` | [`genomes`]: weights of the best genome of each generation, read |
//!
//! Numbers are separated by commas and spaces. A heading is given as the step ahead: `1, 0` is
//! east, `0, 1` north, `-1, 0` west, `0, -1` south. Blank lines at the end and spaces around lines
//! are allowed; any other deviation is rejected with its line number.

pub mod agents;
pub mod genomes;
pub mod trajectory;

pub use agents::{AgentsOfGeneration, read_agents};
pub use genomes::{
    GenomeRows, ImportError, ImportedGenome, NetworkName, RowsOfText, SaturatedWeight, generations,
    import_genome, read_genomes,
};
pub use trajectory::Trajectory;

use crate::torus::{Grid, GridError, Heading, Pose};
use crate::world::{WorldError, check_poses};
use core::str::FromStr;

/// An error in an input text, with its line number.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct ExchangeError {
    /// Line number, counted from 1.
    pub line: usize,
    /// The problem in the line.
    pub problem: Problem,
}

/// An error in a line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// A different line was expected.
    #[error("expected `{expected}`, found {found:?}")]
    Expected {
        /// Form of the line.
        expected: &'static str,
        /// The line, shortened.
        found: String,
    },
    /// The text ends too early.
    #[error("the text ends before {missing}")]
    Ended {
        /// The missing part of the text.
        missing: String,
    },
    /// A field is not a number.
    #[error("{found:?} is not a finite number")]
    NotANumber {
        /// The text found.
        found: String,
    },
    /// The grid is not valid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The number of robots is 0 or exceeds the number of cells.
    #[error("{robots} robots on a {grid} grid; from 1 to {} fit", grid.cells())]
    RobotsDoNotFit {
        /// Number of robots.
        robots: u64,
        /// The grid.
        grid: Grid,
    },
    /// The number of robots changes from one generation to the next.
    #[error("{found} robots, but {expected} in the earlier generations")]
    OtherSwarmSize {
        /// Number of robots of the generation that ends here.
        found: usize,
        /// Number of robots of the earlier generations.
        expected: usize,
    },
    /// The line belongs to a different time step.
    #[error("a robot of t = {found}; expected t = {expected}")]
    OtherStep {
        /// The time step expected.
        expected: u64,
        /// The time step found.
        found: u64,
    },
    /// A robot is outside the grid.
    #[error("a robot at ({x}, {y}), outside the {grid} grid")]
    OutsideGrid {
        /// The x coordinate of the robot.
        x: i64,
        /// The y coordinate of the robot.
        y: i64,
        /// The grid.
        grid: Grid,
    },
    /// Two robots share a cell.
    #[error("a robot at ({x}, {y}), which the robot of line {other} already occupies")]
    Overlap {
        /// The x coordinate of both robots.
        x: u16,
        /// The y coordinate of both robots.
        y: u16,
        /// Line number of the robot that occupies the cell already.
        other: usize,
    },
    /// The heading is not one of the four directions.
    #[error("heading ({x}, {y}); headings are (1, 0), (0, 1), (-1, 0) and (0, -1)")]
    UnknownHeading {
        /// The x component of the heading.
        x: i64,
        /// The y component of the heading.
        y: i64,
    },
}

impl Problem {
    fn at(self, line: usize) -> ExchangeError {
        ExchangeError {
            line,
            problem: self,
        }
    }
}

/// The lines of a text, numbered from 1, without white space around them.
struct Lines<'a> {
    lines: core::iter::Peekable<core::iter::Enumerate<core::str::Lines<'a>>>,
    next: usize,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        Self {
            lines: text.lines().enumerate().peekable(),
            next: 1,
        }
    }

    /// Returns the next line and its number.
    fn next(&mut self) -> Option<(usize, &'a str)> {
        let (index, text) = self.lines.next()?;
        self.next = index + 2;
        Some((index + 1, text.trim()))
    }

    /// Returns the next line, which must exist.
    fn required(
        &mut self,
        missing: impl FnOnce() -> String,
    ) -> Result<(usize, &'a str), ExchangeError> {
        let line = self.next;
        self.next()
            .ok_or_else(|| Problem::Ended { missing: missing() }.at(line))
    }

    /// Returns true if a line with text follows.
    fn text_follows(&mut self) -> bool {
        self.lines
            .peek()
            .is_some_and(|(_, text)| !text.trim().is_empty())
    }

    fn skip_blank(&mut self) {
        while self.lines.peek().is_some() && !self.text_follows() {
            self.next();
        }
    }
}

/// Parses the numbers of a line of the form `<name>: <number>, …`.
fn header<T: FromStr, const N: usize>(
    lines: &mut Lines,
    name: &str,
    expected: &'static str,
) -> Result<(usize, [T; N]), ExchangeError> {
    let (line, text) = lines.required(|| format!("`{expected}`"))?;
    let rest = text
        .strip_prefix(name)
        .and_then(|text| text.strip_prefix(':'));
    let numbers = rest.map(|rest| numbers(line, rest, expected));
    let numbers = numbers.ok_or_else(|| unexpected(expected, text).at(line))??;
    Ok((line, numbers))
}

/// Parses the grid of a line `Grid: <Lx>, <Ly>`.
fn grid_header(lines: &mut Lines) -> Result<Grid, ExchangeError> {
    let (line, [width, height]) = header(lines, "Grid", "Grid: <Lx>, <Ly>")?;
    Grid::new(width, height).map_err(|error| Problem::from(error).at(line))
}

/// Parses exactly N numbers, separated by commas.
fn numbers<T: FromStr, const N: usize>(
    line: usize,
    text: &str,
    expected: &'static str,
) -> Result<[T; N], ExchangeError> {
    let mut parsed = Vec::with_capacity(N);
    for field in text.split(',').map(str::trim) {
        if parsed.len() == N || field.is_empty() {
            return Err(unexpected(expected, text).at(line));
        }
        parsed.push(number(line, field)?);
    }
    parsed
        .try_into()
        .map_err(|_| unexpected(expected, text).at(line))
}

fn number<T: FromStr>(line: usize, field: &str) -> Result<T, ExchangeError> {
    field.parse().map_err(|_| {
        Problem::NotANumber {
            found: shortened(field),
        }
        .at(line)
    })
}

fn unexpected(expected: &'static str, found: &str) -> Problem {
    Problem::Expected {
        expected,
        found: shortened(found.trim()),
    }
}

/// Returns the start of a text, for a one-line message.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Creates a pose from its numbers.
fn pose(line: usize, grid: Grid, at: (i64, i64), ahead: (i64, i64)) -> Result<Pose, ExchangeError> {
    let (x, y) = at;
    let on_side = |at: i64, side: u16| (0..i64::from(side)).contains(&at);
    if !on_side(x, grid.width()) || !on_side(y, grid.height()) {
        return Err(Problem::OutsideGrid { x, y, grid }.at(line));
    }
    let heading = Heading::ALL.into_iter().find(|heading| {
        let (dx, dy) = heading.ahead();
        (i64::from(dx), i64::from(dy)) == ahead
    });
    let (ahead_x, ahead_y) = ahead;
    Ok(Pose {
        x: x as u16,
        y: y as u16,
        heading: heading.ok_or_else(|| {
            Problem::UnknownHeading {
                x: ahead_x,
                y: ahead_y,
            }
            .at(line)
        })?,
    })
}

/// Checks that no two robots share a cell. Robot 0 is on line `first`, the others on the lines that
/// follow.
fn no_overlap(grid: Grid, poses: &[Pose], first: usize) -> Result<(), ExchangeError> {
    check_poses(grid, poses).map_err(|error| match error {
        WorldError::Overlap { robot, other, x, y } => Problem::Overlap {
            x,
            y,
            other: first + other,
        }
        .at(first + robot),
        WorldError::OutsideGrid { robot, x, y, grid } => Problem::OutsideGrid {
            x: x.into(),
            y: y.into(),
            grid,
        }
        .at(first + robot),
    })
}
