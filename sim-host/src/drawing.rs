//! Swarms drawn as text: one character per cell, north at the top.

use crate::torus::{Grid, Heading, Pose};

/// Returns the arrow that stands for a heading.
#[must_use]
pub fn arrow(heading: Heading) -> char {
    match heading {
        Heading::East => '▶',
        Heading::North => '▲',
        Heading::West => '◀',
        Heading::South => '▼',
    }
}

/// Returns the hollow arrow that stands for a heading, for robots that are not highlighted.
#[must_use]
pub fn hollow_arrow(heading: Heading) -> char {
    match heading {
        Heading::East => '▷',
        Heading::North => '△',
        Heading::West => '◁',
        Heading::South => '▽',
    }
}

/// Character of an empty cell.
pub const EMPTY: char = '·';

/// Draws a swarm, one line per row, northernmost row first.
#[must_use]
pub fn draw(grid: Grid, poses: &[Pose]) -> String {
    draw_members(grid, poses, |_| true)
}

/// Draws a swarm like [`draw`], with filled arrows for members of a structure and hollow arrows for
/// all other robots.
#[must_use]
pub fn draw_members(grid: Grid, poses: &[Pose], is_member: impl Fn(u32) -> bool) -> String {
    let width = usize::from(grid.width());
    let mut cells = vec![EMPTY; grid.cells() as usize];
    for (robot, pose) in (0..).zip(poses) {
        cells[grid.cell(pose.x, pose.y) as usize] = if is_member(robot) {
            arrow(pose.heading)
        } else {
            hollow_arrow(pose.heading)
        };
    }
    let rows: Vec<String> = cells.chunks(width).rev().map(String::from_iter).collect();
    rows.join("\n")
}

/// Reason why the drawing does not describe a swarm.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DrawingError {
    /// The rows have different lengths.
    #[error("line {line} has {found} cells, but the first row has {expected}")]
    UnevenRows {
        /// Line number in the text, counted from 1.
        line: usize,
        /// Number of cells in the line.
        found: usize,
        /// Number of cells in the first row.
        expected: usize,
    },
    /// The drawing contains a character that is neither an arrow nor an empty cell.
    #[error("line {line}: {found:?}; cells are ▶ ▲ ◀ ▼, hollow ▷ △ ◁ ▽, or ·")]
    UnknownCharacter {
        /// Line number in the text, counted from 1.
        line: usize,
        /// The character.
        found: char,
    },
    /// The drawing is too small or too large for a grid.
    #[error(transparent)]
    Grid(#[from] crate::torus::GridError),
}

/// Parses a drawing; returns the grid, and the poses row by row from the south, each row from the
/// west. Both filled and hollow arrows stand for robots; spaces and empty lines are skipped.
///
/// # Errors
/// [`DrawingError`] if the rows differ in length, a character is unknown or the grid is invalid.
pub fn parse(drawing: &str) -> Result<(Grid, Vec<Pose>), DrawingError> {
    let mut rows: Vec<(usize, Vec<Option<Heading>>)> = Vec::new();
    for (line, text) in (1..).zip(drawing.lines()) {
        let cells = text
            .chars()
            .filter(|cell| !cell.is_whitespace())
            .map(|found| cell(found).ok_or(DrawingError::UnknownCharacter { line, found }))
            .collect::<Result<Vec<_>, _>>()?;
        if !cells.is_empty() {
            rows.push((line, cells));
        }
    }
    let expected = rows.first().map_or(0, |(_, cells)| cells.len());
    let grid = Grid::new(expected as u32, rows.len() as u32)?;
    let mut poses = Vec::new();
    for (y, (line, cells)) in (0..).zip(rows.into_iter().rev()) {
        if cells.len() != expected {
            return Err(DrawingError::UnevenRows {
                line,
                found: cells.len(),
                expected,
            });
        }
        for (x, heading) in (0..).zip(cells) {
            poses.extend(heading.map(|heading| Pose { x, y, heading }));
        }
    }
    Ok((grid, poses))
}

/// Returns the heading of the robot that a character stands for, or `Some(None)` for an empty cell;
/// `None` if the character is not a cell.
fn cell(drawn: char) -> Option<Option<Heading>> {
    let of = |heading: &Heading| arrow(*heading) == drawn || hollow_arrow(*heading) == drawn;
    match Heading::ALL.into_iter().find(of) {
        None if drawn != EMPTY => None,
        heading => Some(heading),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_is_read_back_unchanged() {
        let drawing = "▶··\n·▲◀\n··▼\n···";
        let (grid, poses) = parse(drawing).unwrap();
        assert_eq!((grid.width(), grid.height()), (3, 4));
        assert_eq!((poses[0].x, poses[0].y), (2, 1));
        assert_eq!(draw(grid, &poses), drawing);
    }

    #[test]
    fn robots_that_are_not_members_are_drawn_hollow() {
        let (grid, poses) = parse("▶▲·\n··◀\n▼··").unwrap();
        let drawing = draw_members(grid, &poses, |robot| robot % 2 == 0);
        assert_eq!(drawing, "▶△·\n··◁\n▼··");
        let nobody = draw_members(grid, &poses, |_| false);
        assert_eq!(nobody, "▷△·\n··◁\n▽··");
    }

    #[test]
    fn drawings_with_spaces_and_hollow_arrows_are_read_too() {
        let (grid, poses) = parse("  ▶ · △\n\n  · ▼ ·\n  ◁ · ·\n").unwrap();
        assert_eq!(draw(grid, &poses), "▶·▲\n·▼·\n◀··");
    }

    #[test]
    fn uneven_rows_unknown_characters_and_small_grids_are_refused() {
        assert!(matches!(
            parse("···\n··\n···"),
            Err(DrawingError::UnevenRows { line: 2, .. })
        ));
        assert!(matches!(
            parse("···\n·x·\n···"),
            Err(DrawingError::UnknownCharacter {
                line: 2,
                found: 'x'
            })
        ));
        assert!(matches!(parse(""), Err(DrawingError::Grid(_))));
    }
}
