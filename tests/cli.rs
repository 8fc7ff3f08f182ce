//! The command line, run as a user would run it.

use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX, CRC_32C};
use minimal_surprise_controller::{
    EncodedGenome, Genome, KERNEL_ID, Prediction, Provenance, SensorModel, Topology,
};
use std::fs;
use std::time::{Duration, Instant};
use tests::program::{Evolver, Finished};

/// Flags for a short evolution.
const SHORT: [(&str, &str); 6] = [
    ("--robots", "12"),
    ("--grid", "7x6"),
    ("--steps", "20"),
    ("--population", "4"),
    ("--repetitions", "2"),
    ("--generations", "3"),
];

/// Maximum time to wait for a process.
const PATIENCE: Duration = Duration::from_secs(60);

/// Waits until another process has made a condition true.
fn wait_until(what: &str, holds: impl Fn() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < PATIENCE, "no {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Parses progress events printed as JSON.
fn events(run: &Finished) -> Vec<serde_json::Value> {
    let lines = run.stdout.lines();
    lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// Returns the arguments of a short evolution; `flags` override those of [`SHORT`].
fn short(flags: &[&str]) -> Vec<String> {
    let defaults = SHORT.iter().filter(|(flag, _)| !flags.contains(flag));
    let defaults = defaults.flat_map(|&(flag, value)| [flag, value]);
    ["evolve"]
        .into_iter()
        .chain(defaults)
        .chain(flags.iter().copied())
        .map(str::to_owned)
        .collect()
}

/// Asserts that the program prints a single message with all these words, exits with code 2 and
/// writes no file.
fn assert_refused(evolver: &Evolver, arguments: &[String], words: &[&str]) {
    let before = evolver.files();
    let run = evolver.run(arguments);
    assert_eq!(run.code, Some(2), "{arguments:?}: {run:?}");
    for word in words {
        assert!(
            run.stderr.contains(word),
            "{arguments:?}: no {word:?} in {run:?}"
        );
    }
    assert_eq!(evolver.files(), before, "{arguments:?} wrote something");
}

fn container(topology: Topology) -> Vec<u8> {
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    let genome = Genome::zeroed(topology);
    codec::encode(&genome, Provenance::default(), &mut buffer)
        .unwrap()
        .to_vec()
}

fn hash_of(run: &Finished) -> &str {
    let line = run.stdout.lines().find(|line| line.starts_with("hash"));
    line.and_then(|line| line.split_whitespace().nth(1))
        .unwrap_or_else(|| panic!("no hash in {run:?}"))
}

#[test]
fn an_evolution_ends_with_a_picture_a_hash_and_a_genome_and_can_be_repeated_from_its_seed() {
    let evolver = Evolver::in_empty_folder();
    let first = evolver.run(&short(&["--out", "first"]));
    assert_eq!(first.code, Some(0), "{first:?}");
    let arrows = first
        .stdout
        .chars()
        .filter(|c| "▶▲◀▼▷△◁▽".contains(*c))
        .count();
    assert_eq!(arrows, 12);
    let seed = first.stdout.lines().next().unwrap();
    let seed = seed.split_whitespace().nth(1).unwrap();

    let second = evolver.run(&short(&["--seed", seed, "--out", "second"]));
    assert_eq!(hash_of(&first), hash_of(&second));
    let genome = evolver.read("first/best.genome");
    assert_eq!(genome, evolver.read("second/best.genome"));
    let encoded = EncodedGenome::decode(&genome).unwrap();
    assert_eq!(encoded.provenance().seed, Some(seed.parse().unwrap()));
    assert_eq!(encoded.provenance().generation, 2);

    let again = evolver.run(&["evolve", "first/config.toml", "--out", "third"]);
    assert_eq!(hash_of(&first), hash_of(&again));
}

#[test]
fn a_run_directory_holds_its_files() {
    let evolver = Evolver::in_empty_folder();
    let run = evolver.run(&short(&["--seed", "7", "--out", "run"]));
    let names = [
        "run/DONE",
        "run/best.genome",
        "run/config.toml",
        "run/final.json",
        "run/generations.csv",
        "run/meta.json",
        "run/time.json",
    ];
    assert_eq!(evolver.files(), names);
    assert_eq!(evolver.text("run/DONE").trim(), hash_of(&run));
    assert_eq!(evolver.text("run/generations.csv").lines().count(), 4);

    let meta: serde_json::Value = serde_json::from_slice(&evolver.read("run/meta.json")).unwrap();
    assert_eq!(meta["schema_version"], 1);
    assert_eq!(meta["seed"], 7);
    for key in ["program_version", "revision", "compiler"] {
        assert!(
            meta[key].as_str().is_some_and(|text| !text.is_empty()),
            "{key}"
        );
    }
    assert_eq!(meta["command_line"].as_array().unwrap().len(), 18);

    let state: serde_json::Value = serde_json::from_slice(&evolver.read("run/final.json")).unwrap();
    assert_eq!(state["schema_version"], 1);
    assert_eq!(state["start"].as_array().unwrap().len(), 12);
    assert_eq!(state["final"].as_array().unwrap().len(), 12);
    assert_eq!(state["average_prediction"].as_array().unwrap().len(), 14);
    let matches = state["matches"].as_f64().unwrap();
    let bits = state["scored_bits"].as_f64().unwrap();
    assert_eq!(bits, 12.0 * 20.0 * 14.0);
    assert_eq!(state["fitness"].as_f64().unwrap(), matches / bits);
}

#[test]
fn no_run_is_ever_overwritten() {
    let evolver = Evolver::in_empty_folder();
    for expected in ["runs/c-free-7x6-seed-5", "runs/c-free-7x6-seed-5-2"] {
        let run = evolver.run(&short(&["--seed", "5"]));
        assert!(run.stdout.contains(expected), "{run:?}");
    }
    let arguments = short(&["--seed", "6", "--out", "runs/c-free-7x6-seed-5"]);
    assert_refused(&evolver, &arguments, &["--out", "exists", "--resume"]);
    assert!(
        evolver
            .text("runs/c-free-7x6-seed-5/config.toml")
            .contains("seed = 5")
    );
}

#[test]
fn bad_flags_get_one_message_with_the_flag_the_value_and_the_valid_range() {
    let evolver = Evolver::in_empty_folder();
    let cases: [(&[&str], &[&str]); 25] = [
        (&["--grid", "2x15"], &["--grid", "2x15", "from 3 to"]),
        (&["--grid", "15"], &["--grid", "15", "as in 15x15"]),
        (&["--grid", "15x"], &["--grid", "15x"]),
        (&["--robots", "0"], &["--robots", "0", "from 1 to 225"]),
        (&["--robots", "226"], &["--robots", "226", "from 1 to 225"]),
        (&["--robots", "-1"], &["--robots", "-1", "from 1 to 225"]),
        (
            &["--robots", "many"],
            &["--robots", "many", "from 1 to 225"],
        ),
        (&["--grid", "9x9"], &["--robots", "9x9", "from 1 to 81"]),
        (&["--generations", "0"], &["--generations", "0", "from 1"]),
        (&["--population", "0"], &["--population", "0", "from 1"]),
        (&["--repetitions", "0"], &["--repetitions", "0", "from 1"]),
        (&["--steps", "0"], &["--steps", "0", "from 1"]),
        (
            &["--mutation", "1.1"],
            &["--mutation", "1.1", "from 0 to 1"],
        ),
        (
            &["--mutation", "-0.1"],
            &["--mutation", "-0.1", "from 0 to 1"],
        ),
        (
            &["--mutation", "nan"],
            &["--mutation", "nan", "from 0 to 1"],
        ),
        (&["--noise", "2"], &["--noise", "2", "from 0 to 1"]),
        (&["--noise", "inf"], &["--noise", "inf", "from 0 to 1"]),
        (&["--noise", "x"], &["--noise", "x", "from 0 to 1"]),
        (
            &["--sensor-model", "d"],
            &["--sensor-model", "d", "a, b and c"],
        ),
        (
            &["--predefine", "ring"],
            &["--predefine", "ring", "line, pair, square"],
        ),
        (
            &["--predefine", "square", "--sensor-model", "b"],
            &["--predefine", "square", "B"],
        ),
        (
            &["--predefine-partly", "pair"],
            &["--predefine-partly", "pair", "line on sensor model C only"],
        ),
        (
            &["--predefine-partly", "line", "--sensor-model", "a"],
            &["--predefine-partly", "line", "A"],
        ),
        (&["--seed", "-3"], &["--seed", "-3", "from 0 to"]),
        (&["--threads", "0"], &["--threads", "0", "from 1"]),
    ];
    for (flags, words) in cases {
        let arguments: Vec<String> = ["evolve"].iter().chain(flags).map(|&w| w.into()).collect();
        assert_refused(&evolver, &arguments, words);
    }
    assert_refused(
        &evolver,
        &[
            "evolve",
            "--predefine",
            "line",
            "--predefine-partly",
            "line",
        ]
        .map(String::from),
        &["--predefine", "--predefine-partly", "exclude"],
    );
    assert_refused(
        &evolver,
        &["evolve".into(), "--nosuch".into()],
        &["--nosuch"],
    );
    assert_refused(
        &evolver,
        &["evolve", "--progress", "loud"].map(String::from),
        &["loud", "auto", "none"],
    );
}

#[test]
fn bad_files_get_one_message_with_the_line_the_value_and_the_valid_range() {
    let evolver = Evolver::in_empty_folder();
    let cases = [
        (
            "robots = 12\nrobbots = 3\n",
            ["line 2", "robbots", "sensor-model"],
        ),
        ("# swarm\ngrid = \"2x2\"\n", ["line 2", "grid", "from 3 to"]),
        ("noise = nan\n", ["line 1", "noise", "from 0 to 1"]),
        ("mutation = 1.5\n", ["line 1", "mutation", "from 0 to 1"]),
        (
            "robots = [1]\n",
            ["line 1", "robots", "a number or a string"],
        ),
        ("robots = 1.5\n", ["line 1", "1.5", "whole number"]),
        ("generations = 0\n", ["line 1", "generations", "from 1"]),
        ("robots = \n", ["swarm.toml", "line 1", "robots"]),
        (
            "robots = 1\nrobots = 2\n",
            ["swarm.toml", "line 2", "duplicate"],
        ),
        (
            "predefine = \"line\"\npredefine-partly = \"line\"\n",
            ["line 1", "line 2", "exclude"],
        ),
    ];
    for (text, words) in cases {
        evolver.write("swarm.toml", text.as_bytes());
        assert_refused(&evolver, &["evolve".into(), "swarm.toml".into()], &words);
    }
    assert_refused(
        &evolver,
        &["evolve".into(), "missing.toml".into()],
        &["missing.toml", "No such file"],
    );
}

#[test]
fn a_flag_overrides_the_file() {
    let evolver = Evolver::in_empty_folder();
    evolver.write(
        "swarm.toml",
        b"robots = 1_2\nseed = 3\nsensor-model = \"b\"\nsteps = 0\n",
    );
    let mut arguments = vec!["evolve".to_owned(), "swarm.toml".to_owned()];
    arguments.extend_from_slice(&short(&["--sensor-model", "a", "--out", "run"])[3..]);
    assert_eq!(evolver.run(&arguments).code, Some(0));
    let config = evolver.text("run/config.toml");
    assert!(
        config.contains("sensor-model = \"a\"") && config.contains("robots = 12"),
        "{config}"
    );
}

#[test]
fn genomes_that_cannot_be_used_are_refused_with_the_reason() {
    let evolver = Evolver::in_empty_folder();
    let fitting = container(Topology::default());
    evolver.write("truncated.genome", &fitting[..500]);
    let model_a = Topology::new(SensorModel::A, Prediction::Free).unwrap();
    evolver.write("a.genome", &container(model_a));
    let mut other_kernel = fitting.clone();
    let at = other_kernel
        .windows(8)
        .position(|window| window == KERNEL_ID.0)
        .unwrap();
    other_kernel[at] ^= 1;
    let body = other_kernel.len() - 4;
    let crc = CRC_32C.checksum(&other_kernel[..body]);
    other_kernel[body..].copy_from_slice(&crc.to_le_bytes());
    evolver.write("kernel.genome", &other_kernel);
    evolver.write("text.genome", b"not a genome at all");

    let from = |name: &str| short(&["--from", name]);
    let truncated = ["--from", "truncated.genome", "too short", "500"];
    assert_refused(&evolver, &from("truncated.genome"), &truncated);
    assert_refused(
        &evolver,
        &from("a.genome"),
        &["--from", "sensor model A", "sensor model C"],
    );
    assert_refused(
        &evolver,
        &from("kernel.genome"),
        &["--from", "evolved for kernel"],
    );
    assert_refused(&evolver, &from("text.genome"), &["--from", "not a genome"]);
    assert_refused(&evolver, &from("none.genome"), &["--from", "No such file"]);
    for (name, word) in [
        ("truncated.genome", "too short"),
        ("kernel.genome", "evolved for kernel"),
        ("none.genome", "No such file"),
    ] {
        assert_refused(&evolver, &["inspect".into(), name.into()], &[name, word]);
    }
}

#[test]
fn from_starts_with_the_genome_and_its_mutants() {
    let evolver = Evolver::in_empty_folder();
    evolver.run(&short(&["--seed", "1", "--out", "first"]));
    let flags = [
        "--seed",
        "2",
        "--out",
        "second",
        "--mutation",
        "0",
        "--from",
    ];
    let flags = [&flags[..], &["first/best.genome"]].concat();
    assert_eq!(evolver.run(&short(&flags)).code, Some(0));
    let (first, second) = (
        evolver.read("first/best.genome"),
        evolver.read("second/best.genome"),
    );
    let weights = |bytes: &[u8]| EncodedGenome::decode(bytes).unwrap().to_genome();
    assert_eq!(
        weights(&first),
        weights(&second),
        "without mutation nothing changes"
    );
    assert!(
        evolver
            .text("second/config.toml")
            .contains("first/best.genome")
    );
}

#[test]
fn an_output_directory_that_is_not_writable_is_refused() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("file", b"");
    assert_refused(&evolver, &short(&["--out", "file/run"]), &["--out", "file"]);
    assert_refused(
        &evolver,
        &short(&["--out", "file"]),
        &["--out", "file", "exists"],
    );
    assert_refused(
        &evolver,
        &short(&["--out", "/proc/run"]),
        &["--out", "/proc"],
    );
}

#[test]
fn only_an_unchanged_run_is_resumed() {
    let evolver = Evolver::in_empty_folder();
    let resume = |name: &str| ["evolve".to_owned(), "--resume".to_owned(), name.to_owned()];
    assert_refused(&evolver, &resume("none"), &["none", "No such file"]);

    let done = evolver.run(&short(&["--seed", "1", "--out", "done"]));
    let again = evolver.run(&resume("done"));
    assert_eq!(again.code, Some(0));
    assert!(again.stdout.contains(hash_of(&done)), "{again:?}");
    for file in ["best.genome", "generations.csv", "final.json", "meta.json"] {
        let whole = evolver.read(&format!("done/{file}"));
        evolver.write(&format!("done/{file}"), &whole[..whole.len() / 2]);
        evolver.run(&resume("done")).assert_failed(&["done", file]);
        evolver.write(&format!("done/{file}"), &whole);
    }

    let long = short(&["--seed", "1", "--generations", "100000", "--out", "cut"]);
    let running = evolver.start(&long);
    running.wait_for_lines(3);
    let held = evolver.run(&resume("cut"));
    held.assert_failed(&["cut is in use by"]);
    running.kill();

    let config = evolver.text("cut/config.toml");
    evolver.write(
        "cut/config.toml",
        config.replace("steps = 20", "steps = 21").as_bytes(),
    );
    let cut = evolver.run(&resume("cut"));
    cut.assert_failed(&["config.toml differs from the settings that the run was started with"]);
    evolver.write("cut/config.toml", config.as_bytes());
    let mut checkpoint = evolver.read("cut/checkpoint");
    checkpoint[100] ^= 4;
    evolver.write("cut/checkpoint", &checkpoint);
    let cut = evolver.run(&resume("cut"));
    cut.assert_failed(&["cut/checkpoint", "damaged"]);
    fs::remove_file(evolver.folder().join("cut/checkpoint")).unwrap();
    assert_refused(&evolver, &resume("cut"), &["cut", "no checkpoint"]);
    let flags = [&resume("cut")[..], &["--seed".to_owned(), "2".to_owned()]].concat();
    assert_refused(
        &evolver,
        &flags,
        &["--resume", "--seed", "cannot be used with"],
    );
}

#[test]
fn the_first_signal_ends_cleanly_and_says_how_to_resume() {
    let evolver = Evolver::in_empty_folder();
    let arguments = |out| short(&["--seed", "9", "--generations", "150", "--out", out]);
    let whole = evolver.run(&arguments("whole"));
    for signal in ["INT", "TERM", "HUP"] {
        let running = evolver.start(&arguments(signal));
        running.wait_for_lines(1);
        running.signal(signal);
        let stopped = running.ended(PATIENCE);
        assert_eq!(stopped.code, Some(130), "{signal}: {stopped:?}");
        let resume = format!("evolve --resume {signal}");
        assert!(stopped.stderr.contains(&resume), "{stopped:?}");

        let resumed = evolver.run(&["evolve", "--resume", signal, "--progress", "json"]);
        let events = events(&resumed);
        let (done, generations) = events.split_last().unwrap();
        assert_eq!(done["hash"], hash_of(&whole));
        for (later, event) in generations.iter().enumerate() {
            assert_eq!(event["generation"], 150 - generations.len() + later);
            let left = event["seconds_left"].as_f64().unwrap();
            assert!((0.0..1e6).contains(&left), "{event}");
            assert!(event["robot_steps_per_second"].as_f64().unwrap() > 0.0);
        }
        assert_eq!(generations.last().unwrap()["seconds_left"], 0.0);
    }
}

/// Flags of an evolution whose generations take longer than a test waits.
const ENDLESS: &str = "--grid 20x20 --robots 100 --population 50 --repetitions 10 \
                       --steps 3000000 --threads 1 --seed 1 --out endless";

#[cfg(unix)]
#[test]
fn the_second_signal_ends_at_once() {
    let evolver = Evolver::in_empty_folder();
    let arguments: Vec<&str> = ["evolve"]
        .into_iter()
        .chain(ENDLESS.split_whitespace())
        .collect();
    let running = evolver.start(&arguments);
    let checkpoint = evolver.folder().join("endless/checkpoint");
    wait_until("a checkpoint", || checkpoint.exists());
    running.signal("INT");
    running.wait_for_lines(2);
    running.signal("INT");
    let ended = running.ended(PATIENCE);
    assert_eq!(ended.code, Some(130), "{ended:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_signal_that_the_caller_ignores_stays_ignored() {
    let evolver = Evolver::in_empty_folder();
    let work = short(&["--seed", "9", "--generations", "100", "--out"]).join(" ");
    let program = evolver.program().display();
    let done = |out: &str, starts: String, signal: &str| {
        let mut shell = evolver.shell(&starts);
        wait_until("a generation", || {
            let table = evolver.folder().join(out).join("generations.csv");
            fs::read_to_string(table).is_ok_and(|table| table.lines().count() > 1)
        });
        let line = format!("kill -{signal} $(cat pid)");
        let sent = evolver.shell(&line).wait().unwrap();
        assert!(sent.success(), "{out} had ended");
        assert!(shell.wait().unwrap().success(), "{out}");
        assert!(evolver.folder().join(out).join("DONE").exists(), "{out}");
    };
    for signal in ["INT", "TERM", "HUP"] {
        let line = format!("trap '' {signal}; {program} {work} {signal} & echo $! > pid; wait $!");
        done(signal, line, signal);
    }
    // Shells start background jobs with SIGINT ignored.
    let job = format!("{program} {work} job & echo $! > pid; wait $!");
    done("job", job, "INT");
    let nohup = format!("nohup {program} {work} nohup > out 2>&1 & echo $! > pid; wait $!");
    done("nohup", nohup, "HUP");
}

#[cfg(unix)]
#[test]
fn a_run_whose_output_is_closed_stops_unfinished_and_says_how_to_resume() {
    let evolver = Evolver::in_empty_folder();
    let program = evolver.program().display();
    let work = short(&["--generations", "150"]).join(" ");
    let unfinished = |line: &str, reader: &str, words: &str| {
        let line = format!("{{ {program} {line}; echo code $? >&2; }} | {reader}");
        let piped = evolver.shell(&line).wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&piped.stderr);
        assert!(said.ends_with("code 3\n"), "{line}: {said}");
        assert!(said.contains("standard output was closed"), "{said}");
        assert!(said.contains(words), "{line}: {said}");
    };
    let whole = evolver.run(&short(&[
        "--generations",
        "150",
        "--seed",
        "9",
        "--out",
        "whole",
    ]));
    let line = format!("{work} --seed 9 --out cut --progress json");
    unfinished(&line, "head -1", "evolve --resume cut");
    let resumed = evolver.run(&["evolve", "--resume", "cut"]);
    assert_eq!(hash_of(&resumed), hash_of(&whole));
    // The seed is printed before the work begins, so the reader can close the pipe.
    unfinished(
        &format!("{work} --out drawn"),
        "sleep 0",
        "evolve --resume drawn",
    );

    let suite = "name = \"own\"\n[[experiment]]\nname = \"one\"\nruns = 6\ngrids = [\"8x8\"]\n\
                 robots = [20]\npopulation = 4\ngenerations = 40\nrepetitions = 1\nsteps = 20\n";
    evolver.write("own.toml", suite.as_bytes());
    let run = "suite own.toml run --out suite --progress json";
    unfinished(run, "head -1", "continue with: ");
    let finished = evolver.run(&["suite", "own.toml", "run", "--out", "suite"]);
    assert_eq!(finished.code, Some(0), "{finished:?}");
    assert!(finished.stdout.contains("6 of 6 runs done"), "{finished:?}");
}

/// Commands that print to standard output; run in a folder with a run.
const PRINTING: [&str; 15] = [
    "--help",
    "--version",
    "help evolve",
    "suite --help",
    "completions bash",
    "completions fish",
    "classify run",
    "classify run --json",
    "inspect run",
    "evaluate run --starts 2",
    "damage run --area 0,0,3,3 --remove --repeat 2 --structure line",
    "export run --format c",
    "hil run --simulate",
    "paper plan",
    "paper status",
];

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_standard_output_is_a_failure_and_no_panic() {
    let evolver = Evolver::in_empty_folder();
    evolver.run(&short(&["--seed", "1", "--out", "run"]));
    let program = evolver.program().display();
    let evolve = format!("{} --seed 1 --out other", short(&[]).join(" "));
    for command in PRINTING
        .into_iter()
        .chain([evolve.as_str(), "evolve --resume run"])
    {
        let piped = evolver.shell(&format!("{program} {command} > /dev/full"));
        let piped = piped.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&piped.stderr);
        assert_eq!(piped.status.code(), Some(1), "{command}: {said}");
        assert!(
            said.contains("standard output: No space left"),
            "{command}: {said}"
        );
    }
    let line = format!("{program} {evolve}-2 --progress json > /dev/full");
    let piped = evolver.shell(&line).wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&piped.stderr);
    assert_eq!(piped.status.code(), Some(1), "{said}");
    assert!(said.contains("evolve --resume other-2"), "{said}");
    // A full device behind standard error does not cause a panic either.
    let lines = short(&["--seed", "1", "--progress", "lines", "--out"]).join(" ");
    for (index, place) in ["/dev/full", "&-"].into_iter().enumerate() {
        for (command, code) in [
            (format!("{lines} quiet-{index}"), 0),
            ("classify nothing".to_owned(), 2),
            ("classify --nosuch".to_owned(), 2),
            ("classify run > /dev/full".to_owned(), 1),
        ] {
            let shell = evolver.shell(&format!("{program} {command} 2>{place}"));
            let piped = shell.wait_with_output().unwrap();
            assert_eq!(piped.status.code(), Some(code), "{command} 2>{place}");
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn exit_codes_distinguish_bad_input_failures_and_interruptions() {
    let evolver = Evolver::in_empty_folder();
    evolver.run(&short(&["--seed", "1", "--out", "run"]));
    evolver.run(&short(&["--seed", "1", "--out", "cut"]));
    let state = evolver.read("cut/final.json");
    evolver.write("cut/final.json", &state[..state.len() / 2]);
    evolver.write("cut/best.genome", &evolver.read("run/best.genome")[..100]);
    evolver.write("cut.genome", &evolver.read("cut/best.genome"));
    let cases = [
        ("--version", 0),
        ("classify run", 0),
        // Failures: damaged runs and disk errors.
        ("classify cut", 1),
        ("inspect cut", 1),
        ("replay cut --svg a.svg", 1),
        ("damage cut --area 0,0,1,1 --remove", 1),
        ("export cut --format trajectory", 1),
        ("hil cut --simulate", 1),
        ("evolve --resume cut", 1),
        ("inspect /proc/self/mem", 1),
        ("replay run --svg /dev/full --overwrite", 1),
        // Invalid input.
        ("nosuch", 2),
        ("classify --nosuch", 2),
        ("classify nothing", 2),
        ("inspect cut.genome", 2),
        ("inspect .", 2),
        ("evaluate nothing", 2),
        ("suite nothing.toml run", 2),
        ("suite . plan", 2),
        ("evolve nothing.toml", 2),
        ("evolve --robots 0", 2),
        ("evolve --resume nothing", 2),
        ("replay run", 2),
        ("replay run --svg no/folder.svg", 2),
        ("gallery .git", 2),
    ];
    for (command, code) in cases {
        let arguments: Vec<&str> = command.split(' ').collect();
        let run = evolver.run(&arguments);
        assert_eq!(run.code, Some(code), "{command}: {run:?}");
    }
    let table = include_str!("../docs/exit-codes.md");
    for code in [0, 1, 2, 3, 130] {
        assert!(table.contains(&format!("\n| {code} | ")), "no {code}");
    }
}

#[test]
fn progress_can_be_lines_json_or_nothing() {
    let evolver = Evolver::in_empty_folder();
    let lines = evolver.run(&short(&["--seed", "1", "--progress", "lines"]));
    assert_eq!(lines.stderr.lines().count(), 3, "{lines:?}");
    for word in ["generation 3/3", "best", "mean", "robot-steps/s", "left"] {
        assert!(lines.stderr.contains(word), "{word}: {lines:?}");
    }
    let nothing = evolver.run(&short(&["--seed", "1", "--progress", "none"]));
    assert_eq!(nothing.stderr, "");
    let json = evolver.run(&short(&["--seed", "1", "--progress", "json"]));
    let events = events(&json);
    assert_eq!(events.len(), 4);
    assert_eq!(events[2]["generation"], 2);
    assert_eq!(events[3]["event"], "done");
    assert_eq!(events[3]["hash"], hash_of(&lines));
}

#[test]
fn inspect_shows_everything_in_a_genome() {
    let evolver = Evolver::in_empty_folder();
    evolver.run(&short(&[
        "--seed",
        "77",
        "--predefine-partly",
        "line",
        "--out",
        "run",
    ]));
    let shown = evolver.run(&["inspect", "run/best.genome"]);
    let kernel = KERNEL_ID.to_string();
    for word in [
        "version 1",
        &kernel,
        "line partly predefined",
        "0=1 3=1 8=1 11=1",
        "seed 77",
        "generation          2",
        "15-8-2, 166 weights",
        "15-12-10, 342 weights",
    ] {
        assert!(shown.stdout.contains(word), "{word}: {shown:?}");
    }
}

#[test]
fn completions_are_printed_for_every_shell() {
    let evolver = Evolver::in_empty_folder();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let printed = evolver.run(&["completions", shell]);
        assert_eq!(printed.code, Some(0));
        assert!(printed.stdout.contains("sensor-model"), "{shell}");
    }
}

#[test]
fn names_in_files_are_unquoted_and_numbers_are_decimal() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("swarm.toml", b"out = \"my_run\"\nsteps = 2_0\n");
    let arguments = [
        &["evolve", "swarm.toml"],
        &short_flags_without("--steps")[..],
    ]
    .concat();
    let run = evolver.run(&arguments);
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(evolver.text("my_run/config.toml").contains("steps = 20\n"));
    let from = short(&["--from", "my_run/best.genome", "--out", "next_run"]);
    assert_eq!(evolver.run(&from).code, Some(0));
    let again = evolver.run(&["evolve", "next_run/config.toml", "--out", "third_run"]);
    assert_eq!(again.code, Some(0), "{again:?}");
    evolver.write("hex.toml", b"robots = 0x10\n");
    let words = ["hex.toml, line 1", "decimal"];
    assert_refused(&evolver, &["evolve".into(), "hex.toml".into()], &words);
}

fn short_flags_without(flag: &str) -> Vec<&'static str> {
    SHORT
        .iter()
        .filter(|(name, _)| *name != flag)
        .flat_map(|&(name, value)| [name, value])
        .collect()
}

#[test]
fn a_directory_is_a_run_as_soon_as_it_has_its_name() {
    let evolver = Evolver::in_empty_folder();
    let (mut tried, mut resumed) = (0, 0);
    // Processes start more slowly on a busy machine.
    while tried < 60 || (resumed == 0 && tried < 2000) {
        let wait_us = 500 * tried;
        tried += 1;
        let name = format!("run-{wait_us}");
        let running = evolver.start(&short(&["--generations", "100000", "--out", &name]));
        std::thread::sleep(Duration::from_micros(wait_us));
        running.kill();
        if evolver.folder().join(&name).is_dir() {
            let going_on = evolver.start(&["evolve", "--resume", &name]);
            going_on.wait_for_lines(3);
            going_on.kill();
            let generations = evolver.text(&format!("{name}/generations.csv"));
            assert!(generations.lines().count() > 1, "{name} went on");
            resumed += 1;
        }
    }
    println!("{resumed} of {tried} runs killed at the start had begun and were resumed");
    assert!(resumed > 0);
}

#[cfg(unix)]
#[test]
fn a_report_whose_output_is_closed_ends_quietly() {
    let evolver = Evolver::in_empty_folder();
    evolver.run(&short(&["--seed", "1", "--out", "run"]));
    let program = evolver.program().display();
    for command in PRINTING {
        let line = format!("{{ {program} {command}; echo code $? >&2; }} | head -c 5");
        let piped = evolver.shell(&line).wait_with_output().unwrap();
        assert_eq!(piped.stdout.len(), 5, "{command}");
        let said = String::from_utf8_lossy(&piped.stderr);
        assert_eq!(said, "code 0\n", "{command}");
    }
    // Errors are still reported.
    evolver.run(&short(&["--seed", "1", "--out", "cut"]));
    evolver.write("cut/final.json", b"{");
    let line = format!("{{ {program} gallery . --out pages; echo code $? >&2; }} | sleep 0");
    let piped = evolver.shell(&line).wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&piped.stderr);
    assert!(said.contains("cut/final.json"), "{said}");
    assert!(said.ends_with("code 1\n"), "{said}");
}

#[test]
fn printed_commands_can_be_copied_for_any_name() {
    let evolver = Evolver::in_empty_folder();
    let run = evolver.run(&short(&["--seed", "1", "--out", "it's my run"]));
    let hint = run
        .stdout
        .lines()
        .find(|line| line.contains("classify"))
        .unwrap();
    let command = hint.split_once("evolver").unwrap().1;
    let line = format!("{}{command}", evolver.program().display());
    let copied = std::process::Command::new("sh")
        .args(["-c", &line])
        .current_dir(evolver.folder())
        .output()
        .unwrap();
    assert!(copied.status.success(), "{copied:?}");
}
