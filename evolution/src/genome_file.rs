//! Genome files: read once, checked, with what they say of themselves.

use crate::files::{self, FileError};
use minimal_surprise_controller::codec::CONTAINER_BYTES_MAX;
use minimal_surprise_controller::{DecodeError, EncodedGenome, Genome, Provenance, Topology};
use std::path::{Path, PathBuf};

/// A genome file that this program can run.
#[derive(Clone, Debug)]
pub struct GenomeFile {
    bytes: Vec<u8>,
    genome: Genome,
    provenance: Provenance,
}

/// A file is no genome for this program.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenomeFileError {
    /// It cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// It holds no genome for this program.
    #[error("{}: {error}", path.display())]
    Genome {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: DecodeError,
    },
}

impl GenomeFileError {
    /// Returns what is wrong, without the path.
    #[must_use]
    pub fn problem(&self) -> String {
        match self {
            Self::File(error) => error.error.to_string(),
            Self::Genome { error, .. } => error.to_string(),
        }
    }
}

impl GenomeFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`GenomeFileError`] if it cannot be read, or is no genome for this program.
    pub fn read(path: &Path) -> Result<Self, GenomeFileError> {
        let bytes = files::read(path, CONTAINER_BYTES_MAX as u64)?;
        let encoded = EncodedGenome::decode(&bytes).map_err(|error| GenomeFileError::Genome {
            path: path.to_owned(),
            error,
        })?;
        Ok(Self {
            genome: encoded.to_genome(),
            provenance: encoded.provenance(),
            bytes,
        })
    }

    /// The genome.
    #[must_use]
    pub fn genome(&self) -> &Genome {
        &self.genome
    }

    /// Its topology.
    #[must_use]
    pub fn topology(&self) -> Topology {
        self.genome.topology()
    }

    /// Returns where the genome comes from.
    #[must_use]
    pub fn provenance(&self) -> Provenance {
        self.provenance
    }

    /// The container: the bytes of the file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}
