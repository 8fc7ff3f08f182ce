//! What the controller costs a robot, and that no panic is linked into one.
//!
//! `cargo test -p tests --test budget -- --show-output` prints the table.

use tests::firmware::{self, flash_bytes, link_probe};
use tests::tools::{Missing, require};

/// The keys of `budget.toml` and what they allow.
fn budget() -> Vec<(String, u32)> {
    let path = firmware::directory().join("budget.toml");
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines()
        .filter_map(|line| line.split_once(" = "))
        .map(|(key, most)| (key.to_owned(), most.parse().expect("a whole number")))
        .collect()
}

/// The compiler and what was measured.
fn measure() -> Result<(String, Vec<(String, u32)>), Missing> {
    let firmware = firmware::build()?;
    let lines = firmware.run("budget")?;
    let mut measured: Vec<(String, u32)> = lines
        .iter()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let (key, value) = line.split_once(' ').expect("a key and a value");
            (key.to_owned(), value.parse().expect("a whole number"))
        })
        .collect();
    let [with, without] = ["with", "without"].map(|program| {
        link_probe(program).map(|linked| {
            assert!(linked.success, "{}", linked.messages);
            flash_bytes(program)
        })
    });
    measured.push(("flash_bytes".to_owned(), with? - without?));
    Ok((firmware.compiler, measured))
}

#[test]
fn the_controller_stays_within_its_budget() {
    let Some((compiler, measured)) = require(measure()) else {
        return;
    };
    let budget = budget();
    assert_eq!(budget.len(), measured.len(), "{measured:?}");
    println!("| what | measured | at most |\n|---|---|---|");
    let mut exceeded = Vec::new();
    for (key, most) in &budget {
        let found = measured.iter().find(|(measured, _)| measured == key);
        let (_, found) = found.unwrap_or_else(|| panic!("{key} is not measured"));
        println!("| {key} | {found} | {most} |");
        assert!(*found > 0, "{key}");
        if found > most {
            exceeded.push(key);
        }
    }
    println!("\n{compiler}");
    assert!(exceeded.is_empty(), "exceeded: {exceeded:?}");
}

#[test]
fn no_panic_is_linked_into_a_robot() {
    let Some(robot) = require(link_probe("no_panic")) else {
        return;
    };
    assert!(robot.success, "{}", robot.messages);
    // One index that nothing checks, or the above means nothing.
    let Some(panics) = require(link_probe("panics")) else {
        return;
    };
    assert!(!panics.success, "a panic was linked");
    let named = "undefined symbol: a_panic_can_be_reached";
    assert!(panics.messages.contains(named), "{}", panics.messages);
}
