//! Documents generated from the code match the code.

use minimal_surprise_evolution::settings::SETTINGS;
use std::fs;
use std::path::Path;

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
