//! Scenarios: the conditions of a run, and the trials of a generation.

use crate::noise::{NoiseRate, NoiseStream};
use crate::seed::{Purpose, SeedTree, Stream, uniform_below};
use crate::torus::{Grid, Heading, Pose};

/// The conditions of a run, independent of the genome.
///
/// ```
/// use minimal_surprise_sim::{Grid, NoiseRate, Scenario, ScenarioError, SeedTree};
///
/// let grid = Grid::new(11, 18)?;
/// let scenario = Scenario::new(grid, 100, 500, NoiseRate::NONE)?;
/// assert_eq!(scenario.scored_bits(14), 100 * 500 * 14);
///
/// let seeds = SeedTree::new(1);
/// let trial = scenario.trial(seeds, 0, 0);
/// assert_eq!(trial.starts.len(), 100);
/// assert_ne!(trial.starts, scenario.trial(seeds, 0, 1).starts);
///
/// let too_many = Scenario::new(grid, 199, 500, NoiseRate::NONE);
/// assert_eq!(too_many, Err(ScenarioError::RobotsDoNotFit { robots: 199, grid }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scenario {
    grid: Grid,
    robots: u32,
    steps: u32,
    noise: NoiseRate,
}

/// Reason why the scenario is not valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// The number of robots is 0 or exceeds the number of cells.
    #[error("{robots} robots on a {grid} grid; from 1 to {} fit", grid.cells())]
    RobotsDoNotFit {
        /// Number of robots requested.
        robots: u32,
        /// The grid.
        grid: Grid,
    },
    /// The number of steps is 0.
    #[error("0 steps; at least 1 is needed")]
    NoSteps,
}

impl Scenario {
    /// Creates the scenario of a swarm of `robots` on `grid` for `steps`.
    ///
    /// # Errors
    /// [`ScenarioError`] if `robots` or `steps` is 0, or the grid has fewer cells than robots.
    pub fn new(
        grid: Grid,
        robots: u32,
        steps: u32,
        noise: NoiseRate,
    ) -> Result<Self, ScenarioError> {
        if robots == 0 || robots > grid.cells() {
            Err(ScenarioError::RobotsDoNotFit { robots, grid })
        } else if steps == 0 {
            Err(ScenarioError::NoSteps)
        } else {
            Ok(Self {
                grid,
                robots,
                steps,
                noise,
            })
        }
    }

    /// Returns the grid.
    #[must_use]
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Returns the swarm size N.
    #[must_use]
    pub fn robots(&self) -> u32 {
        self.robots
    }

    /// Returns the evaluation length T, in steps.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Returns the rate of the sensor noise.
    #[must_use]
    pub fn noise(&self) -> NoiseRate {
        self.noise
    }

    /// Returns the number of bits that the swarm senses in one repetition, N·T·R.
    #[must_use]
    pub fn scored_bits(&self, sensors: usize) -> u64 {
        u64::from(self.robots) * u64::from(self.steps) * sensors as u64
    }

    /// Draws a repetition of a generation: its starting poses and noise, shared by all genomes.
    #[must_use]
    pub fn trial(&self, seeds: SeedTree, generation: u32, repetition: u32) -> Trial {
        let stream = |purpose| seeds.stream(purpose, generation, repetition);
        Trial {
            starts: random_poses(self.grid, self.robots, &mut stream(Purpose::Starts)),
            noise: NoiseStream::new(stream(Purpose::Noise), self.noise),
        }
    }

    /// Draws a start of a re-evaluation: new starting poses and noise that no generation has used,
    /// the same for every genome.
    #[must_use]
    pub fn reevaluation(&self, seeds: SeedTree, start: u32) -> Trial {
        let stream = |purpose| seeds.stream(purpose, 0, start);
        let mut starts = stream(Purpose::ReevaluationStarts);
        Trial {
            starts: random_poses(self.grid, self.robots, &mut starts),
            noise: NoiseStream::new(stream(Purpose::ReevaluationNoise), self.noise),
        }
    }
}

/// Starting poses and noise of one repetition of an evaluation.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Starting poses, in index order.
    pub starts: Vec<Pose>,
    /// Sensor noise.
    pub noise: NoiseStream,
}

/// Draws poses on uniformly drawn free cells, with uniformly drawn headings.
///
/// Each robot in turn draws one of the cells that are still free, as an index into a list, and then
/// its heading. The last cell of the list replaces a drawn cell.
///
/// # Panics
/// If `robots` exceeds the number of cells.
#[must_use]
pub fn random_poses(grid: Grid, robots: u32, rng: &mut Stream) -> Vec<Pose> {
    random_poses_among((0..grid.cells()).collect(), grid, robots, rng)
}

/// Draws poses like [`random_poses`], but only on the given cells (numbered as in [`Grid::cell`]).
///
/// # Panics
/// If `robots` exceeds the number of cells.
#[must_use]
pub fn random_poses_among(
    mut free: Vec<u32>,
    grid: Grid,
    robots: u32,
    rng: &mut Stream,
) -> Vec<Pose> {
    let width = u32::from(grid.width());
    (0..robots)
        .map(|_| {
            let drawn = uniform_below(rng, free.len() as u64) as usize;
            let cell = free.swap_remove(drawn);
            Pose {
                x: (cell % width) as u16,
                y: (cell / width) as u16,
                heading: Heading::from_low_bits(uniform_below(rng, 4) as u32),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::check_poses;

    #[test]
    fn value_stability_trial() {
        let grid = Grid::new(15, 15).unwrap();
        let scenario = Scenario::new(grid, 3, 1, NoiseRate::NONE).unwrap();
        let trial = scenario.trial(SeedTree::new(1), 0, 0);
        let poses: Vec<_> = trial
            .starts
            .iter()
            .map(|p| (p.x, p.y, p.heading as u8))
            .collect();
        assert_eq!(poses, [(12, 9, 3), (4, 14, 2), (12, 0, 3)]);
    }

    #[test]
    fn starts_of_a_re_evaluation_are_new_and_repeatable() {
        let grid = Grid::new(15, 15).unwrap();
        let noise = NoiseRate::new(0.5).unwrap();
        let scenario = Scenario::new(grid, 100, 1, noise).unwrap();
        let seeds = SeedTree::new(1);
        let starts = |start| scenario.reevaluation(seeds, start).starts;
        assert_eq!(starts(4), starts(4));
        assert_ne!(starts(4), starts(5));
        assert_ne!(starts(4), scenario.trial(seeds, 0, 4).starts);
        let flips = |mut trial: Trial| trial.noise.draws(0, 0);
        let noise_of = |start| flips(scenario.reevaluation(seeds, start));
        assert_ne!(noise_of(0), noise_of(1));
        assert_ne!(noise_of(0), flips(scenario.trial(seeds, 0, 0)));
    }

    #[test]
    fn a_full_grid_has_a_robot_on_every_cell() {
        let grid = Grid::new(5, 7).unwrap();
        let scenario = Scenario::new(grid, 35, 1, NoiseRate::NONE).unwrap();
        let trial = scenario.trial(SeedTree::new(1), 0, 0);
        assert_eq!(check_poses(grid, &trial.starts), Ok(()));
        assert_eq!(trial.starts.len(), 35);
    }

    #[test]
    fn no_robots_too_many_robots_and_no_steps_are_refused() {
        let grid = Grid::new(3, 3).unwrap();
        for robots in [0, 10] {
            assert_eq!(
                Scenario::new(grid, robots, 1, NoiseRate::NONE),
                Err(ScenarioError::RobotsDoNotFit { robots, grid })
            );
        }
        assert_eq!(
            Scenario::new(grid, 1, 0, NoiseRate::NONE),
            Err(ScenarioError::NoSteps)
        );
    }
}
