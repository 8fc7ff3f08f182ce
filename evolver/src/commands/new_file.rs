//! Files named by a flag.

use super::BadInput;
use minimal_surprise_evolution::files::{self, Existing};
use std::path::Path;

/// Rejects a path that exists.
pub(super) fn refuse_existing(flag: &str, path: &Path, overwrite: bool) -> Result<(), BadInput> {
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(exists(flag, path, ", or replace it with --overwrite"));
    }
    Ok(())
}

/// Creates the error for a path that exists.
fn exists(flag: &str, path: &Path, or_else: &str) -> BadInput {
    BadInput::new(format!(
        "--{flag} = {}: already exists; choose a different name{or_else}",
        path.display()
    ))
}

/// Writes the file named by a flag.
pub(super) fn write_file(
    flag: &str,
    path: &Path,
    contents: &[u8],
    existing: Existing,
) -> anyhow::Result<()> {
    files::write(path, contents, existing).map_err(|error| match error {
        error if error.is_exists() => exists(flag, path, "").into(),
        error if error.is_bad_path() => BadInput::new(format!("--{flag} = {error}")).into(),
        error => error.into(),
    })
}
