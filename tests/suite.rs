//! Suites, run as a user would run them: the result is the same on one machine and on several, with
//! and without interruptions.

use minimal_surprise_evolver::suite::plan::Plan;
use minimal_surprise_evolver::suite::{Suite, report};
use minimal_surprise_sim::engine::PATH_VARIABLE;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tests::disk::Disk;
use tests::full;
use tests::program::{Evolver, Finished};
use tests::tools::{self, Missing};

/// Two settings with three short runs each.
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

/// Returns the hash of all runs, as printed by `status`.
fn hash_by_status(evolver: &Evolver) -> String {
    hash_by(evolver, &[])
}

/// Returns the hash of the chosen runs, as printed by `status`.
fn hash_by(evolver: &Evolver, choice: &[&str]) -> String {
    let status = ["suite", "own.toml", "status", "--out", "suite"];
    let status = evolver.run(&[&status[..], choice].concat());
    let lines = status.stdout.lines();
    let hash = lines.filter_map(|line| line.strip_prefix("hash ")).next();
    hash.unwrap_or_else(|| panic!("no hash in {status:?}"))
        .to_owned()
}

/// Returns the hashes of an uninterrupted suite.
fn expected() -> String {
    let evolver = with_the_suite();
    let run = evolver.run(&RUN);
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver.text("suite/hashes.txt")
}

/// Returns the hashes of a suite that was run in shards, ordered as in the whole suite.
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
    println!("seed of the kill times: {seed}");
    let mut moments = ChaCha8Rng::seed_from_u64(seed);
    let whole = with_the_suite();
    let started = Instant::now();
    assert_eq!(whole.run(&RUN).code, Some(0));
    // The delay before a kill is up to the duration of the whole suite, so processes make progress
    // even on a busy machine.
    let longest = started.elapsed().as_micros() as u32;
    let expected = whole.text("suite/hashes.txt");
    let (mut kills, mut suites) = (0, 0);
    while kills < least {
        suites += 1;
        let evolver = with_the_suite();
        loop {
            let running = evolver.start(&RUN);
            std::thread::sleep(Duration::from_micros((moments.next_u32() % longest).into()));
            if running.kill() {
                break;
            }
            kills += 1;
            assert!(kills < 100_000, "the suite makes no progress");
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
        .expect("GNU parallel is installed");
    assert!(output.status.success(), "{output:?}");
    let by_status = hash_by_status(&evolver);
    assert_eq!(hashes_after(&evolver), expected());
    assert_eq!(hash_by_status(&evolver), by_status);
}

#[test]
fn a_task_succeeds_only_when_its_shard_is_done() {
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
            task.join().expect("the task does not panic")
        });
        assert_eq!(run.code, Some(0), "{run:?}");
        assert!(run.stdout.contains("6 of 6 runs done"), "{run:?}");
        assert_eq!(evolver.text("suite/hashes.txt"), expected);
    }
}

/// Creates a folder with programs named like Slurm's; they record their arguments and print what
/// Slurm would print.
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
fn a_queued_task_is_not_affected_by_later_edits_or_submissions() {
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
    assert!(array.contains("--array=0-1\n"), "one task per run: {array}");
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
fn a_refused_submission_reports_the_clusters_limit_and_leaves_nothing() {
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
        "accepts 1 to 4",
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

/// Reads all files of the runs. Leaves out `meta.json` and `time.json`, which contain the command
/// and the duration, and the leftovers of processes that were killed before a run had its final
/// name.
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
fn processes_without_locks_leave_the_files_of_one() {
    let alone = with_the_suite();
    assert_eq!(alone.run(&RUN).code, Some(0));
    let expected = contents(&alone);
    let (ended, mut removed) = (AtomicBool::new(false), 0);
    for _ in 0..if full::all_cases() { 20 } else { 4 } {
        let evolver = with_the_suite();
        let runs = evolver.folder().join("suite/runs");
        ended.store(false, Ordering::Relaxed);
        std::thread::scope(|scope| {
            // This simulates a file system without locks, where no process sees the locks of
            // others.
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
            let ends = others.map(|other| other.join().expect("the run does not panic"));
            ended.store(true, Ordering::Relaxed);
            for run in ends {
                assert_eq!(run.code, Some(0), "{run:?}");
            }
            removed += remover.join().expect("the remover does not panic");
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
    // 6 runs of 20 robots, 6 genomes, 25 generations, 2 repetitions and 40 steps.
    assert!(plan.stdout.contains("1.4 million robot-steps"), "{plan:?}");
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
    for words in [
        "600 different runs",
        "predefined, geometry                       20 new starts",
        "densities, triangular lattice               3 areas, 20 times",
        "if no run of densities has a line: up to 1000 more runs",
        " billion robot-steps",
    ] {
        assert!(paper.stdout.contains(words), "no {words:?}: {paper:?}");
    }
    let times = evolver.run(&["paper", "plan", "--runs-times", "10", "--only", "noise"]);
    assert!(times.stdout.contains("1200 different runs"), "{times:?}");
}

#[test]
fn a_run_of_a_suite_equals_a_run_with_its_settings() {
    let evolver = with_the_suite();
    let run = evolver.run(&[&RUN[..], &["--runs", "1"]].concat());
    assert_eq!(run.code, Some(0), "{run:?}");
    let files = evolver.files();
    let config = files.iter().find(|file| file.ends_with("/config.toml"));
    let config = config.expect("a run has its settings");
    let again = evolver.run(&["evolve", config, "--out", "again"]);
    assert_eq!(again.code, Some(0), "{again:?}");
    let done = config.replace("config.toml", "DONE");
    assert_eq!(evolver.text("again/DONE"), evolver.text(&done));
}

#[test]
fn the_hashes_of_a_part_do_not_replace_those_of_the_whole() {
    let evolver = with_the_suite();
    let part = |choice: &[&str]| {
        let run = evolver.run(&[&RUN[..], choice].concat());
        assert_eq!(run.code, Some(0), "{run:?}");
        assert!(run.stdout.contains("\"hash\":\""), "{run:?}");
    };
    part(&["--runs", "1"]);
    assert!(!evolver.files().iter().any(|file| file.contains("hashes")));
    let whole = hashes_after(&evolver);
    assert_eq!(whole.lines().count(), 6);
    for choice in [
        &["--runs", "1"][..],
        &["--runs-times", "1"],
        &["--only", "two-grids"],
        &["--all"],
    ] {
        part(choice);
        assert_eq!(evolver.text("suite/hashes.txt"), whole);
    }
}

#[test]
fn bad_suites_are_refused_with_the_position_of_the_error() {
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
    assert_eq!(evolver.files(), ["own.toml"], "no file was written");
}

#[test]
fn an_unknown_engine_path_is_refused_before_anything_is_done() {
    let evolver = with_the_suite();
    let task = [
        "run-task", "--suite", "own.toml", "--shard", "0/2", "--out", "suite",
    ];
    for arguments in [&RUN[..], &task] {
        let run = evolver.run_with((PATH_VARIABLE, "abacus"), arguments);
        assert_refused(&run, &[PATH_VARIABLE, "abacus", "portable"]);
    }
    assert_eq!(evolver.files(), ["own.toml"], "no file was written");
}

#[test]
fn a_file_in_the_way_of_a_suite_is_named() {
    let evolver = with_the_suite();
    evolver.write("suite", b"a file");
    let run = evolver.run(&RUN);
    assert_refused(&run, &["suite"]);
    fs::remove_file(evolver.folder().join("suite")).unwrap();
    let elsewhere = [&RUN[..3], &["--out", "/proc/suite"]].concat();
    assert_refused(&evolver.run(&elsewhere), &["/proc/suite"]);
    assert_eq!(evolver.run(&RUN).code, Some(0));
    evolver.write("report", b"a file");
    let report = ["suite", "own.toml", "report", "--out", "suite"];
    for to in ["report", "report/in-a-file", "/proc/report"] {
        let refused = evolver.run(&[&report[..], &["--gallery", "--to", to]].concat());
        assert_refused(&refused, &[to]);
    }
}

#[test]
fn a_run_whose_lock_cannot_be_opened_is_named_and_the_others_are_done() {
    let evolver = with_the_suite();
    assert_eq!(evolver.run(&RUN).code, Some(0));
    let hashes = evolver.text("suite/hashes.txt");
    let runs: Vec<&str> = hashes.lines().map(|line| &line[..16]).collect();
    let at = |run: &str| evolver.folder().join("suite/runs").join(run);
    fs::remove_file(at(runs[0]).join("DONE")).unwrap();
    fs::create_dir(at(runs[0]).join(".lock")).unwrap();
    fs::remove_dir_all(at(runs[5])).unwrap();
    let run = evolver.run(&RUN);
    run.assert_failed(&[runs[0], ".lock", "1 left out"]);
    assert!(run.stdout.contains("\"runs_done\":5,"), "{run:?}");
    fs::remove_dir_all(at(runs[0])).unwrap();
    assert_eq!(hashes_after(&evolver), hashes);
}

/// Creates a suite that searches for a structure that none of its runs has.
fn with_a_search() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    let text = format!(
        "{SUITE}\n[[resilience]]\nname = \"damage\"\nof = \"two-grids\"\nstructure = \
         \"triangular lattice\"\nrobots-in-areas = [2]\nrepeat = 1\nfurther-runs = 2\n"
    );
    evolver.write("own.toml", text.as_bytes());
    evolver
}

#[test]
fn a_damaged_run_beyond_the_plan_is_named_and_only_ends_its_search() {
    let evolver = with_a_search();
    let suite = Suite::read(&evolver.folder().join("own.toml")).unwrap();
    let plan = Plan::new(&suite, None, None, false).unwrap();
    let further = plan.experiments[0].further().next().unwrap();
    let directory = further.directory(Path::new("suite"));
    fs::create_dir_all(evolver.folder().join(&directory)).unwrap();
    evolver.write(&format!("{}/letter", directory.display()), b"dear");
    let run = evolver.run(&RUN);
    run.assert_failed(&[&further.id, "1 left out"]);
    assert!(run.stdout.contains("\"runs_done\":6,"), "{run:?}");
    assert!(evolver.text("suite/hashes.txt").lines().count() == 6);
}

#[test]
fn a_suite_on_a_full_disk_says_so_and_is_resumed_when_there_is_room() {
    let evolver = with_the_suite();
    // Enough space to start the suite, but too few inodes for its files.
    let Some(disk) = tools::require(Disk::mounted_at(
        evolver.folder().join("suite"),
        "8m,nr_inodes=30",
    )) else {
        return;
    };
    let full = evolver.run(&RUN);
    assert_eq!(full.code, Some(1), "{full:?}");
    assert!(full.stderr.contains("No space left"), "{full:?}");
    assert!(full.stderr.contains("suite/runs/"), "{full:?}");
    disk.remount("nr_inodes=1000");
    let again = evolver.run(&RUN);
    assert_eq!(again.code, Some(0), "{again:?}");
    assert_eq!(evolver.text("suite/hashes.txt"), expected());
}

#[test]
fn a_report_is_written_where_requested_and_replaces_only_a_report() {
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
    // A report's page alone does not mark a directory as a report.
    fs::create_dir(evolver.folder().join("saved")).unwrap();
    evolver.write("saved/report.html", &ours);
    evolver.write("saved/mother.txt", kept);
    assert_refused(&report("saved"), &["saved", "--to"]);
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
            evolver.write(&format!("{folder}/.evolver-report"), b"");
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
fn the_report_of_the_papers_runs_can_be_written_again() {
    let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results");
    assert!(report::may_be_written(&results).unwrap());
}

#[test]
fn a_damaged_run_is_not_counted_as_done_and_every_command_names_it() {
    let evolver = with_the_suite();
    let one = ["--runs", "1"];
    assert_eq!(evolver.run(&[&RUN[..], &one].concat()).code, Some(0));
    let hash = hash_by(&evolver, &one);
    let runs = fs::read_dir(evolver.folder().join("suite/runs")).unwrap();
    let run = runs.flatten().next().unwrap().file_name();
    let run = format!("suite/runs/{}", run.to_string_lossy());
    let verb = |verb: &str| {
        let called = ["suite", "own.toml", verb, "--out", "suite"];
        evolver.run(&[&called[..], &one].concat())
    };
    let (name, whole) = (
        format!("{run}/final.json"),
        evolver.text(&format!("{run}/final.json")),
    );
    let later = whole.replace("\"schema_version\": ", "\"schema_version\": 9");
    assert_ne!(later, whole);
    for damage in [None, Some(later)] {
        match &damage {
            None => fs::remove_file(evolver.folder().join(&name)).unwrap(),
            Some(text) => evolver.write(&name, text.as_bytes()),
        }
        let what = if damage.is_some() {
            "schema version 9"
        } else {
            "no final.json"
        };
        let words = [what, &format!("delete {run}")];
        let status = verb("status");
        status.assert_failed(&words);
        assert!(
            status.stdout.contains("1 of 2 different runs done"),
            "{status:?}"
        );
        assert!(!status.stdout.contains("hash "), "{status:?}");
        verb("run").assert_failed(&words);
        verb("report").assert_failed(&words);
        let resumed = evolver.run(&["evolve", "--resume", &run]);
        resumed.assert_failed(&words);
        assert!(!resumed.stdout.contains("complete"), "{resumed:?}");
    }
    fs::remove_dir_all(evolver.folder().join(&run)).unwrap();
    assert_eq!(verb("run").code, Some(0));
    assert_eq!(hash_by(&evolver, &one), hash);
}

#[test]
fn all_damaged_runs_are_named_and_the_others_are_done_shown_and_reported() {
    let evolver = with_the_suite();
    assert_eq!(evolver.run(&RUN).code, Some(0));
    let hashes = evolver.text("suite/hashes.txt");
    let runs: Vec<String> = hashes
        .lines()
        .map(|line| format!("suite/runs/{}", &line[..16]))
        .collect();
    // One file each is truncated, changed, replaced by a directory and missing; one run is not
    // done.
    let state = evolver.text(&format!("{}/final.json", runs[0]));
    evolver.write(&format!("{}/final.json", runs[0]), &state.as_bytes()[..300]);
    evolver.write(&format!("{}/DONE", runs[1]), b"zzz\n");
    let table = evolver
        .folder()
        .join(format!("{}/generations.csv", runs[2]));
    fs::remove_file(&table).unwrap();
    fs::create_dir(&table).unwrap();
    fs::remove_file(evolver.folder().join(format!("{}/best.genome", runs[3]))).unwrap();
    fs::remove_dir_all(evolver.folder().join(&runs[4])).unwrap();
    let verb = |verb: &[&str]| {
        let called = [&["suite", "own.toml"], verb, &["--out", "suite"]].concat();
        let run = evolver.run(&called);
        assert_eq!(run.code, Some(1), "{run:?}");
        for (damaged, problem) in
            runs.iter()
                .zip(["final.json", "zzz", "Is a directory", "no best"])
        {
            let of_it = |line: &str| line.contains(damaged) && line.contains(problem);
            assert!(
                run.stderr.lines().any(of_it),
                "{damaged}, {problem}: {run:?}"
            );
        }
        let again = format!(
            "delete {}, then run: evolver suite own.toml run",
            runs[..4].join(" ")
        );
        let mut sorted = runs[..4].to_vec();
        sorted.sort();
        let again_sorted = again.replace(&runs[..4].join(" "), &sorted.join(" "));
        assert!(run.stderr.contains("4 left out"), "{run:?}");
        assert!(run.stderr.contains(&again_sorted), "{run:?}");
        run.stdout
    };
    let status = verb(&["status"]);
    assert!(status.contains("1 of 6 different runs done"), "{status}");
    assert!(status.contains("damaged"), "{status}");
    let report = verb(&["report", "--gallery"]);
    assert!(report.contains("1 of 6 runs"), "{report}");
    let text = evolver.text("suite/report/report.md");
    assert!(
        text.contains("## Damaged runs") && text.contains("4 runs"),
        "{text}"
    );
    assert!(
        evolver
            .folder()
            .join("suite/report/gallery/index.html")
            .exists()
    );
    let run = verb(&["run"]);
    assert!(run.contains("2 of 6 runs done"), "{run}");
    for damaged in &runs[..4] {
        fs::remove_dir_all(evolver.folder().join(damaged)).unwrap();
    }
    assert_eq!(hashes_after(&evolver), hashes);
}

#[test]
fn a_run_with_a_damaged_checkpoint_is_named_and_the_others_are_done() {
    let evolver = with_the_suite();
    assert_eq!(evolver.run(&RUN).code, Some(0));
    let hashes = evolver.text("suite/hashes.txt");
    let runs: Vec<&str> = hashes.lines().map(|line| &line[..16]).collect();
    let runs_of_suite = evolver.folder().join("suite/runs");
    fs::remove_dir_all(runs_of_suite.join(runs[1])).unwrap();
    for file in ["DONE", "best.genome", "final.json"] {
        fs::remove_file(runs_of_suite.join(runs[0]).join(file)).unwrap();
    }
    evolver.write(&format!("suite/runs/{}/checkpoint", runs[0]), b"cut");
    for (verb, shown) in [
        ("status", "4 of 6 different runs done"),
        ("run", "5 of 6 runs done"),
    ] {
        let run = evolver.run(&["suite", "own.toml", verb, "--out", "suite"]);
        assert_eq!(run.code, Some(1), "{run:?}");
        assert!(run.stdout.contains(shown), "{run:?}");
        let of_it = |line: &str| line.contains(runs[0]) && line.contains("checkpoint is damaged");
        assert!(run.stderr.lines().any(of_it), "{run:?}");
        let again = format!("delete suite/runs/{}, then run: ", runs[0]);
        assert!(run.stderr.contains(&again), "{run:?}");
    }
    fs::remove_dir_all(runs_of_suite.join(runs[0])).unwrap();
    assert_eq!(hashes_after(&evolver), hashes);
}

#[test]
fn a_report_without_runs_is_refused() {
    let evolver = with_the_suite();
    let report = ["suite", "own.toml", "report", "--out", "siute"];
    assert_refused(&evolver.run(&report), &["siute", "--out"]);
    assert_refused(&evolver.run(&["paper", "report"]), &["runs/paper", "--out"]);
    assert_eq!(evolver.files(), ["own.toml"], "no file was written");
}

#[test]
fn after_tasks_the_command_that_searches_for_a_structure_is_printed() {
    let evolver = Evolver::in_empty_folder();
    // Two robots cannot form a line.
    let damage = "[[resilience]]\nname = \"damage\"\nof = \"two-grids\"\nstructure = \"line\"\n\
                  robots-in-areas = [1]\nrepeat = 1\nfurther-runs = 3\n";
    let suite = SUITE.replace("[20]", "[2]") + damage;
    evolver.write("own.toml", suite.as_bytes());
    let task = |more: &[&str]| {
        let task = ["run-task", "--suite", "own.toml", "--out", "a suite"];
        let run = evolver.run(&[&task[..], more].concat());
        assert_eq!(run.code, Some(0), "{run:?}");
        run.stdout
    };
    let status = || evolver.run(&["suite", "own.toml", "status", "--out", "a suite"]);
    let command = "evolver suite own.toml run --out 'a suite'";
    let first = task(&["--shard", "0/2"]);
    assert!(first.contains(command), "{first}");
    assert!(status().stdout.contains(command), "{:?}", status());
    let second = task(&["--shard", "1/2", "--progress", "json"]);
    assert!(
        second.contains(&format!("\"search_by\":\"{command}\"")),
        "{second}"
    );
    assert!(status().stdout.contains(command), "{:?}", status());
    let other = task(&["--shard", "1/2", "--runs", "1"]);
    assert!(!other.contains(command), "another experiment: {other}");

    let run = evolver.run(&["suite", "own.toml", "run", "--out", "a suite"]);
    assert_eq!(run.code, Some(0), "{run:?}");
    let after = status().stdout;
    assert!(!after.contains(command), "{after}");
    assert!(
        after.contains("no line in 3 runs beyond the plan"),
        "{after}"
    );
    let again = task(&["--shard", "1/2"]);
    assert!(!again.contains(command), "{again}");
}

/// Returns the valid keys that the error for an unknown key lists.
fn keys_said_with(suite: &str) -> Vec<String> {
    let error = Suite::parse(Path::new("own.toml"), suite).unwrap_err();
    let text = error.to_string();
    let (_, expected) = text.split_once("expected one of ").expect("what is valid");
    let parts = expected.split('`').skip(1).step_by(2);
    parts.map(str::to_owned).collect()
}

#[test]
fn every_key_of_a_suite_is_explained() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/suite.md");
    let docs = fs::read_to_string(docs).unwrap();
    for (table, number) in [
        ("", 5),
        ("experiment", 16),
        ("re-evaluation", 3),
        ("resilience", 6),
    ] {
        let wrong = match table {
            "" => "wrong = 1\n".to_owned(),
            table => format!("[[{table}]]\nwrong = 1\n"),
        };
        let keys = keys_said_with(&wrong);
        assert_eq!(keys.len(), number, "{keys:?}");
        let heading = match table {
            "" => "## The suite".to_owned(),
            table => format!("## `[[{table}]]`"),
        };
        let (_, section) = docs.split_once(&heading).expect("one section per table");
        let section = section.split("\n## ").next().unwrap_or_default();
        for key in keys {
            assert!(
                section.contains(&format!("\n| `{key}`")),
                "{table}: no {key}"
            );
        }
    }
}

#[test]
fn a_suite_in_a_read_only_directory_says_so_and_finished_runs_can_be_read() {
    let evolver = with_the_suite();
    let Some(disk) = tools::require(Disk::mounted_at(evolver.folder().join("suite"), "8m")) else {
        return;
    };
    disk.remount("ro");
    let nothing = evolver.run(&RUN);
    assert_eq!(nothing.code, Some(2), "{nothing:?}");
    for words in ["suite/runs", "Read-only file system"] {
        assert!(nothing.stderr.contains(words), "no {words:?}: {nothing:?}");
    }
    disk.remount("rw");
    let one = evolver.run(&[&RUN[..], &["--runs", "1"]].concat());
    assert_eq!(one.code, Some(0), "{one:?}");
    disk.remount("ro");
    let status = evolver.run(&["suite", "own.toml", "status", "--out", "suite"]);
    assert!(
        status.stdout.contains("2 of 6 different runs done"),
        "{status:?}"
    );
    let more = evolver.run(&RUN);
    assert_eq!(more.code, Some(2), "{more:?}");
    assert!(more.stderr.contains("Read-only file system"), "{more:?}");
    let report = ["suite", "own.toml", "report", "--out", "suite"];
    let there = evolver.run(&report);
    assert_eq!(there.code, Some(2), "{there:?}");
    assert!(there.stderr.contains("suite/report"), "{there:?}");
    let elsewhere = evolver.run(&[&report[..], &["--to", "report"]].concat());
    assert_eq!(elsewhere.code, Some(0), "{elsewhere:?}");
    disk.remount("rw");
    assert_eq!(hashes_after(&evolver), expected());
}
