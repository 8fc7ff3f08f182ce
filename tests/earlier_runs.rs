//! Files of the first release keep their names, and can still be read and resumed.

use minimal_surprise_controller::EncodedGenome;
use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX};
use minimal_surprise_evolver::suite::Suite;
use minimal_surprise_evolver::suite::plan::Plan;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use tests::program::Evolver;

/// Six short runs, and the flags of each in addition to [`SHORT`].
const RUNS: [(&str, &[&str]); 6] = [
    ("model-a", &["--sensor-model", "a"]),
    ("model-b", &["--sensor-model", "b"]),
    ("model-c", &[]),
    ("predefined-line", &["--predefine", "line"]),
    ("noise", &["--noise", "0.1"]),
    ("from", &["--from", "model-c/best.genome"]),
];

const SHORT: &str = "evolve --grid 8x8 --robots 20 --population 4 --generations 3 --repetitions 2 \
                     --steps 20 --seed 1";

/// Hash of the run in `unfinished` if it is completed without an interruption.
const RESUMED: &str = "566d8dd58ecfaa36cb840a4c2db3546de9f10497c27f29a4d4af75d976f8968c";

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/first-release")
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).unwrap();
        }
    }
}

/// Creates a folder with all files of the first release; returns the program in it.
fn evolver() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    copy(&fixtures(), evolver.folder());
    evolver
}

fn words(text: &str) -> Vec<&str> {
    text.split_whitespace().collect()
}

#[test]
fn the_runs_of_the_papers_suite_have_the_names_of_the_first_release() {
    let plan = Plan::new(&Suite::paper().unwrap(), None, None, false).unwrap();
    let names: BTreeSet<String> = plan.runs().iter().map(|run| run.id).collect();
    let expected = fs::read_to_string(fixtures().join("paper-run-ids.txt")).unwrap();
    assert_eq!(expected.lines().count(), 600);
    assert!(names.iter().map(String::as_str).eq(expected.lines()));
}

#[test]
fn six_short_runs_end_with_the_hashes_of_the_first_release() {
    let evolver = evolver();
    for (name, flags) in RUNS {
        let again = [&words(SHORT), flags, &["--out", "again"]].concat();
        let made = evolver.run(&again);
        assert_eq!(made.code, Some(0), "{name}: {made:?}");
        for file in ["DONE", "best.genome", "generations.csv", "config.toml"] {
            let [first, again] = [name, "again"].map(|run| evolver.read(&format!("{run}/{file}")));
            // The path of the ancestor is stored as the user gave it.
            assert!(
                first == again || (name, file) == ("from", "config.toml"),
                "{name}: {file}"
            );
        }
        fs::remove_dir_all(evolver.folder().join("again")).unwrap();
    }
}

#[test]
fn finished_runs_and_suites_of_the_first_release_are_read() {
    let evolver = evolver();
    for (name, _) in RUNS {
        for command in [
            "classify RUN",
            "evaluate RUN",
            "inspect RUN",
            "export RUN --format trajectory",
        ] {
            let command = command.replace("RUN", name);
            let read = evolver.run(&words(&command));
            assert_eq!(read.code, Some(0), "{command}: {read:?}");
        }
    }
    let hashes = evolver.read("suite/hashes.txt");
    let run = evolver.run(&words("suite own.toml run --out suite"));
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(run.stdout.contains("2 of 2 runs done"), "{run:?}");
    assert_eq!(evolver.read("suite/hashes.txt"), hashes);
    let report = evolver.run(&words("suite own.toml report --out suite"));
    assert_eq!(report.code, Some(0), "{report:?}");
}

#[test]
fn an_unfinished_run_of_the_first_release_is_resumed() {
    let evolver = evolver();
    let resumed = evolver.run(&words("evolve --resume unfinished"));
    assert_eq!(resumed.code, Some(0), "{resumed:?}");
    assert_eq!(evolver.text("unfinished/DONE").trim(), RESUMED);
}

#[test]
fn genomes_of_the_first_release_are_read_and_written_byte_for_byte() {
    for (name, _) in RUNS {
        let file = fs::read(fixtures().join(name).join("best.genome")).unwrap();
        let encoded = EncodedGenome::decode(&file).unwrap();
        let mut buffer = [0; CONTAINER_BYTES_MAX];
        let written = codec::encode(&encoded.to_genome(), encoded.provenance(), &mut buffer);
        assert_eq!(written.unwrap(), file, "{name}");
    }
}
