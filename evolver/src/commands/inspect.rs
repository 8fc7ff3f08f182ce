//! `evolver inspect`: shows the contents of a genome file.

use super::read_genome;
use crate::report::summary;
use std::path::Path;

/// Shows a genome file, or the genome of a run directory.
///
/// # Errors
/// [`BadInput`](super::BadInput) if the file cannot be read or its genome cannot be used.
pub fn inspect(path: &Path) -> anyhow::Result<()> {
    show!("{}", summary::genome(&read_genome(path)?));
    Ok(())
}
