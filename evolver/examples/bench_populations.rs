//! Generates the populations that `evolver bench` measures, from default evolutions with seed 1.
//!
//! `cargo run --release -p minimal-surprise-evolver --example bench_populations`

use minimal_surprise_controller::Provenance;
use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX};
use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::settings::{Overrides, Settings};
use minimal_surprise_sim::{Engine, EnginePath};

const GENERATIONS: [usize; 3] = [10, 50, 90];
const GENOMES: usize = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bench/populations");
    std::fs::create_dir_all(folder)?;
    for (name, grid, noise) in [
        ("c-15x15", "15x15", "0"),
        ("c-20x20", "20x20", "0"),
        ("c-15x15-noise", "15x15", "0.1"),
    ] {
        let mut given = Overrides::default();
        for (key, value) in [("grid", grid), ("noise", noise), ("seed", "1")] {
            given.flag(key, Some(value));
        }
        let mut experiment = Experiment::new(Settings::resolve(&given, || 1)?);
        let never = std::sync::atomic::AtomicBool::new(false);
        let mut bytes = Vec::new();
        for generation in 0..=GENERATIONS[2] {
            if GENERATIONS.contains(&generation) {
                for genome in &experiment.population().ask()[..GENOMES] {
                    let provenance = Provenance {
                        seed: Some(1),
                        generation: generation as u32,
                        ..Provenance::default()
                    };
                    let mut buffer = [0; CONTAINER_BYTES_MAX];
                    bytes.extend_from_slice(codec::encode(genome, provenance, &mut buffer)?);
                }
            }
            experiment.advance(Engine::Fast, EnginePath::best(), &never);
        }
        std::fs::write(format!("{folder}/{name}.genomes"), &bytes)?;
        println!("{name}: {} bytes", bytes.len());
    }
    Ok(())
}
