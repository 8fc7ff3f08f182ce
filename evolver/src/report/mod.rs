//! Output for users and other programs: progress, tables, summaries and JSON.

pub mod baseline;
pub mod embedding;
pub mod picture;
pub mod progress;
pub mod reevaluation;
pub mod structures;
pub mod suite_progress;
pub mod summary;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

/// Creates a table without a frame.
fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header);
    table
}

/// Formats a table with some columns aligned to the right, without trailing spaces.
fn right_aligned(mut table: Table, columns: &[usize]) -> String {
    for &index in columns {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let lines: Vec<String> = table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect();
    lines.join("\n")
}
