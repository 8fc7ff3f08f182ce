//! Many processes started simultaneously in one directory: none fails, no result is lost, and they
//! produce the same files as a single process. `TEST_ALL=1` repeats this thousands of times.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tests::full;
use tests::program::Evolver;

/// Six runs of a few milliseconds each, so that processes often run at the same time.
const SUITE: &str = "
name = \"own\"

[[experiment]]
name = \"one\"
runs = 6
grids = [\"8x8\"]
robots = [20]
population = 4
generations = 2
repetitions = 1
steps = 20
";

const RUN: &str = "suite own.toml run --out suite --threads 1 --progress none";

/// Maximum duration of any operation in these tests.
const PATIENCE: Duration = Duration::from_secs(120);

/// Locking behaviour of a file system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Locks {
    /// Every process sees the locks of all others.
    Working,
    /// The file system has no locks.
    Missing,
    /// A host does not see the locks of other hosts, and each process runs on a different host.
    OfOneHost,
}

const ALL_LOCKS: [Locks; 3] = [Locks::Working, Locks::Missing, Locks::OfOneHost];

/// C source of a library that overrides the lock functions, to simulate file systems without
/// working locks.
const OTHER_LOCKS: &str = "
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

int flock(int file, int operation) {
    (void)file, (void)operation;
    if (getenv(\"NO_LOCKS\")) { errno = ENOLCK; return -1; }
    return 0;
}

int gethostname(char *name, size_t size) {
    snprintf(name, size, \"host-%d\", (int)getpid());
    return 0;
}
";

/// Builds the shared library from `OTHER_LOCKS`, once.
fn other_locks() -> PathBuf {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = TempDir::new().expect("a temporary folder");
        let source = folder.path().join("locks.c");
        fs::write(&source, OTHER_LOCKS).unwrap();
        let built = Command::new("cc")
            .args(["-shared", "-fPIC", "-o"])
            .arg(folder.path().join("locks.so"))
            .arg(source)
            .status();
        assert!(built.is_ok_and(|status| status.success()), "cc");
        folder
    });
    folder.path().join("locks.so")
}

/// Returns the number of repetitions: `all` if all cases are requested, otherwise `reduced`.
fn times(reduced: usize, all: usize) -> usize {
    if full::all_cases() { all } else { reduced }
}

fn command(evolver: &Evolver, locks: Locks, line: &str) -> Command {
    let mut command = Command::new(evolver.program());
    command
        .args(line.split(' '))
        .current_dir(evolver.folder())
        .env_remove("CARGO")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    if locks != Locks::Working {
        command.env("LD_PRELOAD", other_locks());
    }
    if locks == Locks::Missing {
        command.env("NO_LOCKS", "1");
    }
    command
}

/// Starts all these commands and waits for them to exit.
fn at_once(evolver: &Evolver, locks: Locks, lines: &[&str]) -> Vec<Output> {
    let start = |line: &&str| command(evolver, locks, line).spawn().expect("it starts");
    let started: Vec<Child> = lines.iter().map(start).collect();
    let ended = started.into_iter().map(Child::wait_with_output);
    ended
        .map(|output| output.expect("a child process"))
        .collect()
}

fn assert_success(outputs: &[Output], what: &str) {
    for output in outputs {
        assert!(output.status.success(), "{what}: {output:?}");
    }
}

/// Reads all files below a folder, including hidden files, except the files that contain the
/// command and the duration of a run.
fn contents(evolver: &Evolver, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let files = evolver.files().into_iter();
    files
        .filter(|file| file.starts_with(folder))
        .filter(|file| !file.ends_with("/meta.json") && !file.ends_with("/time.json"))
        .map(|file| (file.clone(), evolver.read(&file)))
        .collect()
}

fn assert_equal(
    found: &BTreeMap<String, Vec<u8>>,
    expected: &BTreeMap<String, Vec<u8>>,
    what: &str,
) {
    let names: Vec<&String> = found.keys().collect();
    let expected_names: Vec<&String> = expected.keys().collect();
    assert_eq!(names, expected_names, "{what}");
    for (name, contents) in found {
        assert!(contents == &expected[name], "{what}: {name} differs");
    }
}

fn with_the_suite() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    evolver.write("own.toml", SUITE.as_bytes());
    evolver
}

#[test]
fn six_processes_on_one_suite_all_succeed_and_leave_the_files_of_one() {
    let task = RUN.replace("suite own.toml run", "run-task --suite own.toml --shard");
    let task = |shard: &str| task.replace("--shard", &format!("--shard {shard}"));
    let tasks = ["0/2", "1/2", "0/1"].map(task);
    let lines = [RUN, &tasks[0], RUN, &tasks[1], RUN, &tasks[2]];
    let alone = with_the_suite();
    for line in lines {
        assert_success(&at_once(&alone, Locks::Working, &[line]), line);
    }
    let expected = contents(&alone, "suite");
    for locks in ALL_LOCKS {
        let starts = times(8, if locks == Locks::Working { 2000 } else { 500 });
        for start in 0..starts {
            let what = format!("start {start} with {locks:?} locks");
            let evolver = with_the_suite();
            let outputs = at_once(&evolver, locks, &lines);
            assert_success(&outputs, &what);
            for (output, line) in outputs.iter().zip(lines) {
                let stdout = String::from_utf8_lossy(&output.stdout);
                let runs = if line.contains("/2") { 3 } else { 6 };
                let done = format!("{runs} of {runs} runs done");
                assert!(stdout.contains(&done), "{what}: {output:?}");
            }
            assert_equal(&contents(&evolver, "suite"), &expected, &what);
        }
    }
}

#[test]
fn six_evolutions_with_the_same_name_each_get_their_own_directory() {
    let evolve = "evolve --grid 8x8 --robots 20 --population 4 --generations 2 --repetitions 1 \
                  --steps 20 --seed 3 --threads 1 --progress none";
    for locks in ALL_LOCKS {
        for start in 0..times(4, if locks == Locks::Working { 500 } else { 100 }) {
            let what = format!("start {start} with {locks:?} locks");
            let evolver = Evolver::in_empty_folder();
            assert_success(&at_once(&evolver, locks, &[evolve; 6]), &what);
            let runs = fs::read_dir(evolver.folder().join("runs")).unwrap();
            let mut runs: Vec<String> = runs
                .map(|run| run.unwrap().file_name().to_string_lossy().into_owned())
                .collect();
            runs.sort_by_key(String::len);
            let name = runs[0].clone();
            let numbered = (2..=6).map(|number| format!("{name}-{number}"));
            let mut expected: Vec<String> = [name.clone()].into_iter().chain(numbered).collect();
            runs.sort();
            expected.sort();
            assert_eq!(runs, expected, "{what}");
            let of = |run: &str| {
                let files = contents(&evolver, &format!("runs/{run}/")).into_iter();
                let relative = |name: String| name.rsplit('/').next().map(str::to_owned);
                files
                    .map(|(name, text)| (relative(name).unwrap_or_default(), text))
                    .collect()
            };
            let first = of(&name);
            for run in &runs {
                assert_equal(&of(run), &first, &what);
            }
        }
    }
}

#[test]
fn two_galleries_at_once_both_succeed_and_the_users_folder_is_kept() {
    let evolver = with_the_suite();
    // A run that takes longer to draw than a process takes to start.
    let long = "evolve --grid 12x12 --robots 40 --population 2 --generations 1 --repetitions 1 \
                --steps 20000 --threads 1 --out long";
    for made in [RUN, long] {
        assert_success(&at_once(&evolver, Locks::Working, &[made]), made);
    }
    evolver.write("suite/.g.part", b"a letter");
    let gallery = "gallery . --out g --threads 1";
    assert_success(&at_once(&evolver, Locks::Working, &[gallery]), gallery);
    let (expected, runs) = (contents(&evolver, "g/"), contents(&evolver, "suite/"));
    let ways = ALL_LOCKS
        .into_iter()
        .flat_map(|locks| [(locks, false), (locks, true)]);
    for (start, (locks, overwrite)) in (0..times(6, 600)).zip(ways.cycle()) {
        let what = format!("start {start} with {locks:?} locks, overwriting: {overwrite}");
        fs::remove_dir_all(evolver.folder().join("g")).unwrap();
        fs::create_dir_all(evolver.folder().join(".g.part")).unwrap();
        evolver.write(".g.part/mother.txt", b"dear");
        let line = if overwrite {
            format!("{gallery} --overwrite")
        } else {
            gallery.to_owned()
        };
        let outputs = at_once(&evolver, locks, &[&line, &line]);
        assert_success(&outputs, &what);
        assert_equal(&contents(&evolver, "g/"), &expected, &what);
        assert_equal(&contents(&evolver, "suite/"), &runs, &what);
        assert_eq!(evolver.read(".g.part/mother.txt"), b"dear", "{what}");
        let parts = fs::read_dir(evolver.folder()).unwrap().flatten();
        let parts = parts.filter(|entry| entry.file_name().to_string_lossy().ends_with(".part"));
        assert_eq!(parts.count(), 1, "{what}: only the user's file remains");
    }
}

/// Sends a signal to a child process.
fn signal(name: &str, child: &Child) {
    let kill = format!("kill -{name} {}", child.id());
    let sent = Command::new("sh").args(["-c", &kill]).status();
    assert!(sent.is_ok_and(|status| status.success()), "{kill}");
}

#[test]
fn a_run_held_by_a_stopped_process_is_waited_for_and_its_holder_is_named() {
    for (way, ends) in [
        (
            "run-task --suite own.toml --shard 0/1 --progress lines",
            "CONT",
        ),
        ("suite own.toml run --progress json", "KILL"),
    ] {
        let evolver = Evolver::in_empty_folder();
        // A single run that is long enough to be stopped.
        let long = SUITE
            .replace("runs = 6", "runs = 1")
            .replace("generations = 2", "generations = 100")
            .replace("steps = 20", "steps = 5000");
        evolver.write("own.toml", long.as_bytes());
        let mut holder = command(&evolver, Locks::Working, RUN).spawn().unwrap();
        let begun = || {
            evolver
                .files()
                .iter()
                .any(|file| file.ends_with("/config.toml"))
        };
        let started = Instant::now();
        while !begun() {
            assert!(started.elapsed() < PATIENCE, "no run has begun");
            std::thread::yield_now();
        }
        signal("STOP", &holder);
        let line = format!("{way} --out suite --threads 1");
        let mut waiter = command(&evolver, Locks::Working, &line).spawn().unwrap();
        let mut stderr = BufReader::new(waiter.stderr.take().unwrap()).lines();
        let said = stderr
            .by_ref()
            .map(Result::unwrap)
            .find(|line| line.contains("waiting"))
            .expect("a message about waiting");
        let host = nix::unistd::gethostname().unwrap();
        let who = format!("process {} on {} ", holder.id(), host.display());
        assert!(
            said.contains(&who) && said.contains("suite/runs/"),
            "{said}"
        );
        signal(ends, &holder);
        let output = waiter.wait_with_output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let stdout = String::from_utf8_lossy(&output.stdout);
        let again = stderr
            .map(Result::unwrap)
            .filter(|line| line.contains("waiting"));
        assert_eq!(again.count(), 0, "the message is printed once");
        if way.contains("json") {
            let event = format!("\"process\":{},", holder.id());
            let waiting = stdout
                .lines()
                .filter(|line| line.contains("\"event\":\"waiting\""));
            assert_eq!(
                waiting.filter(|line| line.contains(&event)).count(),
                1,
                "{stdout}"
            );
            assert!(stdout.contains("\"runs_done\":1"), "{stdout}");
        } else {
            assert!(stdout.contains("1 of 1 runs done"), "{stdout}");
        }
        assert_eq!(holder.wait().unwrap().success(), ends == "CONT");
    }
}

#[test]
fn a_shard_without_runs_is_done_at_once_even_if_there_is_no_suite_yet() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("own.toml", SUITE.replace("runs = 6", "runs = 1").as_bytes());
    let task = "run-task --suite own.toml --shard 1/2 --out new";
    let outputs = at_once(&evolver, Locks::Working, &[task; 2]);
    assert_success(&outputs, task);
    let stdout = String::from_utf8_lossy(&outputs[0].stdout);
    assert!(stdout.contains("0 of 0 runs done"), "{stdout}");
}
