//! Run IDs: hashes of everything that a run's result depends on.
//!
//! A run ID covers the kernel, the version of the results computed with it, and the settings as
//! written to `config.toml`, including the seed. A setting added after the first release is left
//! out while it has its default, so that existing runs keep their IDs.

use crate::settings::Settings;
use minimal_surprise_controller::KERNEL_ID;
use sha2::{Digest, Sha256};

/// Version of the results computed from the same settings; changes whenever results change.
const RESULTS_VERSION: &str = "1";

/// Returns the ID of a run with these settings.
#[must_use]
pub fn run_id(settings: &Settings) -> [u8; 8] {
    let text = format!("{KERNEL_ID}\n{RESULTS_VERSION}\n{}", settings.toml());
    let hash = Sha256::digest(text.as_bytes());
    std::array::from_fn(|byte| hash[byte])
}
