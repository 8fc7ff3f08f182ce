//! `evolver inspect`: everything in a genome file.

use super::BadInput;
use crate::files;
use crate::report::summary;
use minimal_surprise_controller::EncodedGenome;
use std::path::Path;

/// Shows a genome file.
///
/// # Errors
/// [`BadInput`] if the file cannot be read or is not a genome for this program.
pub fn inspect(path: &Path) -> anyhow::Result<()> {
    let bytes = files::read(path).map_err(BadInput::new)?;
    let encoded = EncodedGenome::decode(&bytes)
        .map_err(|error| BadInput::new(format!("{}: {error}", path.display())))?;
    show!("{}", summary::genome(&encoded, bytes.len()));
    Ok(())
}
