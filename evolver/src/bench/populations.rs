//! The populations used for benchmarks: 20 genomes each from generations 10, 50 and 90 of default
//! evolutions with seed 1, as concatenated containers.
//!
//! `cargo run --release --example bench_populations` generates the files.

use minimal_surprise_controller::codec::container_length;
use minimal_surprise_controller::{EncodedGenome, Genome};

/// Returns the population of an evolution on a 15 × 15 grid.
#[must_use]
pub fn c_15x15() -> Vec<Genome> {
    read(include_bytes!("populations/c-15x15.genomes"))
}

/// Returns the population of an evolution on 20 × 20.
#[must_use]
pub fn c_20x20() -> Vec<Genome> {
    read(include_bytes!("populations/c-20x20.genomes"))
}

/// Returns the population of an evolution on 15 × 15 with 10 % noise.
#[must_use]
pub fn c_15x15_noise() -> Vec<Genome> {
    read(include_bytes!("populations/c-15x15-noise.genomes"))
}

fn read(mut bytes: &[u8]) -> Vec<Genome> {
    let mut genomes = Vec::new();
    while !bytes.is_empty() {
        let length = container_length(bytes).expect("shipped files are well-formed");
        let (container, rest) = bytes.split_at(length);
        let encoded = EncodedGenome::decode(container).expect("shipped genomes are valid");
        genomes.push(encoded.to_genome());
        bytes = rest;
    }
    genomes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_holds_sixty_genomes_of_model_c() {
        for genomes in [c_15x15(), c_20x20(), c_15x15_noise()] {
            assert_eq!(genomes.len(), 60);
            assert!(genomes.iter().all(|g| g.weights().len() == 616));
        }
    }
}
