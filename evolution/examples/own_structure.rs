//! A custom structure: two-by-two blocks of robots, in the final states of short evolutions.
//!
//! `cargo run --release -p minimal-surprise-evolution --example own_structure`

use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_sim::structures::{Pattern, Structure};
use minimal_surprise_sim::world::check_poses;
use minimal_surprise_sim::{Engine, EnginePath, Grid, Pose, WorldError};
use std::collections::HashSet;
use std::sync::atomic::AtomicBool;

/// A two-by-two block; robots belong to it if all four cells are occupied.
struct Block;

impl Pattern for Block {
    fn members(&self, grid: Grid, poses: &[Pose]) -> Result<Vec<bool>, WorldError> {
        check_poses(grid, poses)?;
        let occupied: HashSet<(u16, u16)> = poses.iter().map(|pose| (pose.x, pose.y)).collect();
        // Checks the cell at this offset from a pose, around the torus.
        let is_occupied = |pose: &Pose, columns: i32, rows: i32| {
            let x = (i32::from(pose.x) + columns).rem_euclid(grid.width().into());
            let y = (i32::from(pose.y) + rows).rem_euclid(grid.height().into());
            occupied.contains(&(x as u16, y as u16))
        };
        let is_corner = |pose: &Pose| {
            let corners = [(1, 1), (1, -1), (-1, 1), (-1, -1)];
            corners.into_iter().any(|(columns, rows)| {
                is_occupied(pose, columns, 0)
                    && is_occupied(pose, 0, rows)
                    && is_occupied(pose, columns, rows)
            })
        };
        Ok(poses.iter().map(is_corner).collect())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for seed in 1..=3 {
        let settings = Settings::builder()
            .population(6)
            .generations(6)
            .repetitions(2)
            .steps(120)
            .seed(seed)
            .build()?;
        let grid = settings.scenario().grid();
        let mut experiment = Experiment::new(settings);
        while !experiment.is_finished() {
            let _ = experiment.advance(Engine::Fast, EnginePath::best(), &AtomicBool::new(false));
        }
        let result = experiment.result()?.ok_or("no generation was evaluated")?;
        let poses = &result.outcome.final_poses;
        let blocks = 100.0 * Block.share(grid, poses)?;
        let lines = 100.0 * Structure::Line.share(grid, poses)?;
        println!("seed {seed}: {blocks:.0} % of the robots in blocks, {lines:.0} % in lines");
    }
    Ok(())
}
