//! Checkpoints: the state of an evolution between two generations, in one file.
//!
//! The file holds postcard data and its CRC-32C in four bytes, little-endian. The data includes the
//! text of the run's `config.toml`, so that a run is never resumed with different settings.

use crate::experiment::{Experiment, GenerationRecord};
use crate::population::Population;
use crate::run_hash::RunHash;
use crate::settings::Settings;
use minimal_surprise_controller::codec::CRC_32C;
use minimal_surprise_controller::{Genome, KERNEL_ID, KernelId, Topology};
use serde::{Deserialize, Serialize};

/// Version of the file's layout.
const SCHEMA: u32 = 1;

/// Error: the bytes are not a checkpoint that can be resumed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file was truncated or changed.
    #[error("the checkpoint is damaged: {0}")]
    Damaged(&'static str),
    /// The checkpoint was written by a program with a different layout.
    #[error("the checkpoint has schema version {found}; this program reads version {SCHEMA}")]
    OtherSchema {
        /// The version found.
        found: u32,
    },
    /// The checkpoint was written by a program with a different kernel.
    #[error("the checkpoint belongs to kernel {found}; this program is kernel {KERNEL_ID}")]
    OtherKernel {
        /// The kernel found.
        found: KernelId,
    },
    /// The run's settings were edited.
    #[error("config.toml differs from the settings that the run was started with")]
    OtherSettings,
}

#[derive(Serialize, Deserialize)]
struct Stored {
    schema: u32,
    kernel: KernelId,
    settings: String,
    generation: u32,
    genomes: Vec<Vec<i16>>,
    history: Vec<GenerationRecord>,
    hash: RunHash,
    best: Option<Vec<i16>>,
}

/// Encodes an experiment as a checkpoint.
#[must_use]
pub fn encode(experiment: &Experiment, settings_text: &str) -> Vec<u8> {
    let population = experiment.population();
    let weights = |genome: &Genome| genome.weights().to_vec();
    let stored = Stored {
        schema: SCHEMA,
        kernel: KERNEL_ID,
        settings: settings_text.to_owned(),
        generation: population.generation(),
        genomes: population.ask().iter().map(weights).collect(),
        history: experiment.history().to_vec(),
        hash: experiment.hash(),
        best: experiment.best().map(weights),
    };
    sealed(&stored)
}

fn sealed(stored: &Stored) -> Vec<u8> {
    let mut bytes = postcard::to_allocvec(stored).expect("memory is the only limit");
    let crc = CRC_32C.checksum(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// Decodes a checkpoint.
///
/// # Errors
/// [`CheckpointError`] if the checkpoint is damaged or belongs to a different program or to
/// different settings.
pub fn decode(
    bytes: &[u8],
    settings: Settings,
    settings_text: &str,
) -> Result<Experiment, CheckpointError> {
    use CheckpointError::Damaged;
    let (body, crc) = bytes.split_last_chunk().ok_or(Damaged("too short"))?;
    if CRC_32C.checksum(body) != u32::from_le_bytes(*crc) {
        return Err(Damaged("its checksum does not match"));
    }
    // The version comes first, so that it can be read whatever the rest of the layout is.
    let (found, _) = postcard::take_from_bytes(body).map_err(|_| Damaged("no version"))?;
    if found != SCHEMA {
        return Err(CheckpointError::OtherSchema { found });
    }
    let stored: Stored = postcard::from_bytes(body).map_err(|_| Damaged("malformed"))?;
    if stored.kernel != KERNEL_ID {
        return Err(CheckpointError::OtherKernel {
            found: stored.kernel,
        });
    }
    if stored.settings != settings_text {
        return Err(CheckpointError::OtherSettings);
    }
    let genome = |weights: &Vec<i16>| genome(settings.topology(), weights);
    let genomes: Vec<Genome> = stored
        .genomes
        .iter()
        .map(genome)
        .collect::<Result<_, _>>()?;
    let best = stored.best.as_ref().map(genome).transpose()?;
    if genomes.len() as u64 != u64::from(settings.population()) {
        return Err(Damaged("the population has a different size"));
    }
    check(&stored, &settings).map_err(Damaged)?;
    let population = Population::restored(stored.generation, genomes);
    Ok(Experiment::restored(
        settings,
        population,
        stored.history,
        stored.hash,
        best,
    ))
}

/// Checks that the values are possible for an evolution with these settings.
fn check(stored: &Stored, settings: &Settings) -> Result<(), &'static str> {
    let (done, all) = (
        stored.history.len() as u64,
        u64::from(settings.generations()),
    );
    if done > all || stored.best.is_some() != (done > 0) {
        return Err("it has a different number of generations from config.toml");
    }
    // No population follows the last generation.
    if u64::from(stored.generation) != done.min(all - 1) {
        return Err("its population belongs to a different generation");
    }
    let bits = settings.scored_bits();
    let is_possible = |(expected, record): (u32, &GenerationRecord)| {
        record.generation == expected
            && record.best_slot < settings.population()
            && record.worst_repetition < settings.repetitions()
            && record.worst_matches <= record.best_matches
            && record.best_matches <= bits
            && record.total_matches <= bits.saturating_mul(settings.population().into())
    };
    if !(0..).zip(&stored.history).all(is_possible) {
        return Err("a generation has impossible values");
    }
    Ok(())
}

fn genome(topology: Topology, weights: &[i16]) -> Result<Genome, CheckpointError> {
    Genome::from_weights(topology, weights)
        .map_err(|_| CheckpointError::Damaged("a genome does not fit the topology"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Overrides;
    use minimal_surprise_sim::{Engine, EnginePath};
    use std::sync::atomic::AtomicBool;

    fn settings() -> Settings {
        let mut given = Overrides::default();
        for (key, value) in [
            ("grid", "8x8"),
            ("robots", "20"),
            ("population", "4"),
            ("generations", "3"),
            ("repetitions", "2"),
            ("steps", "20"),
        ] {
            given.flag(key, Some(value));
        }
        Settings::resolve(&given, || 1).unwrap()
    }

    /// Decodes a changed checkpoint with a correct checksum, taken after two of three generations.
    fn decoded(change: impl FnOnce(&mut Stored)) -> Result<Experiment, CheckpointError> {
        let mut experiment = Experiment::new(settings());
        for _ in 0..2 {
            let _ =
                experiment.advance(Engine::Plain, EnginePath::Portable, &AtomicBool::new(false));
        }
        let bytes = encode(&experiment, "text");
        let mut stored = postcard::from_bytes(&bytes).unwrap();
        change(&mut stored);
        decode(&sealed(&stored), settings(), "text")
    }

    #[test]
    fn a_checkpoint_with_numbers_that_cannot_be_is_damaged() {
        assert_eq!(decoded(|_| {}).unwrap().history().len(), 2);
        let changes: [fn(&mut Stored); 12] = [
            |stored| stored.generation = 1,
            |stored| stored.generation = u32::MAX,
            |stored| stored.best = None,
            |stored| stored.history.clear(),
            |stored| stored.history.extend_from_within(..),
            |stored| stored.history[1].generation = 0,
            |stored| stored.history[1].best_slot = 4,
            |stored| stored.history[1].worst_repetition = 2,
            |stored| stored.history[1].best_matches = u64::MAX,
            |stored| stored.history[0].total_matches = u64::MAX,
            |stored| stored.history[0].movement = f64::NAN,
            |stored| stored.history[0].share = -1.0,
        ];
        for (place, change) in changes.into_iter().enumerate() {
            let error = decoded(change).expect_err("it is damaged");
            assert!(matches!(error, CheckpointError::Damaged(_)), "{place}");
        }
    }
}
