//! Choice of the areas to damage: small rectangles that contain given numbers of robots.

use minimal_surprise_sim::{Grid, Pose};

/// Cells from x0 to x1 and from y0 to y1, inclusive, not wrapped around the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// Westernmost column.
    pub x0: u32,
    /// Southernmost row.
    pub y0: u32,
    /// Easternmost column.
    pub x1: u32,
    /// Northernmost row.
    pub y1: u32,
}

/// Prefix sums: sums over all rectangles that start at the south-west corner.
struct Sums {
    width: usize,
    sums: Vec<u32>,
}

impl Sums {
    fn of(grid: Grid, cells: &[bool]) -> Self {
        let (width, height) = (usize::from(grid.width()), usize::from(grid.height()));
        let mut sums = vec![0; (width + 1) * (height + 1)];
        let at = |x: usize, y: usize| y * (width + 1) + x;
        for y in 0..height {
            for x in 0..width {
                sums[at(x + 1, y + 1)] = sums[at(x, y + 1)] + sums[at(x + 1, y)] - sums[at(x, y)]
                    + u32::from(cells[y * width + x]);
            }
        }
        Self { width, sums }
    }

    fn within(&self, r: Rectangle) -> u32 {
        let at = |x: u32, y: u32| self.sums[y as usize * (self.width + 1) + x as usize];
        at(r.x1 + 1, r.y1 + 1) + at(r.x0, r.y0) - at(r.x0, r.y1 + 1) - at(r.x1 + 1, r.y0)
    }
}

/// Returns, for each of the numbers in order, the smallest rectangle that contains exactly this
/// number of robots and neither overlaps nor touches earlier rectangles; `None` if no rectangle
/// qualifies. Ties go to the southernmost corner, then the westernmost, then the flattest
/// rectangle.
#[must_use]
pub fn smallest_apart(grid: Grid, poses: &[Pose], numbers: &[u32]) -> Vec<Option<Rectangle>> {
    let mut robots = vec![false; grid.cells() as usize];
    for pose in poses {
        robots[grid.cell(pose.x, pose.y) as usize] = true;
    }
    let robots = Sums::of(grid, &robots);
    let mut taken = vec![false; grid.cells() as usize];
    numbers
        .iter()
        .map(|&number| {
            let found = smallest(grid, &robots, &Sums::of(grid, &taken), number)?;
            let Rectangle { x0, y0, x1, y1 } = found;
            for dx in 0..x1 - x0 + 3 {
                for dy in 0..y1 - y0 + 3 {
                    let (dx, dy) = (dx as i32 - 1, dy as i32 - 1);
                    let (x, y) = grid.moved(x0 as u16, y0 as u16, dx, dy);
                    taken[grid.cell(x, y) as usize] = true;
                }
            }
            Some(found)
        })
        .collect()
}

fn smallest(grid: Grid, robots: &Sums, taken: &Sums, number: u32) -> Option<Rectangle> {
    let (width, height) = (u32::from(grid.width()), u32::from(grid.height()));
    for cells in number.max(1)..=grid.cells() {
        let shapes: Vec<(u32, u32)> = (1..=height)
            .filter(|rows| cells % rows == 0 && cells / rows <= width)
            .map(|rows| (cells / rows, rows))
            .collect();
        if shapes.is_empty() {
            continue;
        }
        for y0 in 0..height {
            for x0 in 0..width {
                for &(columns, rows) in &shapes {
                    if x0 + columns > width || y0 + rows > height {
                        continue;
                    }
                    let rectangle = Rectangle {
                        x0,
                        y0,
                        x1: x0 + columns - 1,
                        y1: y0 + rows - 1,
                    };
                    if robots.within(rectangle) == number && taken.within(rectangle) == 0 {
                        return Some(rectangle);
                    }
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_sim::drawing::parse;

    fn found(drawing: &str, numbers: &[u32]) -> Vec<Option<(u32, u32, u32, u32)>> {
        let (grid, poses) = parse(drawing).unwrap();
        smallest_apart(grid, &poses, numbers)
            .into_iter()
            .map(|found| found.map(|r| (r.x0, r.y0, r.x1, r.y1)))
            .collect()
    }

    #[test]
    fn areas_are_small_southern_and_apart() {
        let drawing = "
            ▶▶···
            ▶▶···
            ·····
            ··▶▶▶
            ··▶▶▶";
        assert_eq!(found(drawing, &[2]), [Some((2, 0, 3, 0))]);
        assert_eq!(
            found(drawing, &[6, 4]),
            [Some((2, 0, 4, 1)), None],
            "the other four robots touch the first area across the edge"
        );
        assert_eq!(
            found(drawing, &[6, 2]),
            [Some((2, 0, 4, 1)), Some((0, 3, 1, 3))]
        );
        assert_eq!(found(drawing, &[11]), [None]);
    }
}
