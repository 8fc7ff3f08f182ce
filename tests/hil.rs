//! A simulated swarm in which the firmware on an emulated robot replaces robot 0.

use minimal_surprise_controller::{Prediction, SensorModel, Topology};
use std::path::Path;
use tests::firmware;
use tests::program::{Evolver, Finished};
use tests::robot::QemuRobot;
use tests::tools::require;

/// Returns the value in the output line that starts with `name`.
fn word<'r>(run: &'r Finished, name: &str) -> &'r str {
    assert_eq!(run.code, Some(0), "{run:?}");
    let line = run.stdout.lines().find_map(|line| line.strip_prefix(name));
    line.unwrap_or_else(|| panic!("no {name:?} in {run:?}"))
        .trim()
}

#[test]
fn a_swarm_with_the_emulated_robot_ends_with_the_hash_of_the_simulation() {
    let Some(firmware) = require(firmware::build()) else {
        return;
    };
    let evolver = Evolver::in_empty_folder();
    let Some(robot) = require(QemuRobot::start(&firmware, evolver.folder())) else {
        return;
    };
    let port = robot.port.as_str();
    for (index, model) in SensorModel::ALL.into_iter().enumerate() {
        let topology = Topology::new(model, Prediction::Free).unwrap();
        let name = format!("{index}.genome");
        evolver.write(&name, &tests::genome::random(11, topology));
        let flashed = evolver.run(&["flash", &name, "--port", port]);
        assert_eq!(flashed.code, Some(0), "{flashed:?}");
        assert!(flashed.stdout.contains("running"), "{flashed:?}");
        // Noise causes readings that would not occur without it.
        let flags = ["--steps", "500", "--seed", "3", "--noise", "0.05"];
        let hil = |mode: &[&str]| {
            let arguments = [&["hil", name.as_str()], mode, &flags].concat();
            evolver.run(&arguments)
        };
        let simulated = hil(&["--simulate"]);
        let with_robot = hil(&["--port", port]);
        let hash = word(&simulated, "hash");
        assert_eq!(word(&with_robot, "hash"), hash, "model {model:?}");
        assert_eq!(word(&with_robot, "simulation"), format!("{hash}, equal"));
        println!("model {model:?}: {hash}");
    }
}

#[test]
fn a_run_directory_provides_the_settings_to_run() {
    let Some(firmware) = require(firmware::build()) else {
        return;
    };
    let evolver = Evolver::in_empty_folder();
    let Some(robot) = require(QemuRobot::start(&firmware, evolver.folder())) else {
        return;
    };
    let short = "evolve --population 4 --generations 2 --repetitions 2 --grid 9x9 --robots 12 \
        --steps 60 --noise 0.1 --predefine-partly line --seed 4 --out run";
    let arguments: Vec<&str> = short.split_whitespace().collect();
    assert_eq!(evolver.run(&arguments).code, Some(0));
    let port = robot.port.as_str();
    let flashed = evolver.run(&["flash", "run/best.genome", "--port", port]);
    assert_eq!(flashed.code, Some(0), "{flashed:?}");
    let simulated = evolver.run(&["hil", "run", "--simulate"]);
    let with_robot = evolver.run(&["hil", "run", "--port", port]);
    assert_eq!(word(&with_robot, "hash"), word(&simulated, "hash"));
    let watched = evolver.run(&["monitor", "--port", port, "--for", "2", "--json"]);
    assert_eq!(watched.code, Some(0), "{watched:?}");
    let seconds: Vec<serde_json::Value> = watched
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    // `hil` has left the robot running, as it was before.
    let steps = |second: &serde_json::Value| {
        let counts = ["straight", "turned_left", "turned_right"];
        counts
            .map(|count| second[count].as_u64().unwrap())
            .iter()
            .sum::<u64>()
    };
    assert_eq!(seconds.len(), 2, "{watched:?}");
    assert!(seconds[1]["running"] == true, "{watched:?}");
    assert!(steps(&seconds[1]) > steps(&seconds[0]), "{watched:?}");
    assert!(Path::new(&evolver.folder().join("flash.bin")).exists());
}
