//! The parts of a picture: areas, lines and text on a background, written as SVG.

use super::words::{self, rounded};
use crate::palette::Theme;
use svg::node::element::path::Data;
use svg::node::element::{Group, Path, Rectangle, Title};
use svg::{Document, Node};

/// Size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Size {
    /// On paper: the width in millimetres; text is set at 7 points.
    Paper(f64),
    /// On a screen: the side of a cell in pixels.
    Screen(u32),
}

impl Size {
    /// Returns the font size, in millimetres (7 points) or in pixels.
    pub(super) fn words(self) -> f64 {
        match self {
            Self::Paper(_) => 2.47,
            Self::Screen(_) => 13.0,
        }
    }

    /// Returns the margin around the picture.
    pub(super) fn margin(self) -> f64 {
        match self {
            Self::Paper(_) => 0.5,
            Self::Screen(_) => 8.0,
        }
    }

    /// Returns the width of the thinnest line.
    pub(super) fn hair(self) -> f64 {
        match self {
            Self::Paper(_) => 0.1,
            Self::Screen(_) => 1.0,
        }
    }

    /// Rounds a length up to whole pixels on a screen, so that equal lengths look equal.
    pub(super) fn whole(self, length: f64) -> f64 {
        match self {
            Self::Paper(_) => length,
            Self::Screen(_) => length.ceil(),
        }
    }

    /// Rounds down to whole pixels on a screen; on paper, returns the position unchanged.
    pub(super) fn floor(self, place: f64) -> f64 {
        match self {
            Self::Paper(_) => place,
            Self::Screen(_) => place.floor(),
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Paper(_) => "mm",
            Self::Screen(_) => "px",
        }
    }
}

/// Alignment of text relative to its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Colour and width of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke<'a> {
    pub(super) colour: &'a str,
    pub(super) width: f64,
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Drawing {
    pub(super) size: Size,
    pub(super) theme: &'static Theme,
    title: String,
    width: f64,
    height: f64,
    content: Group,
}

impl Drawing {
    pub(super) fn new(size: Size, theme: &'static Theme, title: &str) -> Self {
        Self {
            size,
            theme,
            title: title.to_owned(),
            width: 0.0,
            height: 0.0,
            content: Group::new(),
        }
    }

    pub(super) fn set_size(&mut self, width: f64, height: f64) {
        self.width = width;
        self.height = height;
    }

    /// Returns the width in millimetres or pixels.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Returns the picture as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let unit = self.size.unit();
        let [width, height] = [self.width, self.height].map(rounded);
        let ground = Rectangle::new()
            .set("width", width)
            .set("height", height)
            .set("fill", self.theme.ground);
        let document = Document::new()
            .set("width", format!("{width}{unit}"))
            .set("height", format!("{height}{unit}"))
            .set("viewBox", (0, 0, width, height))
            .add(Title::new(self.title.as_str()))
            .add(ground)
            .add(self.content.clone());
        format!("{document}\n")
    }

    /// Draws a filled rectangle with its north-west corner at (`x`, `y`).
    pub(super) fn area(
        &mut self,
        (x, y): (f64, f64),
        (width, height): (f64, f64),
        fill: impl Into<String>,
    ) {
        let area = Rectangle::new()
            .set("x", rounded(x))
            .set("y", rounded(y))
            .set("width", rounded(width))
            .set("height", rounded(height))
            .set("fill", fill.into());
        self.content.append(area);
    }

    pub(super) fn filled(&mut self, outline: Data, colour: &str) {
        let path = Path::new().set("d", outline).set("fill", colour);
        self.content.append(path);
    }

    /// Fills an outline with a translucent colour, so that parts below stay visible.
    pub(super) fn tinted(&mut self, outline: Data, colour: &str) {
        let path = Path::new()
            .set("d", outline)
            .set("fill", colour)
            .set("fill-opacity", 0.3);
        self.content.append(path);
    }

    pub(super) fn stroked(&mut self, line: Data, stroke: Stroke<'_>) {
        let path = Path::new()
            .set("d", line)
            .set("fill", "none")
            .set("stroke", stroke.colour)
            .set("stroke-width", rounded(stroke.width))
            .set("stroke-linejoin", "round")
            .set("stroke-linecap", "round");
        self.content.append(path);
    }

    /// Draws text with its capitals centred on `y`.
    pub(super) fn words(&mut self, words: &str, anchor: Anchor, (x, y): (f64, f64), colour: &str) {
        let size = self.size.words();
        let width = words::width(words, size);
        let x = match anchor {
            Anchor::Start => x,
            Anchor::Middle => x - width / 2.0,
            Anchor::End => x - width,
        };
        let base = y + words::CAPITALS * size / 2.0;
        // On a screen, letters are sharper on a pixel boundary.
        let base = match self.size {
            Size::Paper(_) => base,
            Size::Screen(_) => base.round(),
        };
        self.outlined(words::outlines(words, size, (x, base)), words, colour, None);
    }

    /// Draws text rotated to run upwards, with its capitals centred on `x` and its middle at `y`.
    pub(super) fn words_upwards(&mut self, words: &str, (x, y): (f64, f64), colour: &str) {
        let size = self.size.words();
        let start = -words::width(words, size) / 2.0;
        let outlines = words::outlines(words, size, (start, words::CAPITALS * size / 2.0));
        let turned = format!("translate({} {}) rotate(-90)", rounded(x), rounded(y));
        self.outlined(outlines, words, colour, Some(turned));
    }

    fn outlined(&mut self, outlines: Data, words: &str, colour: &str, turned: Option<String>) {
        // Other programs, such as screen readers, cannot read outlines.
        let mut path = Path::new()
            .set("aria-label", words)
            .set("d", outlines)
            .set("fill", colour);
        if let Some(turned) = turned {
            path = path.set("transform", turned);
        }
        self.content.append(path);
    }
}

/// Returns the red, green and blue of `#rrggbb`.
pub(super) fn channels(colour: &str) -> [u8; 3] {
    [1, 3, 5].map(|at| {
        let digits = colour.get(at..at + 2).unwrap_or("00");
        u8::from_str_radix(digits, 16).unwrap_or(0)
    })
}

/// Returns a closed outline.
pub(super) fn polygon(corners: &[(f64, f64)]) -> Data {
    line(corners).close()
}

/// Returns a line through the points.
pub(super) fn line(points: &[(f64, f64)]) -> Data {
    let mut data = Data::new();
    for (index, &(x, y)) in points.iter().enumerate() {
        let to = (rounded(x), rounded(y));
        data = if index == 0 {
            data.move_to(to)
        } else {
            data.line_to(to)
        };
    }
    data
}
