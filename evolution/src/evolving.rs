//! Evolution with a checkpoint after every generation, written while the next one is evaluated.

use crate::experiment::{Experiment, GenerationRecord};
use crate::files::FileError;
use crate::run_dir::RunDir;
use minimal_surprise_sim::{Engine, EnginePath};
use std::sync::atomic::AtomicBool;
use std::thread::{self, ScopedJoinHandle};

/// Evaluates and saves all remaining generations; returns false if `stop` was set before the last
/// one was evaluated. All evaluated generations are saved before this returns.
///
/// # Errors
/// [`FileError`] if a generation cannot be saved; the last checkpoint is kept.
pub fn until_finished(
    experiment: &mut Experiment,
    run: &RunDir,
    (engine, path): (Engine, EnginePath),
    stop: &AtomicBool,
    mut each_generation: impl FnMut(&GenerationRecord),
) -> Result<bool, FileError> {
    thread::scope(|scope| {
        let mut saving = None;
        while !experiment.is_finished() {
            let Some(record) = experiment.advance(engine, path, stop) else {
                finish(saving)?;
                return Ok(false);
            };
            finish(saving)?;
            let checkpoint = run.checkpoint(experiment);
            saving = Some(scope.spawn(move || run.write(&checkpoint)));
            each_generation(&record);
        }
        finish(saving)?;
        Ok(true)
    })
}

fn finish(saving: Option<ScopedJoinHandle<'_, Result<(), FileError>>>) -> Result<(), FileError> {
    saving.map_or(Ok(()), |saving| {
        saving.join().expect("saving does not panic")
    })
}
