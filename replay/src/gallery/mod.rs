//! A gallery: one page with the final state of every run, each linked to its replay.
//!
//! A gallery is a folder of pages, `index.html` and one per run, so that it opens quickly whatever
//! the number of runs.

use super::page::html::Document;
use super::page::{self, PageError, encoding, prediction_name};
use super::palette;
use super::recording::Recording;
use super::scene::{Colouring, Ink, Scene};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::{self, Existing, FileError};
use minimal_surprise_evolution::finished_run::{
    FinishedRun, Progress, ReadRunError, settings_of_run,
};
use minimal_surprise_evolution::limits::{Needs, TooMuch};
use minimal_surprise_evolution::new_dir::{NewDir, remove_abandoned};
use minimal_surprise_evolution::run_files::{CONFIG, DONE};
use minimal_surprise_evolution::settings::model_name;
use minimal_surprise_evolution::text::{new_file_name, terminal_path};
use minimal_surprise_sim::Structure;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The first page of a gallery.
pub const INDEX: &str = "index.html";
/// Name of the file that marks a folder as a gallery.
const MARKER: &str = ".evolver-gallery";
/// Depth of the search for runs, in folders.
const DEPTH: usize = 3;

/// Error: a gallery could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GalleryError {
    /// A run cannot be read.
    #[error(transparent)]
    Run(#[from] ReadRunError),
    /// A run does not fit on a page.
    #[error("{}: {error}", path.display())]
    Page {
        /// The run directory.
        path: PathBuf,
        /// The cause.
        error: PageError,
    },
    /// A run could not be repeated.
    #[error("{}: {error}", path.display())]
    World {
        /// The run directory.
        path: PathBuf,
        /// The cause.
        error: minimal_surprise_sim::WorldError,
    },
    /// The directories contain no complete run.
    #[error("no complete run in {}", list(.0))]
    Empty(Vec<PathBuf>),
    /// Every run is damaged.
    #[error("{}", causes(.0))]
    Damaged(DamagedRuns),
    /// The folder already exists.
    #[error("{} exists; name another folder, or replace its pages with --overwrite", .0.display())]
    Exists(PathBuf),
    /// The machine has too little memory.
    #[error(transparent)]
    TooMuch(#[from] TooMuch),
    /// A file or folder could not be used.
    #[error(transparent)]
    File(#[from] FileError),
}

/// A gallery that has been written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The first page.
    pub index: PathBuf,
    /// Number of runs.
    pub runs: usize,
    /// Number of run directories left out because their runs are incomplete.
    pub unfinished: usize,
    /// Runs left out because they are damaged, and folders that could not be read.
    pub damaged: DamagedRuns,
    /// Size of all pages, in bytes.
    pub bytes: u64,
    /// True if another process wrote the gallery in the meantime.
    pub by_another: bool,
}

/// Writes the gallery of all runs in the given directories, which are run directories or contain
/// run directories. A new gallery is published as a whole or not at all. If another process
/// publishes one in the meantime, that one is kept: the same runs give the same pages. In an
/// existing folder, pages are replaced one by one and other files are kept.
///
/// # Errors
/// [`GalleryError`] if the folder exists and must not be replaced, there is no complete and
/// undamaged run, memory is insufficient, or a folder or page cannot be used. A new folder is then
/// not published.
pub fn write(
    directories: &[PathBuf],
    out: &Path,
    existing: Existing,
) -> Result<Written, GalleryError> {
    let exists = || out.symlink_metadata().is_ok();
    if exists() && existing == Existing::Refuse {
        return Err(GalleryError::Exists(out.to_owned()));
    }
    let found = Found::in_all(directories)?;
    if found.runs.is_empty() {
        return Err(if found.damaged.is_empty() {
            GalleryError::Empty(directories.to_vec())
        } else {
            GalleryError::Damaged(found.damaged)
        });
    }
    found.check_memory()?;
    let into_existing = || {
        files::remove_old_parts(out);
        found.write(out, out)
    };
    if exists() && existing == Existing::Replace {
        return into_existing();
    }
    remove_abandoned(files::parent(out));
    let new = NewDir::unchecked_beside(out)?;
    let written = found.write(new.path(), out).map_err(|error| match error {
        GalleryError::File(error) => new.in_place(error).into(),
        error => error,
    })?;
    match new.publish() {
        // Another process has created something with this name in the meantime.
        Err(error) if error.is_exists() => match existing {
            Existing::Replace => into_existing(),
            Existing::Refuse if is_marked(out)? => Ok(Written {
                by_another: true,
                ..written
            }),
            Existing::Refuse => Err(GalleryError::Exists(out.to_owned())),
        },
        published => Ok(published.map(|()| written)?),
    }
}

/// The run directories found.
#[derive(Debug, Default)]
struct Found {
    /// The run directories, each with the name of its page.
    runs: Vec<(PathBuf, String)>,
    unfinished: usize,
    seen: BTreeSet<PathBuf>,
    names: BTreeSet<String>,
    damaged: DamagedRuns,
}

impl Found {
    fn in_all(directories: &[PathBuf]) -> Result<Self, GalleryError> {
        let mut found = Self::default();
        found
            .names
            .insert(INDEX.trim_end_matches(".html").to_owned());
        for directory in directories {
            if progress(directory)? != Progress::Pending {
                found.add(directory)?;
            } else {
                found.look_in(directory, DEPTH)?;
            }
        }
        Ok(found)
    }

    fn look_in(&mut self, directory: &Path, depth: usize) -> Result<(), FileError> {
        let at = || FileError::at(directory);
        let mut inside = Vec::new();
        for entry in fs::read_dir(directory).map_err(at())? {
            let entry = entry.map_err(at())?;
            // Temporary files can be renamed at any moment, so they are skipped.
            if !files::is_part(&entry.file_name()) {
                inside.push(entry.path());
            }
        }
        inside.sort();
        for path in inside.iter().filter(|path| path.is_dir()) {
            let looked = match progress(path) {
                Ok(Progress::Done) => self.add(path),
                Ok(Progress::Begun) => {
                    self.unfinished += 1;
                    Ok(())
                }
                Ok(Progress::Pending) if depth > 1 => self.look_in(path, depth - 1),
                Ok(Progress::Pending) => Ok(()),
                Err(error) => Err(error),
            };
            if let Err(error) = looked {
                self.damaged.add(path, error);
            }
        }
        Ok(())
    }

    fn add(&mut self, run: &Path) -> Result<(), FileError> {
        let whole = run.canonicalize().map_err(FileError::at(run))?;
        if self.seen.insert(whole.clone()) {
            let name = terminal_path(Path::new(whole.file_name().unwrap_or_default()));
            let name = format!("{}.html", new_file_name(&name, &mut self.names));
            self.runs.push((run.to_owned(), name));
        }
        Ok(())
    }

    /// Checks that there is enough memory for the largest recordings, one per thread. Read errors
    /// are reported later.
    fn check_memory(&self) -> Result<(), TooMuch> {
        let at_once = self.runs.len().min(rayon::current_num_threads()) as f64;
        let settings = self
            .runs
            .iter()
            .filter_map(|(run, _)| settings_of_run(run).ok());
        let recordings = settings.map(|settings| Needs::of_recording(settings.scenario()));
        let largest = recordings.max_by(|one, other| one.memory().total_cmp(&other.memory()));
        largest.map_or(Ok(()), |needs| needs.times(at_once).check_memory())
    }

    /// Writes all pages, the first page last; `out` is the folder's final path.
    fn write(&self, folder: &Path, out: &Path) -> Result<Written, GalleryError> {
        let cards = self.runs.par_iter().map(|(run, name)| {
            let recording = read(run)?;
            let text =
                page::page(&recording, Colouring::Structure, Some(INDEX)).map_err(|error| {
                    GalleryError::Page {
                        path: run.clone(),
                        error,
                    }
                })?;
            files::replace(&folder.join(name), text.as_bytes())?;
            Ok(Card::of(&recording, name, text.len()))
        });
        let made: Vec<Result<Card, GalleryError>> = cards.collect();
        let (mut cards, mut damaged) = (Vec::new(), self.damaged.clone());
        for (card, (run, _)) in made.into_iter().zip(&self.runs) {
            match card {
                Ok(card) => cards.push(card),
                Err(error @ GalleryError::File(_)) => return Err(error),
                Err(error) => damaged.add(run, error),
            }
        }
        if cards.is_empty() {
            return Err(GalleryError::Damaged(damaged));
        }
        files::replace(&folder.join(MARKER), b"A gallery of evolver.\n")?;
        let index = index(&cards);
        files::replace(&folder.join(INDEX), index.as_bytes())?;
        let pages: usize = cards.iter().map(|card| card.bytes).sum();
        Ok(Written {
            index: out.join(INDEX),
            runs: cards.len(),
            unfinished: self.unfinished,
            damaged,
            bytes: (pages + index.len()) as u64,
            by_another: false,
        })
    }
}

/// Checks whether a folder is marked as a gallery.
///
/// # Errors
/// [`FileError`] if the folder cannot be read.
pub fn is_marked(folder: &Path) -> Result<bool, FileError> {
    match files::exists(&folder.join(MARKER)) {
        // The path is a file.
        Err(error) if error.error.kind() == ErrorKind::NotADirectory => Ok(false),
        marked => marked,
    }
}

/// Returns the progress of the run in a directory, based on the files present; `Pending` if there
/// are none.
fn progress(path: &Path) -> Result<Progress, FileError> {
    Ok(if files::exists(&path.join(DONE))? {
        Progress::Done
    } else if files::exists(&path.join(CONFIG))? {
        Progress::Begun
    } else {
        Progress::Pending
    })
}

fn causes(damaged: &DamagedRuns) -> String {
    let causes: Vec<&str> = damaged.iter().map(|(_, cause)| cause).collect();
    causes.join("\n")
}

fn read(run: &Path) -> Result<Recording, GalleryError> {
    let finished = FinishedRun::read_and_check(run)?;
    let name = terminal_path(run);
    Recording::of_run(&name, &finished, &|| ()).map_err(|error| GalleryError::World {
        path: run.to_owned(),
        error,
    })
}

/// A run in the gallery.
struct Card {
    about: Value,
    robots: Vec<u8>,
    bytes: usize,
}

impl Card {
    fn of(recording: &Recording, page: &str, bytes: usize) -> Self {
        let last = recording.steps();
        let scene = Scene::of(recording, last, Colouring::Structure, None);
        let controller = recording.controller.as_ref();
        let share = recording.in_structure(last) as f64 / recording.robots().max(1) as f64;
        let about = json!({
            "page": page,
            "source": page::source(&recording.origin.name),
            "names": recording.names.iter().map(|name| name.name()).collect::<Vec<_>>(),
            "share": share,
            "fitness": controller.and_then(|data| data.fitness.last()),
            "seed": recording.origin.seed.map(|seed| seed.to_string()),
            "grid": recording.grid.to_string(),
            "width": scene.width,
            "height": scene.height,
            "model": controller.map(|data| model_name(data.topology.model()).to_uppercase()),
            "prediction": controller.map(|data| prediction_name(data.topology)),
            "noise": recording.origin.noise,
            "robots": recording.robots(),
        });
        let xs = scene.robots.iter().flat_map(|robot| robot.x.to_le_bytes());
        let ys = scene.robots.iter().flat_map(|robot| robot.y.to_le_bytes());
        let rest = scene.robots.iter().map(|robot| {
            let ink = match robot.ink {
                Ink::Named => 1,
                Ink::Other => 2,
                Ink::Outside => 3,
                Ink::Plain | Ink::Surprise(_) => 0,
            };
            robot.heading | ink << 2
        });
        Self {
            about,
            robots: xs.chain(ys).chain(rest).collect(),
            bytes,
        }
    }
}

fn index(cards: &[Card]) -> String {
    let about = json!({
        "arrow": palette::ARROW,
        "hollow": page::hollow(),
        "structures": Structure::ALL.map(Structure::name),
        "inks": ["plain", "named", "other", "outside"],
        "runs": cards.iter().map(|card| &card.about).collect::<Vec<_>>(),
    });
    let robots: Vec<Vec<u8>> = cards.iter().map(|card| card.robots.clone()).collect();
    Document {
        title: "Gallery",
        style: include_str!("gallery.css"),
        body: include_str!("gallery.html"),
        script: include_str!("gallery.js"),
        about: &about,
        data: &encoding::packed(&robots),
    }
    .to_html()
}

fn list(paths: &[PathBuf]) -> String {
    let paths: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
    paths.join(", ")
}
