//! Genomes to be written to robots.

use minimal_surprise_controller::codec::{CONTAINER_BYTES_MAX, CRC_32C, Provenance, encode};
use minimal_surprise_controller::{Genome, KERNEL_ID, Topology};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// Returns the container of a genome with random weights.
///
/// # Panics
/// Never: the buffer is large enough for any container.
#[must_use]
pub fn random(seed: u64, topology: Topology) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let genome = Genome::random(topology, &mut rng);
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    encode(&genome, Provenance::default(), &mut buffer)
        .expect("the buffer holds any container")
        .to_vec()
}

/// Returns a copy of the container that names a different kernel.
///
/// # Panics
/// If the bytes are not a container.
#[must_use]
pub fn of_another_kernel(container: &[u8]) -> Vec<u8> {
    let mut other = container.to_vec();
    let at = other
        .windows(8)
        .position(|window| window == KERNEL_ID.0)
        .expect("a container names its kernel");
    other[at] ^= 1;
    let body = other.len() - 4;
    let crc = CRC_32C.checksum(&other[..body]);
    other[body..].copy_from_slice(&crc.to_le_bytes());
    other
}
