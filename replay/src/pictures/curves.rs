//! Charts of values over time (paper, Figs. 5 and 6), with the axes laid out by plotters.

use super::drawing::{Anchor, Drawing, Size, Stroke, channels, line, polygon};
use super::style::{PictureError, named};
use super::words;
use crate::palette::Theme;
use crate::recording::Recording;
use plotters::prelude::{
    ChartBuilder, Color, IntoDrawingArea, IntoFont, PathElement, Polygon, RGBColor, ShapeStyle,
    TRANSPARENT, TextStyle,
};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
    FontTransform,
};
use std::convert::Infallible;

/// Ratio of a curve's height to its width.
const SHAPE: f64 = 0.56;

/// Number of integer coordinates of the crate plotters per millimetre or pixel.
const FINE: f64 = 100.0;

/// Width of a curve on a screen, in pixels.
const SCREEN_WIDTH: f64 = 480.0;

/// Draws the temperature over the steps.
pub(super) fn temperature(
    recording: &Recording,
    size: Size,
    theme: &'static Theme,
) -> Result<Drawing, PictureError> {
    let most = recording.temperature.iter().copied().fold(0.0, f64::max);
    curve(
        &format!("temperature, {}", named(recording)),
        ("time step", "temperature"),
        &recording.temperature,
        (0.0, tenths(most, f64::ceil).max(0.1)),
        (size, theme),
    )
}

/// Draws the best fitness over the generations.
pub(super) fn fitness(
    recording: &Recording,
    size: Size,
    theme: &'static Theme,
) -> Result<Drawing, PictureError> {
    let values = &recording.origin.evolution;
    if values.is_empty() {
        return Err(PictureError::NoEvolution);
    }
    let least = values.iter().copied().fold(1.0, f64::min);
    let most = values.iter().copied().fold(0.0, f64::max);
    let least = tenths(least, f64::floor);
    curve(
        &format!("best fitness, {}", named(recording)),
        ("generation", "best fitness"),
        values,
        (least, tenths(most, f64::ceil).max(least + 0.1)),
        (size, theme),
    )
}

fn tenths(value: f64, to: fn(f64) -> f64) -> f64 {
    to(value * 10.0) / 10.0
}

/// A chart of values over steps or generations: a line on top of bands.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Label of the horizontal axis.
    pub x: &'static str,
    /// Label of the vertical axis.
    pub y: &'static str,
    /// Minimum and maximum *x*.
    pub x_range: (f64, f64),
    /// Minimum and maximum *y*.
    pub y_range: (f64, f64),
    /// Number of decimals on the vertical axis.
    pub decimals: usize,
    /// Areas between two lines, translucent: (*x*, lower *y*, upper *y*) in ascending *x*.
    pub bands: Vec<Vec<(f64, f64, f64)>>,
    /// The line, in ascending *x*.
    pub line: Vec<(f64, f64)>,
}

/// Draws one line, from *x* = 0, as a picture.
fn curve(
    title: &str,
    (x, y): (&'static str, &'static str),
    values: &[f64],
    y_range: (f64, f64),
    (size, theme): (Size, &'static Theme),
) -> Result<Drawing, PictureError> {
    let values = values.iter().enumerate();
    let chart = Chart {
        x,
        y,
        x_range: (0.0, values.len() as f64),
        y_range,
        decimals: 1,
        bands: Vec::new(),
        line: values.map(|(at, &value)| (at as f64, value)).collect(),
    };
    let mut drawing = Drawing::new(size, theme, title);
    let (width, height) = chart.extent(size);
    drawing.set_size(width, height);
    chart.draw(&mut drawing, (0.0, 0.0))?;
    Ok(drawing)
}

impl Chart {
    /// Returns the width and height of a chart in a picture of this size.
    pub(super) fn extent(&self, size: Size) -> (f64, f64) {
        let width = match size {
            Size::Paper(width) => width,
            Size::Screen(_) => SCREEN_WIDTH,
        };
        (width, size.whole(width * SHAPE))
    }

    /// Draws the chart with its north-west corner at `corner`.
    pub(super) fn draw(
        &self,
        drawing: &mut Drawing,
        corner: (f64, f64),
    ) -> Result<(), PictureError> {
        self.plot(drawing, corner)
            .map_err(|error| PictureError::Encoding(error.to_string()))
    }

    fn plot(
        &self,
        drawing: &mut Drawing,
        corner: (f64, f64),
    ) -> Result<(), Box<dyn std::error::Error>> {
        let theme = drawing.theme;
        let size = drawing.size;
        let fine = |length: f64| (length * FINE).round() as u32;
        let words = size.words();
        let (width, height) = self.extent(size);
        let [text, soft, line, curve] = [theme.text, theme.soft, theme.line, theme.named].map(rgb);
        let area = Plot {
            drawing,
            corner,
            size: (fine(width), fine(height)),
        }
        .into_drawing_area();
        let font = ("sans-serif", f64::from(fine(words))).into_font();
        let style = TextStyle::from(font);
        let mut chart = ChartBuilder::on(&area)
            .margin_top(fine(0.8 * words))
            .margin_right(fine(1.2 * words))
            .margin_bottom(fine(0.8 * words))
            .margin_left(fine(0.3 * words))
            .x_label_area_size(fine(3.0 * words))
            .y_label_area_size(fine(4.2 * words))
            .build_cartesian_2d(
                self.x_range.0..self.x_range.1,
                self.y_range.0..self.y_range.1,
            )?;
        let hair = |colour: RGBColor, times: f64| {
            ShapeStyle::from(&colour).stroke_width(fine(times * size.hair()))
        };
        chart
            .configure_mesh()
            .x_desc(self.x)
            .y_desc(self.y)
            .x_labels(6)
            .y_labels(6)
            .set_all_tick_mark_size(fine(0.4 * words))
            .x_label_formatter(&|value| format!("{value:.0}"))
            .y_label_formatter(&|value| format!("{value:.*}", self.decimals))
            .label_style(style.color(&soft))
            .axis_desc_style(style.color(&text))
            .axis_style(hair(soft, 1.5))
            .bold_line_style(hair(line, 1.0))
            .light_line_style(TRANSPARENT)
            .draw()?;
        let bands = self.bands.iter().map(|band| {
            let lower = band.iter().map(|&(x, low, _)| (x, low));
            let upper = band.iter().rev().map(|&(x, _, high)| (x, high));
            Polygon::new(lower.chain(upper).collect::<Vec<_>>(), curve.filled())
        });
        chart.draw_series(bands)?;
        chart.draw_series([PathElement::new(self.line.clone(), hair(curve, 2.0))])?;
        area.present()?;
        Ok(())
    }
}

/// A drawing used as a back end of plotters.
struct Plot<'a> {
    drawing: &'a mut Drawing,
    /// North-west corner in the drawing.
    corner: (f64, f64),
    size: (u32, u32),
}

impl Plot<'_> {
    fn at(&self, (x, y): BackendCoord) -> (f64, f64) {
        let (west, north) = self.corner;
        (west + f64::from(x) / FINE, north + f64::from(y) / FINE)
    }

    fn points(&mut self, points: &[BackendCoord], style: &impl BackendStyle) {
        if style.color().alpha > 0.0 {
            let points: Vec<(f64, f64)> = points.iter().map(|&point| self.at(point)).collect();
            let colour = hexadecimal(style.color());
            let stroke = Stroke {
                colour: &colour,
                width: f64::from(style.stroke_width()) / FINE,
            };
            self.drawing.stroked(line(&points), stroke);
        }
    }
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Implements only lines, areas and text, which are all that charts need.
impl DrawingBackend for Plot<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, at: BackendCoord, colour: BackendColor) -> Drawn {
        self.points(&[at, (at.0 + 1, at.1)], &colour);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn {
        self.points(&[from, to], style);
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        self.points(&path.into_iter().collect::<Vec<_>>(), style);
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> Drawn {
        let corners: Vec<(f64, f64)> = corners.into_iter().map(|corner| self.at(corner)).collect();
        let colour = hexadecimal(style.color());
        self.drawing.tinted(polygon(&corners), &colour);
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, at: BackendCoord) -> Drawn {
        let (x, y) = self.at(at);
        let colour = hexadecimal(style.color());
        let height = words::CAPITALS * self.drawing.size.words();
        // Distance from the anchor to the middle of the capitals.
        let down = match style.anchor().v_pos {
            VPos::Top => height / 2.0,
            VPos::Center => 0.0,
            VPos::Bottom => -height / 2.0,
        };
        match style.transform() {
            FontTransform::None => {
                let anchor = match style.anchor().h_pos {
                    HPos::Left => Anchor::Start,
                    HPos::Center => Anchor::Middle,
                    HPos::Right => Anchor::End,
                };
                self.drawing.words(text, anchor, (x, y + down), &colour);
            }
            // The label of the vertical axis, positioned by its middle.
            _ => self.drawing.words_upwards(text, (x + down, y), &colour),
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        _: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = self.drawing.size.words();
        let fine = |length: f64| (length * FINE).round() as u32;
        Ok((fine(words::width(text, size)), fine(words::CAPITALS * size)))
    }
}

fn rgb(colour: &str) -> RGBColor {
    let [red, green, blue] = channels(colour);
    RGBColor(red, green, blue)
}

fn hexadecimal(colour: BackendColor) -> String {
    let (red, green, blue) = colour.rgb;
    format!("#{red:02x}{green:02x}{blue:02x}")
}
