//! Tests every reader of external bytes with the corpus in `fuzz-corpus` and with mutants of the
//! corpus.
//!
//! The corpus has one folder per target. It contains seeds and, as `found-…`, every input on which
//! a reader has failed. `UPDATE_CORPUS=1` rewrites the seeds. `scripts/fuzz.sh` runs the same
//! targets with coverage guidance.

mod mutation;
mod seeds;
mod targets;

use minimal_surprise_controller::codec::CRC_32C;
use std::fs;
use std::panic::catch_unwind;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use targets::{TARGETS, Target, check, tests_folder};

/// Time for which a target is tested with mutants. No result depends on the number of mutants.
const TIME: Duration = Duration::from_secs(5);
/// Number of the series of mutants: the same series contains the same mutants on every machine.
const SERIES: u64 = 1;

fn corpus(name: &str) -> PathBuf {
    tests_folder().join("fuzz-corpus").join(name)
}

/// Reads the inputs in a target's corpus, ordered by name.
fn inputs(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let files = fs::read_dir(corpus(name)).unwrap_or_else(|_| panic!("{name} has no corpus"));
    let mut paths: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    let read = |path: PathBuf| (path.clone(), fs::read(path).unwrap());
    paths.into_iter().map(read).collect()
}

/// Runs a target. If the target fails, saves the input, which should be committed with the fix.
fn run(target: Target, bytes: &[u8], origin: &str) -> bool {
    catch_unwind(|| check(target, bytes)).unwrap_or_else(|_| {
        let name = format!("found-{:08x}", CRC_32C.checksum(bytes));
        let path = corpus(target.0).join(name);
        fs::write(&path, bytes).unwrap();
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        panic!("{}, {origin}: kept as {}\n{hex}", target.0, path.display());
    })
}

fn any_bytes_are_read_or_refused(name: &str) {
    let target = *TARGETS.iter().find(|target| target.0 == name).unwrap();
    let inputs = inputs(name);
    let accepted =
        |(path, bytes): &&(PathBuf, Vec<u8>)| run(target, bytes, &path.to_string_lossy());
    let accepted = inputs.iter().filter(accepted).count();
    assert!(
        accepted > 0,
        "{name} accepts none of its seeds: UPDATE_CORPUS=1"
    );
    let seeds: Vec<Vec<u8>> = inputs.into_iter().map(|(_, bytes)| bytes).collect();
    let (start, mut accepted) = (Instant::now(), 0);
    let mut number = 0;
    while start.elapsed() < TIME {
        let bytes = mutation::mutant(&seeds, SERIES, number);
        accepted += u64::from(run(target, &bytes, &format!("mutant {number}")));
        number += 1;
    }
    println!("{name}: {number} mutants of series {SERIES}, {accepted} of them accepted");
}

macro_rules! fuzz {
    ($($test:ident $target:literal;)*) => {
        $(#[test] fn $test() { any_bytes_are_read_or_refused($target); })*

        #[test]
        fn every_target_has_a_test_and_a_corpus_and_all_corpora_are_small() {
            let names = TARGETS.map(|(name, _)| name);
            assert_eq!(names, [$($target),*]);
            if std::env::var_os("UPDATE_CORPUS").is_some() {
                for (target, name, bytes) in seeds::seeds() {
                    fs::create_dir_all(corpus(target)).unwrap();
                    fs::write(corpus(target).join(name), bytes).unwrap();
                }
            }
            let inputs = names.into_iter().flat_map(inputs);
            let bytes: usize = inputs.map(|(_, bytes)| bytes.len()).sum();
            assert!(bytes < 300_000, "{bytes} bytes");
        }
    };
}

fuzz! {
    any_bytes_are_a_genome_or_refused "genome";
    any_bytes_are_a_checkpoint_or_refused "checkpoint";
    any_config_is_read_or_refused_with_its_run "run-config";
    any_meta_is_read_or_refused_with_its_run "run-meta";
    any_table_of_generations_is_read_or_refused_with_its_run "run-generations";
    any_genome_is_read_or_refused_with_its_run "run-genome";
    any_time_is_read_or_refused_with_its_run "run-time";
    any_final_state_is_read_or_refused_with_its_run "run-final";
    any_mark_is_read_or_refused_with_its_run "run-done";
    any_bytes_are_a_holder_of_a_lock_or_none "lock";
    any_text_is_a_path_that_is_stored_as_text_and_read_back "path";
    any_bytes_are_settings_or_refused "settings";
    any_bytes_are_a_suite_or_refused "suite";
    any_bytes_are_a_trajectory_or_refused "trajectory";
    any_bytes_are_agents_or_refused "agents";
    any_bytes_are_a_genome_text_or_refused "genome-text";
    any_bytes_are_a_drawing_or_refused "drawing";
    any_bytes_to_a_robot_are_answered_once_or_dropped "link-robot";
    any_bytes_to_a_host_are_the_reply_or_dropped "link-host";
    any_flash_has_slots_that_can_be_written "slots";
}
