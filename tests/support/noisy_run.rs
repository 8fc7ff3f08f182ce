//! A noisy run of the first version; its steps hash also covers bits that have no sensor.

use std::fs;
use std::path::Path;

/// Copies the run's directory.
pub fn copy_noisy_run(to: &Path) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/noisy-run-v1");
    fs::create_dir_all(to).unwrap();
    for file in fs::read_dir(from).unwrap() {
        let file = file.unwrap();
        fs::copy(file.path(), to.join(file.file_name())).unwrap();
    }
}
