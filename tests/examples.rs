//! The examples of the libraries run and print the documented results.

use escargot::CargoBuild;
use std::path::Path;

/// Runs an example and returns the lines that it prints.
fn lines_of(example: &str) -> Vec<String> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
    let built = CargoBuild::new()
        .manifest_path(workspace)
        // As test.sh builds the workspace, so that nothing is built twice.
        .args(["--workspace", "--all-features"])
        .example(example)
        .run()
        .unwrap_or_else(|error| panic!("{example}: {error}"));
    let output = built.command().output().expect("the example starts");
    assert!(output.status.success(), "{example}: {output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(str::to_owned).collect()
}

/// Returns the number after `prefix` in a line.
fn number(line: &str, prefix: &str) -> f64 {
    let rest = line.split_once(prefix).map_or("", |(_, rest)| rest);
    let digits = rest.split(' ').next().unwrap_or_default();
    digits
        .parse()
        .unwrap_or_else(|error| panic!("{line}: {error}"))
}

#[test]
fn swarms_are_selected_for_a_custom_fitness() {
    let lines = lines_of("own_fitness");
    assert_eq!(lines.len(), 10, "{lines:?}");
    let [first, last] = [&lines[0], &lines[9]].map(|line| number(line, ": "));
    assert!(last > 1.1 * first, "{lines:?}");
}

#[test]
fn a_custom_selection_and_another_optimiser_drive_the_population() {
    for example in ["own_selection", "ask_tell"] {
        let lines = lines_of(example);
        assert_eq!(lines.len(), 10, "{example}: {lines:?}");
        let [first, last] = [&lines[0], &lines[9]].map(|line| number(line, "fitness "));
        assert!(last > first && last < 1.0, "{example}: {lines:?}");
    }
}

#[test]
fn a_custom_analysis_sees_every_step_of_a_finished_run() {
    let lines = lines_of("own_analysis");
    assert_eq!(lines.len(), 4, "{lines:?}");
    for line in &lines {
        assert!((25.0..=100.0).contains(&number(line, ": ")), "{lines:?}");
    }
}

#[test]
fn a_custom_structure_is_measured_alongside_the_papers() {
    let lines = lines_of("own_structure");
    assert_eq!(lines.len(), 3, "{lines:?}");
    assert!(
        lines.iter().any(|line| number(line, ": ") > 0.0),
        "{lines:?}"
    );
}
