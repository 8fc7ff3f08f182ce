//! Tests the commands that analyse evolved genomes, run as a user would run them.

use embedded_storage::nor_flash::NorFlash;
use firmware_example::memory_flash::MemoryFlash;
use firmware_example::stm32f4::{SLOT_0_ADDRESS, SLOT_1_ADDRESS};
use minimal_surprise_controller::EncodedGenome;
use minimal_surprise_slots::{Buffer, InUse, Slot, Slots};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tests::program::{Evolver, Finished};

/// A line of four robots, a pair, and two robots that form no structure except dispersion.
const DRAWING: &str = "
    ▲········
    ·········
    ···▶▶◀◀··
    ·········
    ·········
    ·▶◀······
    ·········
    ·······▼·
    ·········
";

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fixtures/exchange")
        .join(name)
}

fn fixture_text(name: &str) -> String {
    fs::read_to_string(fixture(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Creates a folder with a short run in `run`.
fn with_a_run(flags: &[&str]) -> Evolver {
    let evolver = Evolver::in_empty_folder();
    let short =
        "evolve --population 6 --generations 3 --repetitions 2 --steps 60 --seed 4 --out run";
    let arguments: Vec<&str> = short.split(' ').chain(flags.iter().copied()).collect();
    let run = evolver.run(&arguments);
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver
}

fn json(run: &Finished) -> Value {
    assert_eq!(run.code, Some(0), "{run:?}");
    serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {run:?}"))
}

fn assert_refused(run: &Finished, words: &[&str]) {
    assert_eq!(run.code, Some(2), "{run:?}");
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {run:?}");
    }
    assert_eq!(run.stderr.trim_end().lines().count(), 1, "{run:?}");
}

#[test]
fn classify_names_the_structures_of_a_drawing_and_draws_their_members_filled() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("swarm.txt", DRAWING.as_bytes());
    let shown = evolver.run(&["classify", "swarm.txt"]);
    assert_eq!(shown.code, Some(0), "{shown:?}");
    assert!(shown.stdout.contains("▶ ▶ ◀ ◀"), "{shown:?}");
    assert!(
        shown.stdout.contains("▷ ◁"),
        "the pair is no member: {shown:?}"
    );
    assert!(
        shown.stdout.contains("8 robots on 9x9: line\n"),
        "{shown:?}"
    );
    let found = json(&evolver.run(&["classify", "swarm.txt", "--json"]));
    assert_eq!(found["names"], serde_json::json!(["line"]));
    assert_eq!(found["structures"]["line"]["robots"], 4);
    assert_eq!(
        found["structures"]["pair"]["members"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    assert_eq!(found["lines"]["horizontal"], 1);
    assert_eq!(found["structures"]["random dispersion"]["share"], 0.25);
}

#[test]
fn classify_measures_a_run_and_agrees_with_the_files_of_evolve() {
    let evolver = with_a_run(&[]);
    let found = json(&evolver.run(&["classify", "run", "--json"]));
    let written: Value = serde_json::from_slice(&evolver.read("run/final.json")).unwrap();
    assert_eq!(found["names"], written["names"]);
    for key in ["movement", "intended_movement", "temperature", "surprise"] {
        assert_eq!(found["measures"][key], written["measures"][key], "{key}");
    }
    assert_eq!(found["measures"]["fitness"], written["fitness"]);
    assert_eq!(found["average_prediction"], written["average_prediction"]);
    let state = json(&evolver.run(&["classify", "run/final.json", "--json"]));
    assert_eq!(state["structures"], found["structures"]);
    assert!(state["measures"].is_null());
    let header = evolver.text("run/generations.csv");
    let header = header.lines().next().unwrap();
    for column in ["movement", "intended_movement", "structure", "share"] {
        assert!(
            header.split(',').any(|name| name == column),
            "{column}: {header}"
        );
    }
    let last = evolver.text("run/generations.csv");
    let movement = written["measures"]["movement"].as_f64().unwrap();
    let column = header
        .split(',')
        .position(|name| name == "movement")
        .unwrap();
    let cell = last.lines().last().unwrap().split(',').nth(column).unwrap();
    assert_eq!(cell.parse::<f64>().unwrap(), movement);
}

#[test]
fn impossible_states_are_refused_with_their_line() {
    let evolver = Evolver::in_empty_folder();
    let text = fixture_text("c/agent_trajectory");
    let lines: Vec<&str> = text.lines().collect();
    let changed = |line: usize, to: &str| {
        let mut lines = lines.clone();
        lines[line - 1] = to;
        lines.join("\n")
    };
    let cases = [
        (changed(7, lines[5]), vec!["line 7", "already"]),
        (
            changed(9, "0: 15, 2, 1, 0"),
            vec!["line 9", "15", "outside"],
        ),
        (changed(9, "0: 3, 2, 1, 1"), vec!["line 9", "heading"]),
        (changed(9, "0: 3, 2, 1"), vec!["line 9"]),
        (changed(2, "Grid: 2, 15"), vec!["line 2", "from 3"]),
        (lines[..150].join("\n"), vec!["line 151", "ends"]),
    ];
    for (text, mut words) in cases {
        evolver.write("trajectory", text.as_bytes());
        words.push("trajectory");
        assert_refused(&evolver.run(&["classify", "trajectory"]), &words);
    }
    evolver.write("swarm.txt", "···\n·x·\n···\n".as_bytes());
    assert_refused(
        &evolver.run(&["classify", "swarm.txt"]),
        &["swarm.txt", "line 2", "'x'"],
    );
    assert_refused(
        &evolver.run(&["classify", "none"]),
        &["none", "No such file"],
    );
}

#[test]
fn impossible_final_states_are_refused() {
    let evolver = with_a_run(&[]);
    let text = evolver.text("run/final.json");
    let good: Value = serde_json::from_str(&text).unwrap();
    let with = |change: &dyn Fn(&mut Value)| {
        let mut state = good.clone();
        change(&mut state);
        evolver.write("final.json", state.to_string().as_bytes());
        evolver.run(&["classify", "final.json"])
    };
    let first = good["final"][0].clone();
    let refused = with(&|state| state["final"][1] = first.clone());
    assert_refused(&refused, &["final.json", "robot 1", "robot 0"]);
    let refused = with(&|state| state["final"][0][0] = 15.into());
    assert_refused(&refused, &["final.json", "robot 0", "outside"]);
    let refused = with(&|state| state["final"][0][2] = 4.into());
    assert_refused(&refused, &["final.json", "heading 4", "line 1"]);
    let refused = with(&|state| state["final"] = serde_json::json!([]));
    assert_refused(&refused, &["final.json", "0 final poses for 100"]);
    let refused = with(&|state| state["schema_version"] = 9.into());
    assert_refused(&refused, &["final.json", "schema version 9"]);
    evolver.write("final.json", &text.as_bytes()[..700]);
    let refused = evolver.run(&["classify", "final.json"]);
    assert_refused(&refused, &["final.json", "line"]);
    fs::remove_file(evolver.folder().join("run/DONE")).unwrap();
    assert_refused(&evolver.run(&["classify", "run"]), &["run", "no DONE"]);
}

#[test]
fn evaluate_gives_a_table_over_grids_noise_levels_and_swarm_sizes() {
    let evolver = with_a_run(&[]);
    let arguments = "evaluate run/best.genome --starts 3 --steps 50 --grid 15x15,11x18 \
        --noise 0,0.05 --robots 60,100 --json";
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let table = json(&evolver.run(&arguments));
    let rows = table["conditions"].as_array().unwrap();
    assert_eq!(rows.len(), 8);
    for row in rows {
        let starts = row["starts"].as_array().unwrap();
        let fitness: Vec<f64> = starts
            .iter()
            .map(|s| s["fitness"].as_f64().unwrap())
            .collect();
        let mean = fitness.iter().sum::<f64>() / 3.0;
        assert!((row["mean_fitness"].as_f64().unwrap() - mean).abs() < 1e-12);
        let mut sorted = fitness.clone();
        sorted.sort_by(f64::total_cmp);
        assert_eq!(row["median_fitness"].as_f64().unwrap(), sorted[1]);
        let names: f64 = row["structures"]
            .as_object()
            .unwrap()
            .values()
            .map(|n| n.as_f64().unwrap())
            .sum();
        assert!(names <= 3.0 + 1e-9);
    }
    let one_thread = [&arguments[..], &["--threads", "1"]].concat();
    assert_eq!(json(&evolver.run(&one_thread)), table);
    let shown = evolver.run(&[
        "evaluate",
        "run/best.genome",
        "--starts",
        "2",
        "--steps",
        "20",
    ]);
    assert!(shown.stdout.contains("mean fitness"), "{shown:?}");
}

#[test]
fn evaluate_refuses_impossible_settings() {
    let evolver = with_a_run(&[]);
    let run = |flags: &[&str]| evolver.run(&[&["evaluate", "run/best.genome"], flags].concat());
    assert_refused(&run(&["--starts", "0"]), &["--starts", "0", "from 1"]);
    assert_refused(&run(&["--grid", "15x15,2x2"]), &["--grid", "2x2", "from 3"]);
    assert_refused(
        &run(&["--noise", "0,1.5"]),
        &["--noise", "1.5", "from 0 to 1"],
    );
    assert_refused(
        &run(&["--robots", "226"]),
        &["--robots", "226", "from 1 to 225"],
    );
    assert_refused(&run(&["--steps", "-1"]), &["--steps", "-1", "from 1"]);
    assert_refused(
        &evolver.run(&["evaluate", "run/config.toml"]),
        &["config.toml", "not a genome"],
    );
}

#[test]
fn damage_prints_the_rows_of_the_papers_tables() {
    let evolver = with_a_run(&[]);
    let damage = |flags: &str| {
        let arguments: Vec<&str> = flags.split_whitespace().collect();
        evolver.run(&[&["damage", "run", "--structure", "line"], &arguments[..]].concat())
    };
    let table = json(&damage("--area 2,3,8,9 --reposition --repeat 4 --json"));
    let rows = table["rows"].as_array().unwrap();
    let names: Vec<&str> = rows
        .iter()
        .map(|row| row["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["initial run", "new starts", "reposition"]);
    assert_eq!(rows[0]["similarity"]["mean"], 1.0);
    let written: Value = serde_json::from_slice(&evolver.read("run/final.json")).unwrap();
    assert_eq!(rows[0]["fitness"]["mean"], written["fitness"]);
    assert_eq!(rows[2]["robots"]["mean"], 100.0);
    assert_eq!(rows[2]["fitness"]["values"].as_array().unwrap().len(), 4);

    let table = json(&damage("--area 12,13,2,1 --remove --json"));
    let inside = |pose: &Value| {
        let at = |index: usize| pose[index].as_u64().unwrap();
        (at(0) >= 12 || at(0) <= 2) && (at(1) >= 13 || at(1) <= 1)
    };
    let poses = written["final"].as_array().unwrap();
    let left = poses.iter().filter(|pose| !inside(pose)).count();
    assert_eq!(table["rows"][2]["robots"]["mean"], left as f64);
    let shown = damage("--area 2,3,8,9 --remove");
    assert!(shown.stdout.contains("similarity"), "{shown:?}");
}

#[test]
fn damage_refuses_impossible_settings() {
    let evolver = with_a_run(&[]);
    let damage = |flags: &str| {
        let arguments: Vec<&str> = flags.split_whitespace().collect();
        evolver.run(&[&["damage", "run"], &arguments[..]].concat())
    };
    assert_refused(
        &damage("--area 2,3,8 --remove"),
        &["--area", "2,3,8", "four coordinates"],
    );
    assert_refused(
        &damage("--area 2,3,8,15 --remove"),
        &["--area", "(8, 15)", "15x15"],
    );
    assert_refused(
        &damage("--area 0,0,14,14 --remove"),
        &["--area", "0 robots"],
    );
    let crowded = damage("--area 0,0,14,13 --reposition");
    assert_refused(&crowded, &["--area", "robots to reposition"]);
    let named = damage("--area 1,1,2,2 --remove --structure ring");
    assert_refused(&named, &["--structure", "ring", "line, pair"]);
    assert_eq!(damage("--area 1,1,2,2").code, Some(2));
    assert_eq!(damage("--area 1,1,2,2 --remove --reposition").code, Some(2));
}

#[test]
fn genome_text_is_converted_to_genome_files_and_rounding_is_reported() {
    let evolver = Evolver::in_empty_folder();
    for model in ["a", "b", "c", "c-partly-predefined"] {
        let path = |name: &str| fixture(model).join(name).to_string_lossy().into_owned();
        let (action, prediction) = (path("action_genomes"), path("prediction_genomes"));
        let flags = ["import", "--action", &action, "--prediction", &prediction];
        let imported = evolver.run(&[&flags[..], &["--out", model]].concat());
        assert_eq!(imported.code, Some(0), "{imported:?}");
        assert!(
            imported.stdout.contains("largest rounding error 1."),
            "{imported:?}"
        );
        assert!(
            imported.stdout.contains("0 weights out of range"),
            "{imported:?}"
        );
        let shown = evolver.run(&["inspect", &format!("{model}/generation-2.genome")]);
        assert!(shown.stdout.contains("an unknown seed"), "{shown:?}");
        let again = evolver.run(&[&flags[..], &["--out", model]].concat());
        assert_refused(&again, &["--out", model, "exists"]);
        let one = [&flags[..], &["--generation", "1", "--out", "one"]].concat();
        assert_eq!(evolver.run(&one).code, Some(0));
        assert_eq!(
            fs::read_dir(evolver.folder().join("one")).unwrap().count(),
            1
        );
        fs::remove_dir_all(evolver.folder().join("one")).unwrap();
        let beyond = [&flags[..], &["--generation", "3", "--out", "beyond"]].concat();
        assert_refused(&evolver.run(&beyond), &["--generation", "3", "0 to 2"]);
    }
    let action = fixture("c/action_genomes").to_string_lossy().into_owned();
    let predefined = [
        "import",
        "--action",
        &action,
        "--predefine",
        "line",
        "--out",
        "line",
    ];
    let imported = evolver.run(&predefined);
    assert!(imported.stdout.contains("166 weights"), "{imported:?}");
    let missing = evolver.run(&["import", "--action", &action]);
    assert_refused(&missing, &["--prediction", "--predefine"]);
}

#[test]
fn invalid_genome_text_is_refused_with_its_line() {
    let evolver = Evolver::in_empty_folder();
    let prediction = fixture("c/prediction_genomes")
        .to_string_lossy()
        .into_owned();
    let text = fixture_text("c/action_genomes");
    let lines: Vec<&str> = text.lines().collect();
    let short = lines[1].trim_end().rsplit_once(' ').unwrap().0;
    let cases = [
        (
            text.replacen(lines[1], short, 1),
            vec!["line 2", "223", "224"],
        ),
        (
            text.replacen(lines[0], "0.5 nonsense", 1),
            vec!["line 1", "nonsense"],
        ),
        (lines[..2].join("\n"), vec!["line 3", "ends"]),
        (String::new(), vec!["line 1", "ends"]),
    ];
    for (text, words) in cases {
        evolver.write("action", text.as_bytes());
        let flags = ["import", "--action", "action", "--prediction", &prediction];
        assert_refused(&evolver.run(&flags), &words);
    }
    assert_eq!(evolver.files(), ["action"], "no other file was written");
}

#[test]
fn one_generation_is_imported_even_if_others_are_invalid() {
    let evolver = Evolver::in_empty_folder();
    for file in ["action_genomes", "prediction_genomes"] {
        let text = fixture_text(&format!("c/{file}"));
        let lines: Vec<&str> = text.lines().collect();
        // Generation 1 is not numeric, and generation 2 lacks its last row.
        let spoilt = [&lines[..4], &["x"; 3], &lines[7..10]].concat();
        evolver.write(file, spoilt.join("\n").as_bytes());
    }
    let import = |generation: &str| {
        let files = [
            "--action",
            "action_genomes",
            "--prediction",
            "prediction_genomes",
        ];
        let chosen = ["--generation", generation, "--out", "out"];
        evolver.run(&[&["import"][..], &files, &chosen].concat())
    };
    let first = import("0");
    assert_eq!(first.code, Some(0), "{first:?}");
    assert!(evolver.folder().join("out/generation-0.genome").exists());
    fs::remove_dir_all(evolver.folder().join("out")).unwrap();
    assert_refused(&import("1"), &["action_genomes, line 5", "\"x\""]);
    assert_refused(&import("2"), &["action_genomes, line 11", "ends"]);
    assert_refused(&import("-1"), &["--generation = -1", "0 or more"]);
    assert!(!evolver.folder().join("out").exists());
}

#[test]
fn an_exported_trajectory_is_classified_like_its_run() {
    let evolver = with_a_run(&[]);
    let flags = [
        "export",
        "run",
        "--format",
        "trajectory",
        "--out",
        "trajectory",
    ];
    assert_eq!(evolver.run(&flags).code, Some(0));
    assert_eq!(evolver.text("trajectory").lines().count(), 3 + 61 * 100);
    let of_run = json(&evolver.run(&["classify", "run", "--json"]));
    let of_text = json(&evolver.run(&["classify", "trajectory", "--json"]));
    assert_eq!(of_text["structures"], of_run["structures"]);
    assert_refused(&evolver.run(&flags), &["--out", "trajectory", "exists"]);
}

#[test]
fn evaluate_uses_a_runs_conditions_unless_others_are_given() {
    let evolver = with_a_run(&["--grid", "11x18", "--robots", "90", "--noise", "0.05"]);
    for genome in ["run", "run/best.genome"] {
        let table = json(&evolver.run(&["evaluate", genome, "--starts", "2", "--json"]));
        let row = &table["conditions"][0];
        assert_eq!(row["grid"], "11x18");
        assert_eq!(row["robots"], 90);
        assert_eq!(row["noise"], 0.05);
        assert_eq!(row["steps"], 60);
    }
    let flags = [
        "evaluate", "run", "--starts", "2", "--robots", "50", "--json",
    ];
    let table = json(&evolver.run(&flags));
    assert_eq!(table["conditions"][0]["robots"], 50);
}

#[test]
fn a_drawing_from_the_terminal_is_classified_like_its_run() {
    let evolver = with_a_run(&[]);
    let shown = evolver.run(&["classify", "run"]);
    let picture: Vec<&str> = shown.stdout.lines().take(15).collect();
    evolver.write("picture.txt", picture.join("\n").as_bytes());
    let of_picture = json(&evolver.run(&["classify", "picture.txt", "--json"]));
    let of_run = json(&evolver.run(&["classify", "run", "--json"]));
    assert_eq!(of_picture["names"], of_run["names"]);
    assert_eq!(of_picture["lines"], of_run["lines"]);
    evolver.write("other.txt", b"nothing of the kind\n");
    assert_refused(
        &evolver.run(&["classify", "other.txt"]),
        &["other.txt", "neither"],
    );
    evolver.write("empty.txt", b"");
    assert_refused(
        &evolver.run(&["classify", "empty.txt"]),
        &["empty.txt", "neither"],
    );
}

/// Compiles and runs a program that prints the bytes of an exported genome; returns these bytes.
fn printed_by(evolver: &Evolver, compiler: &str, arguments: &[&str]) -> Vec<u8> {
    let run = |program: &Path, arguments: &[&str]| {
        let mut command = std::process::Command::new(program);
        let output = command
            .args(arguments)
            .current_dir(evolver.folder())
            .output();
        let output = output.unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        assert!(output.status.success(), "{output:?}");
        output.stdout
    };
    run(Path::new(compiler), arguments);
    run(&evolver.folder().join("printer"), &[])
}

#[test]
fn an_exported_genome_has_the_same_bytes_in_c_and_rust() {
    let evolver = with_a_run(&[]);
    let container = evolver.read("run/best.genome");
    for (format, name) in [("c", "genome.h"), ("rust", "genome.rs")] {
        let arguments = [
            "export",
            "run/best.genome",
            "--format",
            format,
            "--name",
            "GENOME",
            "--out",
            name,
        ];
        let run = evolver.run(&arguments);
        assert_eq!(run.code, Some(0), "{run:?}");
        let again = evolver.run(&arguments);
        assert_refused(&again, &[&format!("--out = {name}"), "already exists"]);
    }
    evolver.write(
        "printer.c",
        b"#include <stdio.h>\n#include \"genome.h\"\n#include \"genome.h\"\nint main(void) {\n\
          return fwrite(GENOME, sizeof GENOME, 1, stdout) != 1;\n}\n",
    );
    let flags = ["-std=c99", "-Wall", "-Werror", "-o", "printer", "printer.c"];
    assert_eq!(printed_by(&evolver, "cc", &flags), container);
    evolver.write(
        "printer.rs",
        b"#![deny(warnings, missing_docs)]\n//! Prints.\ninclude!(\"genome.rs\");\nfn main() {\n\
          use std::io::Write;\n    std::io::stdout().write_all(&GENOME).unwrap();\n}\n",
    );
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    assert_eq!(printed_by(&evolver, &rustc, &["printer.rs"]), container);
}

#[test]
fn an_exported_genome_can_be_raw_or_intel_hex() {
    let evolver = with_a_run(&[]);
    let container = evolver.read("run/best.genome");
    let export = |more: &str| {
        let arguments = ["export", "run/best.genome", "--format"];
        let arguments = arguments.into_iter().chain(more.split(' '));
        evolver.run(&arguments.collect::<Vec<_>>())
    };
    let raw = export("bin --out raw.bin --address 0x0800c000 --chip STM32F405RGTx");
    assert_eq!(raw.code, Some(0), "{raw:?}");
    assert_eq!(evolver.read("raw.bin"), container);
    assert_eq!(
        raw.stderr,
        "probe-rs download --chip STM32F405RGTx --binary-format bin --base-address 0x0800c000 \
         raw.bin\n"
    );
    // If no output file is given, the genome file itself is the raw form.
    let raw = export("bin");
    assert!(raw.stderr.ends_with(" run/best.genome\n"), "{raw:?}");

    let hex = export("hex --address 0x0800fff0");
    assert_eq!(hex.code, Some(0), "{hex:?}");
    let mut upper = 0;
    let mut next = 0x0800_fff0;
    let mut bytes = Vec::<u8>::new();
    for line in hex.stdout.lines() {
        let digits = line.strip_prefix(':').unwrap().as_bytes().chunks(2);
        let record: Vec<u8> = digits
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect();
        let sum = record
            .iter()
            .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        assert_eq!(
            (usize::from(record[0]) + 5, sum),
            (record.len(), 0),
            "{line}"
        );
        let data = &record[4..record.len() - 1];
        let address = u32::from(record[1]) << 8 | u32::from(record[2]);
        match record[3] {
            0 => {
                assert_eq!(upper + address, next, "{line}");
                next += data.len() as u32;
                bytes.extend(data);
            }
            4 => upper = u32::from(data[0]) << 24 | u32::from(data[1]) << 16,
            kind => assert_eq!((kind, data), (1, &[][..]), "{line}"),
        }
    }
    assert_eq!(bytes, container);
    assert!(hex.stdout.ends_with(":00000001FF\n"));
}

#[test]
fn an_exported_slot_is_run_by_a_robot_and_placed_at_its_boards_slots() {
    let evolver = with_a_run(&[]);
    let container = evolver.read("run/best.genome");
    let export = |more: &str| {
        let arguments = ["export", "run/best.genome", "--format", "slot", "--out"];
        let arguments = arguments.into_iter().chain(more.split(' '));
        evolver.run(&arguments.collect::<Vec<_>>())
    };
    let exported = export("old.bin");
    assert_eq!(exported.code, Some(0), "{exported:?}");
    assert_eq!(
        exported.stderr,
        format!(
            "probe-rs download --chip STM32F407VGTx --binary-format bin \
             --base-address {SLOT_1_ADDRESS:#010x} old.bin\n"
        )
    );
    let help = evolver.run(&["export", "--help"]).stdout;
    for address in [SLOT_0_ADDRESS, SLOT_1_ADDRESS] {
        assert!(help.contains(&format!("{address:#010x}")), "{help}");
    }
    let exported = export("new.bin --write-count 7");
    assert_eq!(exported.code, Some(0), "{exported:?}");

    let mut flash = MemoryFlash::new();
    let second = MemoryFlash::ERASE_SIZE as u32;
    for (at, file) in [(second, "old.bin"), (0, "new.bin")] {
        let mut bytes = evolver.read(file);
        bytes.resize(bytes.len().next_multiple_of(MemoryFlash::WRITE_SIZE), 0xff);
        flash.write(at, &bytes).unwrap();
        let mut room = Buffer::new();
        let mut slots = Slots::open(&mut flash, 0, &mut room).unwrap();
        let (slot, header) = slots.newest().unwrap();
        let expected = if at == 0 {
            (Slot::First, 7)
        } else {
            (Slot::Second, 1)
        };
        assert_eq!((slot, header.write_count), expected);
        let genome = EncodedGenome::decode(&container).unwrap();
        let InUse::Slot { genome: found, .. } = slots.in_use(&mut room) else {
            panic!("{file} is not run");
        };
        assert!(found.weights().eq(genome.weights()));
    }
}

#[test]
fn export_refuses_invalid_genomes_and_places_where_they_do_not_fit() {
    let evolver = with_a_run(&[]);
    evolver.write("damaged.genome", &evolver.read("run/best.genome")[..500]);
    let refused = |arguments: &str, words: &[&str]| {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        let before = evolver.files();
        assert_refused(&evolver.run(&arguments), words);
        assert_eq!(evolver.files(), before);
    };
    for format in ["bin", "c", "rust", "hex", "slot"] {
        refused(
            &format!("export damaged.genome --format {format} --out out"),
            &["damaged.genome", "too short"],
        );
    }
    refused(
        "export run/best.genome --format hex --address 0xfffffff0 --out out",
        &["--address = 0xfffffff0", "beyond 0xffffffff"],
    );
    refused(
        "export run/best.genome --format bin --address flash --out out",
        &["--address = flash", "such as 0x080e0000"],
    );
    refused(
        "export run/best.genome --format slot --write-count 0 --out out",
        &["--write-count = 0", "from 1 to 4278190079"],
    );
    refused(
        "export run/best.genome --format trajectory",
        &["from a run directory"],
    );
}

#[test]
fn every_command_reports_a_damaged_run_as_damaged_and_a_folder_without_a_run_as_bad_input() {
    let evolver = with_a_run(&[]);
    fs::create_dir(evolver.folder().join("empty")).unwrap();
    let commands = [
        "inspect",
        "evaluate --starts 1",
        "classify",
        "export --format rust",
    ];
    let expect = |code: i32, directory: &str, word: &str| {
        for command in commands {
            let mut words: Vec<&str> = command.split(' ').collect();
            words.insert(1, directory);
            let run = evolver.run(&words);
            assert_eq!(run.code, Some(code), "{words:?}: {run:?}");
            assert!(run.stderr.contains(word), "no {word:?}: {run:?}");
        }
    };
    expect(2, "empty", "it has no DONE");
    let good = evolver.read("run/best.genome");
    evolver.write("run/best.genome", &good[..good.len() / 2]);
    expect(1, "run", "best.genome");
    fs::remove_file(evolver.folder().join("run/best.genome")).unwrap();
    expect(1, "run", "best.genome");
    evolver.write("run/best.genome", &good);
    let config = evolver.text("run/config.toml");
    evolver.write("run/config.toml", &config.as_bytes()[..40]);
    let run = evolver.run(&["evaluate", "run"]);
    assert_eq!(run.code, Some(1), "{run:?}");
}
