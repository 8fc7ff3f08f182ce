//! Lines: robots in a row that hold each other in place.
//!
//! Along an axis, take a maximal run of neighbouring robots whose headings are on that axis, and
//! remove the outward-pointing robots at both ends of the run. The rest is a line if it has at
//! least [`LENGTH_MIN`] robots and no two adjacent cells beside it, on the same side, are both
//! occupied. A run around the whole torus has no ends (paper, Sec. 2.2, rules 1 to 3).
//!
//! The paper also requires the number of neighbours on a side to be at most half the length. At
//! most ⌈n/2⌉ of n cells in a row are non-adjacent, so this is always the case.

use super::field::Field;
use crate::torus::Heading;

/// Minimum number of robots of a line.
pub const LENGTH_MIN: usize = 3;

/// Direction of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Axis {
    /// From west to east.
    Horizontal,
    /// From south to north.
    Vertical,
}

impl Axis {
    /// Every axis, in order.
    pub const ALL: [Self; 2] = [Self::Horizontal, Self::Vertical];

    /// Returns the heading along the axis; the other heading on the axis is its reverse.
    fn forward(self) -> Heading {
        match self {
            Self::Horizontal => Heading::East,
            Self::Vertical => Heading::North,
        }
    }

    fn backward(self) -> Heading {
        match self {
            Self::Horizontal => Heading::West,
            Self::Vertical => Heading::South,
        }
    }

    fn has(self, heading: Heading) -> bool {
        heading == self.forward() || heading == self.backward()
    }
}

/// One line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Direction of the line.
    pub axis: Axis,
    /// Robots of the line, in order along the axis.
    pub robots: Vec<u32>,
    /// True if the line runs around the whole torus.
    pub spanning: bool,
}

/// Numbers of lines by direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounts {
    /// Number of lines from west to east.
    pub horizontal: u32,
    /// Number of lines from south to north.
    pub vertical: u32,
    /// Number of lines around the whole torus, in either direction.
    pub spanning: u32,
}

/// The direction of most lines of a swarm (paper, Sec. 3.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineOrientation {
    /// More than two thirds of the lines are horizontal.
    MostlyHorizontal,
    /// More than two thirds of the lines are vertical.
    MostlyVertical,
    /// Neither direction has more than two thirds of the lines.
    MazeLike,
}

impl LineOrientation {
    /// Every orientation, in order.
    pub const ALL: [Self; 3] = [Self::MostlyHorizontal, Self::MostlyVertical, Self::MazeLike];

    /// Returns the name used in files and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MostlyHorizontal => "mostly horizontal",
            Self::MostlyVertical => "mostly vertical",
            Self::MazeLike => "maze-like",
        }
    }

    /// Returns the orientation that a genome forms from many starts: the orientation of more than
    /// half of the runs; otherwise `None` (the paper's *diverse*). Runs without lines are counted
    /// too.
    #[must_use]
    pub fn of_most(runs: &[Option<Self>]) -> Option<Self> {
        Self::ALL.into_iter().find(|&orientation| {
            let formed = runs.iter().filter(|&&run| run == Some(orientation));
            2 * formed.count() > runs.len()
        })
    }
}

impl LineCounts {
    pub(super) fn of(lines: &[Line]) -> Self {
        let mut counts = Self::default();
        for line in lines {
            match line.axis {
                Axis::Horizontal => counts.horizontal += 1,
                Axis::Vertical => counts.vertical += 1,
            }
            counts.spanning += u32::from(line.spanning);
        }
        counts
    }

    /// Returns the number of lines in both directions.
    #[must_use]
    pub fn total(self) -> u32 {
        self.horizontal + self.vertical
    }

    /// Returns the direction of most lines; `None` without lines.
    #[must_use]
    pub fn orientation(self) -> Option<LineOrientation> {
        if self.total() == 0 {
            None
        } else if 3 * self.horizontal > 2 * self.total() {
            Some(LineOrientation::MostlyHorizontal)
        } else if 3 * self.vertical > 2 * self.total() {
            Some(LineOrientation::MostlyVertical)
        } else {
            Some(LineOrientation::MazeLike)
        }
    }
}

/// Finds all lines: first the horizontal lines, then the vertical lines.
pub(super) fn find(field: &Field) -> Vec<Line> {
    let mut lines = Vec::new();
    let mut seen = vec![false; field.robots()];
    for axis in Axis::ALL {
        let mut add = |run: &[u32], ring: bool| {
            let robots = if ring {
                run
            } else {
                without_outward(field, axis, run)
            };
            if robots.len() >= LENGTH_MIN && sides_are_free(field, axis, robots, ring) {
                lines.push(Line {
                    axis,
                    robots: robots.to_vec(),
                    spanning: ring,
                });
            }
        };
        let behind = axis.backward().ahead();
        let on_axis = |robot: &u32| axis.has(field.heading(*robot));
        let mut run = Vec::new();
        for first in field.row_by_row().filter(on_axis) {
            if field
                .near(first, behind)
                .is_none_or(|robot| !on_axis(&robot))
            {
                follow(field, axis, first, &mut seen, &mut run);
                add(&run, false);
            }
        }
        // A run without a first robot goes around the torus.
        for first in field.row_by_row().filter(on_axis) {
            if !seen[first as usize] {
                follow(field, axis, first, &mut seen, &mut run);
                add(&run, true);
            }
        }
    }
    lines
}

/// Fills `run` with the robots on the axis, starting at `first`, up to a gap or back to `first`.
fn follow(field: &Field, axis: Axis, first: u32, seen: &mut [bool], run: &mut Vec<u32>) {
    run.clear();
    let mut next = Some(first);
    while let Some(robot) = next {
        seen[robot as usize] = true;
        run.push(robot);
        next = field
            .near(robot, axis.forward().ahead())
            .filter(|&robot| axis.has(field.heading(robot)) && robot != first);
    }
}

/// Returns the run without the outward-pointing robots at its ends.
fn without_outward<'a>(field: &Field, axis: Axis, run: &'a [u32]) -> &'a [u32] {
    let points = |heading| move |&robot: &u32| field.heading(robot) == heading;
    let first = run.iter().position(points(axis.forward()));
    let last = run.iter().rposition(points(axis.backward()));
    match (first, last) {
        (Some(first), Some(last)) if first < last => &run[first..=last],
        _ => &[],
    }
}

/// Returns true if no two adjacent cells on the same side of the line are occupied.
fn sides_are_free(field: &Field, axis: Axis, line: &[u32], ring: bool) -> bool {
    let (dx, dy) = axis.forward().ahead();
    [(dy, dx), (-dy, -dx)].into_iter().all(|side| {
        let beside = |&robot: &u32| field.occupied(robot, side);
        let closed = ring && line.first().is_some_and(beside) && line.last().is_some_and(beside);
        !closed && !line.windows(2).any(|two| two.iter().all(beside))
    })
}
