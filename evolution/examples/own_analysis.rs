//! A custom analysis: the agreement of the robots' headings over the steps of a finished run.
//!
//! `cargo run --release -p minimal-surprise-evolution --example own_analysis -- RUN`, where `RUN`
//! is a run directory; without it, the example performs a short run.

use minimal_surprise_evolution::evolving::until_finished;
use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::run_dir::RunDir;
use minimal_surprise_evolution::run_files::Program;
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_sim::{Engine, EnginePath, Heading};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn main() -> Result<(), Box<dyn Error>> {
    let scratch = tempfile::tempdir()?;
    let directory = match std::env::args_os().nth(1) {
        Some(directory) => PathBuf::from(directory),
        None => evolved(scratch.path())?,
    };
    let finished = FinishedRun::read(&directory)?;
    let mut step = 0;
    finished.replay(|world| {
        step += 1;
        let heading = |heading: Heading| {
            world
                .poses()
                .iter()
                .filter(|pose| pose.heading == heading)
                .count()
        };
        let most = Heading::ALL.map(heading).into_iter().max().unwrap_or(0);
        if step % 50 == 0 {
            let share = most as f64 / world.poses().len() as f64;
            println!(
                "step {step}: {:.0} % of the robots have the same heading",
                100.0 * share
            );
        }
    })?;
    Ok(())
}

/// Performs a short run in `folder`.
fn evolved(folder: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let settings = Settings::builder()
        .population(8)
        .generations(5)
        .repetitions(2)
        .steps(200)
        .build()?;
    let directory = folder.join("run");
    let mut experiment = Experiment::new(settings);
    let run = RunDir::create(&directory, &experiment, &Program::default())?;
    let engine = (Engine::Fast, EnginePath::best());
    until_finished(
        &mut experiment,
        &run,
        engine,
        &AtomicBool::new(false),
        |_| {},
    )?;
    if let Some(result) = experiment.result()? {
        run.finish(&experiment, &result)?;
    }
    Ok(directory)
}
