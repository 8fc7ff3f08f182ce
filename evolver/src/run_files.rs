//! The files of a run directory, by name; [`run_dir`](crate::run_dir) says what they hold.

/// The settings.
pub(crate) const CONFIG: &str = "config.toml";
/// Schema version, seed, program.
pub(crate) const META: &str = "meta.json";
/// A line a generation.
pub(crate) const GENERATIONS: &str = "generations.csv";
/// The last generation's best genome.
pub(crate) const BEST: &str = "best.genome";
/// Where the final run started from and ended.
pub(crate) const FINAL: &str = "final.json";
/// How long it took.
pub(crate) const TIME: &str = "time.json";
/// Marks a run as complete, and holds its hash.
pub(crate) const DONE: &str = "DONE";
/// Until the run is complete: where it goes on.
pub(crate) const CHECKPOINT: &str = "checkpoint";

/// What a complete run cannot be read back without, besides [`DONE`].
pub(crate) const OF_COMPLETE: [&str; 5] = [CONFIG, META, BEST, FINAL, GENERATIONS];
