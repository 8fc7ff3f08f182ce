//! Errors of commands, divided into invalid input and failures.

use crate::data::ExportError;
use crate::exit::Exit;
use crate::output;
use crate::suite::report::ReportError;
use crate::suite::report::gather::GatherError;
use crate::suite::slurm::SubmitError;
use crate::suite::worker::ToDoError;
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::FileError;
use minimal_surprise_evolution::finished_run::ReadRunError;
use minimal_surprise_evolution::run_dir::RunDirError;
use minimal_surprise_evolution::run_files::DONE;
use minimal_surprise_evolution::settings::SettingError;
use minimal_surprise_evolution::text::shell_path;
use minimal_surprise_replay::gallery::GalleryError;
use std::io::ErrorKind;

/// Invalid input, with a message for the user.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BadInput(String);

impl BadInput {
    /// Creates the error with a message that describes the problem.
    pub fn new(message: impl ToString) -> Self {
        Self(message.to_string())
    }
}

/// Incomplete work; the message contains the command that continues it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unfinished(pub(super) String);

/// Interruption of work with a robot; the message describes the robot's state.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Interrupted(pub(super) String);

/// Returns the exit code for an error.
#[must_use]
pub fn exit_of(error: &anyhow::Error) -> Exit {
    if error.is::<BadInput>() {
        Exit::BadInput
    } else if error.is::<Unfinished>() {
        Exit::Unfinished
    } else if error.is::<Interrupted>() {
        Exit::Interrupted
    } else {
        Exit::Failure
    }
}

/// Reports why work stopped early and which command continues it.
pub(super) fn stopped(resume: &str) -> anyhow::Result<Exit> {
    match output::lost() {
        None => {
            tell!("interrupted; continue with: {resume}");
            Ok(Exit::Interrupted)
        }
        Some(error) if output::is_gone(error) => Err(Unfinished(format!(
            "standard output was closed before all work was done; continue with: {resume}"
        ))
        .into()),
        Some(error) => anyhow::bail!("standard output: {error}; continue with: {resume}"),
    }
}

/// Lists the runs that were left out because they are damaged; `again` is the command that repeats
/// them.
pub(super) fn name_damaged(damaged: &DamagedRuns, again: Option<&str>) -> Exit {
    if damaged.is_empty() {
        return Exit::Done;
    }
    let directories: Vec<String> = damaged.iter().map(|(run, _)| shell_path(run)).collect();
    for (_, error) in damaged.iter() {
        tell!("error: {error}");
    }
    let again = again.map_or(String::new(), |command| {
        let directories = directories.join(" ");
        format!("; to repeat them, delete {directories}, then run: {command}")
    });
    tell!(
        "{} left out: damaged, unreadable, or created by a different version{again}",
        directories.len()
    );
    Exit::Failure
}

/// An error about an input that the user named.
pub(super) trait AboutInput: std::error::Error + Send + Sync + Sized + 'static {
    /// Returns whether the error is about invalid input; otherwise it is a failure.
    fn is_bad_input(&self) -> bool;
}

/// Converts an error to [`BadInput`] if it is about invalid input; returns other errors unchanged.
pub(super) fn unusable(error: impl AboutInput) -> anyhow::Error {
    if error.is_bad_input() {
        BadInput::new(error).into()
    } else {
        error.into()
    }
}

impl AboutInput for FileError {
    fn is_bad_input(&self) -> bool {
        self.is_bad_path()
    }
}

impl AboutInput for ExportError {
    fn is_bad_input(&self) -> bool {
        match self {
            Self::File(error) => error.is_bad_input() || error.is_exists(),
            Self::World(_) | Self::Csv { .. } => false,
        }
    }
}

impl AboutInput for SettingError {
    fn is_bad_input(&self) -> bool {
        match self {
            Self::Unreadable(error) => error.is_bad_input(),
            _ => true,
        }
    }
}

/// An incomplete run is bad input. A complete run with an unreadable file is damaged, and damage is
/// a failure.
impl AboutInput for ReadRunError {
    fn is_bad_input(&self) -> bool {
        match self {
            // If a file other than the mark is missing, the run is marked complete but damaged.
            Self::NotComplete { missing, .. } => *missing == DONE,
            Self::NotThere(error) => error.is_bad_input(),
            // The mark is read first. If it is a directory or a pipe, that counts as damage.
            Self::File(error) => {
                let damage = [ErrorKind::IsADirectory, ErrorKind::InvalidInput];
                let is_damage = damage.contains(&error.error.kind());
                error.path.ends_with(DONE) && error.is_bad_input() && !is_damage
            }
            _ => false,
        }
    }
}

impl AboutInput for RunDirError {
    fn is_bad_input(&self) -> bool {
        match self {
            Self::Exists(_) | Self::NotARun { .. } => true,
            Self::EnginePath(_) | Self::TooMuch(_) => true,
            Self::NotThere(error) | Self::File(error) => error.is_bad_input(),
            Self::Damaged(error) => error.is_bad_input(),
            _ => false,
        }
    }
}

impl AboutInput for ToDoError {
    fn is_bad_input(&self) -> bool {
        match self {
            Self::TooMuch(_) => true,
            Self::Folder(error) => error.is_bad_input(),
        }
    }
}

impl AboutInput for GalleryError {
    fn is_bad_input(&self) -> bool {
        match self {
            Self::Empty(_) | Self::Exists(_) | Self::Page { .. } | Self::TooMuch(_) => true,
            Self::Run(error) => error.is_bad_input(),
            Self::File(error) => error.is_bad_input(),
            _ => false,
        }
    }
}

impl AboutInput for GatherError {
    fn is_bad_input(&self) -> bool {
        matches!(self, Self::File(error) if error.is_bad_input())
    }
}

impl AboutInput for ReportError {
    fn is_bad_input(&self) -> bool {
        matches!(self, Self::File(error) if error.is_bad_input())
    }
}

impl AboutInput for SubmitError {
    fn is_bad_input(&self) -> bool {
        match self {
            Self::UnusablePath(_) => true,
            Self::File(error) => error.is_bad_input(),
            Self::NoSbatch(_) | Self::Refused { .. } => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::ErrorKind;
    use std::path::Path;

    #[test]
    fn a_wrong_name_is_bad_input_and_a_broken_disk_is_a_failure() {
        let cases = [
            (ErrorKind::NotFound, Exit::BadInput),
            (ErrorKind::PermissionDenied, Exit::BadInput),
            (ErrorKind::IsADirectory, Exit::BadInput),
            (ErrorKind::StorageFull, Exit::Failure),
            (ErrorKind::QuotaExceeded, Exit::Failure),
            (ErrorKind::OutOfMemory, Exit::Failure),
            (ErrorKind::Other, Exit::Failure),
        ];
        for (kind, exit) in cases {
            let file = || FileError::at(Path::new("a file"))(kind.into());
            assert_eq!(exit_of(&unusable(file())), exit, "{kind}");
            assert_eq!(exit_of(&unusable(RunDirError::File(file()))), exit);
            let of_run = |name: &str| {
                let error = FileError::at(&Path::new("run").join(name))(kind.into());
                exit_of(&unusable(ReadRunError::File(error)))
            };
            // A directory instead of the mark counts as damage.
            let of_mark = match kind {
                ErrorKind::IsADirectory => Exit::Failure,
                _ => exit,
            };
            assert_eq!(of_run(DONE), of_mark);
            assert_eq!(of_run("best.genome"), Exit::Failure);
            assert_eq!(exit_of(&unusable(GalleryError::File(file()))), exit);
            let about = unusable(file()).context("--out = a file");
            assert_eq!(exit_of(&about), exit, "{about:#}");
        }
    }
}
