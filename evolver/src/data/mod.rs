//! Runs as tidy tables for other programs: CSV files and their description.
//!
//! Each table is described once, by its columns; the CSV headers, `datapackage.json` (Frictionless
//! Data) and `docs/data.md` are generated from these descriptions.

mod tables;

use clap::ValueEnum;
use minimal_surprise_evolution::files::{self, FileError};
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::new_dir::NewDir;
use minimal_surprise_sim::WorldError;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// File name of the description.
const PACKAGE: &str = "datapackage.json";

/// A table of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Table {
    /// One row per run: settings, outcomes, baselines.
    Runs,
    /// One row per generation of a run.
    Generations,
    /// One row per step of the final run of the best genome.
    Steps,
    /// One row per robot and step of that run.
    Robots,
    /// One row per run: the weights of the best genome.
    Genomes,
}

/// Type of a column's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number.
    Integer,
    /// A number; the text is the shortest that gives the same 64-bit number.
    Number,
    /// Text.
    String,
}

impl Kind {
    /// Returns the type's name in Frictionless Data.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Integer => "integer",
            Self::Number => "number",
            Self::String => "string",
        }
    }
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name in the header.
    pub name: String,
    /// Type.
    pub kind: Kind,
    /// Unit; empty for numbers without a unit and for text.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: String,
}

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A whole number.
    Integer(u64),
    /// A number.
    Number(f64),
    /// Text.
    Text(String),
    /// No value.
    Missing,
}

impl Cell {
    fn text(&self) -> String {
        match self {
            Self::Integer(value) => value.to_string(),
            Self::Number(value) => value.to_string(),
            Self::Text(text) => text.clone(),
            Self::Missing => String::new(),
        }
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<u64> for Cell {
    fn from(value: u64) -> Self {
        Self::Integer(value)
    }
}

impl From<u32> for Cell {
    fn from(value: u32) -> Self {
        Self::Integer(value.into())
    }
}

impl From<&str> for Cell {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

/// A run to be exported.
#[derive(Clone, Debug)]
pub struct ExportedRun {
    /// The experiment; empty for a single run.
    pub experiment: String,
    /// Label of the settings in a suite; empty for a single run.
    pub setting: String,
    /// Run ID in a suite, otherwise the run's directory name.
    pub id: String,
    /// The run.
    pub finished: FinishedRun,
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
/// [`ExportError`] if the directory exists or a file cannot be written.
pub fn write(
    to: &Path,
    tables: &[Table],
    runs: impl Iterator<Item = ExportedRun>,
) -> Result<(), ExportError> {
    let new = NewDir::beside(to)?;
    let weights = tables::WEIGHTS_MAX;
    let mut writers = Vec::new();
    for &table in tables {
        let path = new.path().join(table.file_name());
        let file = File::create(&path).map_err(FileError::at(&path))?;
        let mut csv = csv::Writer::from_writer(BufWriter::new(file));
        let names = table.columns(weights);
        let names = names.iter().map(|column| &column.name);
        csv.write_record(names).map_err(table.failed())?;
        writers.push((table, csv));
    }
    // Experiments may share runs; only the table of runs has a row for each.
    let mut seen = BTreeSet::new();
    for run in runs {
        let is_new = seen.insert(run.id.clone());
        for (table, csv) in &mut writers {
            if !is_new && *table != Table::Runs {
                continue;
            }
            for row in table.rows(&run, weights)? {
                let row = row.iter().map(Cell::text);
                csv.write_record(row).map_err(table.failed())?;
            }
        }
    }
    for (table, csv) in writers {
        let path = new.path().join(table.file_name());
        let file = csv.into_inner();
        let file = file.map_err(|error| FileError::at(&path)(error.into_error()))?;
        let mut file = file
            .into_inner()
            .map_err(|error| FileError::at(&path)(error.into_error()))?;
        file.flush().map_err(FileError::at(&path))?;
    }
    let package = format!("{:#}\n", package(tables, weights));
    files::create(&new.path().join(PACKAGE), package.as_bytes())?;
    new.publish()?;
    Ok(())
}

impl Table {
    /// All tables, in the order of the document.
    pub const ALL: [Self; 5] = [
        Self::Runs,
        Self::Generations,
        Self::Steps,
        Self::Robots,
        Self::Genomes,
    ];

    /// Returns the table's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Generations => "generations",
            Self::Steps => "steps",
            Self::Robots => "robots",
            Self::Genomes => "genomes",
        }
    }

    fn file_name(self) -> String {
        format!("{}.csv", self.name())
    }

    /// Describes the rows.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Runs => "One row per run: settings, outcomes and baselines.",
            Self::Generations => "One row per generation of a run.",
            Self::Steps => {
                "One row per step of the final run, in which the best genome runs again from the \
                 start that determined its fitness."
            }
            Self::Robots => "One row per robot and step of the final run.",
            Self::Genomes => {
                "One row per run: the weights of the best genome, in the order of the genome \
                 container. Genomes of smaller networks leave the last columns empty."
            }
        }
    }

    fn failed(self) -> impl FnOnce(csv::Error) -> ExportError {
        let table = self.file_name();
        move |source| ExportError::Csv { table, source }
    }
}

/// Describes tables as a Frictionless data package.
fn package(tables: &[Table], weights: usize) -> Value {
    let resources = tables.iter().map(|table| {
        let fields = table.columns(weights).into_iter().map(|column| {
            let mut field = json!({
                "name": column.name,
                "type": column.kind.name(),
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
                column.kind.name(),
                column.meaning
            );
        }
        text.push('\n');
    }
    text.trim_end().to_owned() + "\n"
}
