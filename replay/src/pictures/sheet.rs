//! Several panels in rows: swarms, predictions and charts, each below its title.

use super::curves::Chart;
use super::drawing::{Anchor, Drawing, Size};
use super::predictions::{CELL_MAX, Surroundings};
use super::style::PictureError;
use super::{state, words};
use crate::palette::Theme;
use crate::scene::Scene;
use minimal_surprise_controller::SensorModel;

/// Side of a swarm's cell, in pixels.
const CELL: u32 = 12;

/// A part of a sheet.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// The title above the panel.
    pub title: String,
    /// The picture.
    pub content: Content<'a>,
}

/// The picture of a panel.
#[derive(Clone, Debug)]
pub enum Content<'a> {
    /// A swarm.
    Swarm(Scene),
    /// The average prediction of every sensor, 0 to 1, in the cells around the robot.
    Predictions {
        /// The sensor model.
        model: SensorModel,
        /// One average per sensor, in sensor order.
        averages: &'a [f64],
    },
    /// Values over time.
    Chart(Chart),
}

impl Content<'_> {
    /// Returns the width and height in pixels.
    fn extent(&self, size: Size) -> (f64, f64) {
        match self {
            Self::Swarm(scene) => {
                // One more pixel, for the last grid line.
                let side = |cells: u16| f64::from(cells) * f64::from(CELL) + 1.0;
                (side(scene.width), side(scene.height))
            }
            &Self::Predictions { model, averages } => {
                let (columns, rows) = Surroundings { model, averages }.cells();
                let side = prediction_side(size);
                (columns * side + 1.0, rows * side + 1.0)
            }
            Self::Chart(chart) => chart.extent(size),
        }
    }

    fn draw(&self, drawing: &mut Drawing, (west, north): (f64, f64)) -> Result<(), PictureError> {
        // A one-pixel line is sharp at the middle of a pixel.
        let on_pixels = (west + 0.5, north + 0.5);
        match self {
            Self::Swarm(scene) => state::swarm(drawing, scene, on_pixels, f64::from(CELL)),
            &Self::Predictions { model, averages } => {
                let side = prediction_side(drawing.size);
                Surroundings { model, averages }.draw(drawing, on_pixels, side);
            }
            Self::Chart(chart) => chart.draw(drawing, (west, north))?,
        }
        Ok(())
    }
}

fn prediction_side(size: Size) -> f64 {
    size.whole(CELL_MAX * size.words())
}

/// Draws panels for a screen, `columns` per row; all panels get the space of the largest.
///
/// # Errors
/// [`PictureError::Encoding`] if a chart cannot be laid out.
pub fn sheet(
    title: &str,
    panels: &[Panel<'_>],
    columns: usize,
    theme: &'static Theme,
) -> Result<Drawing, PictureError> {
    let size = Size::Screen(CELL);
    let (words, margin) = (size.words(), size.margin());
    let gap = size.whole(1.5 * words);
    let header = size.whole(1.5 * words);
    let (mut width, mut height) = (0.0_f64, 0.0_f64);
    for panel in panels {
        let (content_width, content_height) = panel.content.extent(size);
        let title_width = words::width(&panel.title, words);
        width = width.max(size.whole(content_width.max(title_width)));
        height = height.max(size.whole(content_height));
    }
    let columns = columns.clamp(1, panels.len().max(1));
    let mut drawing = Drawing::new(size, theme, title);
    for (index, panel) in panels.iter().enumerate() {
        let west = margin + (width + gap) * (index % columns) as f64;
        let north = margin + (header + height + gap) * (index / columns) as f64;
        let middle = (west, north + 0.4 * header);
        drawing.words(&panel.title, Anchor::Start, middle, theme.text);
        panel.content.draw(&mut drawing, (west, north + header))?;
    }
    let rows = panels.len().div_ceil(columns).max(1);
    let total = |number: usize, side: f64| 2.0 * margin + (side + gap) * number as f64 - gap;
    drawing.set_size(total(columns, width), total(rows, header + height));
    Ok(drawing)
}
