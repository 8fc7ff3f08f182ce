//! Common parts of all pictures: style, errors, and the names of a run's structures.

use super::drawing::Size;
use crate::palette::Theme;
use crate::recording::Recording;
use crate::scene::Colouring;
use std::io;

/// Style of a swarm's picture.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Size of the picture.
    pub size: Size,
    /// Colours for a light or dark background.
    pub theme: &'static Theme,
    /// Meaning of the robots' colours.
    pub colouring: Colouring,
    /// The selected robot.
    pub robot: Option<usize>,
}

/// Error: a picture could not be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The recording has no such state.
    #[error("there is no state {asked}; states are 0 to {last}")]
    NoState {
        /// The requested state.
        asked: u32,
        /// The last state.
        last: usize,
    },
    /// The recording has no such robot.
    #[error("there is no robot {asked}; robots are 0 to {last}")]
    NoRobot {
        /// The requested robot.
        asked: usize,
        /// The last robot.
        last: usize,
    },
    /// The recording is a trajectory, which has poses only.
    #[error(
        "a trajectory has poses only; give a run or a genome to show what robots sense and predict"
    )]
    NoController,
    /// The recording does not come from a run directory, so its evolution is unknown.
    #[error("only a run directory records how fitness evolved")]
    NoEvolution,
    /// The swarm was not damaged.
    #[error("nothing was damaged; damage an area with --remove or --reposition")]
    NoDamage,
    /// Text would be truncated or overlap.
    #[error("the text of this picture needs {needed} mm")]
    TooNarrow {
        /// Minimum width, in millimetres.
        needed: u32,
    },
    /// The picture would have too many pixels.
    #[error("{width} x {height} pixels are too many; a picture has 64 million at most")]
    TooLarge {
        /// Pixels per row.
        width: f64,
        /// Number of rows.
        height: f64,
    },
    /// A picture could not be encoded.
    #[error("the picture cannot be encoded: {0}")]
    Encoding(String),
    /// ffmpeg is not installed.
    #[error(
        "MP4 needs the program ffmpeg: install it (on Debian: apt-get install ffmpeg), or write a GIF \
         with --gif"
    )]
    NoFfmpeg,
    /// ffmpeg could not be run, or stopped early.
    #[error("ffmpeg: {0}")]
    Ffmpeg(io::Error),
    /// ffmpeg failed.
    #[error("ffmpeg failed: {0}")]
    FfmpegFailed(String),
}

/// Returns the last state whose colours have a meaning: in the final state, robots sense nothing.
pub(super) fn last_shown(recording: &Recording, colouring: Colouring) -> usize {
    match colouring {
        Colouring::Surprise => recording.steps().saturating_sub(1),
        Colouring::Structure | Colouring::Plain => recording.steps(),
    }
}

/// Returns the names of the run's dominant structures.
pub(super) fn named(recording: &Recording) -> String {
    let names: Vec<&str> = recording.names.iter().map(|name| name.name()).collect();
    if names.is_empty() {
        "no structure".to_owned()
    } else {
        names.join(", ")
    }
}
