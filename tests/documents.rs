//! Documents generated from the code match the code.

use minimal_surprise_evolution::settings::SETTINGS;
use std::fs;
use std::path::Path;
use tests::program::Evolver;

/// Returns the table of settings for `docs/settings.md`.
fn table() -> String {
    let mut table =
        "| setting | meaning | default | valid | in a suite |\n|---|---|---|---|---|\n".to_owned();
    for setting in SETTINGS {
        let default = match setting.default {
            "" => "–",
            default => default,
        };
        let list = match setting.list {
            "" => "–".to_owned(),
            key => format!("`{key}`"),
        };
        table += &format!(
            "| `{}` | {} | {default} | {} | {list} |\n",
            setting.name,
            setting.meaning(),
            setting.valid
        );
    }
    table
}

#[test]
fn the_table_of_settings_is_in_the_documents() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/settings.md");
    let text = fs::read_to_string(&path).unwrap();
    let table = table();
    assert!(
        text.contains(&table),
        "docs/settings.md needs this table:\n{table}"
    );
}

#[test]
fn the_tables_of_exported_data_are_in_the_documents() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/data.md");
    let text = fs::read_to_string(&path).unwrap();
    let tables = minimal_surprise_evolver::data::document();
    assert!(
        text.ends_with(&tables),
        "docs/data.md must end with these tables:\n{tables}"
    );
}

#[test]
fn the_readme_shows_the_hashes_and_the_genome_of_seed_1() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md");
    let readme = fs::read_to_string(&path).unwrap();
    let evolver = Evolver::in_empty_folder();
    let run = evolver.run(&[
        "evolve",
        "--seed",
        "1",
        "--out",
        "run",
        "--progress",
        "none",
    ]);
    assert_eq!(run.code, Some(0), "{run:?}");
    let done = evolver.text("run/DONE");
    let simulated = evolver.run(&["hil", "run", "--simulate"]);
    let simulated = simulated.stdout.trim().rsplit(' ').next().unwrap();
    let source = evolver.run(&["export", "run", "--format", "c"]).stdout;
    let name = source
        .lines()
        .find_map(|line| line.split("genome_run_").nth(1));
    let crc: String = name.unwrap().chars().take(8).collect();
    for shown in [done.trim(), simulated, &crc] {
        assert!(
            shown.len() >= 8 && readme.contains(shown),
            "README.md does not show {shown}"
        );
    }
}
