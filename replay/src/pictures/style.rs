//! What all pictures share: their style, what can be wrong with them, and their words for a run.

use super::drawing::Size;
use crate::palette::Theme;
use crate::recording::Recording;
use crate::scene::Colouring;
use std::io;

/// How a swarm is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// How large it is.
    pub size: Size,
    /// Its colours, for a light or dark background.
    pub theme: &'static Theme,
    /// What the colours of robots show.
    pub colouring: Colouring,
    /// The selected robot.
    pub robot: Option<usize>,
}

/// A picture could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The recording has no such state.
    #[error("there is no state {asked}; states are 0 to {last}")]
    NoState {
        /// The state asked for.
        asked: u32,
        /// The last state.
        last: usize,
    },
    /// The recording has no such robot.
    #[error("there is no robot {asked}; robots are 0 to {last}")]
    NoRobot {
        /// The robot asked for.
        asked: usize,
        /// The last robot.
        last: usize,
    },
    /// The recording is a trajectory, which has poses only.
    #[error(
        "a trajectory has poses only; give a run or a genome to show what robots sense and predict"
    )]
    NoController,
    /// The recording is not of a run directory, so no evolution is known.
    #[error("only a run directory records how fitness evolved")]
    NoEvolution,
    /// Nothing was damaged.
    #[error("nothing was damaged; damage an area with --remove or --reposition")]
    NoDamage,
    /// Text would be cut off or overlap.
    #[error("the text of this picture needs {needed} mm")]
    TooNarrow {
        /// Least width, in millimetres.
        needed: u32,
    },
    /// More pixels than a picture can have.
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

/// The last state whose colours show something: in the final state nothing is sensed.
pub(super) fn last_shown(recording: &Recording, colouring: Colouring) -> usize {
    match colouring {
        Colouring::Surprise => recording.steps().saturating_sub(1),
        Colouring::Structure | Colouring::Plain => recording.steps(),
    }
}

/// The run's dominant structures.
pub(super) fn named(recording: &Recording) -> String {
    let names: Vec<&str> = recording.names.iter().map(|name| name.name()).collect();
    if names.is_empty() {
        "no structure".to_owned()
    } else {
        names.join(", ")
    }
}
