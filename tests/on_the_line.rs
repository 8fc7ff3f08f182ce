//! Commands for a robot on a serial port, tested with a robot and with other devices that may be
//! connected to the port.
#![cfg(target_os = "linux")]

use minimal_surprise_controller::{KERNEL_ID, KernelId, SensorBits, Surprise, Topology};
use minimal_surprise_evolver::report::embedding::slot;
use minimal_surprise_evolver::robot::{Afterwards, PortName, Robot};
use minimal_surprise_link::{GenomeInUse, Handler, Refusal, Report};
use serde_json::Value;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};
use tests::full;
use tests::genome::{of_another_kernel, random};
use tests::link_robot::Flash;
use tests::program::{Evolver, Finished};
use tests::pty::{Answer, Device, Fault, PluggedRobot};

/// Maximum time to wait for a command to exit.
const PATIENCE: Duration = Duration::from_secs(120);

/// Creates a folder with two genomes for this kernel and one for a different kernel.
fn with_genomes() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    let topology = Topology::default();
    evolver.write("old.genome", &random(1, topology));
    evolver.write("new.genome", &random(2, topology));
    let other = of_another_kernel(&random(2, topology));
    evolver.write("other.genome", &other);
    evolver
}

/// Plugs in a robot that runs the old genome.
fn with_the_old_genome(evolver: &Evolver, fault: Fault) -> PluggedRobot {
    let fresh = PluggedRobot::start(Flash::new(), Fault::None);
    let flashed = flash(evolver, "old.genome", &fresh.device.port);
    assert_eq!(flashed.code, Some(0), "{flashed:?}");
    PluggedRobot::start(fresh.stop(), fault)
}

fn flash(evolver: &Evolver, genome: &str, port: &str) -> Finished {
    evolver.run(&["flash", genome, "--port", port])
}

/// Returns the CRC of the genome that the robot reports as in use.
fn crc_in_use(robot: &PluggedRobot) -> String {
    format!("{:?}", robot.robot().identify().genome)
}

fn crc_of(container: &[u8]) -> String {
    let (_, crc) = container.split_last_chunk().unwrap();
    format!("crc: {}", u32::from_le_bytes(*crc))
}

/// Asserts that the run printed a single message containing all these words and exited with the
/// code for bad input.
fn assert_refused(run: &Finished, words: &[&str]) {
    assert_error(run, 2, words);
}

/// Asserts that the run printed a single message containing all these words and exited with the
/// code for failures.
fn assert_failed(run: &Finished, words: &[&str]) {
    assert_error(run, 1, words);
}

fn assert_error(run: &Finished, code: i32, words: &[&str]) {
    assert_eq!(run.code, Some(code), "{run:?}");
    let errors: Vec<&str> = run
        .stderr
        .lines()
        .filter(|line| line.starts_with("error: "))
        .collect();
    let [error] = errors[..] else {
        panic!("not one error: {run:?}");
    };
    assert_eq!(run.stderr.lines().last(), Some(error), "{run:?}");
    for word in words {
        assert!(error.contains(word), "no {word:?} in {run:?}");
    }
    assert_eq!(run.stdout, "", "{run:?}");
}

/// Returns every command that communicates with a robot, on this port.
fn all_commands(port: &str) -> [Vec<&str>; 5] {
    [
        vec!["flash", "new.genome", "--port", port],
        vec!["monitor", "--port", port, "--for", "1"],
        vec!["hil", "old.genome", "--port", port, "--steps", "5"],
        vec!["start", "--port", port],
        vec!["stop", "--port", port],
    ]
}

#[test]
fn flash_writes_verifies_starts_and_reports_what_runs() {
    let evolver = with_genomes();
    let robot = PluggedRobot::start(Flash::new(), Fault::None);
    let port = robot.device.port.clone();
    for (count, name) in [(1, "old.genome"), (2, "new.genome"), (3, "new.genome")] {
        let flashed = flash(&evolver, name, &port);
        assert_eq!(flashed.code, Some(0), "{flashed:?}");
        let runs = format!("{port}: robot 0.1.0, running, genome {count} in slot ");
        assert!(flashed.stdout.starts_with(&runs), "{flashed:?}");
        assert!(crc_in_use(&robot).contains(&crc_of(&evolver.read(name))));
        assert!(robot.robot().identify().running);
    }
}

#[test]
fn monitor_shows_surprise_and_actions_second_by_second() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    robot.robot().start().unwrap();
    let port = robot.device.port.clone();
    let arguments = ["monitor", "--port", &port, "--json", "--for", "3"];
    let watched = std::thread::scope(|scope| {
        let watching = scope.spawn(|| evolver.run(&arguments));
        while !watching.is_finished() {
            robot.robot().period(SensorBits::new(1));
            std::thread::sleep(Duration::from_millis(10));
        }
        watching.join().unwrap()
    });
    assert_eq!(watched.code, Some(0), "{watched:?}");
    let seconds: Vec<Value> = watched
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(seconds.len(), 3, "{watched:?}");
    let number = |second: &Value, key: &str| second[key].as_u64().unwrap();
    for pair in seconds.windows(2) {
        let bits = |key| number(&pair[1], key) - number(&pair[0], key);
        let recent = bits("mispredicted_bits") as f64 / bits("seen_bits") as f64;
        assert_eq!(pair[1]["surprise_in_this_second"], recent, "{watched:?}");
    }
    let last = &seconds[2];
    let steps: u64 = ["straight", "turned_left", "turned_right"]
        .iter()
        .map(|key| number(last, key))
        .sum();
    assert_eq!(number(last, "seen_bits"), 14 * steps);
    assert_eq!(last["running"], true);
    assert_eq!(last["faults"], serde_json::json!([]));

    let lines = evolver.run(&["monitor", "--port", &port, "--for", "1"]);
    for word in [
        "1 s",
        "surprise 0.",
        "straight",
        "held back",
        "left",
        "right",
    ] {
        assert!(lines.stdout.contains(word), "no {word:?} in {lines:?}");
    }
    assert_eq!(lines.stdout.lines().count(), 1);
}

#[test]
fn monitor_ends_at_ctrl_c_which_counts_as_early_only_before_the_given_time() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    for (time, code) in [(&[][..], 0), (&["--for", "600"], 130)] {
        let arguments = [&["monitor", "--port", &robot.device.port], time].concat();
        let watching = evolver.start(&arguments);
        watching.wait_for_lines(1);
        let ended = watching.interrupt(PATIENCE);
        assert_eq!(ended.code, Some(code), "{ended:?}");
    }
}

#[test]
fn hil_ends_with_the_hash_of_the_simulation_and_restores_the_robot() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let port = robot.device.port.as_str();
    let flags = "--grid 8x9 --robots 20 --steps 50 --noise 0.1 --seed 5";
    let hil = |more: &[&str]| {
        let flags = flags.split(' ');
        let arguments: Vec<&str> = ["hil", "old.genome"]
            .into_iter()
            .chain(flags)
            .chain(more.iter().copied())
            .collect();
        evolver.run(&arguments)
    };
    let simulated = hil(&["--simulate"]);
    assert_eq!(simulated.code, Some(0), "{simulated:?}");
    for running in [false, true] {
        if running {
            robot.robot().start().unwrap();
        }
        let ran = hil(&["--port", port]);
        assert_eq!(ran.code, Some(0), "{ran:?}");
        assert!(ran.stdout.starts_with(&simulated.stdout), "{ran:?}");
        assert!(ran.stdout.contains(", equal"), "{ran:?}");
        assert_eq!(robot.robot().identify().running, running);
    }

    robot.robot().errs_in_step = Some(30);
    let ran = hil(&["--port", port]);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(ran.stdout.contains(", different"), "{ran:?}");
    assert!(!ran.stdout.contains(simulated.stdout.trim()), "{ran:?}");
    assert!(
        ran.stderr.contains("in step 31 the robot decided"),
        "{ran:?}"
    );
}

#[test]
fn hil_requires_the_same_genome_on_the_robot() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let port = robot.device.port.as_str();
    let ran = evolver.run(&["hil", "new.genome", "--port", port]);
    let command = format!("evolver flash new.genome --port {port}");
    assert_refused(&ran, &["the robot runs genome 1", &command]);
    let fresh = PluggedRobot::start(Flash::new(), Fault::None);
    let ran = evolver.run(&["hil", "new.genome", "--port", &fresh.device.port]);
    assert_refused(&ran, &["the built-in genome"]);
}

#[test]
fn bad_flags_are_refused_with_the_flag_the_value_and_the_valid_range() {
    let evolver = with_genomes();
    let runs = [
        (
            "hil old.genome --simulate --grid 2x9",
            "--grid = 2x9: a grid of 2x9",
        ),
        (
            "hil old.genome --simulate --steps none",
            "--steps = none: expected a whole number from 1 to 4294967295",
        ),
        (
            "monitor --port nowhere --for 0",
            "--for = 0: expected a whole number from 1 to 4294967295",
        ),
        (
            "start --port nowhere --wait never",
            "--wait = never: expected a whole number from 1 to 3600",
        ),
        (
            "flash old.genome --port nowhere --baud fast",
            "--baud = fast: expected a whole number from 1 to 12000000",
        ),
        (
            "hil . --simulate --seed 1",
            "--seed cannot be combined with a run directory",
        ),
        ("hil . --simulate", "no complete run"),
    ];
    for (arguments, words) in runs {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        assert_refused(&evolver.run(&arguments), &[words]);
    }
    for (mode, words) in [
        (&[][..], "required arguments were not provided"),
        (&["--simulate", "--port", "nowhere"], "cannot be used with"),
    ] {
        let run = evolver.run(&[&["hil", "old.genome"], mode].concat());
        assert_eq!(run.code, Some(2), "{run:?}");
        assert!(run.stderr.contains(words), "{run:?}");
    }
}

#[test]
fn a_path_that_is_not_a_port_is_refused() {
    let evolver = with_genomes();
    for arguments in all_commands("/dev/nowhere") {
        let run = evolver.run(&arguments);
        assert_refused(&run, &["--port = /dev/nowhere: no such port"]);
    }
    for arguments in all_commands("new.genome") {
        let run = evolver.run(&arguments);
        assert_refused(&run, &["--port = new.genome: not a serial port"]);
    }
    let device = flash(&evolver, "new.genome", "/dev/null");
    assert_refused(&device, &["/dev/null: not a serial port"]);
}

#[test]
fn a_port_whose_name_is_not_utf8_is_refused_with_a_workaround() {
    let evolver = with_genomes();
    let robot = PluggedRobot::start(Flash::new(), Fault::None);
    let name = OsStr::from_bytes(b"robot\xff");
    symlink(&robot.device.port, evolver.folder().join(name)).unwrap();
    let run = evolver.run(&[OsStr::new("start"), OsStr::new("--port"), name]);
    assert_refused(
        &run,
        &[
            r"--port = robot\xff: its name is not UTF-8",
            "symbolic link",
        ],
    );
}

#[test]
fn a_port_with_a_blank_or_a_line_end_is_shown_in_one_line_and_can_be_typed() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    for port in ["a port", "a\nport", "-a 'port'"] {
        symlink(&robot.device.port, evolver.folder().join(port)).unwrap();
        let port = format!("--port={port}");
        let run = evolver.run(&["hil", "new.genome", &port]);
        assert_refused(
            &run,
            &["write that genome to it with: evolver flash new.genome"],
        );
        let (_, line) = run.stderr.split_once("with: evolver ").unwrap();
        let program = evolver.program().display();
        let typed = evolver.shell(&format!("{program} {line}"));
        let typed = typed.wait_with_output().unwrap();
        assert!(typed.status.success(), "{line}: {typed:?}");
        assert_eq!(
            typed.stdout.iter().filter(|&&byte| byte == b'\n').count(),
            1
        );
        let again = flash(&evolver, "old.genome", &robot.device.port);
        assert_eq!(again.code, Some(0), "{again:?}");
    }
}

#[test]
fn a_silent_port_is_refused() {
    let evolver = with_genomes();
    let silent = Device::plug_in(|_| Answer::Bytes(Vec::new()));
    for arguments in all_commands(&silent.port) {
        let run = evolver.run(&arguments);
        assert_failed(
            &run,
            &[
                &silent.port,
                "nothing received for 2.",
                "115200 baud",
                "--wait",
            ],
        );
    }
}

#[test]
fn another_device_is_refused() {
    let evolver = with_genomes();
    let another = |device: &Device, words: &str| {
        for arguments in all_commands(&device.port) {
            let run = evolver.run(&arguments);
            assert_failed(
                &run,
                &[
                    &device.port,
                    "a different device is sending data",
                    words,
                    "--wait",
                ],
            );
        }
    };
    let echo = Device::plug_in(|bytes| Answer::Bytes(bytes.to_vec()));
    another(&echo, "echoes");
    let modem = Device::plug_in(|_| Answer::Bytes(b"ERROR\r\n".to_vec()));
    another(&modem, "bytes without a message");
    let newer = Device::plug_in(|_| {
        let message = [2_u8, 1, 0, 0];
        let mut wire = [0; 32];
        let length = minimal_surprise_link::encode(&message, &mut wire).unwrap();
        Answer::Bytes(wire[..length].to_vec())
    });
    another(&newer, "uses version 2 of the protocol");
}

#[test]
fn a_device_that_never_stops_sending_is_refused() {
    let evolver = with_genomes();
    let compass = Device::talking(b"$HCHDG,101.1,,,7.1,W*3C\r\n");
    for arguments in all_commands(&compass.port) {
        let run = evolver.run(&arguments);
        assert_failed(
            &run,
            &["a different device is sending data", "without a message"],
        );
    }
}

#[test]
fn a_genome_for_another_kernel_is_refused_before_the_robot_is_contacted() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let before = crc_in_use(&robot);
    let run = flash(&evolver, "other.genome", &robot.device.port);
    assert_refused(
        &run,
        &["other.genome: evolved for kernel", "this controller"],
    );
    assert_eq!(robot.robot().done, 0);
    assert_eq!(crc_in_use(&robot), before);
}

#[test]
fn a_robot_of_another_kernel_is_refused_before_anything_is_stopped_or_erased() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let before = crc_in_use(&robot);
    let mut kernel = KERNEL_ID;
    kernel.0[0] ^= 1;
    robot.robot().kernel = kernel;
    for arguments in [
        &all_commands(&robot.device.port)[0],
        &all_commands(&robot.device.port)[2],
    ] {
        let run = evolver.run(arguments);
        let words = format!(
            "the robot has kernel {}, but this program has",
            KernelId(kernel.0)
        );
        assert_failed(&run, &[&words]);
    }
    assert_eq!(robot.robot().done, 0);
    assert_eq!(crc_in_use(&robot), before);
}

#[test]
fn a_robot_whose_write_count_is_exhausted_says_what_to_do_and_is_restored() {
    let evolver = with_genomes();
    let old = evolver.read("old.genome");
    for running in [true, false] {
        let robot = PluggedRobot::start(Flash::with_slot(&slot(&old, u32::MAX)), Fault::None);
        if running {
            robot.robot().start().unwrap();
        }
        let before = robot.robot().identify().genome;
        let run = flash(&evolver, "new.genome", &robot.device.port);
        let words = [
            "has reached its maximum",
            "erase both of its genome slots with a debug probe",
            "it keeps its old genome",
        ];
        assert_failed(&run, &words);
        let mut robot = robot.robot();
        let identity = robot.identify();
        assert_eq!((identity.genome, identity.running), (before, running));
        assert!(format!("{before:?}").contains(&crc_of(&old)), "{before:?}");
    }
}

#[test]
fn after_a_refusal_halfway_the_robot_is_restored() {
    let evolver = with_genomes();
    let chunks = evolver.read("new.genome").len().div_ceil(128) as u64;
    // Request 1 stops the robot, and request 2 begins an update or resets the controller; the
    // chunks and the commit, or the steps, follow.
    let refused = [
        (
            "flash",
            4,
            Refusal::WrongOffset { expected: 9 },
            "receiving",
        ),
        ("flash", 4, Refusal::NoSession, "receiving"),
        ("flash", 3 + chunks, Refusal::BadGenome, "committing"),
        ("flash", 3 + chunks, Refusal::Flash, "committing"),
        ("hil", 2, Refusal::Unsupported, "starting or stopping"),
        ("hil", 9, Refusal::Unsupported, "stepping"),
        ("hil", 9, Refusal::NoSession, "stepping"),
    ];
    for (command, request, refusal, doing) in refused {
        for running in [true, false] {
            let robot = with_the_old_genome(&evolver, Fault::None);
            if running {
                robot.robot().start().unwrap();
            }
            let before = robot.robot().identify().genome;
            robot.robot().done = 0;
            robot.robot().refuses = Some((request, refusal));
            let genome = if command == "flash" { "new" } else { "old" };
            let genome = format!("{genome}.genome");
            let run = evolver.run(&[command, &genome, "--port", &robot.device.port]);
            let words = format!("request rejected while the robot was {doing}");
            assert_failed(&run, &[&words, &refusal.to_string()]);
            let kept = match (command, refusal) {
                ("hil", _) => "",
                (_, Refusal::Flash) => "; it has either its old genome or the new one",
                _ => "; it keeps its old genome",
            };
            assert_eq!(
                run.stderr.contains("its old genome"),
                command == "flash",
                "{run:?}"
            );
            assert!(run.stderr.contains(kept), "{run:?}");
            let mut robot = robot.robot();
            let identity = robot.identify();
            assert_eq!((identity.genome, identity.running), (before, running));
            if command == "hil" {
                assert_eq!(robot.telemetry().surprise, Surprise::default());
            }
        }
    }
}

#[test]
fn a_line_unplugged_halfway_leaves_the_old_genome_in_use() {
    let evolver = with_genomes();
    // Request 1 stops the robot, request 2 begins the update, the others send chunks, and the last
    // request commits.
    for done in 1..=6 {
        for (fault, words) in [
            (Fault::PulledAfter(done), "the line failed"),
            (Fault::MuteAfter(done), "stopped replying"),
        ] {
            // The time-out of an erase is the longest, so this case is tested only on request.
            if fault == Fault::MuteAfter(2) && !full::all_cases() {
                continue;
            }
            let robot = with_the_old_genome(&evolver, fault);
            let run = flash(&evolver, "new.genome", &robot.device.port);
            let keeps = if done == 1 {
                "starting or stopping"
            } else {
                "it keeps its old genome"
            };
            assert_failed(&run, &[&robot.device.port, words, keeps]);
            let restarted = PluggedRobot::start(robot.stop(), Fault::None);
            let old = crc_of(&evolver.read("old.genome"));
            assert!(crc_in_use(&restarted).contains(&old), "{fault:?}");
            let again = flash(&evolver, "new.genome", &restarted.device.port);
            assert_eq!(again.code, Some(0), "{again:?}");
        }
    }
}

#[test]
fn a_line_unplugged_during_monitor_or_hil_is_reported() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::PulledAfter(20));
    let run = evolver.run(&["hil", "old.genome", "--port", &robot.device.port]);
    assert_failed(&run, &["the line failed while the robot was stepping"]);
    let robot = with_the_old_genome(&evolver, Fault::MuteAfter(20));
    let run = evolver.run(&["hil", "old.genome", "--port", &robot.device.port]);
    assert_failed(&run, &["the robot stopped replying while it was stepping"]);

    let robot = with_the_old_genome(&evolver, Fault::None);
    let port = robot.device.port.clone();
    let run = std::thread::scope(|scope| {
        let watching = scope.spawn(|| evolver.run(&["monitor", "--port", &port]));
        std::thread::sleep(Duration::from_millis(1500));
        drop(robot);
        watching.join().unwrap()
    });
    assert_eq!(run.code, Some(1), "{run:?}");
    let told = "the line failed while the robot was reporting";
    assert!(run.stderr.contains(told), "{run:?}");
}

#[test]
fn a_commit_whose_answer_is_lost_is_detected() {
    let evolver = with_genomes();
    let chunks = evolver.read("new.genome").len().div_ceil(128) as u64;
    let robot = with_the_old_genome(&evolver, Fault::MuteAfter(3 + chunks));
    let run = flash(&evolver, "new.genome", &robot.device.port);
    let words = "either its old genome or the new one: run the command again";
    assert_failed(&run, &["committing a genome", words]);
    let new = crc_of(&evolver.read("new.genome"));
    assert!(crc_in_use(&robot).contains(&new));
}

/// Returns the message that shows how to start a robot on this port.
fn start_line(port: &str) -> String {
    format!("the robot may still be stopped; start it with: evolver start --port {port}")
}

/// Waits until the robot has executed this many requests.
fn wait_for(robot: &PluggedRobot, done: u64) {
    let started = Instant::now();
    while robot.robot().done < done {
        assert!(started.elapsed() < PATIENCE, "the robot hangs");
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn start_and_stop_work_and_say_so() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let port = robot.device.port.as_str();
    for (command, state, running) in [
        ("start", "running", true),
        ("start", "running", true),
        ("stop", "stopped", false),
    ] {
        let run = evolver.run(&[command, "--port", port]);
        assert_eq!(run.code, Some(0), "{run:?}");
        let says = format!("{port}: robot 0.1.0, {state}, genome 1 in slot ");
        assert!(run.stdout.starts_with(&says), "{run:?}");
        assert_eq!(robot.robot().identify().running, running);
    }
}

#[test]
fn every_command_ends_although_another_program_reads_the_port() {
    let evolver = with_genomes();
    let rounds = if full::all_cases() { 20 } else { 3 };
    let one = |kind: usize, bytes: usize| {
        let robot = with_the_old_genome(&evolver, Fault::None);
        let port = robot.device.port.clone();
        // The other program reads all bytes at once, or a few at a time.
        let read = match bytes {
            0 => "exec cat <$0".to_owned(),
            bytes => format!("while dd bs={bytes} count=1 <$0 2>&1; do :; done"),
        };
        let mut other = Command::new("sh")
            .args(["-c", &read, &port])
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let arguments = match kind {
            0 => vec!["hil", "old.genome", "--steps", "12", "--port", &port],
            1 => vec!["monitor", "--for", "2", "--port", &port],
            _ => vec!["flash", "new.genome", "--port", &port],
        };
        let running = evolver.start(&arguments);
        if !full::all_cases() {
            // If the other reader were still running, the request to begin would be repeated for 50
            // s.
            thread::sleep(Duration::from_secs(4));
            other.kill().unwrap();
        }
        let run = running.ended(PATIENCE);
        other.kill().unwrap();
        other.wait().unwrap();
        if run.code != Some(0) {
            assert_failed(&run, &[&port]);
            let error = run.stderr.lines().last().unwrap_or_default();
            let told = ["another program", "a different device"];
            assert!(told.iter().any(|told| error.contains(told)), "{run:?}");
            assert!(!error.contains("in use"), "{run:?}");
        }
        println!("{kind} {bytes}: {:?} {}", run.code, run.stderr);
    };
    thread::scope(|scope| {
        let runs: Vec<_> = (0..rounds * 3)
            .map(|run| scope.spawn(move || one(run % 3, [0, 1, 7][run / 3 % 3])))
            .collect();
        for run in runs {
            run.join().unwrap();
        }
    });
}

#[test]
fn a_port_that_another_program_has_locked_is_in_use() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let port = robot.device.port.as_str();
    let watching = evolver.start(&["monitor", "--port", port]);
    watching.wait_for_lines(1);
    let run = flash(&evolver, "new.genome", port);
    assert_failed(&run, &[port, "in use by another program"]);
    assert_eq!(watching.interrupt(PATIENCE).code, Some(0));
}

#[test]
fn a_board_that_restarts_when_its_port_is_opened_is_waited_for() {
    let evolver = &with_genomes();
    let noise = b"\xff\0boot: v1.2\r\n\0\x07";
    let ask = |restarts_for, noise, wait: &str| {
        let silence = Duration::from_millis(restarts_for);
        let robot = PluggedRobot::restarting(Flash::new(), Fault::None, silence, noise);
        evolver.run(&["stop", "--port", &robot.device.port, "--wait", wait])
    };
    thread::scope(|scope| {
        let answered = [
            (1000, &b""[..], "2"),
            (2400, b"", "4"),
            (2400, noise, "4"),
            (6000, noise, "9"),
        ];
        let answered = answered
            .map(|(restarts_for, noise, wait)| scope.spawn(move || ask(restarts_for, noise, wait)));
        let given_up = scope.spawn(move || ask(6000, noise, "2"));
        for run in answered {
            let run = run.join().unwrap();
            assert_eq!(run.code, Some(0), "{run:?}");
        }
        let run = given_up.join().unwrap();
        assert_failed(&run, &["a different device is sending data", "--wait 10"]);
    });
}

#[test]
fn wait_applies_only_to_the_first_answer() {
    let evolver = &with_genomes();
    thread::scope(|scope| {
        for wait in ["1", "60"] {
            scope.spawn(move || {
                // The first chunk gets no reply.
                let robot = with_the_old_genome(evolver, Fault::MuteAfter(3));
                let port = robot.device.port.as_str();
                let started = Instant::now();
                let run = evolver.run(&["flash", "new.genome", "--port", port, "--wait", wait]);
                let waited = started.elapsed().as_secs_f64();
                assert_failed(&run, &["the robot stopped replying while it was receiving"]);
                // Five attempts of half a second each.
                assert!((2.5..20.0).contains(&waited), "{wait}: {waited}");
            });
        }
    });
}

#[test]
fn ctrl_c_during_flash_restores_the_robot() {
    let evolver = with_genomes();
    for (running, signal) in [(true, "INT"), (false, "TERM")] {
        let robot = with_the_old_genome(&evolver, Fault::SlowAfter(2));
        let before = crc_in_use(&robot);
        let mut done = 0;
        if running {
            robot.robot().start().unwrap();
            done = 1;
        }
        let port = robot.device.port.as_str();
        let flashing = evolver.start(&["flash", "new.genome", "--port", port]);
        wait_for(&robot, done + 2);
        flashing.signal(signal);
        let run = flashing.ended(PATIENCE);
        assert_eq!(run.code, Some(130), "{run:?}");
        let words = "interrupted while the robot was receiving a genome; it keeps";
        assert!(run.stderr.contains(words), "{run:?}");
        assert!(!run.stderr.contains("evolver start"), "{run:?}");
        assert_eq!(robot.robot().identify().running, running);
        assert_eq!(crc_in_use(&robot), before);
    }
}

#[test]
fn ctrl_c_during_hil_restores_the_robot() {
    let evolver = with_genomes();
    for (running, signal) in [(true, "INT"), (false, "INT"), (true, "TERM")] {
        let robot = with_the_old_genome(&evolver, Fault::SlowAfter(4));
        if running {
            robot.robot().start().unwrap();
        }
        let port = robot.device.port.as_str();
        let stepping = evolver.start(&["hil", "old.genome", "--port", port]);
        wait_for(&robot, 6);
        stepping.signal(signal);
        let run = stepping.ended(PATIENCE);
        assert_eq!(run.code, Some(130), "{run:?}");
        assert!(
            run.stderr
                .contains("interrupted while the robot was stepping"),
            "{run:?}"
        );
        let mut robot = robot.robot();
        assert_eq!(robot.identify().running, running);
        assert_eq!(robot.telemetry().surprise, Surprise::default());
    }
}

#[test]
fn a_second_ctrl_c_ends_at_once_and_says_how_to_start_the_robot() {
    let evolver = with_genomes();
    // The request to begin has been sent, and the program is waiting for the reply.
    let robot = with_the_old_genome(&evolver, Fault::MuteAfter(3));
    robot.robot().start().unwrap();
    let port = robot.device.port.as_str();
    let flashing = evolver.start(&["flash", "new.genome", "--port", port]);
    wait_for(&robot, 3);
    flashing.signal("INT");
    // The robot's identity, an empty line, and the message about the first Ctrl-C.
    flashing.wait_for_lines(3);
    let run = flashing.interrupt(PATIENCE);
    assert_eq!(run.code, Some(130), "{run:?}");
    assert_eq!(run.stderr.lines().last(), Some(start_line(port).as_str()));
}

#[test]
fn a_lost_line_says_how_to_start_a_robot_that_was_running() {
    let evolver = with_genomes();
    for command in ["flash", "hil"] {
        for fault in [Fault::PulledAfter(3), Fault::MuteAfter(3)] {
            if (command, fault) == ("flash", Fault::MuteAfter(3)) && !full::all_cases() {
                continue;
            }
            let robot = with_the_old_genome(&evolver, fault);
            robot.robot().start().unwrap();
            let port = robot.device.port.as_str();
            let run = evolver.run(&[command, "old.genome", "--port", port]);
            assert_failed(&run, &[&start_line(port)]);
        }
    }
}

#[test]
fn a_panic_restores_the_robot() {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let evolver = with_genomes();
    for running in [true, false] {
        let robot = with_the_old_genome(&evolver, Fault::None);
        if running {
            robot.robot().start().unwrap();
        }
        let port = PortName(robot.device.port.clone().into());
        let mut line = Robot::connect(&port, 115_200, Duration::from_secs(2), &NEVER).unwrap();
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            line.while_stopped(Afterwards::Runs, "", |_| -> Result<(), _> {
                panic!("on purpose")
            })
        }));
        assert!(panicked.is_err());
        assert_eq!(robot.robot().identify().running, running);
    }
}

#[test]
fn impossible_numbers_are_reported_and_not_used() {
    let evolver = with_genomes();
    let robot = with_the_old_genome(&evolver, Fault::None);
    let port = robot.device.port.as_str();
    let surprise = |mispredicted_bits, seen_bits| Surprise {
        mispredicted_bits,
        seen_bits,
    };
    let report = |surprise| Report {
        surprise,
        straight: 3,
        ..Report::default()
    };
    for (claim, words) in [
        (
            report(surprise(u64::MAX, 1)),
            "impossible counts: 18446744073709551615 of 1 bits mispredicted",
        ),
        (
            report(surprise(0, u64::MAX)),
            "impossible counts: 18446744073709551615 bits seen in ",
        ),
        (
            Report {
                held_back: 4,
                ..report(surprise(0, 42))
            },
            "impossible counts: 4 of 3 steps ahead held back",
        ),
    ] {
        robot.robot().claims_report = Some(claim);
        let run = evolver.run(&["monitor", "--port", port, "--for", "2"]);
        assert_failed(&run, &[port, words]);
        if claim.held_back == 0 {
            let run = evolver.run(&["hil", "old.genome", "--port", port]);
            assert_failed(&run, &[port, words]);
        }
    }
    robot.robot().claims_genome = Some(GenomeInUse::Slot {
        slot: 7,
        write_count: 1,
        length: 100,
        crc: 0,
    });
    for arguments in all_commands(port) {
        assert_failed(&evolver.run(&arguments), &[port, "impossible slot: 7"]);
    }
}
