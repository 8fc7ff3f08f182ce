//! `evolver gallery`: an overview of all runs, linked to their replays.

use super::errors::{name_damaged, unusable};
use super::{thread_pool, threads_flag};
use crate::exit::Exit;
use clap::Args;
use minimal_surprise_evolution::files::Existing;
use minimal_surprise_evolution::text::terminal_path;
use minimal_surprise_replay::gallery::write;
use std::path::PathBuf;

/// Arguments of `evolver gallery`.
#[derive(Debug, Args)]
pub struct GalleryArgs {
    /// Run directories, or directories that contain run directories.
    #[arg(required = true, value_name = "DIR")]
    directories: Vec<PathBuf>,
    /// The folder for index.html and one page per run.
    #[arg(long, value_name = "FOLDER", default_value = "gallery")]
    out: PathBuf,
    /// Replace the pages in an existing folder.
    #[arg(long)]
    overwrite: bool,
    /// Threads [default: one per core]; the pages do not depend on them.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    threads: Option<String>,
}

/// Writes a gallery.
///
/// # Errors
/// [`BadInput`](super::BadInput) if no runs are found or the folder cannot be used.
pub fn gallery(arguments: &GalleryArgs) -> anyhow::Result<Exit> {
    let threads = threads_flag(&arguments.threads)?;
    let existing = Existing::with_overwrite(arguments.overwrite);
    let written = thread_pool(threads)?
        .install(|| write(&arguments.directories, &arguments.out, existing))
        .map_err(unusable)?;
    let left_out = match written.unfinished {
        0 => String::new(),
        n => format!("; left out: {n} unfinished"),
    };
    if written.by_another {
        tell!("another process has written the same gallery in the meantime");
    }
    show_line!(
        "{} ({} runs, {:.1} MB{left_out})",
        terminal_path(&written.index),
        written.runs,
        written.bytes as f64 / 1e6
    );
    Ok(name_damaged(&written.damaged, None))
}
