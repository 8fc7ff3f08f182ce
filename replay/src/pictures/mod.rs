//! Pictures of a run: stills as SVG and PNG, animations as GIF and MP4.
//!
//! [`still`] turns a scene or a curve into a [`Drawing`], and [`sheet()`] turns several into one;
//! [`raster`] turns the SVG of a drawing into pixels; [`film`] combines many pictures into an
//! animation.

mod curves;
mod drawing;
pub mod film;
mod legend;
mod predictions;
pub mod raster;
mod sheet;
mod state;
mod style;
mod symbols;
mod words;

pub use curves::Chart;
pub use drawing::{Drawing, Size};
pub use sheet::{Content, Panel, sheet};
pub use style::{PictureError, Style};

use super::recording::Recording;
use style::last_shown;

/// Content of a still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Picture {
    /// The swarm, as in the paper's Figs. 7 and 8.
    State,
    /// The swarm before the damage and after it, as in the paper's Figs. 13 and 14.
    Damage,
    /// Average predictions of the robots over the run, as in the paper's Fig. 9.
    Predictions,
    /// Share of robots that move, over the steps, as in the paper's Fig. 5.
    Temperature,
    /// Best fitness over the generations of the evolution, as in the paper's Fig. 6.
    Fitness,
}

/// Draws a still. `at` selects the state of a swarm; the default is the last state that the
/// colouring can show.
///
/// # Errors
/// [`PictureError`] if the recording lacks the requested data, the text does not fit, or a chart
/// cannot be laid out.
pub fn still(
    recording: &Recording,
    what: Picture,
    at: Option<u32>,
    style: &Style,
) -> Result<Drawing, PictureError> {
    let state = || {
        let last = recording.steps();
        let last_shown = last_shown(recording, style.colouring);
        at.map_or(Ok(last_shown), |at| match at as usize {
            at if at <= last => Ok(at),
            _ => Err(PictureError::NoState { asked: at, last }),
        })
    };
    match what {
        Picture::State => state::state(recording, state()?, style),
        Picture::Damage => state::damage(recording, state()?, style),
        Picture::Predictions => predictions::predictions(recording, style.size, style.theme),
        Picture::Temperature => curves::temperature(recording, style.size, style.theme),
        Picture::Fitness => curves::fitness(recording, style.size, style.theme),
    }
}
