//! `evolver import`: converts genomes from the text files of the authors' program to genome
//! containers.

use super::errors::unusable;
use super::{BadInput, flag};
use clap::Args;
use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX};
use minimal_surprise_controller::{Prediction, Provenance, SensorModel, Template, Topology};
use minimal_surprise_evolution::files::{self, DATA_BYTES_MAX, FileError};
use minimal_surprise_evolution::new_dir::{NewDir, remove_abandoned};
use minimal_surprise_evolution::settings::{Overrides, describe};
use minimal_surprise_evolution::text::terminal_path;
use minimal_surprise_sim::exchange::{
    ExchangeError, GenomeRows, ImportedGenome, generations, import_genome,
};
use std::path::{Path, PathBuf};

/// Arguments of `evolver import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// The `action_genomes` file.
    #[arg(long, value_name = "FILE")]
    action: PathBuf,
    /// The `prediction_genomes` file; not needed if all predictions are predefined.
    #[arg(long, value_name = "FILE")]
    prediction: Option<PathBuf>,
    /// Import only this generation.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    generation: Option<String>,
    /// Sensor model: a, b or c [default: from the length of the rows].
    #[arg(long, value_name = "MODEL")]
    sensor_model: Option<String>,
    /// The template that all predictions were fixed to.
    #[arg(long, value_name = "TEMPLATE")]
    predefine: Option<String>,
    /// The template that some predictions were fixed to [default: from the length of the rows].
    #[arg(long, value_name = "TEMPLATE")]
    predefine_partly: Option<String>,
    /// The directory for the genomes; must not exist.
    #[arg(long, value_name = "DIR", default_value = "imported")]
    out: PathBuf,
}

/// Imports genomes.
///
/// # Errors
/// [`BadInput`] if a file or a flag is invalid; the message names the file and the line.
pub fn import(arguments: &ImportArgs) -> anyhow::Result<()> {
    let only = match &arguments.generation {
        None => None,
        Some(text) => Some(flag("generation", text, |text| {
            let number: Result<u32, _> = text.parse();
            number.map_err(|_| "expected a whole number, 0 or more".to_owned())
        })?),
    };
    let action = read(&arguments.action, only)?;
    let prediction = match &arguments.prediction {
        None => None,
        Some(path) => Some((path, read(path, only)?)),
    };
    let topology = topology(arguments, &action)?;
    if let Some((path, prediction)) = &prediction
        && prediction.len() != action.len()
    {
        return Err(BadInput::new(format!(
            "{} contains {} generations, {} contains {}",
            arguments.action.display(),
            action.len(),
            path.display(),
            prediction.len()
        ))
        .into());
    }
    let imported = action
        .iter()
        .enumerate()
        .map(|(place, (generation, action))| {
            let prediction = prediction.as_ref().map(|(_, rows)| &rows[place].1);
            import_genome(topology, action, prediction).map(|genome| (*generation, genome))
        })
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| {
            let files = [Some(&arguments.action), arguments.prediction.as_ref()];
            let files: Vec<String> = files
                .into_iter()
                .flatten()
                .map(|file| file.display().to_string())
                .collect();
            BadInput::new(format!("{}: {error}", files.join(", ")))
        })?;
    write(&arguments.out, &imported)?;
    show!("{}", report(topology, &arguments.out, &imported));
    Ok(())
}

/// Reads the numbered generations in a file; if only one is requested, the others may be invalid.
fn read(path: &Path, only: Option<u32>) -> anyhow::Result<Vec<(u32, GenomeRows)>> {
    let text = files::read_text(path, DATA_BYTES_MAX).map_err(unusable)?;
    let about = |error: ExchangeError| BadInput::new(format!("{}, {error}", path.display()));
    let (mut found, mut count) = (Vec::new(), 0);
    for (generation, rows) in (0..).zip(generations(&text)) {
        let rows = rows.map_err(about)?;
        count += 1;
        if only.is_none_or(|only| only == generation) {
            found.push((generation, rows.numbers().map_err(about)?));
        }
        if only == Some(generation) {
            break;
        }
    }
    match only {
        Some(only) if found.is_empty() => Err(BadInput::new(format!(
            "--generation = {only}: {} contains generations 0 to {}",
            path.display(),
            count - 1
        ))
        .into()),
        _ => Ok(found),
    }
}

/// Determines the topology from the flags. If they do not specify it, determines it from the row
/// length, including padding.
fn topology(arguments: &ImportArgs, action: &[(u32, GenomeRows)]) -> Result<Topology, BadInput> {
    let length = action.first().map_or(0, |(_, rows)| rows.rows[0].len());
    let mut given = Overrides::default();
    given.flag("sensor-model", arguments.sensor_model.as_deref());
    given.flag("predefine", arguments.predefine.as_deref());
    given.flag("predefine-partly", arguments.predefine_partly.as_deref());
    let model = match length {
        80 => "a",
        48 => "b",
        _ => "c",
    };
    if given.place("sensor-model").is_none() {
        given.flag("sensor-model", Some(model));
    }
    let free = given.place("predefine").is_none() && given.place("predefine-partly").is_none();
    let topology = given.topology().map_err(BadInput::new)?;
    if free && arguments.prediction.is_none() {
        return Err(BadInput::new(
            "--prediction is missing; to import without it, name the template with --predefine",
        ));
    }
    if free && topology.model() == SensorModel::C && length == 192 {
        let partly = Prediction::PartlyPredefined(Template::Line);
        return Topology::new(SensorModel::C, partly).map_err(BadInput::new);
    }
    Ok(topology)
}

fn write(out: &Path, imported: &[(u32, ImportedGenome)]) -> anyhow::Result<()> {
    let refused = |error: FileError| match error.is_bad_path() {
        true => BadInput::new(format!("--out = {error}")).into(),
        false => anyhow::Error::from(error),
    };
    remove_abandoned(files::parent(out));
    let new = NewDir::beside(out).map_err(refused)?;
    for (generation, imported) in imported {
        let provenance = Provenance {
            generation: *generation,
            ..Provenance::default()
        };
        let mut buffer = [0; CONTAINER_BYTES_MAX];
        let bytes = codec::encode(&imported.genome, provenance, &mut buffer)?;
        let file = new.path().join(name(*generation));
        files::create(&file, bytes).map_err(|error| new.in_place(error))?;
    }
    new.publish().map_err(refused)
}

fn name(generation: u32) -> String {
    format!("generation-{generation}.genome")
}

fn report(topology: Topology, directory: &Path, imported: &[(u32, ImportedGenome)]) -> String {
    let mut text = format!("{}, {} weights\n", describe(topology), topology.weights());
    for (generation, imported) in imported {
        let path = directory.join(name(*generation));
        text += &format!(
            "{}: largest rounding error {:.2e}, {} weights out of range\n",
            terminal_path(&path),
            imported.rounding_error_max,
            imported.saturated.len()
        );
        for weight in &imported.saturated {
            text += &format!(
                "  {} genomes, line {}, number {}: {} became {:.4}\n",
                weight.network,
                weight.line,
                weight.column,
                weight.value,
                f64::from(weight.weight_q3_12) / 4096.0
            );
        }
    }
    text
}
