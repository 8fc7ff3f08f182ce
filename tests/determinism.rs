//! One seed gives one result, regardless of threads, builds and interruptions.

use minimal_surprise_sim::EnginePath;
use minimal_surprise_sim::engine::PATH_VARIABLE;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::time::Duration;
use tests::program::{Evolver, Profile};

/// An evolution of many short generations.
const EVOLUTION: [&str; 15] = [
    "evolve",
    "--grid",
    "9x8",
    "--robots",
    "20",
    "--steps",
    "40",
    "--population",
    "8",
    "--repetitions",
    "3",
    "--generations",
    "60",
    "--seed",
    "31",
];

/// Hash of [`EVOLUTION`] on every machine.
const EVOLUTION_HASH: &str = "5af79e9f6d39fb2448edb30f7dd788f90428940f44d6386844b6a4908b381b37";

/// Two evolutions with pinned hashes: fixed seeds give the same results in every version, unless
/// the change log states otherwise.
const PINNED: [(&[&str], &str); 2] = [
    (
        &[
            "evolve",
            "--generations",
            "2",
            "--population",
            "6",
            "--seed",
            "1",
        ],
        "7974ac1942d3d73e297285a1df392689de20a180c885369776b9c45b3fc17ea7",
    ),
    (
        &[
            "evolve",
            "--grid",
            "20x20",
            "--sensor-model",
            "b",
            "--noise",
            "0.1",
            "--steps",
            "100",
            "--generations",
            "4",
            "--population",
            "5",
            "--seed",
            "2",
        ],
        "7a0bb8583d4034831d497d18fb2b551cc02416561b051b917ad5e45c9ac1c678",
    ),
];

fn hash(evolver: &Evolver, arguments: &[&str], extra: &[&str]) -> String {
    let arguments = [arguments, extra, &["--out", "run"]].concat();
    let run = evolver.run(&arguments);
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver.text("run/DONE").trim().to_owned()
}

/// Reads all files of the run except those that contain the command and the duration.
fn contents(evolver: &Evolver) -> Vec<(String, String)> {
    let files = evolver.files().into_iter();
    files
        .filter(|file| !file.ends_with("/meta.json") && !file.ends_with("/time.json"))
        .map(|file| (file.clone(), evolver.text(&file)))
        .collect()
}

#[test]
fn the_number_of_threads_changes_nothing() {
    for threads in ["1", "2", "3"] {
        let evolver = Evolver::in_empty_folder();
        let hash = hash(&evolver, &EVOLUTION, &["--threads", threads]);
        assert_eq!(hash, EVOLUTION_HASH, "{threads} threads");
    }
}

#[test]
fn engines_and_their_paths_change_nothing() {
    for (arguments, expected) in PINNED.into_iter().chain([(&EVOLUTION[..], EVOLUTION_HASH)]) {
        let evolver = Evolver::in_empty_folder();
        assert_eq!(hash(&evolver, arguments, &["--engine", "plain"]), expected);
        let of_plain_world = contents(&evolver);
        for path in EnginePath::available() {
            let evolver = Evolver::in_empty_folder();
            let arguments = [arguments, &["--out", "run"]].concat();
            let run = evolver.run_with((PATH_VARIABLE, path.name()), &arguments);
            assert_eq!(run.code, Some(0), "{run:?}");
            assert_eq!(contents(&evolver), of_plain_world, "path {}", path.name());
        }
    }
    let refused = Evolver::in_empty_folder().run_with((PATH_VARIABLE, "abacus"), &["evolve"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.stderr.contains("abacus") && refused.stderr.contains("portable"));
}

#[test]
fn a_build_with_debug_assertions_gives_the_same_hash() {
    let evolver = Evolver::built(Profile::Debug);
    assert_eq!(hash(&evolver, &EVOLUTION, &[]), EVOLUTION_HASH);
}

#[test]
fn at_least_twenty_kills_and_resumes_change_nothing() {
    let seed = 20;
    println!("seed of the kill times: {seed}");
    let mut moments = ChaCha8Rng::seed_from_u64(seed);
    let evolver = Evolver::in_empty_folder();
    let flags = ["--out", "run", "--progress", "lines"];
    let mut running = evolver.start(&[&EVOLUTION[..], &flags[..]].concat());
    let mut kills = 0;
    loop {
        running.wait_for_lines(moments.next_u32() as usize % 3 + 1);
        std::thread::sleep(Duration::from_micros((moments.next_u32() % 3000).into()));
        if running.kill() {
            break;
        }
        kills += 1;
        assert!(kills < 1000, "the run makes no progress");
        running = evolver.start(&["evolve", "--resume", "run", "--progress", "lines"]);
    }
    println!("{kills} kills");
    assert!(kills >= 20, "only {kills} kills");
    assert_eq!(evolver.text("run/DONE").trim(), EVOLUTION_HASH);
    let uninterrupted = Evolver::in_empty_folder();
    hash(&uninterrupted, &EVOLUTION, &[]);
    for file in [
        "generations.csv",
        "best.genome",
        "final.json",
        "config.toml",
    ] {
        let name = format!("run/{file}");
        assert_eq!(evolver.read(&name), uninterrupted.read(&name), "{file}");
    }
    assert_eq!(
        evolver.files(),
        uninterrupted.files(),
        "no other files are left"
    );
}

#[test]
fn value_stability_run_hash() {
    for (arguments, expected) in PINNED {
        let evolver = Evolver::in_empty_folder();
        assert_eq!(hash(&evolver, arguments, &[]), expected, "{arguments:?}");
    }
}
