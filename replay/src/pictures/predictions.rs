//! The robots' predictions of their surroundings, averaged over the run, as in the paper's Fig. 9.

use super::drawing::{Anchor, Drawing, Size, Stroke, channels};
use super::style::{PictureError, named};
use super::symbols::{arrow, square};
use super::words;
use crate::palette::Theme;
use crate::recording::Recording;
use crate::scene::Ink;
use minimal_surprise_controller::SensorModel;

/// Maximum width of a cell, in text heights: a number with two decimals fits.
pub(super) const CELL_MAX: f64 = 4.5;

/// Draws the average prediction in every sensor's cell; the robot faces up.
///
/// # Errors
/// [`PictureError::NoController`] if the recording is a trajectory; [`PictureError::TooNarrow`] if
/// the title does not fit.
pub(super) fn predictions(
    recording: &Recording,
    size: Size,
    theme: &'static Theme,
) -> Result<Drawing, PictureError> {
    let controller = recording
        .controller
        .as_ref()
        .ok_or(PictureError::NoController)?;
    let words = size.words();
    let margin = size.margin();
    let surroundings = Surroundings {
        model: controller.topology.model(),
        averages: &controller.average_prediction,
    };
    let (columns, rows) = surroundings.cells();
    let title = format!("average predictions, {}", named(recording));
    let needed = words::width(&title, words) + 2.0 * margin;
    let width = match size {
        Size::Paper(width) if width < needed => {
            let needed = needed.ceil() as u32;
            return Err(PictureError::TooNarrow { needed });
        }
        Size::Paper(width) => width,
        Size::Screen(_) => (columns * CELL_MAX * words + 2.0 * margin).max(needed),
    };
    let side = ((width - 2.0 * margin) / columns).min(CELL_MAX * words);
    let header = 2.0 * words;
    let mut drawing = Drawing::new(size, theme, &title);
    drawing.set_size(width, header + rows * side + margin);
    let above = (width / 2.0, header / 2.0);
    drawing.words(&title, Anchor::Middle, above, theme.text);
    surroundings.draw(&mut drawing, ((width - columns * side) / 2.0, header), side);
    Ok(drawing)
}

/// The sensor cells around a robot, with the average prediction of each.
pub(super) struct Surroundings<'a> {
    pub(super) model: SensorModel,
    pub(super) averages: &'a [f64],
}

impl Surroundings<'_> {
    /// Returns the foremost and the leftmost position, then the rearmost and the rightmost one;
    /// the robot, at (0, 0), is one of the cells shown.
    fn bounds(&self) -> [(f64, f64); 2] {
        let bound = |choose: fn(i8, i8) -> i8| {
            let cells = self.model.cells().iter();
            let (ahead, left) = cells.fold((0, 0), |(ahead, left), cell| {
                (choose(ahead, cell.ahead), choose(left, cell.left))
            });
            (f64::from(ahead), f64::from(left))
        };
        [bound(i8::max), bound(i8::min)]
    }

    /// Returns the number of columns and rows.
    pub(super) fn cells(&self) -> (f64, f64) {
        let [(ahead, left), (behind, right)] = self.bounds();
        (left - right + 1.0, ahead - behind + 1.0)
    }

    /// Draws the cells; their north-west corner is at (`west`, `north`).
    pub(super) fn draw(&self, drawing: &mut Drawing, (west, north): (f64, f64), side: f64) {
        let theme = drawing.theme;
        let [(most_ahead, most_left), _] = self.bounds();
        let corner = |ahead: f64, left: f64| {
            (
                west + (most_left - left) * side,
                north + (most_ahead - ahead) * side,
            )
        };
        for (cell, &average) in self.model.cells().iter().zip(self.averages) {
            let (x, y) = corner(f64::from(cell.ahead), f64::from(cell.left));
            let fill = mixed(theme.cell, theme.named, average);
            drawing.area((x, y), (side, side), fill);
            let outline = square((x, y), side, 0.0);
            drawing.stroked(
                outline,
                Stroke {
                    colour: theme.line,
                    width: drawing.size.hair(),
                },
            );
            let colour = if average > 0.5 {
                theme.ground
            } else {
                theme.text
            };
            let middle = (x + side / 2.0, y + side / 2.0);
            drawing.words(&format!("{average:.2}"), Anchor::Middle, middle, colour);
        }
        arrow(drawing, corner(0.0, 0.0), side, 1, Ink::Plain);
    }
}

/// Mixes two colours; returns `#rrggbb`.
fn mixed(from: &str, to: &str, share: f64) -> String {
    let [from, to] = [from, to].map(channels);
    let mixed = [0, 1, 2].map(|channel| {
        let (from, to) = (f64::from(from[channel]), f64::from(to[channel]));
        (from + (to - from) * share.clamp(0.0, 1.0)).round() as u8
    });
    format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mixed_colour_lies_between_the_two_and_equals_them_at_the_ends() {
        assert_eq!(mixed("#000000", "#ff8040", 0.0), "#000000");
        assert_eq!(mixed("#000000", "#ff8040", 1.0), "#ff8040");
        assert_eq!(mixed("#000000", "#ff8040", 0.5), "#804020");
    }
}
