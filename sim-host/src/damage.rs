//! Damage: the robots in a rectangle are removed or repositioned, and the run continues (paper,
//! Sec. 3.4, Algs. 1 and 2).
//!
//! The run after the damage is an ordinary run of T steps: network states, last actions and
//! predictions are reset. So [`Damage::trial`] returns a scenario and a trial for
//! [`run`](crate::evaluation::run).

use crate::noise::NoiseStream;
use crate::scenario::{Scenario, ScenarioError, Trial, random_poses_among};
use crate::seed::{Purpose, SeedTree, Stream};
use crate::torus::{Grid, Pose};
use crate::world::{WorldError, check_poses};

/// A rectangle of cells on a torus, including its corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Area {
    grid: Grid,
    from: (u16, u16),
    to: (u16, u16),
}

/// Reason why the damage cannot be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DamageError {
    /// A corner of the area is not on the grid.
    #[error("the area's corner ({x}, {y}) is outside the {grid} grid")]
    CornerOutside {
        /// The x coordinate of the corner.
        x: u32,
        /// The y coordinate of the corner.
        y: u32,
        /// The grid.
        grid: Grid,
    },
    /// The area and the swarm are on different grids.
    #[error("the area is on a {area} grid, but the swarm is on a {swarm} grid")]
    OtherGrid {
        /// Grid of the area.
        area: Grid,
        /// Grid of the swarm.
        swarm: Grid,
    },
    /// The number of free cells outside the area is too small.
    #[error("{robots} robots to reposition, but only {free} free cells outside the area")]
    NoRoom {
        /// Number of robots in the area.
        robots: u32,
        /// Number of free cells outside the area.
        free: u32,
    },
    /// The poses do not fit the grid.
    #[error(transparent)]
    World(#[from] WorldError),
    /// No robot is left.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
}

impl Area {
    /// Creates the area from x0 to x1 and from y0 to y1, including both ends. If x0 > x1, the area
    /// extends across the eastern edge; if y0 > y1, across the northern edge.
    ///
    /// # Errors
    /// [`DamageError::CornerOutside`] if a corner is not on the grid.
    pub fn new(grid: Grid, x0: u32, y0: u32, x1: u32, y1: u32) -> Result<Self, DamageError> {
        let corner = |x: u32, y: u32| {
            if x < grid.width().into() && y < grid.height().into() {
                Ok((x as u16, y as u16))
            } else {
                Err(DamageError::CornerOutside { x, y, grid })
            }
        };
        Ok(Self {
            grid,
            from: corner(x0, y0)?,
            to: corner(x1, y1)?,
        })
    }

    /// Returns true if the area contains the cell (x, y).
    #[must_use]
    pub fn contains(self, x: u16, y: u16) -> bool {
        let within = |at: u16, from: u16, to: u16| {
            if from <= to {
                from <= at && at <= to
            } else {
                from <= at || at <= to
            }
        };
        within(x, self.from.0, self.to.0) && within(y, self.from.1, self.to.1)
    }

    /// Returns the area's grid.
    #[must_use]
    pub fn grid(self) -> Grid {
        self.grid
    }
}

/// Effect of the damage on the robots in an area.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Damage {
    /// The robots are removed (Alg. 1).
    Remove(Area),
    /// The robots are placed on uniformly drawn free cells outside the area, with new headings
    /// (Alg. 2).
    Reposition(Area),
}

impl Damage {
    /// Applies the damage and returns the resulting swarm. The robots outside the area keep their
    /// order and poses; repositioned robots follow them, in index order. Removal draws no random
    /// numbers.
    ///
    /// # Errors
    /// [`DamageError`] if the area is on a different grid, the poses do not fit the grid, or there
    /// are too few free cells for the robots to be repositioned.
    pub fn apply(
        self,
        grid: Grid,
        poses: &[Pose],
        rng: &mut Stream,
    ) -> Result<Vec<Pose>, DamageError> {
        let (Self::Remove(area) | Self::Reposition(area)) = self;
        if area.grid != grid {
            return Err(DamageError::OtherGrid {
                area: area.grid,
                swarm: grid,
            });
        }
        check_poses(grid, poses)?;
        let outside = poses.iter().filter(|pose| !area.contains(pose.x, pose.y));
        let mut left: Vec<Pose> = outside.copied().collect();
        if matches!(self, Self::Reposition(_)) {
            let robots = (poses.len() - left.len()) as u32;
            let free = free_cells_outside(area, &left);
            if free.len() < robots as usize {
                return Err(DamageError::NoRoom {
                    robots,
                    free: free.len() as u32,
                });
            }
            left.extend(random_poses_among(free, grid, robots, rng));
        }
        Ok(left)
    }

    /// Returns the run after the damage: its scenario, with the number of robots left, and its
    /// trial. Poses come from the seed tree's [`Purpose::Damage`], noise from
    /// [`Purpose::DamageNoise`], both for the same repetition.
    ///
    /// # Errors
    /// [`DamageError`] if [`Damage::apply`] fails or no robot is left.
    pub fn trial(
        self,
        scenario: &Scenario,
        poses: &[Pose],
        seeds: SeedTree,
        repetition: u32,
    ) -> Result<(Scenario, Trial), DamageError> {
        let stream = |purpose| seeds.stream(purpose, 0, repetition);
        let starts = self.apply(scenario.grid(), poses, &mut stream(Purpose::Damage))?;
        let scenario = Scenario::new(
            scenario.grid(),
            starts.len() as u32,
            scenario.steps(),
            scenario.noise(),
        )?;
        let noise = NoiseStream::new(stream(Purpose::DamageNoise), scenario.noise());
        Ok((scenario, Trial { starts, noise }))
    }
}

/// Lists the free cells that are not in the area, row by row from the south, each row from the
/// west.
fn free_cells_outside(area: Area, robots_outside: &[Pose]) -> Vec<u32> {
    let grid = area.grid;
    let mut free = vec![true; grid.cells() as usize];
    for pose in robots_outside {
        free[grid.cell(pose.x, pose.y) as usize] = false;
    }
    let cells = (0..grid.height()).flat_map(|y| (0..grid.width()).map(move |x| (x, y)));
    cells
        .filter(|&(x, y)| free[grid.cell(x, y) as usize] && !area.contains(x, y))
        .map(|(x, y)| grid.cell(x, y))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::{draw, parse};
    use crate::evaluation::run;
    use crate::noise::NoiseRate;
    use crate::torus::Heading;
    use minimal_surprise_controller::{Controller, Genome, Topology};

    fn stream(repetition: u32) -> Stream {
        SeedTree::new(5).stream(Purpose::Damage, 0, repetition)
    }

    fn assert_removed(area: (u32, u32, u32, u32), before: &str, after: &str) {
        let (grid, poses) = parse(before).unwrap();
        let area = Area::new(grid, area.0, area.1, area.2, area.3).unwrap();
        let left = Damage::Remove(area).apply(grid, &poses, &mut stream(0));
        let rows: Vec<&str> = after.split_whitespace().collect();
        assert_eq!(draw(grid, &left.unwrap()), rows.join("\n"));
    }

    #[test]
    fn robots_in_the_rectangle_are_removed_ends_included() {
        assert_removed(
            (1, 1, 3, 2),
            "▶▶▶▶▶
             ▶▶▶▶▶
             ▶▶▶▶▶
             ▶▶▶▶▶",
            "▶▶▶▶▶
             ▶···▶
             ▶···▶
             ▶▶▶▶▶",
        );
        assert_removed(
            (2, 0, 2, 0),
            "···\n···\n▲▶▼",
            "···
             ···
             ▲▶·",
        );
    }

    #[test]
    fn a_rectangle_may_extend_across_the_edge() {
        assert_removed(
            (3, 3, 0, 0),
            "▶▶▶▶▶
             ▶▶▶▶▶
             ▶▶▶▶▶
             ▶▶▶▶▶",
            "·▶▶··
             ▶▶▶▶▶
             ▶▶▶▶▶
             ·▶▶··",
        );
        assert_removed(
            (4, 1, 1, 2),
            "▶▶▶▶▶
             ▶▶▶▶▶
             ▶▶▶▶▶
             ▶▶▶▶▶",
            "▶▶▶▶▶
             ··▶▶·
             ··▶▶·
             ▶▶▶▶▶",
        );
    }

    #[test]
    fn repositioned_robots_are_outside_the_area_and_follow_the_others() {
        let (grid, poses) = parse("▶·▶··\n·▲·▲·\n▶▶▶▶▶\n·····").unwrap();
        let area = Area::new(grid, 4, 1, 1, 2).unwrap();
        let mut placed = std::collections::BTreeMap::new();
        for repetition in 0..400 {
            let damage = Damage::Reposition(area);
            let after = damage.apply(grid, &poses, &mut stream(repetition)).unwrap();
            assert_eq!(check_poses(grid, &after), Ok(()));
            assert_eq!(after.len(), 9);
            let untouched = poses.iter().filter(|pose| !area.contains(pose.x, pose.y));
            assert_eq!(after[..5], untouched.copied().collect::<Vec<_>>());
            for pose in &after[5..] {
                assert!(!area.contains(pose.x, pose.y));
                *placed.entry((pose.x, pose.y)).or_insert(0) += 1;
            }
        }
        // Of the 20 cells, 6 are in the area and 5 are taken; 9 are free, each drawn 400 · 4 / 9
        // times.
        assert_eq!(placed.len(), 9);
        assert!(
            placed.values().all(|count| (130..230).contains(count)),
            "{placed:?}"
        );
    }

    #[test]
    fn new_headings_are_uniform() {
        let (grid, poses) = parse("▶▶▶\n···\n···\n···").unwrap();
        let area = Area::new(grid, 0, 3, 2, 3).unwrap();
        let mut headings = [0; 4];
        for repetition in 0..400 {
            let after = Damage::Reposition(area).apply(grid, &poses, &mut stream(repetition));
            for pose in after.unwrap() {
                headings[pose.heading as usize] += 1;
            }
        }
        assert!(
            headings.iter().all(|count| (250..350).contains(count)),
            "{headings:?}"
        );
    }

    #[test]
    fn value_stability_reposition() {
        let (grid, poses) = parse("▶▶▶\n···\n···\n···").unwrap();
        let area = Area::new(grid, 0, 3, 1, 3).unwrap();
        let after = Damage::Reposition(area)
            .apply(grid, &poses, &mut stream(7))
            .unwrap();
        let after: Vec<_> = after.iter().map(|p| (p.x, p.y, p.heading as u8)).collect();
        assert_eq!(after, [(2, 3, 0), (0, 0, 1), (2, 1, 3)]);
    }

    #[test]
    fn an_area_without_robots_changes_nothing() {
        let (grid, poses) = parse("▶▶▶\n···\n···\n···").unwrap();
        let area = Area::new(grid, 0, 0, 2, 1).unwrap();
        for damage in [Damage::Remove(area), Damage::Reposition(area)] {
            assert_eq!(damage.apply(grid, &poses, &mut stream(0)).unwrap(), poses);
        }
    }

    #[test]
    fn the_run_after_damage_is_an_ordinary_run_of_the_robots_left() {
        let (grid, poses) = parse("▶▶▶▶\n····\n▲▲▲▲\n····").unwrap();
        let scenario = Scenario::new(grid, 8, 30, NoiseRate::new(0.1).unwrap()).unwrap();
        let area = Area::new(grid, 0, 3, 1, 3).unwrap();
        let seeds = SeedTree::new(2);
        let mut genome_stream = seeds.stream(Purpose::InitialGenome, 0, 0);
        let genome = Genome::random(Topology::default(), &mut genome_stream);
        for (damage, robots) in [(Damage::Remove(area), 6), (Damage::Reposition(area), 8)] {
            let (after, trial) = damage.trial(&scenario, &poses, seeds, 3).unwrap();
            assert_eq!((after.robots(), after.steps()), (robots, 30));
            let outcome = run(&Controller::new(&genome), &after, &trial, |_| {}).unwrap();
            assert_eq!(outcome.scored_bits, u64::from(robots) * 30 * 14);
            let (_, again) = damage.trial(&scenario, &poses, seeds, 3).unwrap();
            assert_eq!(again.starts, trial.starts);
        }
    }

    #[test]
    fn impossible_damage_is_refused() {
        let (grid, poses) = parse("▶▶▶\n▶▶▶\n▶▶▶\n··▶").unwrap();
        assert_eq!(
            Area::new(grid, 0, 0, 3, 1),
            Err(DamageError::CornerOutside { x: 3, y: 1, grid })
        );
        let area = Area::new(grid, 0, 0, 2, 2).unwrap();
        let apply = |damage: Damage, poses: &[Pose]| damage.apply(grid, poses, &mut stream(0));
        assert_eq!(
            apply(Damage::Reposition(area), &poses),
            Err(DamageError::NoRoom { robots: 7, free: 0 })
        );
        let other = Grid::new(5, 5).unwrap();
        assert_eq!(
            Damage::Remove(area).apply(other, &poses, &mut stream(0)),
            Err(DamageError::OtherGrid {
                area: grid,
                swarm: other
            })
        );
        let twice = [
            poses[0],
            Pose {
                heading: Heading::South,
                ..poses[0]
            },
        ];
        assert!(matches!(
            apply(Damage::Remove(area), &twice),
            Err(DamageError::World(WorldError::Overlap { .. }))
        ));
        let everything = Damage::Remove(Area::new(grid, 0, 0, 2, 3).unwrap());
        let scenario = Scenario::new(grid, 10, 1, NoiseRate::NONE).unwrap();
        assert!(matches!(
            everything.trial(&scenario, &poses, SeedTree::new(0), 0),
            Err(DamageError::Scenario(ScenarioError::RobotsDoNotFit {
                robots: 0,
                ..
            }))
        ));
    }
}
