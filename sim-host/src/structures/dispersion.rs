//! Dispersion: squares, triangular lattices, and robots that are dispersed at random.
//!
//! Headings do not matter. Patterns are matched on the torus: on a grid smaller than a pattern,
//! several positions of the pattern fall on the same cell, which must then satisfy all of them. If
//! a side of the grid is three cells long, no pattern is possible.

use super::field::{Field, MOORE};

/// Corners of a square, relative to its south-western robot.
const CORNERS: [(i32, i32); 4] = [(0, 0), (2, 0), (0, 2), (2, 2)];

/// Occupied cells around the centre of a triangular lattice.
const LATTICE_OCCUPIED: [(i32, i32); 8] = [
    (2, 0),
    (-2, 0),
    (0, 2),
    (0, -2),
    (1, 1),
    (1, -1),
    (-1, 1),
    (-1, -1),
];

/// Empty cells around the centre of a triangular lattice.
const LATTICE_EMPTY: [(i32, i32); 12] = [
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 2),
    (1, -2),
    (-1, 2),
    (-1, -2),
    (2, 1),
    (2, -1),
    (-2, 1),
    (-2, -1),
];

/// Returns whether each robot is in a square: the corners of a 3 × 3 block are occupied, and the
/// other 21 cells of the 5 × 5 block around it are empty.
pub(super) fn in_squares(field: &Field) -> Vec<bool> {
    let mut members = vec![false; field.robots()];
    for robot in field.row_by_row() {
        let block = (-1..=3).flat_map(|dy| (-1..=3).map(move |dx| (dx, dy)));
        let as_asked = |offset| field.occupied(robot, offset) == CORNERS.contains(&offset);
        if CORNERS.iter().all(|&offset| field.occupied(robot, offset))
            && block.into_iter().all(as_asked)
        {
            mark(&mut members, field, robot, &CORNERS);
        }
    }
    members
}

/// Returns whether each robot is in a triangular lattice, as a centre or as one of the eight robots
/// around a centre.
pub(super) fn in_triangular_lattices(field: &Field) -> Vec<bool> {
    let mut members = vec![false; field.robots()];
    for robot in field.row_by_row() {
        let occupied = |&offset: &(i32, i32)| field.occupied(robot, offset);
        if LATTICE_OCCUPIED.iter().all(occupied) && !LATTICE_EMPTY.iter().any(occupied) {
            members[robot as usize] = true;
            mark(&mut members, field, robot, &LATTICE_OCCUPIED);
        }
    }
    members
}

/// Returns whether each robot has at most one Moore neighbour and is not `excluded`.
pub(super) fn randomly_dispersed(field: &Field, excluded: impl Fn(u32) -> bool) -> Vec<bool> {
    let mut members = vec![false; field.robots()];
    for robot in field.row_by_row() {
        let neighbours = MOORE.iter().filter(|&&o| field.occupied(robot, o)).count();
        members[robot as usize] = neighbours <= 1 && !excluded(robot);
    }
    members
}

fn mark(members: &mut [bool], field: &Field, robot: u32, offsets: &[(i32, i32)]) {
    for &offset in offsets {
        if let Some(member) = field.near(robot, offset) {
            members[member as usize] = true;
        }
    }
}
