//! A replay as one self-contained page: it opens from a local file, without network access, is
//! controlled by mouse and keyboard, and verifies the states that it shows.
//!
//! The page receives its parameters as JSON and the states packed by [`encoding`]. The page's
//! script follows the rules of [`super::scene`].

pub mod encoding;
pub mod html;

use super::recording::{ControllerData, Origin, Recording};
use super::scene::Ink;
use super::{palette, scene};
use html::Document;
use minimal_surprise_controller::{Prediction, Topology};
use minimal_surprise_evolution::settings::model_name;
use minimal_surprise_evolution::steps_hash::Version;
use minimal_surprise_sim::damage::Damage;
use minimal_surprise_sim::{Grid, Heading, Structure};
use serde_json::{Value, json};

/// Maximum number of robot-steps on a page; browsers open a page of this size without trouble.
pub const ROBOT_STEPS_MAX: u64 = 20_000_000;
/// Maximum number of cells of a page's torus.
pub const CELLS_MAX: u32 = 4_000_000;

/// Error: a recording is too large for a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// The recording has too many robot-steps.
    #[error(
        "{robots} robots and {steps} steps; a page holds up to {} million robot-steps",
        ROBOT_STEPS_MAX / 1_000_000
    )]
    TooLong {
        /// Number of robots.
        robots: usize,
        /// Number of steps.
        steps: usize,
    },
    /// The torus is too large.
    #[error("a grid of {cells} cells; a page shows up to {CELLS_MAX}")]
    TooWide {
        /// Number of cells.
        cells: u32,
    },
}

/// Checks that a recording of this size fits on a page.
///
/// # Errors
/// [`PageError`] if the recording is too large.
pub fn check_page(robots: usize, steps: usize, grid: Grid) -> Result<(), PageError> {
    if (robots as u64).saturating_mul(steps as u64) > ROBOT_STEPS_MAX {
        return Err(PageError::TooLong { robots, steps });
    }
    let cells = grid.cells();
    if cells > CELLS_MAX {
        return Err(PageError::TooWide { cells });
    }
    Ok(())
}

/// Creates the page. In a gallery, it links back to the gallery's first page.
///
/// # Errors
/// [`PageError`] if the recording is too large.
pub fn page(
    recording: &Recording,
    colouring: scene::Colouring,
    gallery: Option<&str>,
) -> Result<String, PageError> {
    check_page(recording.robots(), recording.steps(), recording.grid)?;
    let (layout, data) = encoding::encode(recording);
    let mut about = about(recording);
    about["layout"] = json!(layout);
    about["colouring"] = json!(colouring);
    about["gallery"] = json!(gallery);
    Ok(Document {
        title: &title(recording),
        style: include_str!("page.css"),
        body: include_str!("page.html"),
        script: include_str!("page.js"),
        about: &about,
        data: &data,
    }
    .to_html())
}

/// Returns the page's data except for the states.
fn about(recording: &Recording) -> Value {
    let origin = &recording.origin;
    let controller = recording.controller.as_ref();
    let scene = scene::Scene::of(recording, 0, scene::Colouring::Plain, None);
    let damage = origin.damage.as_ref().map(|damaged| {
        let done = match damaged.damage {
            Damage::Remove(_) => "remove",
            Damage::Reposition(_) => "reposition",
        };
        json!({ "done": done, "before": damaged.before })
    });
    json!({
        "title": title(recording),
        "source": source(&origin.name),
        "grid": recording.grid.to_string(),
        "width": recording.grid.width(),
        "height": recording.grid.height(),
        "structures": Structure::ALL.map(Structure::name),
        "names": recording.names.iter().map(|s| s.name()).collect::<Vec<_>>(),
        "named": recording.name().and_then(|name| Structure::ALL.iter().position(|&s| s == name)),
        "model": controller.map(|data| model_name(data.topology.model()).to_uppercase()),
        "prediction": controller.map(|data| prediction_name(data.topology)),
        "sensors": controller.map_or(0, |data| data.topology.sensors()),
        "cells": controller.map(|data| {
            let cells = data.topology.model().cells().iter();
            cells.map(|cell| [cell.ahead, cell.left]).collect::<Vec<_>>()
        }),
        "offsets": controller.map(|data| Heading::ALL.map(|heading| {
            let cells = data.topology.model().cells().iter();
            cells.map(|&cell| heading.offset(cell)).collect::<Vec<_>>()
        })),
        "ahead": Heading::ALL.map(Heading::ahead),
        "turned": Heading::ALL.map(|heading| html::TURNS.map(|turn| heading.turned(turn))),
        "seed": origin.seed.map(|seed| seed.to_string()),
        "noise": origin.noise,
        "flips": controller.and_then(|data| flips(data, origin)),
        "run_hash": origin.run_hash,
        "recorded_hash": origin.steps_hash.as_ref().map(|recorded| &recorded.hash),
        "computed_hash": recording.steps_hash.as_ref().map(ToString::to_string),
        "hash_start": std::str::from_utf8(minimal_surprise_evolution::steps_hash::START).unwrap_or_default(),
        "area": scene.area,
        "damage": damage,
        "evolution": origin.evolution,
        "arrow": palette::ARROW,
        "hollow": hollow(),
    })
}

/// Returns the parameters of the noise generator; `None` without noise.
fn flips(controller: &ControllerData, origin: &Origin) -> Option<Value> {
    let key = controller.noise.key();
    let words = key.as_chunks::<4>().0.iter();
    let words: Vec<u32> = words.map(|&word| u32::from_le_bytes(word)).collect();
    let rate = controller.noise.rate();
    let sensed = controller.topology.model().mask().bits();
    let version = origin.steps_hash.as_ref().map(|recorded| recorded.version);
    let hashed = match version.unwrap_or_default() {
        Version::V1 => u16::MAX,
        Version::V2 => sensed,
    };
    (!rate.is_none()).then(|| {
        json!({
            "key": words, "per_65536": rate.per_65_536(), "sensed": sensed, "hashed": hashed,
        })
    })
}

/// Returns, for each ink, whether it is drawn as an outline.
pub(super) fn hollow() -> Value {
    let inks = [
        ("plain", Ink::Plain),
        ("named", Ink::Named),
        ("other", Ink::Other),
        ("outside", Ink::Outside),
        ("surprise-0", Ink::Surprise(0)),
        ("surprise-1", Ink::Surprise(1)),
        ("surprise-2", Ink::Surprise(2)),
        ("surprise-3", Ink::Surprise(3)),
    ];
    inks.map(|(name, ink)| (name.to_owned(), json!(palette::is_hollow(ink))))
        .into_iter()
        .collect::<serde_json::Map<_, _>>()
        .into()
}

/// Returns the title of the run: its dominant structures.
fn title(recording: &Recording) -> String {
    let names: Vec<&str> = recording.names.iter().map(|name| name.name()).collect();
    let mut title = if names.is_empty() {
        "no structure".to_owned()
    } else {
        names.join(" and ")
    };
    if let Some(first) = title.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    title
}

/// Returns the last part of a path, so that pages do not disclose their author's folders.
pub(super) fn source(name: &str) -> String {
    let path = std::path::Path::new(name);
    let last = path.file_name().map(|last| last.to_string_lossy());
    last.map_or_else(|| name.to_owned(), |last| last.into_owned())
}

/// Describes the predictions of a topology.
#[must_use]
pub fn prediction_name(topology: Topology) -> String {
    match topology.prediction() {
        Prediction::Free => "free".to_owned(),
        Prediction::PartlyPredefined(template) => format!("{}, partly predefined", template.name()),
        Prediction::Predefined(template) => format!("{}, predefined", template.name()),
    }
}
