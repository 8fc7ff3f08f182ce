//! `agent_trajectory`: a run, one line per robot and step.
//!
//! ```text
//! Gen: <generation>
//! Grid: <Lx>, <Ly>
//! Agents: <N>
//! <t>: <x>, <y>, <heading x>, <heading y>      N lines per step, t = 0, 1, …
//! ```
//!
//! The file does not contain the number of steps, so a text truncated between two steps cannot be
//! distinguished from a shorter run.

use super::{ExchangeError, Lines, Problem, grid_header, header, no_overlap, numbers, pose};
use crate::torus::{Grid, Pose};
use crate::trace::Trace;
use std::io;

/// The poses of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trajectory {
    generation: u32,
    grid: Grid,
    states: Vec<Vec<Pose>>,
}

const ROBOT: &str = "<t>: <x>, <y>, <heading x>, <heading y>";

impl Trajectory {
    /// Creates a trajectory from the poses of a trace.
    #[must_use]
    pub fn of_trace(generation: u32, grid: Grid, trace: &Trace) -> Self {
        let before = trace.steps.iter().map(|step| step.poses.clone());
        Self {
            generation,
            grid,
            states: before.chain([trace.final_poses.clone()]).collect(),
        }
    }

    /// Returns the generation given in the file.
    #[must_use]
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// Returns the grid.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Returns the swarm at t = 0, 1, …; at least one state.
    #[must_use]
    pub fn states(&self) -> &[Vec<Pose>] {
        &self.states
    }

    /// Returns the final state of the swarm.
    #[must_use]
    pub fn final_poses(&self) -> &[Pose] {
        self.states.last().map_or(&[], Vec::as_slice)
    }

    /// Returns the number of steps: one less than the number of states.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.states.len().saturating_sub(1) as u32
    }

    /// Parses the text of an `agent_trajectory` file.
    ///
    /// # Errors
    /// [`ExchangeError`] if a line is invalid; it contains the number of the first invalid line.
    pub fn read(text: &str) -> Result<Self, ExchangeError> {
        let mut lines = Lines::of(text);
        let (_, [generation]) = header(&mut lines, "Gen", "Gen: <generation>")?;
        let grid = grid_header(&mut lines)?;
        let (line, [robots]) = header::<u64, 1>(&mut lines, "Agents", "Agents: <N>")?;
        if robots == 0 || robots > grid.cells().into() {
            return Err(Problem::RobotsDoNotFit { robots, grid }.at(line));
        }
        let mut states = Vec::new();
        loop {
            states.push(read_state(&mut lines, grid, states.len() as u64, robots)?);
            lines.skip_blank();
            if !lines.text_follows() {
                return Ok(Self {
                    generation,
                    grid,
                    states,
                });
            }
        }
    }

    /// Writes the text of an `agent_trajectory` file.
    ///
    /// # Errors
    /// [`io::Error`] if writing fails.
    pub fn write(&self, out: &mut impl io::Write) -> io::Result<()> {
        writeln!(out, "Gen: {}", self.generation)?;
        writeln!(out, "Grid: {}, {}", self.grid.width(), self.grid.height())?;
        writeln!(out, "Agents: {}", self.final_poses().len())?;
        for (t, poses) in self.states.iter().enumerate() {
            for pose in poses {
                let (dx, dy) = pose.heading.ahead();
                writeln!(out, "{t}: {}, {}, {dx}, {dy}", pose.x, pose.y)?;
            }
        }
        Ok(())
    }
}

/// Reads the robots of one time step.
fn read_state(
    lines: &mut Lines,
    grid: Grid,
    expected: u64,
    robots: u64,
) -> Result<Vec<Pose>, ExchangeError> {
    let first = lines.next;
    let mut poses = Vec::new();
    for robot in 0..robots {
        let missing = || format!("robot {} of {robots} at t = {expected}", robot + 1);
        let (line, text) = lines.required(missing)?;
        let (found, rest) = text
            .split_once(':')
            .ok_or_else(|| super::unexpected(ROBOT, text).at(line))?;
        let found: u64 = super::number(line, found.trim())?;
        if found != expected {
            return Err(Problem::OtherStep { expected, found }.at(line));
        }
        let [x, y, ahead_x, ahead_y] = numbers(line, rest, ROBOT)?;
        poses.push(pose(line, grid, (x, y), (ahead_x, ahead_y))?);
    }
    no_overlap(grid, &poses, first)?;
    Ok(poses)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::parse;

    const TEXT: &str = "Gen: 3\nGrid: 4, 3\nAgents: 2\n\
        0: 3, 0, 1, 0\n0: 1, 2, 0, -1\n1: 0, 0, 1, 0\n1: 1, 2, -1, 0\n";

    fn problem(text: &str) -> (usize, Problem) {
        let error = Trajectory::read(text).unwrap_err();
        (error.line, error.problem)
    }

    #[test]
    fn a_trajectory_is_read_and_written_unchanged() {
        let trajectory = Trajectory::read(TEXT).unwrap();
        assert_eq!(trajectory.generation(), 3);
        assert_eq!(trajectory.steps(), 1);
        let (grid, mut poses) = parse("·▼··\n····\n···▶").unwrap();
        assert_eq!(trajectory.grid(), grid);
        assert_eq!(trajectory.states()[0], poses);
        poses = parse("·◀··\n····\n▶···").unwrap().1;
        assert_eq!(trajectory.final_poses(), poses);
        let mut written = Vec::new();
        trajectory.write(&mut written).unwrap();
        assert_eq!(String::from_utf8(written).unwrap(), TEXT);
    }

    #[test]
    fn a_robot_outside_the_grid_is_refused() {
        for (x, y) in [(4, 2), (1, 3), (-1, 2), (70_000, 0)] {
            let text = TEXT.replace("0: 1, 2, 0, -1", &format!("0: {x}, {y}, 0, -1"));
            let grid = Grid::new(4, 3).unwrap();
            assert_eq!(problem(&text), (5, Problem::OutsideGrid { x, y, grid }));
        }
    }

    #[test]
    fn robots_on_the_same_cell_are_refused() {
        let text = TEXT.replace("1: 1, 2, -1, 0", "1: 0, 0, -1, 0");
        let overlap = Problem::Overlap {
            x: 0,
            y: 0,
            other: 6,
        };
        assert_eq!(problem(&text), (7, overlap));
    }

    #[test]
    fn an_unknown_heading_is_refused() {
        for (x, y) in [(0, 0), (1, 1), (2, 0), (0, -2)] {
            let text = TEXT.replace("0: 1, 2, 0, -1", &format!("0: 1, 2, {x}, {y}"));
            assert_eq!(problem(&text), (5, Problem::UnknownHeading { x, y }));
        }
    }

    #[test]
    fn truncated_text_is_refused() {
        let ended = |missing: &str| Problem::Ended {
            missing: missing.into(),
        };
        assert_eq!(problem(""), (1, ended("`Gen: <generation>`")));
        assert_eq!(problem("Gen: 3\n"), (2, ended("`Grid: <Lx>, <Ly>`")));
        let cut = |until: &str| &TEXT[..TEXT.find(until).unwrap()];
        assert_eq!(problem(cut("0: 3")), (4, ended("robot 1 of 2 at t = 0")));
        assert_eq!(problem(cut("1: 1")), (7, ended("robot 2 of 2 at t = 1")));
        let expected = |found: &str| Problem::Expected {
            expected: ROBOT,
            found: found.into(),
        };
        assert_eq!(problem(cut(" -1, 0")), (7, expected("1, 2,")));
        assert_eq!(problem(cut(", -1, 0")), (7, expected("1, 2")));
        let minus = Problem::NotANumber { found: "-".into() };
        assert_eq!(problem(cut("1\n1: 0")), (5, minus));
    }

    #[test]
    fn robots_of_another_step_are_refused() {
        let text = TEXT.replace("1: 1, 2", "2: 1, 2");
        let other = Problem::OtherStep {
            expected: 1,
            found: 2,
        };
        assert_eq!(problem(&text), (7, other));
        let one_too_many = TEXT.replace("1: 0, 0, 1", "0: 0, 0, 1");
        let other = Problem::OtherStep {
            expected: 1,
            found: 0,
        };
        assert_eq!(problem(&one_too_many), (6, other));
    }

    #[test]
    fn wrong_headers_are_refused() {
        assert!(matches!(
            problem(&TEXT.replace("Gen: 3", "Fitness: 0.5")),
            (1, Problem::Expected { .. })
        ));
        assert!(matches!(
            problem(&TEXT.replace("Grid: 4, 3", "Grid: 2, 3")),
            (2, Problem::Grid(_))
        ));
        for robots in [0, 13, u64::MAX] {
            let text = TEXT.replace("Agents: 2", &format!("Agents: {robots}"));
            let grid = Grid::new(4, 3).unwrap();
            assert_eq!(
                problem(&text),
                (3, Problem::RobotsDoNotFit { robots, grid })
            );
        }
        assert!(matches!(
            problem(&TEXT.replace("Agents: 2", "Agents: two")),
            (3, Problem::NotANumber { .. })
        ));
    }
}
