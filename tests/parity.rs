//! On an emulated Cortex-M4, the controller computes the same bits as on the host and stays within
//! its instruction budget.

use firmware_example::parity;
use minimal_surprise_controller::KERNEL_ID;
use tests::firmware::{self, Firmware};
use tests::tools::{Missing, require};

/// Maximum number of instructions for a layer of 14 activations.
const ACTIVATIONS_BUDGET: u32 = 320;

fn host_lines() -> Vec<String> {
    let mut lines = Vec::new();
    parity::run(|line| lines.push(line.to_string()));
    lines
}

fn expected_lines() -> Vec<String> {
    let path = firmware::directory().join("src/bin/parity.out");
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines().map(str::to_owned).collect()
}

/// Builds the firmware; returns it and the log of one of its programs.
fn logged(program: &str) -> Option<(Firmware, Vec<String>)> {
    let both = firmware::build().and_then(|firmware| {
        let lines = firmware.run(program)?;
        Ok::<_, Missing>((firmware, lines))
    });
    require(both)
}

/// Returns the number before "instructions" in the line that starts with `subject`.
fn instructions(lines: &[String], subject: &str) -> u32 {
    let line = lines.iter().find_map(|line| line.strip_prefix(subject));
    line.and_then(|line| line.split_once(" instructions"))
        .and_then(|(number, _)| number.trim().parse().ok())
        .unwrap_or_else(|| panic!("no instructions of {subject:?} in {lines:?}"))
}

#[test]
fn the_host_computes_the_expected_hashes() {
    assert_eq!(host_lines(), expected_lines());
}

#[test]
fn the_hash_of_the_activations_is_the_kernels_identity() {
    assert_eq!(parity::activations().0[..8], KERNEL_ID.0);
}

#[test]
fn the_emulated_robot_computes_the_same_hashes_as_the_host() {
    let Some((firmware, lines)) = logged("parity") else {
        return;
    };
    assert_eq!(lines, expected_lines());
    assert_eq!(lines, host_lines());
    println!(
        "{} activations and {} control steps equal; {}",
        1 << 16,
        parity::STEPS,
        firmware.compiler
    );
}

#[test]
fn fourteen_activations_stay_within_their_instruction_limit() {
    let Some((firmware, lines)) = logged("counts") else {
        return;
    };
    println!("{}\n{}", lines.join("\n"), firmware.compiler);
    let activations = instructions(&lines, "14 activations:");
    let step = instructions(&lines, "one control step:");
    assert!(activations <= ACTIVATIONS_BUDGET, "{activations}");
    assert!(step > activations, "{step}");
}
