//! A run's identity: a hash of everything that its result depends on.
//!
//! It covers the kernel, the version of what is computed with it, and the settings as
//! `config.toml` holds them, with the seed. A setting that was added after the first release is left
//! out while it has its default, so that runs keep their names.

use crate::settings::Settings;
use minimal_surprise_controller::KERNEL_ID;
use sha2::{Digest, Sha256};

/// Version of what a run computes from its settings; changes with every change of results.
const RESULTS_VERSION: &str = "1";

/// The identity of a run with these settings.
#[must_use]
pub fn run_id(settings: &Settings) -> [u8; 8] {
    let text = format!("{KERNEL_ID}\n{RESULTS_VERSION}\n{}", settings.toml());
    let hash = Sha256::digest(text.as_bytes());
    std::array::from_fn(|byte| hash[byte])
}
