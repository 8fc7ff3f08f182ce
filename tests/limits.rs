//! Work that exceeds the machine's memory or disk space is rejected before anything is written, and
//! estimates are close to measurements.
#![cfg(unix)]

use embedded_storage::nor_flash::NorFlash;
use minimal_surprise_controller::Topology;
use minimal_surprise_evolution::experiment::Experiment;
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::run_dir::RunDir;
use minimal_surprise_evolution::run_files::Program;
use minimal_surprise_evolution::settings::{DRAWN_SEED_MAX, Overrides, Settings};
use minimal_surprise_evolver::report::embedding::slot;
use minimal_surprise_evolver::suite::Suite;
use minimal_surprise_evolver::suite::plan::Plan;
use minimal_surprise_link::{Handler, Refusal};
use minimal_surprise_slots::{Buffer, Slots};
use robot_support::link_robot::{Flash, LinkRobot};
use serde_json::Value;
use std::fs::{self, File};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tests::disk::Disk;
use tests::program::{Evolver, Finished};
use tests::{genome, tools};
use wait4::Wait4;

/// A tiny evolution; tests make its settings large one at a time.
const TINY: [(&str, &str); 6] = [
    ("grid", "5x5"),
    ("robots", "2"),
    ("population", "1"),
    ("generations", "1"),
    ("repetitions", "1"),
    ("steps", "1"),
];
/// Number of the program's threads; each thread uses some memory.
const THREADS: u32 = 2;
/// Maximum duration of any operation in these tests.
const PATIENCE: Duration = Duration::from_secs(120);
/// Memory used by the program itself, in bytes.
const PROGRAM: f64 = 16e6;

/// Returns the arguments for the tiny evolution with these settings.
fn evolve(settings: &[(&'static str, &str)]) -> Vec<String> {
    let tiny = TINY
        .iter()
        .filter(|(tiny, _)| settings.iter().all(|(key, _)| key != tiny));
    let flags = tiny
        .chain(settings)
        .flat_map(|(key, value)| [format!("--{key}"), (*value).to_owned()]);
    ["evolve".to_owned()].into_iter().chain(flags).collect()
}

fn settings(of: &[(&'static str, &str)]) -> Settings {
    let mut given = Overrides::default();
    for (key, value) in TINY.iter().chain(of) {
        given.flag(key, Some(value));
    }
    Settings::resolve(&given, || 1).unwrap()
}

/// Runs the program to completion; returns its peak memory use in bytes.
fn peak(evolver: &Evolver, arguments: &[String]) -> f64 {
    let child = Command::new(evolver.program())
        .args(arguments)
        .current_dir(evolver.folder())
        // This engine path computes only the actions that are used, so it is fast with many
        // genomes.
        .env("MINIMAL_SURPRISE_PATH", "portable")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let ended = child.wait4().unwrap();
    assert!(ended.status.success(), "{arguments:?}");
    ended.rusage.maxrss as f64
}

fn words(line: &str) -> Vec<String> {
    line.split(' ').map(str::to_owned).collect()
}

/// Runs the program with a limited address space.
fn within(evolver: &Evolver, kilobytes: u32, arguments: &[String]) -> Finished {
    let output = Command::new("sh")
        .args(["-c", &format!("ulimit -v {kilobytes}; exec \"$@\""), "sh"])
        .arg(evolver.program())
        .args(arguments)
        .current_dir(evolver.folder())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Finished {
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

#[track_caller]
fn assert_near(what: &str, estimated: f64, measured: f64) {
    println!("{what}: estimated {estimated:.0}, measured {measured:.0}");
    assert!(
        (0.5..=2.0).contains(&(estimated / measured)),
        "{what}: estimated {estimated:.0}, measured {measured:.0}"
    );
}

#[test]
fn the_memory_of_an_evolution_is_close_to_its_estimate_for_every_large_setting() {
    for large in [
        [("population", "20000"), ("steps", "1")],
        [("repetitions", "100000"), ("robots", "25")],
        [("grid", "700x700"), ("robots", "400000")],
        [("grid", "4000x4000"), ("robots", "10")],
        [("steps", "500000"), ("robots", "2")],
    ] {
        let evolver = Evolver::in_empty_folder();
        let threads = THREADS.to_string();
        let out = [("threads", threads.as_str()), ("out", "run")];
        let measured = peak(&evolver, &evolve(&[&large[..], &out].concat()));
        let needs = Needs::of_evolution(&settings(&large), f64::from(THREADS));
        assert_near(&format!("{large:?}"), needs.memory() + PROGRAM, measured);
    }
}

#[test]
fn the_memory_of_a_replay_and_of_new_starts_is_close_to_its_estimate() {
    let evolver = Evolver::in_empty_folder();
    let made = evolver.run(&evolve(&[("out", "run")]));
    assert_eq!(made.code, Some(0), "{made:?}");
    let genome = "run/best.genome --grid 15x15 --robots 100";
    let scenario = |steps| {
        let of = [("grid", "15x15"), ("robots", "100"), ("steps", steps)];
        *settings(&of).scenario()
    };
    let replay = words(&format!("replay {genome} --steps 30000 --svg still.svg"));
    let needs = Needs::of_recording(&scenario("30000"));
    assert_near("replay", needs.memory() + PROGRAM, peak(&evolver, &replay));

    let evaluate = words(&format!(
        "evaluate {genome} --steps 1 --starts 30000 --threads {THREADS}"
    ));
    let scenarios = [(scenario("1"), ())];
    let needs = Needs::of_starts(&scenarios, ("starts", 30_000), f64::from(THREADS));
    assert_near(
        "evaluate",
        needs.memory() + PROGRAM,
        peak(&evolver, &evaluate),
    );
}

#[test]
fn memory_that_is_used_for_one_condition_after_the_other_is_counted_once() {
    let evolver = Evolver::in_empty_folder();
    let made = evolver.run(&evolve(&[("out", "run")]));
    assert_eq!(made.code, Some(0), "{made:?}");
    let evaluate = words(&format!(
        "evaluate run --grid 4000x4000 --robots 10 --noise 0,0.1,0.2,0.3,0.4 --steps 1 --starts 2 \
         --threads {THREADS}"
    ));
    let scenario = *settings(&[("grid", "4000x4000"), ("robots", "10")]).scenario();
    let needs = Needs::of_starts(&[(scenario, ()); 5], ("starts", 2), f64::from(THREADS));
    let measured = peak(&evolver, &evaluate);
    assert_near("five conditions", needs.memory() + PROGRAM, measured);
}

#[test]
fn a_run_that_does_not_fit_into_memory_is_not_damaged_and_is_resumed_when_it_fits() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("one.toml", ONE_LARGE.as_bytes());
    let suite = Suite::read(&evolver.folder().join("one.toml")).unwrap();
    let plan = Plan::new(&suite, None, None, false).unwrap();
    let run = plan.runs().iter().next().unwrap();
    let directory = run.directory(&evolver.folder().join("suite"));
    let begun = evolver.start(&words("suite one.toml run --out suite"));
    let started = Instant::now();
    while !directory.join("checkpoint").exists() {
        assert!(started.elapsed() < PATIENCE, "no checkpoint yet");
        thread::sleep(Duration::from_millis(1));
    }
    assert!(!begun.kill(), "the run had ended before the kill");
    let files = evolver.files();
    let status = "suite one.toml status --out suite";
    let status = within(&evolver, SHORT, &words(status));
    assert_eq!(status.code, Some(0), "{status:?}");
    assert!(status.stdout.contains("1 begun"), "{status:?}");
    let resume = format!("evolve --resume {}", directory.display());
    for arguments in ["suite one.toml run --out suite", &resume] {
        let refused = within(&evolver, SHORT, &words(arguments));
        assert_eq!(refused.code, Some(2), "{arguments}: {refused:?}");
        for word in ["population = 100000", "of memory would be needed"] {
            assert!(refused.stderr.contains(word), "{arguments}: {refused:?}");
        }
        assert!(!refused.stderr.contains("delete"), "{refused:?}");
    }
    let unchanged = evolver.files();
    let is_lock = |file: &&String| file.ends_with(".lock");
    assert!(
        unchanged
            .iter()
            .filter(|file| !is_lock(file))
            .eq(files.iter().filter(|file| !is_lock(file)))
    );

    // Once the large run is done, the other run needs little memory; so does a shard without the
    // large run.
    evolver.write("both.toml", format!("{ONE_LARGE}{ONE_SMALL}").as_bytes());
    let small = "run-task --suite both.toml --shard 1/2 --out suite --threads 1";
    let small = within(&evolver, SHORT, &words(small));
    assert_eq!(small.code, Some(0), "{small:?}");
    let all = evolver.run(&words("suite both.toml run --out suite"));
    assert_eq!(all.code, Some(0), "{all:?}");
    let again = within(
        &evolver,
        SHORT,
        &words("suite both.toml run --out suite --threads 1"),
    );
    assert_eq!(again.code, Some(0), "{again:?}");
}

#[test]
fn a_run_is_resumed_if_there_is_memory_for_the_requested_threads() {
    let evolver = Evolver::in_empty_folder();
    let settings = settings(&[
        ("grid", "300x300"),
        ("robots", "40000"),
        ("population", "512"),
    ]);
    let run = evolver.folder().join("run");
    drop(
        RunDir::create(
            &run,
            &Experiment::new(settings.clone()),
            &Program::default(),
        )
        .unwrap(),
    );
    let needs = |threads| Needs::of_evolution(&settings, threads).memory();
    let kilobytes = ((needs(1.0) + needs(512.0)) / 2.0 / 1000.0) as u32;
    let resume = |threads| words(&format!("evolve --resume run --threads {threads}"));
    let refused = within(&evolver, kilobytes, &resume(512));
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.stderr.contains("robots = 40000"), "{refused:?}");
    let done = within(&evolver, kilobytes, &resume(1));
    assert_eq!(done.code, Some(0), "{done:?}");
}

#[test]
fn the_text_of_a_trajectory_is_nearly_as_long_as_estimated() {
    let evolver = Evolver::in_empty_folder();
    let of = [("grid", "15x15"), ("robots", "100"), ("steps", "2000")];
    let made = evolver.run(&evolve(&[&of[..], &[("out", "run")]].concat()));
    assert_eq!(made.code, Some(0), "{made:?}");
    let exported = evolver.run(&words("export run --format trajectory --out text"));
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let measured = evolver.read("text").len() as f64;
    let estimated = Needs::of_trajectory(settings(&of).scenario()).disk();
    assert_near("trajectory", estimated, measured);
}

#[test]
fn work_that_does_not_fit_on_the_disk_is_refused_before_anything_is_written() {
    let evolver = Evolver::in_empty_folder();
    let run = [("steps", "2000"), ("robots", "20"), ("out", "run")];
    assert_eq!(evolver.run(&evolve(&run)).code, Some(0));
    let disk = evolver.folder().join("disk");
    let Some(_disk) = tools::require(Disk::mounted_at(disk.clone(), "500k")) else {
        return;
    };
    evolver.write(
        "many.toml",
        format!("name = \"many\"\n{ONE_SMALL}")
            .replace("runs = 1", "runs = 1000")
            .as_bytes(),
    );
    let runs = disk.join("suite/runs");
    for (name, files) in [("without others", 0), ("with others'", 60)] {
        fs::create_dir_all(&runs).unwrap();
        for file in 0..files {
            fs::create_dir(runs.join(format!("folder {file}"))).unwrap();
        }
        let there = fs::read_dir(&runs).unwrap().count();
        for (arguments, said) in [
            (
                "evolve --population 3000 --out disk/new",
                "population = 3000",
            ),
            (
                "evolve --out disk/new --generations 9999",
                "generations = 9999",
            ),
            ("suite many.toml run --out disk/suite", "1000 runs to do"),
            (
                "export run --format trajectory --out disk/text",
                "steps = 2000",
            ),
        ] {
            let refused = evolver.run(&words(arguments));
            assert_eq!(refused.code, Some(2), "{name}: {arguments}: {refused:?}");
            for word in [said, "of disk would be needed", "are free in disk"] {
                assert!(
                    refused.stderr.contains(word),
                    "{name}: {arguments}: {refused:?}"
                );
            }
            assert_eq!(fs::read_dir(&runs).unwrap().count(), there, "{arguments}");
            assert_eq!(fs::read_dir(&disk).unwrap().count(), 1, "{arguments}");
        }
    }
}

#[test]
fn the_files_of_a_run_have_nearly_the_estimated_sizes() {
    let scratch = tempfile::tempdir().unwrap();
    for of in [[("population", "3000")], [("population", "300")]] {
        let settings = settings(&of);
        let estimated = limits::checkpoint_bytes(&settings);
        let path = scratch.path().join(of[0].1);
        let run = RunDir::create(&path, &Experiment::new(settings), &Program::default()).unwrap();
        let measured = fs::metadata(run.path().join("checkpoint")).unwrap().len();
        assert_near("checkpoint", estimated, measured as f64);
    }
    let evolver = Evolver::in_empty_folder();
    for (out, of) in [
        (
            "long",
            [("generations", "200"), ("steps", "2000"), ("robots", "20")],
        ),
        (
            "wide",
            [
                ("generations", "100"),
                ("grid", "200x200"),
                ("robots", "5000"),
            ],
        ),
    ] {
        let made = evolver.run(&evolve(&[&of[..], &[("out", out)]].concat()));
        assert_eq!(made.code, Some(0), "{made:?}");
        let settings = settings(&of);
        let size = |name: &str| evolver.read(&format!("{out}/{name}")).len() as f64;
        assert_near(
            "generations.csv",
            limits::table_bytes(&settings),
            size("generations.csv"),
        );
        assert_near(
            "final.json",
            limits::final_state_bytes(&settings),
            size("final.json"),
        );
    }
}

/// Writes a suite file with the given number of runs.
fn suite(evolver: &Evolver, runs: u32, robots: u32) {
    let robots: Vec<String> = (1..=robots).map(|n| n.to_string()).collect();
    let text = format!(
        "name = \"large\"\n[[experiment]]\nname = \"one\"\nruns = {runs}\nrobots = [{}]\n\
         grids = [\"40x40\"]\npopulation = 2\ngenerations = 1\nrepetitions = 1\nsteps = 2\n",
        robots.join(", ")
    );
    evolver.write("large.toml", text.as_bytes());
}

/// Limit on the address space in kilobytes, too small for the suite's large run.
const SHORT: u32 = 300_000;
/// A suite with a single run that needs more than [`SHORT`], although the run computes little.
const ONE_LARGE: &str = "
    name = \"own\"
    [[experiment]]
    name = \"large\"
    runs = 1
    grids = [\"5x5\"]
    robots = [2]
    population = 100000
    generations = 2
    repetitions = 1
    steps = 1
";
/// A small experiment, which fits into [`SHORT`].
const ONE_SMALL: &str = "
    [[experiment]]
    name = \"small\"
    runs = 1
    grids = [\"5x5\"]
    robots = [2]
    population = 2
    generations = 1
    repetitions = 1
    steps = 1
";

#[test]
fn work_that_exceeds_this_machine_is_refused_before_anything_is_written() {
    let evolver = Evolver::in_empty_folder();
    let made = evolver.run(&evolve(&[("out", "run")]));
    assert_eq!(made.code, Some(0), "{made:?}");
    let long = [("steps", "1000000"), ("out", "long")];
    let made = evolver.run(&evolve(&long));
    assert_eq!(made.code, Some(0), "{made:?}");
    suite(&evolver, 1_000_000, 1200);
    evolver.write(
        "again.toml",
        b"name = \"a\"\n[[experiment]]\nname = \"one\"\nruns = 1\ngrids = [\"100x100\"]\n\
          robots = [10000]\n[[re-evaluation]]\nname = \"again\"\nof = [\"one\"]\n\
          starts = 1000000\n",
    );
    evolver.write(
        "memory.toml",
        b"name = \"m\"\n[[experiment]]\nname = \"one\"\nruns = 1\npopulation = 1000000\n",
    );
    let files = evolver.files();
    for (arguments, said) in [
        (
            "evolve --population 1000000 --out new",
            "population = 1000000",
        ),
        (
            "evolve --repetitions 1000000 --robots 225 --out new",
            "repetitions = 1000000",
        ),
        (
            "evolve --grid 16384x16384 --robots 268435456 --out new",
            "robots = 268435456",
        ),
        ("evolve --steps 4294967295 --out new", "steps = 4294967295"),
        (
            "evaluate run --grid 100x100 --robots 10000 --starts 1000000",
            "starts = 1000000",
        ),
        (
            "replay run/best.genome --steps 4294967295 --html page.html",
            "steps = 4294967295",
        ),
        (
            "replay run/best.genome --steps 4294967295",
            "steps = 4294967295",
        ),
        (
            "hil run/best.genome --simulate --steps 4294967295",
            "steps = 4294967295",
        ),
        ("suite again.toml report --out new", "starts = 1000000"),
        ("suite memory.toml run --out new", "population = 1000000"),
        (
            "run-task --suite memory.toml --shard 0/1 --out new",
            "population = 1000000",
        ),
    ] {
        let refused = within(&evolver, 2_000_000, &words(arguments));
        assert_eq!(refused.code, Some(2), "{arguments}: {refused:?}");
        assert!(refused.stderr.contains(said), "{arguments}: {refused:?}");
        assert_eq!(evolver.files(), files, "{arguments}");
        for word in ["of memory would be needed", "are available"] {
            assert!(refused.stderr.contains(word), "{arguments}: {refused:?}");
        }
    }
    let gallery = words("gallery run long --out new --threads 1");
    let refused = within(&evolver, 200_000, &gallery);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.stderr.contains("steps = 1000000"), "{refused:?}");
    assert_eq!(evolver.files(), files, "{refused:?}");
    // The number of scored bits of a single run overflows the counter; a replay has no population.
    let endless =
        "replay run/best.genome --grid 16384x16384 --robots 268435456 --steps 4294967295 --svg a";
    let refused = evolver.run(&words(endless));
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused.stderr.contains("--robots = 268435456: "),
        "{refused:?}"
    );
    for (arguments, runs) in [
        ("suite large.toml run --out new", "1200000000"),
        (
            "run-task --suite large.toml --shard 0/2 --out new",
            "600000000",
        ),
        (
            "suite large.toml submit --engine slurm --out new",
            "1200000000",
        ),
    ] {
        let runs = format!("{runs} runs to do");
        let refused = evolver.run(&words(arguments));
        assert_eq!(refused.code, Some(2), "{arguments}: {refused:?}");
        for word in [&runs, "of disk would be needed", "are free in new"] {
            assert!(refused.stderr.contains(word), "{arguments}: {refused:?}");
        }
        assert_eq!(evolver.files(), files, "{arguments}");
    }
    let done = within(&evolver, 2_000_000, &evolve(&[("out", "new")]));
    assert_eq!(done.code, Some(0), "{done:?}");
}

#[test]
fn a_million_runs_are_planned_counted_and_sharded_in_a_hundred_megabytes() {
    for (runs, combinations) in [(1_000_000, 1), (1000, 1000)] {
        let evolver = Evolver::in_empty_folder();
        suite(&evolver, runs, combinations);
        for arguments in [
            "suite large.toml plan",
            "suite large.toml submit --engine slurm --dry-run",
            "suite large.toml status --out suite",
            "run-task --suite large.toml --shard 999999/1000000 --out suite",
        ] {
            let peak = peak(&evolver, &words(arguments));
            println!("{runs} runs of {combinations} settings, {arguments}: {peak:.0} bytes");
            assert!(peak <= 100e6, "{arguments}: {peak:.0} bytes");
        }
        let plan = evolver.run(&["suite", "large.toml", "plan"]);
        assert!(plan.stdout.contains("1000000 different runs"), "{plan:?}");
    }
    let evolver = Evolver::in_empty_folder();
    suite(&evolver, 1_000_000, 1200);
    let peak = peak(&evolver, &words("suite large.toml plan"));
    assert!(peak <= 100e6, "{peak:.0} bytes");
    let plan = evolver.run(&["suite", "large.toml", "plan"]);
    assert!(
        plan.stdout.contains("1200000000 different runs"),
        "{plan:?}"
    );
}

#[test]
fn no_reader_uses_more_memory_than_its_largest_valid_input_needs() {
    let evolver = Evolver::in_empty_folder();
    let large = File::create(evolver.folder().join("large")).unwrap();
    large.set_len(1 << 30).unwrap();
    for command in [
        "inspect large",
        "evaluate large",
        "replay large",
        "classify large",
        "evolve large",
        "evolve --from large",
        "suite large plan",
        "import --action large",
    ] {
        let refused = within(&evolver, 900_000, &words(command));
        assert_eq!(refused.code, Some(2), "{command}: {refused:?}");
        for word in ["large: it has 1073741824 bytes", "at most"] {
            assert!(refused.stderr.contains(word), "{command}: {refused:?}");
        }
    }
    for command in [
        "inspect /dev/zero",
        "replay /dev/zero",
        "classify /dev/zero",
        "evolve /dev/zero",
        "evolve --from /dev/zero",
        "suite /dev/zero plan",
        "import --action /dev/zero",
    ] {
        let refused = within(&evolver, 900_000, &words(command));
        assert_eq!(refused.code, Some(2), "{command}: {refused:?}");
        assert!(
            refused.stderr.contains("it does not end"),
            "{command}: {refused:?}"
        );
    }
    let pipe = "mkfifo pipe; yes > pipe & exec \"$0\" inspect pipe";
    let refused = Command::new("sh")
        .args(["-c", pipe])
        .arg(evolver.program())
        .current_dir(evolver.folder())
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("it does not end"),
        "{refused:?}"
    );
}

#[test]
fn seeds_are_represented_exactly_in_programs_that_use_floating_point() {
    let evolver = Evolver::in_empty_folder();
    let json = |name: &str| -> Value { serde_json::from_slice(&evolver.read(name)).unwrap() };
    for run in ["a", "b", "c", "d"] {
        let done = evolver.run(&evolve(&[("out", run)]));
        assert_eq!(done.code, Some(0), "{done:?}");
        for file in ["meta.json", "final.json"] {
            let read = json(&format!("{run}/{file}"));
            assert!(read["seed"].as_u64().unwrap() <= DRAWN_SEED_MAX, "{read}");
            assert!(read.get("seed_text").is_none(), "{read}");
        }
    }
    let largest = u64::MAX.to_string();
    let done = evolver.run(&evolve(&[
        ("out", "run"),
        ("seed", &largest),
        ("progress", "json"),
    ]));
    let last: Value = serde_json::from_str(done.stdout.lines().last().unwrap()).unwrap();
    let evaluated = evolver.run(&["evaluate", "run", "--starts", "1", "--json"]);
    let evaluated: Value = serde_json::from_str(&evaluated.stdout).unwrap();
    for said in [
        json("run/meta.json"),
        json("run/final.json"),
        last,
        evaluated,
    ] {
        assert_eq!(said["seed"].as_u64(), Some(u64::MAX), "{said}");
        assert_eq!(said["seed_text"].as_str(), Some(largest.as_str()), "{said}");
    }
    let classified = evolver.run(&["classify", "run"]);
    assert_eq!(classified.code, Some(0), "{classified:?}");
}

#[test]
fn a_long_replay_reports_what_it_computes() {
    let evolver = Evolver::in_empty_folder();
    let made = evolver.run(&evolve(&[("out", "run")]));
    assert_eq!(made.code, Some(0), "{made:?}");
    let replay = "replay run/best.genome --grid 5x5 --robots 20 --steps 100000 --svg still.svg";
    let done = evolver.run(&words(replay));
    assert_eq!(done.code, Some(0), "{done:?}");
    assert!(
        done.stderr.contains("computing 100000 steps of 20 robots"),
        "{done:?}"
    );
}

#[test]
fn a_robot_whose_write_count_is_exhausted_says_so_and_no_export_creates_one() {
    let container = genome::random(1, Topology::default());
    let mut robot = LinkRobot::start(Flash::with_slot(&slot(&container, u32::MAX)));
    assert_eq!(robot.slots.write_count(), u32::MAX);
    assert_eq!(robot.begin(100, 0), Err(Refusal::CountExhausted));
    // The remedy is to erase both slots: after that, the robot counts from 1 again.
    let mut flash = robot.stop();
    let end = Flash::OFFSET + 2 * Slots::<Flash>::SLOT_BYTES as u32;
    flash.erase(Flash::OFFSET, end).unwrap();
    let mut room = Buffer::new();
    let mut slots = Slots::open(flash, Flash::OFFSET, &mut room).unwrap();
    assert_eq!(slots.write(&container, &mut room), Ok(1));

    let evolver = Evolver::in_empty_folder();
    evolver.write("a.genome", &container);
    for (count, code) in [("4294967295", 2), ("4278190080", 2), ("4278190079", 0)] {
        let export = format!("export a.genome --format slot --write-count {count} --out {count}");
        let exported = evolver.run(&words(&export));
        assert_eq!(exported.code, Some(code), "{exported:?}");
        let said = exported.stderr.contains("from 1 to 4278190079");
        assert_eq!(said, code == 2, "{exported:?}");
    }
}
