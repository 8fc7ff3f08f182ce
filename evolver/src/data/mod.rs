//! Runs as tidy tables for other programs: CSV files and their description.
//!
//! Each table is described once, by its columns; the CSV headers, `datapackage.json` (Frictionless
//! Data) and `docs/data.md` are generated from these descriptions.

mod tables;

pub use tables::{Cell, Column, ExportedRun, Table};

use minimal_surprise_evolution::files::{self, FileError};
use minimal_surprise_evolution::new_dir::NewDir;
use minimal_surprise_evolution::settings::ScalarKind;
use minimal_surprise_sim::WorldError;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use tables::weights_max;

/// File name of the description.
const PACKAGE: &str = "datapackage.json";

/// Returns a type's name in Frictionless Data.
fn name_of(kind: ScalarKind) -> &'static str {
    match kind {
        ScalarKind::Text => "string",
        ScalarKind::Integer => "integer",
        ScalarKind::Float => "number",
    }
}

/// Data could not be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The poses of a run do not fit the grid.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A row cannot be written.
    #[error("{table}: {source}")]
    Csv {
        /// File name of the table.
        table: String,
        /// The cause.
        source: csv::Error,
    },
}

/// Writes tables of runs, with their description, to a new directory. The directory appears only
/// when it is complete.
///
/// # Errors
/// [`ExportError`] if the directory exists, a file cannot be written or a run cannot be repeated.
pub fn write(
    to: &Path,
    tables: &[Table],
    runs: impl Iterator<Item = ExportedRun>,
) -> Result<(), ExportError> {
    let tables: BTreeSet<Table> = tables.iter().copied().collect();
    let new = NewDir::beside(to)?;
    let mut writers = Vec::new();
    for &table in &tables {
        let path = new.path().join(table.file_name());
        let file = File::create(&path).map_err(FileError::at(&path))?;
        writers.push(writer(table, BufWriter::new(file))?);
    }
    // Experiments may share runs; only the table of runs has a row for each.
    let mut seen = BTreeSet::new();
    for run in runs {
        let is_new = seen.insert(run.id.clone());
        for (table, csv) in tables.iter().zip(&mut writers) {
            if is_new || *table == Table::Runs {
                write_run(*table, &run, csv)?;
            }
        }
    }
    for (table, csv) in tables.iter().zip(writers) {
        let path = new.path().join(table.file_name());
        let file = csv.into_inner();
        let mut file = file.map_err(|error| FileError::at(&path)(error.into_error()))?;
        file.flush().map_err(FileError::at(&path))?;
    }
    let package = format!("{:#}\n", package(&tables));
    files::create(&new.path().join(PACKAGE), package.as_bytes())?;
    new.publish()?;
    Ok(())
}

/// Returns the table of runs as CSV.
///
/// # Errors
/// [`ExportError`] if a run cannot be repeated.
pub fn runs_text(runs: impl Iterator<Item = ExportedRun>) -> Result<String, ExportError> {
    let mut csv = writer(Table::Runs, Vec::new())?;
    for run in runs {
        write_run(Table::Runs, &run, &mut csv)?;
    }
    let bytes = csv.into_inner();
    let bytes = bytes.expect("flushing a buffer in memory cannot fail");
    Ok(String::from_utf8(bytes).expect("text stays text"))
}

/// Creates a table that has only its header.
fn writer<W: Write>(table: Table, to: W) -> Result<csv::Writer<W>, ExportError> {
    let mut csv = csv::Writer::from_writer(to);
    let columns = table.columns(weights_max());
    let names = columns.iter().map(|column| &column.name);
    csv.write_record(names).map_err(failed(table))?;
    Ok(csv)
}

/// Adds the rows of a run.
fn write_run<W: Write>(
    table: Table,
    run: &ExportedRun,
    csv: &mut csv::Writer<W>,
) -> Result<(), ExportError> {
    let mut written = Ok(());
    table.rows(run, &mut |row| {
        if written.is_ok() {
            let row = row.into_iter();
            let row = row.map(|cell| cell.map_or_else(String::new, |cell| cell.to_string()));
            written = csv.write_record(row);
        }
    })?;
    written.map_err(failed(table))
}

fn failed(table: Table) -> impl FnOnce(csv::Error) -> ExportError {
    let table = table.file_name();
    move |source| ExportError::Csv { table, source }
}

/// Describes tables as a Frictionless data package.
fn package(tables: &BTreeSet<Table>) -> Value {
    let resources = tables.iter().map(|table| {
        let fields = table.columns(weights_max()).into_iter().map(|column| {
            let mut field = json!({
                "name": column.name,
                "type": name_of(column.kind),
                "description": column.meaning,
            });
            if !column.unit.is_empty() {
                field["unit"] = column.unit.into();
            }
            field
        });
        let mut schema = json!({
            "fields": fields.collect::<Vec<_>>(),
            "missingValues": [""],
        });
        if *table == Table::Runs {
            schema["primaryKey"] = json!(["experiment", "setting", "run"]);
        }
        json!({
            "name": table.name(),
            "path": table.file_name(),
            "description": table.meaning(),
            "format": "csv",
            "mediatype": "text/csv",
            "encoding": "utf-8",
            "profile": "tabular-data-resource",
            "schema": schema,
        })
    });
    json!({
        "name": "minimal-surprise",
        "profile": "tabular-data-package",
        "resources": resources.collect::<Vec<_>>(),
    })
}

/// Describes all tables for `docs/data.md`.
#[must_use]
pub fn document() -> String {
    let mut text = String::new();
    for table in Table::ALL {
        text += &format!("## `{}`\n\n{}\n\n", table.file_name(), table.meaning());
        text += "| column | type | unit | meaning |\n|---|---|---|---|\n";
        for column in table.columns(1) {
            let unit = match column.unit {
                "" => "–",
                unit => unit,
            };
            text += &format!(
                "| `{}` | {} | {unit} | {} |\n",
                column.name,
                name_of(column.kind),
                column.meaning
            );
        }
        text.push('\n');
    }
    text.trim_end().to_owned() + "\n"
}
