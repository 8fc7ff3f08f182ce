//! Pairs: two robots that face each other and therefore block each other.
//!
//! Neither robot is in a line, and on each side of the pair at most one of the two cells is
//! occupied (paper, Sec. 2.2). A pair may be part of a run that is not a line.

use super::field::Field;
use crate::torus::Heading;

/// Finds all pairs, each starting with its western or southern robot.
pub(super) fn find(field: &Field, in_line: &[bool]) -> Vec<[u32; 2]> {
    let free = |robot: u32| !in_line[robot as usize];
    field
        .row_by_row()
        .filter(|&robot| free(robot))
        .filter_map(|robot| {
            let (facing, side) = match field.heading(robot) {
                Heading::East => (Heading::West, (0, 1)),
                Heading::North => (Heading::South, (1, 0)),
                Heading::West | Heading::South => return None,
            };
            let other = field.near(robot, field.heading(robot).ahead())?;
            let pair = [robot, other];
            let side_is_full =
                |side| -> bool { pair.iter().all(|&robot| field.occupied(robot, side)) };
            let found = field.heading(other) == facing
                && free(other)
                && !side_is_full(side)
                && !side_is_full((-side.0, -side.1));
            found.then_some(pair)
        })
        .collect()
}
