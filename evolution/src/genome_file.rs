//! Genome files, read and checked once, with the topology and provenance that they state.

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

/// Error: a file holds no genome that this program can run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GenomeFileError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file does not contain a genome that this program can run.
    #[error("{}: {error}", path.display())]
    Genome {
        /// The file.
        path: PathBuf,
        /// The error in its contents.
        error: DecodeError,
    },
}

impl GenomeFileError {
    /// Returns the error without the path.
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
    /// [`GenomeFileError`] if the file cannot be read or holds no genome for this program.
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

    /// Returns the genome.
    #[must_use]
    pub fn genome(&self) -> &Genome {
        &self.genome
    }

    /// Returns the genome's topology.
    #[must_use]
    pub fn topology(&self) -> Topology {
        self.genome.topology()
    }

    /// Returns the genome's provenance.
    #[must_use]
    pub fn provenance(&self) -> Provenance {
        self.provenance
    }

    /// Returns the container: the bytes of the file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}
