//! `agents`: initial and final poses of the best genome of each generation.
//!
//! ```text
//! Gen: <generation>
//! Grid: <Lx>, <Ly>
//! Fitness: <fitness>
//! <x>, <y>, <start x>, <start y>, <heading x>, <heading y>, <start heading x>, <start heading y>, <type>
//! ⋮                                            one line per robot, then a blank line
//! ```
//!
//! This module ignores the type of a robot.

use super::{ExchangeError, Lines, Problem, grid_header, header, no_overlap, numbers, pose};
use crate::torus::{Grid, Pose};

/// The run that determined the fitness of the best genome of a generation.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentsOfGeneration {
    /// Index of the generation.
    pub generation: u32,
    /// The grid.
    pub grid: Grid,
    /// Fitness of the genome, 0 to 1, as written: six decimals.
    pub fitness: f64,
    /// Poses before the first step.
    pub starts: Vec<Pose>,
    /// Poses after the last step, with the robots in the same order.
    pub finals: Vec<Pose>,
}

const ROBOT: &str = "<x>, <y>, <start x>, <start y>, <heading x>, <heading y>, \
    <start heading x>, <start heading y>, <type>";

/// Parses the text of an `agents` file: one or more generations, in order.
///
/// # Errors
/// [`ExchangeError`] if a line is invalid; it contains the number of the first invalid line.
pub fn read_agents(text: &str) -> Result<Vec<AgentsOfGeneration>, ExchangeError> {
    let mut lines = Lines::of(text);
    let mut generations: Vec<AgentsOfGeneration> = Vec::new();
    loop {
        let agents = read_generation(&mut lines)?;
        if let Some(first) = generations.first()
            && first.starts.len() != agents.starts.len()
        {
            let (found, expected) = (agents.starts.len(), first.starts.len());
            return Err(Problem::OtherSwarmSize { found, expected }.at(lines.next));
        }
        generations.push(agents);
        lines.skip_blank();
        if !lines.text_follows() {
            return Ok(generations);
        }
    }
}

fn read_generation(lines: &mut Lines) -> Result<AgentsOfGeneration, ExchangeError> {
    let (_, [generation]) = header(lines, "Gen", "Gen: <generation>")?;
    let grid = grid_header(lines)?;
    let (line, [fitness]) = header::<f64, 1>(lines, "Fitness", "Fitness: <fitness>")?;
    if !fitness.is_finite() {
        let found = fitness.to_string();
        return Err(Problem::NotANumber { found }.at(line));
    }
    let first = lines.next;
    let (mut starts, mut finals) = (Vec::new(), Vec::new());
    while lines.text_follows() {
        let (line, text) = lines.required(String::new)?;
        let [
            x,
            y,
            start_x,
            start_y,
            ahead_x,
            ahead_y,
            start_ahead_x,
            start_ahead_y,
            _type,
        ] = numbers(line, text, ROBOT)?;
        finals.push(pose(line, grid, (x, y), (ahead_x, ahead_y))?);
        let start_ahead = (start_ahead_x, start_ahead_y);
        starts.push(pose(line, grid, (start_x, start_y), start_ahead)?);
    }
    if starts.is_empty() {
        return Err(Problem::Ended {
            missing: "the robots".into(),
        }
        .at(first));
    }
    no_overlap(grid, &starts, first)?;
    no_overlap(grid, &finals, first)?;
    Ok(AgentsOfGeneration {
        generation,
        grid,
        fitness,
        starts,
        finals,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::parse;

    const TEXT: &str = "Gen: 0\nGrid: 4, 3\nFitness: 0.523250 \n\
        0, 0, 3, 0, 1, 0, 1, 0, -1\n1, 2, 1, 2, -1, 0, 0, -1, -1\n\n\
        Gen: 1\nGrid: 4, 3\nFitness: 0.6 \n\
        0, 0, 3, 0, 1, 0, 1, 0, 1\n1, 2, 1, 2, -1, 0, 0, -1, 1\n\n";

    fn problem(text: &str) -> (usize, Problem) {
        let error = read_agents(text).unwrap_err();
        (error.line, error.problem)
    }

    #[test]
    fn starts_and_finals_of_every_generation_are_read() {
        let generations = read_agents(TEXT).unwrap();
        assert_eq!(generations.len(), 2);
        let first = &generations[0];
        assert_eq!((first.generation, first.fitness), (0, 0.52325));
        assert_eq!(first.starts, parse("·▼··\n····\n···▶").unwrap().1.clone());
        assert_eq!(first.finals, parse("·◀··\n····\n▶···").unwrap().1);
        assert_eq!(generations[1].generation, 1);
    }

    #[test]
    fn wrong_robots_are_refused_with_their_line() {
        let robot = "1, 2, 1, 2, -1, 0, 0, -1, -1";
        let second = |text: &str| problem(&TEXT.replacen(robot, text, 1));
        assert!(matches!(
            second("1, 3, 1, 2, -1, 0, 0, -1, -1"),
            (5, Problem::OutsideGrid { x: 1, y: 3, .. })
        ));
        assert!(matches!(
            second("1, 2, 1, 2, -1, 0, 1, -1, -1"),
            (5, Problem::UnknownHeading { x: 1, y: -1 })
        ));
        assert!(matches!(
            second("0, 0, 1, 2, -1, 0, 0, -1, -1"),
            (5, Problem::Overlap { other: 4, .. })
        ));
        assert!(matches!(
            second("1, 2, 3, 0, -1, 0, 0, -1, -1"),
            (5, Problem::Overlap { other: 4, .. })
        ));
        assert!(matches!(
            second("1, 2, 1, 2, -1, 0"),
            (5, Problem::Expected { .. })
        ));
        assert!(matches!(
            second("1, 2, 1, b, -1, 0, 0, -1, -1"),
            (5, Problem::NotANumber { .. })
        ));
    }

    #[test]
    fn truncated_text_is_refused() {
        let lines = |count: usize| TEXT.split_inclusive('\n').take(count).collect::<String>();
        for (count, line) in [(0, 1), (2, 3), (3, 4), (7, 8), (8, 9), (9, 10), (10, 11)] {
            let problem = problem(&lines(count));
            assert_eq!(problem.0, line, "{problem:?}");
        }
        assert_eq!(
            problem(&lines(10)).1,
            Problem::OtherSwarmSize {
                found: 1,
                expected: 2
            }
        );
    }
}
