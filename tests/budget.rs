//! Checks the cost of the controller on a robot, and that no panic is linked into the firmware.
//!
//! `cargo test -p tests --test budget -- --show-output` prints the table.

use tests::firmware::{self, flash_bytes, link};
use tests::tools::{Missing, require};

/// Keys of `budget.toml`, and their names in the README's table.
const ROWS: [(&str, &str); 9] = [
    ("step_instructions", "one control step, instructions"),
    (
        "activations_14_instructions",
        "14 activations, instructions",
    ),
    (
        "reset_to_first_step_instructions",
        "reset to first step, instructions",
    ),
    (
        "flash_bytes",
        "flash: controller, tables, genome loading, bytes",
    ),
    ("ram_bytes", "RAM: controller and state, bytes"),
    ("step_stack_bytes", "deepest stack of a step, bytes"),
    (
        "decode_stack_bytes",
        "deepest stack of decoding a genome, bytes",
    ),
    (
        "build_stack_bytes",
        "deepest stack of building a controller, bytes",
    ),
    (
        "start_stack_bytes",
        "deepest stack while starting from the slots, bytes",
    ),
];

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Row {
    what: String,
    measured: u32,
    most: u32,
}

fn text(name: &str) -> String {
    let path = firmware::directory().join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Reads the limits in `budget.toml`, in the order of [`ROWS`].
fn budget() -> Vec<u32> {
    let text = text("budget.toml");
    let lines: Vec<(&str, &str)> = text
        .lines()
        .filter_map(|line| line.split_once(" = "))
        .collect();
    assert_eq!(lines.len(), ROWS.len(), "{lines:?}");
    let most = |key| {
        let line = lines.iter().find(|(found, _)| *found == key);
        let (_, most) = line.unwrap_or_else(|| panic!("budget.toml has no {key}"));
        most.parse().expect("a whole number")
    };
    ROWS.iter().map(|(key, _)| most(*key)).collect()
}

/// Reads the README's table of costs and the name of the compiler used for it.
fn readme() -> (Vec<Row>, String) {
    let text = text("../README.md");
    let (_, cost) = text.split_once("### Cost").expect("a section on costs");
    let (cost, _) = cost.split_once("\n## ").expect("a section after it");
    let rows = cost.lines().filter_map(|line| {
        let mut cells = line.trim_matches('|').split(" | ").map(str::trim);
        let (what, measured, most) = (cells.next()?, cells.next()?, cells.next()?);
        Some(Row {
            what: what.to_owned(),
            measured: measured.parse().ok()?,
            most: most.parse().ok()?,
        })
    });
    let rows = rows.collect();
    let (_, compiler) = cost.split_once("rustc ").expect("a compiler is named");
    let end = compiler.find(|c: char| !c.is_ascii_digit() && c != '.');
    (rows, format!("rustc {} ", &compiler[..end.unwrap_or(0)]))
}

/// Measures the values, in the order of [`ROWS`]; returns the compiler and the values.
fn measure() -> Result<(String, Vec<u32>), Missing> {
    let firmware = firmware::build()?;
    let lines = firmware.run("budget")?;
    let [with, without] = ["with", "without"].map(|program| {
        link("probe", program).map(|linked| {
            assert!(linked.success, "{}", linked.messages);
            flash_bytes(program)
        })
    });
    let flash = format!("flash_bytes {}", with? - without?);
    let measured = |key| {
        let mut lines = lines.iter().chain([&flash]);
        let found = lines.find_map(|line| line.strip_prefix(key)?.strip_prefix(' '));
        let found = found.unwrap_or_else(|| panic!("{key} is not measured"));
        found.parse().expect("a whole number")
    };
    let measured = ROWS.iter().map(|(key, _)| measured(*key)).collect();
    Ok((firmware.compiler, measured))
}

#[test]
fn the_controller_stays_within_its_budget_and_the_readme_states_its_costs() {
    let Some((compiler, measured)) = require(measure()) else {
        return;
    };
    println!("| what | measured | at most |\n|---|---|---|");
    let rows: Vec<Row> = std::iter::zip(ROWS, std::iter::zip(measured, budget()))
        .map(|((_, what), (measured, most))| Row {
            what: what.to_owned(),
            measured,
            most,
        })
        .collect();
    for row in &rows {
        println!("| {} | {} | {} |", row.what, row.measured, row.most);
    }
    println!("\n{compiler}");
    for row in &rows {
        assert!((1..=row.most).contains(&row.measured), "{row:?}");
    }
    // A different compiler or core library produces a different program.
    let (in_readme, its_compiler) = readme();
    if compiler.starts_with(&its_compiler) && !compiler.contains("from its source") {
        assert_eq!(in_readme, rows, "README.md is not up to date");
    }
}

#[test]
fn the_readme_names_the_limits_and_no_value_exceeds_them() {
    let (rows, _) = readme();
    let whats: Vec<&str> = rows.iter().map(|row| row.what.as_str()).collect();
    assert_eq!(whats, ROWS.map(|(_, what)| what));
    let limits: Vec<u32> = rows.iter().map(|row| row.most).collect();
    assert_eq!(limits, budget());
    for row in &rows {
        assert!(row.measured <= row.most, "{row:?}");
    }
}

#[test]
fn the_firmware_is_linked_for_both_boards() {
    for (package, program) in [
        ("firmware-example", "robot"),
        ("robot-stm32f4", "robot-stm32f4"),
    ] {
        let Some(linked) = require(link(package, program)) else {
            return;
        };
        assert!(linked.success, "{}", linked.messages);
        println!("{program}: {} bytes of flash", flash_bytes(program));
    }
}

#[test]
fn no_panic_is_linked_into_a_robot() {
    let Some(robot) = require(link("probe", "no_panic")) else {
        return;
    };
    assert!(robot.success, "{}", robot.messages);
    // A program with an unchecked index must fail to link; otherwise, the check above would prove
    // nothing.
    let Some(panics) = require(link("probe", "panics")) else {
        return;
    };
    assert!(!panics.success, "a panic was linked");
    let named = "undefined symbol: a_panic_can_be_reached";
    assert!(panics.messages.contains(named), "{}", panics.messages);
}
