//! Suites, run as a user would run them: one machine or many, interrupted or not, one result.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tests::full;
use tests::program::{Evolver, Finished};
use tests::tools::{self, Missing};

/// Two settings, three runs each, a moment long.
const SUITE: &str = "
name = \"own\"

[[experiment]]
name = \"two-grids\"
runs = 3
grids = [\"9x8\", \"7x9\"]
robots = [20]
population = 6
generations = 25
repetitions = 2
steps = 40
";

const RUN: [&str; 7] = [
    "suite",
    "own.toml",
    "run",
    "--out",
    "suite",
    "--progress",
    "json",
];

fn with_the_suite() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    evolver.write("own.toml", SUITE.as_bytes());
    evolver
}

/// The hash of all runs, as `status` says it.
fn hash_by_status(evolver: &Evolver) -> String {
    let status = evolver.run(&["suite", "own.toml", "status", "--out", "suite"]);
    let lines = status.stdout.lines();
    let hash = lines.filter_map(|line| line.strip_prefix("hash ")).next();
    hash.unwrap_or_else(|| panic!("no hash in {status:?}"))
        .to_owned()
}

/// The hashes of an uninterrupted suite.
fn expected() -> String {
    let evolver = with_the_suite();
    let run = evolver.run(&RUN);
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver.text("suite/hashes.txt")
}

/// The hashes of a suite that shares did, in the order of the whole.
fn hashes_after(evolver: &Evolver) -> String {
    let run = evolver.run(&RUN);
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver.text("suite/hashes.txt")
}

fn assert_refused(run: &Finished, words: &[&str]) {
    assert_eq!(run.code, Some(2), "{run:?}");
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {run:?}");
    }
}

#[test]
fn kills_at_random_moments_change_no_hash() {
    let least = if full::all_cases() { 100 } else { 15 };
    let seed = 6;
    println!("seed of the moments: {seed}");
    let mut moments = ChaCha8Rng::seed_from_u64(seed);
    let expected = expected();
    let (mut kills, mut suites) = (0, 0);
    while kills < least {
        suites += 1;
        let evolver = with_the_suite();
        loop {
            let running = evolver.start(&RUN);
            std::thread::sleep(Duration::from_micros((moments.next_u32() % 40_000).into()));
            if running.kill() {
                break;
            }
            kills += 1;
            assert!(kills < 100_000, "it does not get anywhere");
        }
        assert_eq!(hashes_after(&evolver), expected);
        let parts: Vec<String> = evolver
            .files()
            .into_iter()
            .filter(|f| f.contains(".part"))
            .collect();
        assert!(
            parts.len() <= 2,
            "abandoned directories are removed: {parts:?}"
        );
    }
    println!("{kills} kills over {suites} suites");
}

#[test]
fn threads_shards_and_gnu_parallel_change_no_hash() {
    let expected = expected();
    let mut hash = String::new();
    for threads in ["1", "2"] {
        let evolver = with_the_suite();
        let run = evolver.run(&[&RUN[..], &["--threads", threads]].concat());
        assert_eq!(run.code, Some(0), "{run:?}");
        hash = hash_by_status(&evolver);
        assert!(run.stdout.contains(&hash), "{hash}: {run:?}");
        assert_eq!(
            evolver.text("suite/hashes.txt"),
            expected,
            "{threads} threads"
        );
    }
    let evolver = with_the_suite();
    for shard in ["2/3", "0/3", "1/3", "1/3"] {
        let task = [
            "run-task", "--suite", "own.toml", "--out", "suite", "--shard", shard,
        ];
        let run = evolver.run(&task);
        assert!(run.stdout.contains("2 of 2 runs done"), "{run:?}");
    }
    assert_eq!(hash_by_status(&evolver), hash);
    let mut lines: Vec<String> = (0..3)
        .flat_map(|shard| {
            let hashes = evolver.text(&format!("suite/hashes-{shard}-of-3.txt"));
            hashes.lines().map(str::to_owned).collect::<Vec<_>>()
        })
        .collect();
    lines.sort();
    let mut whole: Vec<&str> = expected.lines().collect();
    whole.sort_unstable();
    assert_eq!(lines, whole);
}

#[test]
fn gnu_parallel_runs_the_shards() {
    let found = Command::new("parallel").arg("--version").output();
    let is_gnu = found.is_ok_and(|output| output.stdout.starts_with(b"GNU parallel"));
    let tool = if is_gnu {
        Ok(())
    } else {
        Err(Missing(
            "no GNU parallel: apt-get install parallel".to_owned(),
        ))
    };
    if tools::require(tool).is_none() {
        return;
    }
    let evolver = with_the_suite();
    let task = "run-task --suite own.toml --out suite --threads 1 --shard {}/4";
    let output = Command::new("parallel")
        .args(["--will-cite", "--jobs", "2", "--joblog", "joblog"])
        .arg(evolver.program())
        .args(task.split(' '))
        .args([":::", "0", "1", "2", "3"])
        .current_dir(evolver.folder())
        .output()
        .expect("it has just answered");
    assert!(output.status.success(), "{output:?}");
    let by_status = hash_by_status(&evolver);
    assert_eq!(hashes_after(&evolver), expected());
    assert_eq!(hash_by_status(&evolver), by_status);
}

#[test]
fn a_task_ends_well_only_when_its_share_is_done() {
    let expected = expected();
    for patience in [0, 20, 500] {
        let evolver = with_the_suite();
        let other = evolver.start(&RUN);
        let begun = || evolver.files().iter().any(|file| file.contains("/runs/"));
        while !begun() {
            std::thread::sleep(Duration::from_millis(1));
        }
        let task = [
            "run-task", "--suite", "own.toml", "--out", "suite", "--shard", "0/1",
        ];
        let run = std::thread::scope(|scope| {
            let task = scope.spawn(|| evolver.run(&task));
            std::thread::sleep(Duration::from_millis(patience));
            other.kill();
            task.join().expect("it does not panic")
        });
        assert_eq!(run.code, Some(0), "{run:?}");
        assert!(run.stdout.contains("6 of 6 runs done"), "{run:?}");
        assert_eq!(evolver.text("suite/hashes.txt"), expected);
    }
}

/// A folder with programs of Slurm's names, which keep what they are told and say what Slurm would.
fn fake_slurm(evolver: &Evolver, sbatch: &str) -> String {
    let programs = [
        ("sbatch", sbatch),
        ("scontrol", "echo 'MaxArraySize            = 4'"),
    ];
    fs::create_dir(evolver.folder().join("bin")).expect("the folder is new");
    for (name, text) in programs {
        evolver.write(
            &format!("bin/{name}"),
            format!("#!/bin/sh\n{text}\n").as_bytes(),
        );
        let path = evolver.folder().join("bin").join(name);
        let made = Command::new("chmod").arg("+x").arg(path).status();
        assert!(made.is_ok_and(|status| status.success()), "{name}");
    }
    let path = std::env::var("PATH").unwrap_or_default();
    format!("{}/bin:{path}", evolver.folder().display())
}

const SUBMIT: [&str; 9] = [
    "suite", "own.toml", "submit", "--engine", "slurm", "--shards", "5", "--out", "suite",
];

#[test]
fn a_queued_task_does_not_meet_what_was_edited_or_submitted_later() {
    let evolver = with_the_suite();
    let path = fake_slurm(
        &evolver,
        "cp \"$1\" ../../../got.sh; echo Submitted batch job 7",
    );
    let path = ("PATH", path.as_str());
    let shown = evolver.run_with(path, &[&SUBMIT[..], &["--dry-run"]].concat());
    assert_eq!(shown.code, Some(0), "{shown:?}");
    assert!(!evolver.folder().join("suite").exists(), "only shown");
    let submitted = evolver.run_with(path, &SUBMIT);
    assert_eq!(submitted.stdout, "Submitted batch job 7\n", "{submitted:?}");
    assert_eq!(evolver.text("got.sh"), shown.stdout);

    evolver.write("own.toml", SUITE.replace("runs = 3", "runs = 1").as_bytes());
    let later = evolver.run_with(path, &SUBMIT);
    assert_eq!(later.code, Some(0), "{later:?}");
    let array = evolver.text("got.sh");
    assert!(array.contains("--array=0-1\n"), "a task a run: {array}");
    for index in 0..5 {
        let task = Command::new("sh")
            .arg("suite/jobs/1/job.sh")
            .env("SLURM_ARRAY_TASK_ID", index.to_string())
            .current_dir(evolver.folder())
            .output()
            .expect("the shell starts");
        assert!(task.status.success(), "{task:?}");
    }
    evolver.write("own.toml", SUITE.as_bytes());
    let by_status = hash_by_status(&evolver);
    assert_eq!(hashes_after(&evolver), expected());
    assert_eq!(hash_by_status(&evolver), by_status);
}

#[test]
fn a_refused_submission_says_what_the_cluster_takes_and_leaves_nothing() {
    let evolver = with_the_suite();
    let path = fake_slurm(
        &evolver,
        "echo 'Invalid job array specification' >&2; exit 1",
    );
    let refused = evolver.run_with(("PATH", &path), &SUBMIT);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    for words in [
        "Invalid job array specification",
        "--shards = 5",
        "from 1 to 4",
    ] {
        assert!(refused.stderr.contains(words), "no {words:?}: {refused:?}");
    }
    let none = evolver.run_with(("PATH", "/none"), &SUBMIT);
    assert!(none.stderr.contains("login node"), "{none:?}");
    let percent = [&SUBMIT[..8], &["100%"]].concat();
    let percent = evolver.run_with(("PATH", &path), &percent);
    assert_eq!(percent.code, Some(2), "{percent:?}");
    assert!(percent.stderr.contains("--out"), "{percent:?}");
    let jobs = |file: &String| file.contains("jobs");
    assert!(!evolver.files().iter().any(jobs), "{:?}", evolver.files());
}

#[test]
fn two_processes_share_the_work() {
    let evolver = with_the_suite();
    let other = evolver.start(&RUN);
    let run = evolver.run(&RUN);
    assert_eq!(run.code, Some(0), "{run:?}");
    other.wait_for_lines(1000);
    other.kill();
    assert_eq!(hashes_after(&evolver), expected());
}

/// Every file of the runs but `meta.json` and `time.json`, which say by which command and how long,
/// and what a process left that was killed before a run had its name.
fn contents(evolver: &Evolver) -> BTreeMap<String, Vec<u8>> {
    let files = evolver.files().into_iter();
    files
        .filter(|file| file.starts_with("suite/runs/"))
        .filter(|file| !file.ends_with("/meta.json") && !file.ends_with("/time.json"))
        .filter(|file| !file.starts_with("suite/runs/."))
        .map(|file| (file.clone(), evolver.read(&file)))
        .collect()
}

#[test]
fn processes_that_know_no_locks_leave_what_one_leaves() {
    let alone = with_the_suite();
    assert_eq!(alone.run(&RUN).code, Some(0));
    let expected = contents(&alone);
    let (ended, mut removed) = (AtomicBool::new(false), 0);
    for _ in 0..if full::all_cases() { 20 } else { 4 } {
        let evolver = with_the_suite();
        let runs = evolver.folder().join("suite/runs");
        ended.store(false, Ordering::Relaxed);
        std::thread::scope(|scope| {
            // As on a file system without locks: nobody meets the lock of another.
            let remover = scope.spawn(|| {
                let mut removed = 0;
                while !ended.load(Ordering::Relaxed) {
                    for run in fs::read_dir(&runs).into_iter().flatten().flatten() {
                        removed += u32::from(fs::remove_file(run.path().join(".lock")).is_ok());
                    }
                }
                removed
            });
            let killed = evolver.start(&RUN);
            let others = [(); 2].map(|()| scope.spawn(|| evolver.run(&RUN)));
            std::thread::sleep(Duration::from_millis(30));
            killed.kill();
            let ends = others.map(|other| other.join().expect("it does not panic"));
            ended.store(true, Ordering::Relaxed);
            for run in ends {
                assert_eq!(run.code, Some(0), "{run:?}");
            }
            removed += remover.join().expect("it does not panic");
        });
        assert_eq!(hashes_after(&evolver), alone.text("suite/hashes.txt"));
        assert!(contents(&evolver) == expected, "{:?}", evolver.files());
    }
    println!("{removed} locks removed");
    assert!(removed > 0);
}

#[test]
fn plan_and_status_count_the_runs() {
    let evolver = with_the_suite();
    let plan = evolver.run(&["suite", "own.toml", "plan"]);
    assert!(plan.stdout.contains("6 different runs"), "{plan:?}");
    let none = evolver.run(&["suite", "own.toml", "status", "--out", "suite"]);
    assert_eq!(none.stdout.matches("0 of 3 done").count(), 2, "{none:?}");
    let one = evolver.run(&[&RUN[..], &["--runs", "1"]].concat());
    assert_eq!(one.code, Some(0), "{one:?}");
    let status = evolver.run(&["suite", "own.toml", "status", "--out", "suite"]);
    assert_eq!(
        status.stdout.matches("1 of 3 done").count(),
        2,
        "{status:?}"
    );
    let paper = evolver.run(&["paper", "plan"]);
    assert!(paper.stdout.contains("600 different runs"), "{paper:?}");
    let times = evolver.run(&["paper", "plan", "--runs-times", "10", "--only", "noise"]);
    assert!(times.stdout.contains("1200 different runs"), "{times:?}");
}

#[test]
fn a_run_of_a_suite_is_the_run_of_its_settings() {
    let evolver = with_the_suite();
    let run = evolver.run(&[&RUN[..], &["--runs", "1"]].concat());
    assert_eq!(run.code, Some(0), "{run:?}");
    let hashes = evolver.text("suite/hashes.txt");
    let (id, hash) = hashes.lines().next().unwrap().split_once(' ').unwrap();
    let config = format!("suite/runs/{id}/config.toml");
    let again = evolver.run(&["evolve", &config, "--out", "again"]);
    assert_eq!(again.code, Some(0), "{again:?}");
    assert_eq!(evolver.text("again/DONE").trim(), hash);
}

#[test]
fn bad_suites_are_refused_with_their_place() {
    let evolver = Evolver::in_empty_folder();
    let suite = |text: &str| {
        evolver.write("own.toml", text.as_bytes());
        evolver.run(&["suite", "own.toml", "run"])
    };
    assert_refused(
        &suite("name = \"own\"\nexperiments = 3\n"),
        &["own.toml", "line 2", "experiments"],
    );
    assert_refused(
        &suite(&SUITE.replace("9x8", "9x2")),
        &["two-grids", "9x2", "from 3"],
    );
    assert_refused(
        &suite(&SUITE.replace("runs = 3", "runs = 0")),
        &["two-grids", "runs = 0"],
    );
    assert_refused(
        &suite(&SUITE.replace("[20]", "[64]")),
        &["two-grids", "64", "from 1 to 63"],
    );
    assert_refused(&suite("name = 3\n"), &["own.toml", "line 1"]);
    let none = evolver.run(&["suite", "none.toml", "run"]);
    assert_refused(&none, &["none.toml", "No such file"]);
    evolver.write("own.toml", SUITE.as_bytes());
    let only = evolver.run(&["suite", "own.toml", "run", "--only", "three-grids"]);
    assert_refused(&only, &["--only", "three-grids", "two-grids"]);
    let shard = ["run-task", "--suite", "own.toml", "--shard", "3/3"];
    assert_refused(&evolver.run(&shard), &["--shard", "3/3", "i/n"]);
    assert_refused(
        &evolver.run(&["run-task", "--shard", "0/3"]),
        &["--suite <FILE>"],
    );
    assert_eq!(evolver.files(), ["own.toml"], "nothing was written");
}

#[test]
fn a_directory_that_cannot_be_written_is_said_to_be() {
    let evolver = with_the_suite();
    evolver.write("suite", b"a file");
    let run = evolver.run(&RUN);
    assert_ne!(run.code, Some(0), "{run:?}");
    assert!(run.stderr.contains("suite"), "{run:?}");
}

/// A file system of its own, as large as it is made; gone with this.
struct SmallDisk(std::path::PathBuf);

impl SmallDisk {
    /// Only a privileged process gets one.
    fn mounted_at(path: std::path::PathBuf, size: &str) -> Option<Self> {
        fs::create_dir_all(&path).unwrap();
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(&path)
            .output();
        mounted
            .is_ok_and(|output| output.status.success())
            .then(|| Self(path))
    }

    fn grow_to(&self, size: &str) {
        let grown = Command::new("mount")
            .args(["-o", &format!("remount,size={size}")])
            .arg(&self.0)
            .status();
        assert!(grown.unwrap().success());
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

#[test]
fn a_suite_on_a_full_disk_says_so_and_goes_on_when_there_is_room() {
    let evolver = with_the_suite();
    let Some(disk) = SmallDisk::mounted_at(evolver.folder().join("suite"), "112k") else {
        println!("skipped: no file system can be mounted here");
        return;
    };
    let full = evolver.run(&RUN);
    assert_eq!(full.code, Some(1), "{full:?}");
    assert!(full.stderr.contains("No space left"), "{full:?}");
    assert!(full.stderr.contains("suite/runs/"), "{full:?}");
    disk.grow_to("8m");
    let again = evolver.run(&RUN);
    assert_eq!(again.code, Some(0), "{again:?}");
    assert_eq!(evolver.text("suite/hashes.txt"), expected());
}

#[test]
fn a_report_goes_where_it_is_asked_for_and_replaces_nothing_but_a_report() {
    let evolver = with_the_suite();
    assert_eq!(evolver.run(&RUN).code, Some(0));
    let report =
        |to: &str| evolver.run(&["suite", "own.toml", "report", "--out", "suite", "--to", to]);
    for _ in 0..2 {
        let written = report("results");
        assert_eq!(written.code, Some(0), "{written:?}");
    }
    assert!(evolver.text("results/report.html").contains("<h1>"));
    let with_gallery = |to: &str| {
        let report = ["suite", "own.toml", "report", "--out", "suite", "--gallery"];
        evolver.run(&[&report[..], &["--to", to]].concat())
    };
    for to in ["results", "results", "new", "new"] {
        let written = with_gallery(to);
        assert_eq!(written.code, Some(0), "{written:?}");
    }
    fs::create_dir(evolver.folder().join("said")).unwrap();
    evolver.write("said/looked-into.md", b"Chance.\n");
    assert_eq!(report("said").code, Some(0));

    let (ours, kept) = (evolver.read("results/report.html"), b"dear");
    for (folder, file, with_ours) in [
        ("letters", "mother.txt", false),
        ("letters-on-what-was-looked-into", "looked-into.md", false),
        ("pictures", "gallery/index.html", false),
        ("photographs", "gallery/one.png", true),
        ("file", "gallery", true),
        ("of-work", "report.html", false),
    ] {
        let path = format!("{folder}/{file}");
        let inside = evolver.folder().join(&path);
        fs::create_dir_all(inside.parent().unwrap()).unwrap();
        evolver.write(&path, kept);
        if with_ours {
            evolver.write(&format!("{folder}/report.html"), &ours);
        }
        if file == "looked-into.md" {
            evolver.write(&format!("{folder}/table-1.csv"), kept);
        }
        let before = evolver.files();
        assert_refused(&with_gallery(folder), &[folder, "--to"]);
        assert_refused(&report(folder), &[folder, "--to"]);
        assert_eq!(evolver.files(), before);
        assert_eq!(evolver.read(&path), kept);
    }
}

#[test]
fn the_report_of_the_papers_runs_may_be_written_again() {
    let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results");
    assert!(minimal_surprise_evolver::suite::report::may_be_written(
        &results
    ));
}
