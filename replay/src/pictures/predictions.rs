//! What robots predict around them, averaged over the run, as in the paper's Fig. 9.

use super::drawing::{Anchor, Drawing, Size, Stroke, channels};
use super::style::{PictureError, named};
use super::symbols::{arrow, square};
use super::words;
use crate::palette::Theme;
use crate::recording::Recording;
use crate::scene::Ink;

/// Widest cell, in text heights: it has room for a number with two decimals.
const CELL_MAX: f64 = 4.5;

/// The average prediction in every sensor's cell; the robot faces up.
///
/// # Errors
/// [`PictureError::NoController`] of a trajectory.
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
    let cells = controller.topology.model().cells();
    // The robot is one of the cells shown.
    let sides = |of_cells: Vec<i8>| {
        let least = of_cells
            .iter()
            .fold(0, |least: i8, &value| least.min(value));
        let most = of_cells.iter().fold(0, |most: i8, &value| most.max(value));
        (f64::from(least), f64::from(most))
    };
    let (behind, ahead) = sides(cells.iter().map(|cell| cell.ahead).collect());
    let (right, left) = sides(cells.iter().map(|cell| cell.left).collect());
    let columns = left - right + 1.0;
    let rows = ahead - behind + 1.0;
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
    // The north-west corner of a cell relative to the robot.
    let corner = |cell_ahead: f64, cell_left: f64| {
        (
            width / 2.0 + ((left + right) / 2.0 - cell_left - 0.5) * side,
            header + (ahead - cell_ahead) * side,
        )
    };
    for (cell, &average) in cells.iter().zip(&controller.average_prediction) {
        let (x, y) = corner(f64::from(cell.ahead), f64::from(cell.left));
        let fill = mixed(theme.cell, theme.named, average);
        drawing.area((x, y), (side, side), fill);
        let outline = square((x, y), side, 0.0);
        drawing.stroked(
            outline,
            Stroke {
                colour: theme.line,
                width: size.hair(),
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
    arrow(&mut drawing, corner(0.0, 0.0), side, 1, Ink::Plain);
    Ok(drawing)
}

/// A colour between two others, as `#rrggbb`.
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
