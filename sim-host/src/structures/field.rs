//! The swarm as cells: the robot on each cell.

use crate::torus::{Grid, Heading, Pose};
use crate::world::{WorldError, check_poses};

/// Mark of a cell without a robot.
const EMPTY: u32 = u32::MAX;

/// A swarm that can be queried for the neighbours of a robot.
pub(super) struct Field<'a> {
    grid: Grid,
    poses: &'a [Pose],
    cells: Vec<u32>,
}

impl<'a> Field<'a> {
    pub(super) fn new(grid: Grid, poses: &'a [Pose]) -> Result<Self, WorldError> {
        check_poses(grid, poses)?;
        let mut cells = vec![EMPTY; grid.cells() as usize];
        for (robot, pose) in (0..).zip(poses) {
            cells[grid.cell(pose.x, pose.y) as usize] = robot;
        }
        Ok(Self { grid, poses, cells })
    }

    /// Returns the number of robots.
    pub(super) fn robots(&self) -> usize {
        self.poses.len()
    }

    /// Iterates over all robots, row by row from the south, each row from the west. This order
    /// depends only on the positions of the robots and keeps neighbours close together.
    pub(super) fn row_by_row(&self) -> impl Iterator<Item = u32> {
        self.cells.iter().copied().filter(|&robot| robot != EMPTY)
    }

    pub(super) fn heading(&self, robot: u32) -> Heading {
        self.poses[robot as usize].heading
    }

    /// Returns the robot on the cell at offset (dx, dy) from a robot, across the edges. The cell
    /// must be at most three cells away, which is the length of the shortest side.
    pub(super) fn near(&self, robot: u32, (dx, dy): (i32, i32)) -> Option<u32> {
        let Pose { x, y, .. } = self.poses[robot as usize];
        let x = wrapped(i32::from(x) + dx, self.grid.width());
        let y = wrapped(i32::from(y) + dy, self.grid.height());
        let found = self.cells[self.grid.cell(x, y) as usize];
        (found != EMPTY).then_some(found)
    }

    /// Returns true if the cell at offset (dx, dy) from a robot is occupied.
    pub(super) fn occupied(&self, robot: u32, offset: (i32, i32)) -> bool {
        self.near(robot, offset).is_some()
    }
}

/// Wraps a coordinate that is off the grid by at most one side.
fn wrapped(at: i32, side: u16) -> u16 {
    let side = i32::from(side);
    let on_torus = if at < 0 {
        at + side
    } else if at >= side {
        at - side
    } else {
        at
    };
    on_torus as u16
}

/// Offsets of the four orthogonal neighbours.
pub(super) const VON_NEUMANN: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Offsets of the eight surrounding cells, the orthogonal ones first.
pub(super) const MOORE: [(i32, i32); 8] = [
    (1, 0),
    (0, 1),
    (-1, 0),
    (0, -1),
    (1, 1),
    (-1, 1),
    (-1, -1),
    (1, -1),
];
