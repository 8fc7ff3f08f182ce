//! `evolver inspect`: everything in a genome file.

use super::read_genome;
use crate::report::summary;
use minimal_surprise_controller::EncodedGenome;
use std::path::Path;

/// Shows a genome file, or that of a run directory.
///
/// # Errors
/// [`BadInput`](super::BadInput) if the file cannot be read or is not a genome for this program.
pub fn inspect(path: &Path) -> anyhow::Result<()> {
    let bytes = read_genome(path)?;
    let encoded = EncodedGenome::decode(&bytes)?;
    show!("{}", summary::genome(&encoded, bytes.len()));
    Ok(())
}
