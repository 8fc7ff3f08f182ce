//! `evolver export`: writes runs and genomes in the formats of other programs.

use super::errors::unusable;
use super::new_file::write_file;
use super::{BadInput, flag, genome_file, read_genome};
use crate::data::{self, ExportedRun, Table};
use crate::report::embedding::{self, c_header, intel_hex, probe_rs_line, rust_source, slot};
use clap::{Args, ValueEnum};
use minimal_surprise_evolution::files::Existing;
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::limits::Needs;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_evolution::text::{checked_identifier, terminal_path};
use minimal_surprise_sim::exchange::Trajectory;
use minimal_surprise_slots::MADE_WRITE_COUNT_MAX;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// Arguments of `evolver export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The genome file or a run directory; for trajectory and csv, a run directory.
    #[arg(value_name = "GENOME|RUN")]
    from: PathBuf,
    /// The format.
    #[arg(long, value_enum)]
    format: Format,
    /// For csv: the directory to write; must not exist.
    #[arg(long, value_name = "DIR")]
    to: Option<PathBuf>,
    /// For csv: tables, as in runs,robots [default: runs,generations,steps].
    #[arg(long, value_enum, value_delimiter = ',')]
    what: Vec<Table>,
    /// The file to write; must not exist [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// For bin, slot and hex: the address in the chip's memory. The default is slot 1 of an
    /// STM32F405 or STM32F407 with 1 MiB; slot 0 is at 0x080c0000.
    #[arg(
        long,
        value_name = "N",
        default_value = "0x080e0000",
        allow_hyphen_values = true
    )]
    address: String,
    /// For slot: write count of this genome, at least 1. The robot runs the genome with the larger
    /// write count; `flash` prints it.
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        allow_hyphen_values = true
    )]
    write_count: String,
    /// For c and rust: the name of the array [default: from the run or file name and the genome's
    /// CRC, so that one program can contain several genomes].
    #[arg(long, value_name = "IDENTIFIER", allow_hyphen_values = true)]
    name: Option<String>,
    /// For bin and slot: the chip's name in probe-rs.
    #[arg(long, value_name = "CHIP", default_value = "STM32F407VGTx")]
    chip: String,
}

/// Formats for other programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// The genome container, for firmware that reads it at a fixed address; also prints the
    /// probe-rs command that writes it.
    Bin,
    /// A genome slot that contains the genome, for firmware with slots; also prints the probe-rs
    /// command that writes it.
    Slot,
    /// The genome as a C header.
    C,
    /// The genome as Rust source.
    Rust,
    /// The genome as Intel HEX.
    Hex,
    /// `agent_trajectory` of the authors' program: the poses of every step.
    Trajectory,
    /// Tables of the run as CSV files with their description, in the directory of `--to`.
    Csv,
}

/// Exports a genome or a run.
///
/// # Errors
/// [`BadInput`] if a flag is invalid, the genome or run cannot be read, the output file already
/// exists, or memory or disk space is insufficient.
pub fn export(arguments: &ExportArgs) -> anyhow::Result<()> {
    if arguments.name.is_some() && !matches!(arguments.format, Format::C | Format::Rust) {
        return Err(BadInput::new("--name requires --format c or --format rust").into());
    }
    match (arguments.format == Format::Csv, &arguments.to) {
        (true, None) => return Err(BadInput::new("--format csv requires --to DIR").into()),
        (false, Some(_)) => return Err(BadInput::new("--to requires --format csv").into()),
        (false, None) if !arguments.what.is_empty() => {
            return Err(BadInput::new("--what requires --format csv").into());
        }
        _ => {}
    }
    if let Some(to) = &arguments.to {
        return tables(arguments, to);
    }
    let address = flag("address", &arguments.address, memory_address)?;
    // The limit leaves enough write counts for all later updates over the serial line.
    let write_count = flag("write-count", &arguments.write_count, |text| {
        count(text, MADE_WRITE_COUNT_MAX)
    })?;
    let bytes = match arguments.format {
        Format::Trajectory => trajectory(arguments)?,
        format => genome(arguments, format, address, write_count)?,
    };
    match &arguments.out {
        None if is_for_a_chip(arguments.format) && std::io::stdout().is_terminal() => {
            let missing = "--out is missing; a terminal cannot show --format = bin or slot";
            return Err(BadInput::new(missing).into());
        }
        None => crate::output::write_bytes(&bytes),
        Some(path) => write_file("out", path, &bytes, Existing::Refuse)?,
    }
    let file = match arguments.format {
        // A genome file is itself the raw container.
        Format::Bin => {
            let out = arguments.out.clone();
            Some(out.unwrap_or_else(|| genome_file(&arguments.from)))
        }
        Format::Slot => arguments.out.clone(),
        _ => None,
    };
    if let Some(file) = file {
        tell!("{}", probe_rs_line(&file, &arguments.chip, address));
    }
    Ok(())
}

fn tables(arguments: &ExportArgs, to: &Path) -> anyhow::Result<()> {
    needs_run(arguments, "tables")?;
    if arguments.out.is_some() {
        return Err(BadInput::new("--out cannot be combined with --format csv; use --to").into());
    }
    let directory = std::path::absolute(&arguments.from)?;
    let name = directory.file_name().unwrap_or_default();
    let run = ExportedRun {
        experiment: String::new(),
        setting: String::new(),
        id: name.to_string_lossy().into_owned(),
        finished: FinishedRun::read_and_check(&arguments.from).map_err(unusable)?,
    };
    let what = match arguments.what.as_slice() {
        [] => &[Table::Runs, Table::Generations, Table::Steps],
        what => what,
    };
    data::write(to, what, std::iter::once(run)).map_err(unusable)?;
    show_line!("{}", terminal_path(to));
    Ok(())
}

fn is_for_a_chip(format: Format) -> bool {
    matches!(format, Format::Bin | Format::Slot)
}

/// Rejects a genome file where a run directory is needed.
fn needs_run(arguments: &ExportArgs, what: &str) -> Result<(), BadInput> {
    match arguments.from.is_file() {
        false => Ok(()),
        true => Err(BadInput::new(format!(
            "{}: {what} can be exported only from a run directory, not from a file",
            arguments.from.display()
        ))),
    }
}

fn trajectory(arguments: &ExportArgs) -> anyhow::Result<Vec<u8>> {
    needs_run(arguments, "a trajectory")?;
    let finished = FinishedRun::read_and_check(&arguments.from).map_err(unusable)?;
    let needs = Needs::of_trajectory(finished.settings.scenario());
    needs.check_memory().map_err(BadInput::new)?;
    if let Some(out) = &arguments.out {
        needs.check_disk(out).map_err(BadInput::new)?;
    }
    let trace = finished.trace()?;
    let grid = finished.settings.scenario().grid();
    let mut text = Vec::new();
    Trajectory::of_trace(finished.provenance.generation, grid, &trace).write(&mut text)?;
    Ok(text)
}

fn genome(
    arguments: &ExportArgs,
    format: Format,
    address: u32,
    write_count: u32,
) -> anyhow::Result<Vec<u8>> {
    let genome = read_genome(&arguments.from)?;
    let container = genome.bytes();
    Ok(match format {
        Format::C => c_header(&genome, &symbol(arguments, container)?).into_bytes(),
        Format::Rust => {
            let mut symbol = symbol(arguments, container)?;
            if arguments.name.is_none() {
                symbol.make_ascii_uppercase();
            }
            rust_source(&genome, &symbol).into_bytes()
        }
        Format::Hex => {
            let text = intel_hex(container, address).ok_or_else(|| {
                BadInput::new(format!(
                    "--address = {}: the genome's {} bytes would extend beyond 0xffffffff",
                    arguments.address,
                    container.len()
                ))
            })?;
            text.into_bytes()
        }
        Format::Slot => slot(container, write_count),
        Format::Bin | Format::Trajectory | Format::Csv => container.to_vec(),
    })
}

/// Returns the genome's name in source code.
fn symbol(arguments: &ExportArgs, container: &[u8]) -> Result<String, BadInput> {
    if let Some(name) = &arguments.name {
        return flag("name", name, |name| {
            let checked = checked_identifier(name);
            checked.map(str::to_owned).map_err(str::to_owned)
        });
    }
    // The genome of a run is named after the run.
    let file = genome_file(&arguments.from);
    let file = file.canonicalize().unwrap_or(file);
    let stem = file.file_stem().filter(|stem| *stem != "best");
    let name = stem.or_else(|| file.parent()?.file_name());
    let name = terminal_path(Path::new(name.unwrap_or_default()));
    Ok(embedding::symbol(&name, container))
}

/// Parses a decimal or hexadecimal address.
fn memory_address(text: &str) -> Result<u32, String> {
    let parsed = match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    };
    parsed.map_err(|_| "expected an address from 0 to 0xffffffff, such as 0x080e0000".to_owned())
}
