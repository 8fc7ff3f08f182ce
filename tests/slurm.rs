//! Suites on a real Slurm cluster of three nodes. Nodes fail, and tasks are terminated and
//! restarted.
//!
//! The tests run only with `TEST_ALL=1`, as root, and if Slurm is installed.
#![cfg(target_os = "linux")]

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tests::full;
use tests::program::{Evolver, Finished};
use tests::tools::{self, Missing};

/// A suite that keeps each of three tasks busy for a few seconds.
const SUITE: &str = "
name = \"own\"

[[experiment]]
name = \"two-grids\"
runs = 6
grids = [\"11x9\", \"9x11\"]
robots = [30]
population = 20
generations = 60
repetitions = 4
steps = 300
";

/// Maximum duration of any operation. The task of a failed node is restarted after half a minute.
const PATIENCE: Duration = Duration::from_secs(180);

/// Allows only one cluster at a time, since two would be slower.
static ONE_CLUSTER: Mutex<()> = Mutex::new(());

/// A cluster. The cluster and everything that runs on it stop when it is dropped or this process
/// exits.
struct Slurm {
    script: Child,
    input: Option<ChildStdin>,
    answers: Receiver<String>,
    conf: PathBuf,
    _one: MutexGuard<'static, ()>,
}

impl Slurm {
    /// Starts a cluster in a new folder; returns `None` if the test is skipped.
    fn start(folder: &Path) -> Option<Self> {
        if !full::all_cases() {
            println!("SKIPPED: runs with TEST_ALL=1 only");
            return None;
        }
        tools::require(installed())?;
        // Even a failed test has stopped its cluster before releasing the lock.
        let one = ONE_CLUSTER.lock().unwrap_or_else(|e| e.into_inner());
        let free = [(); 4].map(|()| TcpListener::bind("127.0.0.1:0").expect("a free port"));
        let ports = free.map(|port| port.local_addr().expect("it is bound").port());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/slurm-cluster.sh");
        let mut script = Command::new(script)
            .arg(folder)
            .args(ports.map(|port| port.to_string()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the script starts");
        let output = script.stdout.take().expect("it is piped");
        let (sender, answers) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        let slurm = Self {
            input: script.stdin.take(),
            script,
            answers,
            conf: folder.join("slurm.conf"),
            _one: one,
        };
        slurm.expect_answer("up");
        Some(slurm)
    }

    fn expect_answer(&self, expected: &str) {
        let answer = self.answers.recv_timeout(PATIENCE);
        assert_eq!(answer.as_deref(), Ok(expected), "the cluster's script");
    }

    /// Executes `kill` or `start` on a node.
    fn node(&mut self, verb: &str, name: &str) {
        let input = self.input.as_mut().expect("open until the drop");
        writeln!(input, "{verb} {name}").expect("the script reads");
        self.expect_answer("done");
    }

    /// Returns the output of a Slurm command.
    fn ask(&self, command: &[&str]) -> String {
        let output = Command::new("timeout")
            .arg("60")
            .args(command)
            .env("SLURM_CONF", &self.conf)
            .output()
            .unwrap_or_else(|error| panic!("{command:?}: {error}"));
        assert!(output.status.success(), "{command:?}: {output:?}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Returns the state, node and pending reason of each unfinished task of the array, by task
    /// number.
    fn tasks(&self, job: &str) -> BTreeMap<u32, [String; 3]> {
        let format = "--format=%K|%T|%N|%r";
        let text = self.ask(&["squeue", "--noheader", "--array", "--jobs", job, format]);
        text.lines()
            .map(|line| {
                let words: Vec<String> = line.trim().split('|').map(str::to_owned).collect();
                let [task, rest @ ..] = <[String; 4]>::try_from(words).expect("four words");
                (task.parse().expect("a task's number"), rest)
            })
            .collect()
    }

    /// Starts requeued tasks; otherwise, Slurm would delay them by two minutes.
    fn hurry(&self, job: &str) {
        for (task, [state, _, reason]) in self.tasks(job) {
            if state == "PENDING" && reason == "BeginTime" {
                // A node rejects a job if the node ended the same job less than a second ago.
                std::thread::sleep(Duration::from_secs(3));
                let task = format!("jobid={job}_{task}");
                self.ask(&["scontrol", "update", &task, "StartTime=now"]);
            }
        }
    }

    /// Returns the properties of a running or finished task, such as exit code, state and restarts.
    fn task(&self, job: &str, task: u32) -> BTreeMap<String, String> {
        let text = self.ask(&[
            "scontrol",
            "--oneliner",
            "show",
            "job",
            &format!("{job}_{task}"),
        ]);
        let pairs = text
            .split_whitespace()
            .filter_map(|pair| pair.split_once('='));
        pairs
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .collect()
    }

    /// Runs the program so that it uses this cluster.
    fn evolver(&self, evolver: &Evolver, arguments: &[&str]) -> Finished {
        let conf = self.conf.to_string_lossy();
        evolver.run_with(("SLURM_CONF", conf.as_ref()), arguments)
    }

    /// Submits the suite as `shards` tasks; returns the job number.
    fn submit(&self, evolver: &Evolver, shards: &str) -> String {
        let submit = format!("suite own.toml submit --engine slurm --shards {shards} --out suite");
        let run = self.evolver(evolver, &submit.split(' ').collect::<Vec<_>>());
        let job = run.stdout.trim().strip_prefix("Submitted batch job ");
        job.unwrap_or_else(|| panic!("{run:?}")).to_owned()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        if std::thread::panicking() {
            for log in ["controller", "n1", "n2", "n3"] {
                let log = self.conf.with_file_name("log").join(log);
                let text = fs::read_to_string(log).unwrap_or_default();
                let from = text.lines().count().saturating_sub(25);
                text.lines().skip(from).for_each(|line| println!("{line}"));
            }
        }
        // The script stops the whole cluster when its input ends.
        self.input = None;
        let _ = self.script.wait();
    }
}

fn installed() -> Result<(), Missing> {
    let missing = |what: &str| {
        Err(Missing(format!(
            "no {what}: scripts/slurm-cluster.sh needs it"
        )))
    };
    for program in ["slurmctld", "slurmd", "sbatch", "munged"] {
        // The programs only have to start: without a cluster, some of them fail.
        if Command::new(program).arg("-V").output().is_err() {
            return missing(&format!(
                "{program} (packages slurmctld slurmd slurm-client munge)"
            ));
        }
    }
    let known = Command::new("sh")
        .args(["-c", "getent hosts \"$(hostname -s)\""])
        .output();
    if !known.is_ok_and(|output| output.status.success()) {
        return missing("address of this host in /etc/hosts");
    }
    let user = Command::new("id").arg("-u").output();
    match user {
        Ok(user) if user.stdout == b"0\n" => Ok(()),
        _ => missing("right to start Slurm's daemons, only root's"),
    }
}

/// Polls until the condition is true.
fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "timed out waiting for {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn with_the_suite() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    evolver.write("own.toml", SUITE.as_bytes());
    evolver
}

fn status(evolver: &Evolver) -> String {
    evolver
        .run(&["suite", "own.toml", "status", "--out", "suite"])
        .stdout
}

/// Returns the hash of a complete suite.
fn hash(evolver: &Evolver) -> String {
    let status = status(evolver);
    assert!(status.contains("12 of 12 different runs done"), "{status}");
    let hash = status.lines().find_map(|line| line.strip_prefix("hash "));
    hash.unwrap_or_else(|| panic!("no hash: {status}"))
        .to_owned()
}

/// Reads all files of the runs except `meta.json`, which contains the command, and `time.json`.
fn contents(evolver: &Evolver) -> BTreeMap<String, Vec<u8>> {
    let files = evolver.files().into_iter();
    files
        .filter(|file| file.starts_with("suite/runs/"))
        .filter(|file| !file.ends_with("/meta.json") && !file.ends_with("/time.json"))
        .map(|file| (file.clone(), evolver.read(&file)))
        .collect()
}

/// Runs the suite on this machine without Slurm.
fn alone(threads: &str) -> Evolver {
    let evolver = with_the_suite();
    let run = [
        "suite",
        "own.toml",
        "run",
        "--out",
        "suite",
        "--threads",
        threads,
    ];
    let run = evolver.run(&run);
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver
}

/// Runs the suite with GNU parallel.
fn parallel() -> Evolver {
    let evolver = with_the_suite();
    let task = "run-task --suite own.toml --out suite --threads 1 --shard {}/3";
    let output = Command::new("parallel")
        .args(["--will-cite", "--jobs", "2"])
        .arg(evolver.program())
        .args(task.split(' '))
        .args([":::", "0", "1", "2"])
        .current_dir(evolver.folder())
        .output()
        .expect("GNU parallel starts");
    assert!(output.status.success(), "{output:?}");
    evolver
}

fn assert_same(evolver: &Evolver, expected: &Evolver, by: &str) {
    assert_eq!(hash(evolver), hash(expected), "{by}");
    let (found, expected) = (contents(evolver), contents(expected));
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&expected), "{by}");
    for (name, bytes) in &expected {
        assert!(found[name] == *bytes, "{by}: {name}");
    }
}

#[test]
fn a_node_that_dies_in_a_real_slurm_changes_no_byte() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let Some(mut slurm) = Slurm::start(&folder.path().join("slurm")) else {
        return;
    };
    let evolver = with_the_suite();
    let job = slurm.submit(&evolver, "3");
    // Changes to the suite's file do not affect the tasks, since they use copies.
    evolver.write("own.toml", b"edited");
    until("a task on each node, and each with a run", || {
        let on_nodes = |task: &[String; 3]| task[0] == "RUNNING";
        let runs = evolver.files();
        slurm
            .tasks(&job)
            .values()
            .filter(|task| on_nodes(task))
            .count()
            == 3
            && runs
                .iter()
                .filter(|file| file.ends_with("/checkpoint"))
                .count()
                == 3
    });
    let before = slurm.tasks(&job);
    let (victim, _) = before
        .iter()
        .find(|(_, task)| task[1] == "n2")
        .expect("one is on n2");
    slurm.node("kill", "n2");
    let own = evolver
        .files()
        .into_iter()
        .filter(|file| file.ends_with("/DONE"));
    assert!(
        own.count() < 12,
        "the node failed before all runs were complete"
    );

    let (one, two, parallel) = (alone("1"), alone("2"), parallel());
    assert_same(&two, &one, "two threads");
    assert_same(&parallel, &one, "GNU parallel");

    until("the array's end", || {
        slurm.hurry(&job);
        slurm.tasks(&job).is_empty()
    });
    for task in 0..3 {
        let ended = slurm.task(&job, task);
        let log = evolver.text(&format!("suite/jobs/1/log-{task}.txt"));
        assert_eq!(ended["JobState"], "COMPLETED", "{ended:?}: {log}");
        assert_eq!(ended["ExitCode"], "0:0", "{ended:?}: {log}");
        let again = if task == *victim { "1" } else { "0" };
        assert_eq!(ended["Restarts"], again, "{ended:?}: {log}");
        assert!(log.contains("4 of 4 runs done"), "{log}");
    }
    evolver.write("own.toml", SUITE.as_bytes());
    assert_same(&evolver, &one, "Slurm");
    println!(
        "one hash by 1 and 2 threads, GNU parallel and Slurm: {}",
        hash(&evolver)
    );
}

#[test]
fn tasks_that_a_real_slurm_terminates_and_requeues_continue_without_loss() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let Some(slurm) = Slurm::start(&folder.path().join("slurm")) else {
        return;
    };
    let evolver = with_the_suite();
    let job = slurm.submit(&evolver, "3");
    until("a checkpoint", || {
        evolver
            .files()
            .iter()
            .any(|file| file.ends_with("/checkpoint"))
    });
    // This is the signal that Slurm sends at a time limit.
    slurm.ask(&["scancel", "--signal=TERM", "--batch", &format!("{job}_0")]);
    until("the end of the terminated task", || {
        !slurm.tasks(&job).contains_key(&0)
    });
    let ended = slurm.task(&job, 0);
    assert_eq!(ended["ExitCode"], "130:0", "{ended:?}");
    assert!(
        evolver
            .text("suite/jobs/1/log-0.txt")
            .contains("interrupted")
    );

    // Requeue a task that has ended and a task that may still be running.
    slurm.ask(&["scontrol", "requeue", &format!("{job}_0")]);
    slurm.ask(&["scontrol", "requeue", &format!("{job}_1")]);
    until("the array's end", || {
        slurm.hurry(&job);
        slurm.tasks(&job).is_empty()
    });
    for task in 0..3 {
        let ended = slurm.task(&job, task);
        let log = evolver.text(&format!("suite/jobs/1/log-{task}.txt"));
        assert_eq!(ended["JobState"], "COMPLETED", "{ended:?}: {log}");
    }
    let one = alone("1");
    assert_same(&evolver, &one, "after requeues");

    slurm.ask(&["scontrol", "requeue", &format!("{job}_2")]);
    until("the end of a task that has nothing to do", || {
        slurm.hurry(&job);
        slurm.tasks(&job).is_empty()
    });
    for task in 0..3 {
        let ended = slurm.task(&job, task);
        assert_eq!(ended["ExitCode"], "0:0", "{ended:?}");
        assert_eq!(ended["Restarts"], "1", "{ended:?}");
    }
    assert_same(&evolver, &one, "after a requeue of a complete task");
}

#[test]
fn a_shard_that_a_real_slurm_runs_twice_at_once_gives_the_result_of_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let Some(slurm) = Slurm::start(&folder.path().join("slurm")) else {
        return;
    };
    let evolver = with_the_suite();
    let jobs = [slurm.submit(&evolver, "1"), slurm.submit(&evolver, "1")];
    let runs = evolver.folder().join("suite/runs");
    let mut at_once = false;
    until("the end of both", || {
        let tasks = jobs.each_ref().map(|job| slurm.tasks(job));
        let runs_now =
            |tasks: &BTreeMap<u32, [String; 3]>| tasks.values().any(|task| task[0] == "RUNNING");
        at_once |= tasks.iter().all(runs_now);
        // This simulates a file system without locks, where no process sees the locks of others.
        for run in fs::read_dir(&runs).into_iter().flatten().flatten() {
            let _ = fs::remove_file(run.path().join(".lock"));
        }
        tasks.iter().all(BTreeMap::is_empty)
    });
    assert!(at_once);
    for job in &jobs {
        let ended = slurm.task(job, 0);
        assert_eq!(ended["ExitCode"], "0:0", "{ended:?}");
    }
    assert_same(&evolver, &alone("1"), "two tasks at once");
}

#[test]
fn a_real_slurm_refuses_too_many_tasks_and_reports_a_failed_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let Some(slurm) = Slurm::start(&folder.path().join("slurm")) else {
        return;
    };
    let evolver = with_the_suite();
    let submit = "suite own.toml submit --engine slurm --out suite --runs 60 --shards 102";
    let refused = slurm.evolver(&evolver, &submit.split(' ').collect::<Vec<_>>());
    assert_eq!(refused.code, Some(1), "{refused:?}");
    for words in ["Invalid job array", "--shards = 102", "accepts 1 to 101"] {
        assert!(refused.stderr.contains(words), "no {words:?}: {refused:?}");
    }
    // The file is created after submission but before the start: if it existed earlier, nothing
    // would be submitted.
    slurm.ask(&["scontrol", "update", "PartitionName=all", "State=DOWN"]);
    let job = slurm.submit(&evolver, "3");
    evolver.write("suite/runs", b"a file where the runs should be");
    slurm.ask(&["scontrol", "update", "PartitionName=all", "State=UP"]);
    until("the array's end", || slurm.tasks(&job).is_empty());
    for task in 0..3 {
        let ended = slurm.task(&job, task);
        assert_eq!(ended["JobState"], "FAILED", "{ended:?}");
        assert_ne!(ended["ExitCode"], "0:0", "{ended:?}");
        let log = evolver.text(&format!("suite/jobs/1/log-{task}.txt"));
        assert!(log.contains("suite/runs"), "{log}");
    }
}
