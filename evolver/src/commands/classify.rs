//! `evolver classify`: classifies the structure that a swarm formed, and measures the run.

use super::BadInput;
use super::errors::unusable;
use crate::report::structures::{self, Classified};
use minimal_surprise_evolution::baseline::{Chance, FitnessBaselines};
use minimal_surprise_evolution::files::{self, DATA_BYTES_MAX};
use minimal_surprise_evolution::finished_run::{FinishedRun, parse_final_state};
use minimal_surprise_evolution::text::{self, TextError};
use minimal_surprise_sim::exchange::Trajectory;
use minimal_surprise_sim::structures::classify as find_structures;
use minimal_surprise_sim::{Grid, Pose, drawing};
use std::path::Path;

/// Classifies a run directory, a `final.json`, an `agent_trajectory`, or a drawing.
///
/// # Errors
/// [`BadInput`] if the file or run cannot be read or contains no swarm.
pub fn classify(path: &Path, json: bool) -> anyhow::Result<()> {
    let (grid, poses, measures, baselines) = if path.is_dir() {
        let finished = FinishedRun::read_and_check(path).map_err(unusable)?;
        let measures = finished.measures()?;
        let scenario = finished.settings.scenario();
        let baselines = FitnessBaselines::of_run(scenario, &measures);
        let grid = scenario.grid();
        (grid, finished.final_poses, Some(measures), Some(baselines))
    } else {
        let (grid, poses) = read_state(path)?;
        (grid, poses, None, None)
    };
    let found = find_structures(grid, &poses)
        .map_err(|error| BadInput::new(format!("{}: {error}", path.display())))?;
    let chance = Chance::of_default_placements(grid, poses.len() as u32)?;
    let classified = Classified {
        grid,
        poses: &poses,
        found: &found,
        measures: measures.as_ref(),
        baselines: baselines.as_ref(),
        chance: chance.as_ref(),
    };
    if json {
        show_line!("{}", structures::json(&classified));
    } else {
        show!("{}", structures::text(&classified));
    }
    Ok(())
}

/// Reads the last state in a file; recognises the format by the file's first characters.
fn read_state(path: &Path) -> anyhow::Result<(Grid, Vec<Pose>)> {
    let bytes = files::read(path, DATA_BYTES_MAX).map_err(unusable)?;
    let text = text::decode(&bytes).map_err(|error| {
        BadInput::new(match error {
            TextError::Utf16 => format!("{}: {error}", path.display()),
            _ => format!(
                "{}: neither a final.json, nor an agent_trajectory, nor a drawing: {error}",
                path.display()
            ),
        })
    })?;
    if !text.chars().any(|c| "▶▲◀▼▷△◁▽·{".contains(c)) && !text.starts_with("Gen:")
    {
        return Err(BadInput::new(format!(
            "{}: neither a final.json, nor an agent_trajectory, nor a drawing of ▶ ▲ ◀ ▼ and ·",
            path.display()
        ))
        .into());
    }
    if text.starts_with("Gen:") {
        let trajectory = Trajectory::read(&text)
            .map_err(|error| BadInput::new(format!("{}, {error}", path.display())))?;
        Ok((trajectory.grid(), trajectory.final_poses().to_vec()))
    } else if text.trim_start().starts_with('{') {
        let state = parse_final_state(path, text.as_bytes()).map_err(BadInput::new)?;
        Ok((state.grid, state.final_poses))
    } else {
        let drawing = drawing::parse(&text);
        Ok(drawing.map_err(|error| BadInput::new(format!("{}: {error}", path.display())))?)
    }
}
