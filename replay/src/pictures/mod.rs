//! Pictures of a run: stills as SVG and PNG, animations as GIF and MP4.
//!
//! A [`Drawing`] is made of a scene or of a curve ([`still`]); pixels are made of its SVG
//! ([`raster`]), and animations of the pixels of many ([`film`]).

mod curves;
mod drawing;
pub mod film;
mod legend;
mod predictions;
pub mod raster;
mod state;
mod symbols;
mod words;

pub use drawing::{Drawing, Size};

use super::palette::Theme;
use super::recording::Recording;
use super::scene::Colouring;
use std::io;

/// What a still shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum What {
    /// The swarm, as in the paper's Figs. 7 and 8.
    State,
    /// The swarm before the damage and after it, as in the paper's Figs. 13 and 14.
    Damage,
    /// What robots expect around them, averaged over the run, as in the paper's Fig. 9.
    Predictions,
    /// How many robots move, over the steps, as in the paper's Fig. 5.
    Temperature,
    /// Best fitness over the generations of the evolution, as in the paper's Fig. 6.
    Fitness,
}

/// How a swarm is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// How large.
    pub size: Size,
    /// On which ground.
    pub theme: &'static Theme,
    /// What the colours of robots say.
    pub colouring: Colouring,
    /// The robot that is looked into.
    pub robot: Option<usize>,
}

/// A picture cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// It has no such state.
    #[error("there is no state {asked}; states are 0 to {last}")]
    NoState {
        /// The one asked for.
        asked: u32,
        /// The last one.
        last: usize,
    },
    /// It has no such robot.
    #[error("there is no robot {asked}; robots are 0 to {last}")]
    NoRobot {
        /// The one asked for.
        asked: usize,
        /// The last one.
        last: usize,
    },
    /// Nothing is known of what the robots think.
    #[error("a trajectory does not say what robots sense and predict; a run or a genome does")]
    NoMinds,
    /// Nothing is known of an evolution.
    #[error("only a run directory says how fitness evolved")]
    NoEvolution,
    /// Nothing was damaged.
    #[error("nothing was damaged; say what with --remove or --reposition")]
    NoDamage,
    /// Words would be cut off or cover others.
    #[error("the words of this picture need {needed} mm")]
    TooNarrow {
        /// Least width, in millimetres.
        needed: u32,
    },
    /// More pixels than a picture can have.
    #[error("{width} x {height} pixels are too many; a picture has 64 million at most")]
    TooLarge {
        /// Pixels of a row.
        width: f64,
        /// Rows.
        height: f64,
    },
    /// A picture could not be encoded.
    #[error("the picture cannot be encoded: {0}")]
    Encoding(String),
    /// There is no program that makes films.
    #[error(
        "there is no program ffmpeg, which MP4 takes: install it (on Debian: apt-get install \
         ffmpeg), or write a GIF with --gif"
    )]
    NoFfmpeg,
    /// ffmpeg could not be run, or stopped.
    #[error("ffmpeg: {0}")]
    Ffmpeg(io::Error),
    /// ffmpeg failed.
    #[error("ffmpeg failed: {0}")]
    FfmpegFailed(String),
}

/// A still, of state `at` where it shows a swarm; without, of the last one with something to show.
///
/// # Errors
/// [`PictureError`] if the recording does not have what is asked for.
pub fn still(
    recording: &Recording,
    what: What,
    at: Option<u32>,
    look: &Look,
) -> Result<Drawing, PictureError> {
    let state = || {
        let last = recording.steps();
        let last_shown = last_shown(recording, look.colouring);
        at.map_or(Ok(last_shown), |at| match at as usize {
            at if at <= last => Ok(at),
            _ => Err(PictureError::NoState { asked: at, last }),
        })
    };
    match what {
        What::State => state::state(recording, state()?, look),
        What::Damage => state::damage(recording, state()?, look),
        What::Predictions => predictions::predictions(recording, look.size, look.theme),
        What::Temperature => curves::temperature(recording, look.size, look.theme),
        What::Fitness => curves::fitness(recording, look.size, look.theme),
    }
}

/// The last state in which colours say something: in the final one nothing is sensed any more.
fn last_shown(recording: &Recording, colouring: Colouring) -> usize {
    match colouring {
        Colouring::Surprise => recording.steps().saturating_sub(1),
        Colouring::Structure | Colouring::Plain => recording.steps(),
    }
}

/// The names of the final state.
fn named(recording: &Recording) -> String {
    let names: Vec<&str> = recording.names.iter().map(|name| name.name()).collect();
    if names.is_empty() {
        "no structure".to_owned()
    } else {
        names.join(", ")
    }
}
