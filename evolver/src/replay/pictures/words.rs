//! Words as outlines, in the bundled font: a picture looks the same wherever it is opened, with
//! whatever fonts are there.

use super::drawing::rounded;
use skrifa::instance::{LocationRef, Size};
use skrifa::metrics::GlyphMetrics;
use skrifa::outline::pen::PathStyle;
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider};
use std::sync::LazyLock;
use svg::node::element::path::Data;

/// Inter, the letters of ASCII and a few signs; see `fonts/README.md`.
const FONT: &[u8] = include_bytes!("../../../fonts/inter-subset.ttf");

static FACE: LazyLock<FontRef<'static>> =
    LazyLock::new(|| FontRef::new(FONT).expect("the bundled font is a font"));

/// Height of capitals and digits, as a share of the size.
pub(super) const CAPITALS: f64 = 0.727;

/// How wide words are in some size.
pub(super) fn width(words: &str, size: f64) -> f64 {
    let advances = words.chars().map(|letter| advance(glyph(letter)));
    advances.sum::<f64>() * scale(size)
}

/// The outlines of words that start at `x` and stand on `y`.
pub(super) fn outlines(words: &str, size: f64, (x, y): (f64, f64)) -> Data {
    let mut pen = Pen {
        data: Data::new(),
        scale: scale(size),
        x,
        y,
    };
    let glyphs = FACE.outline_glyphs();
    for letter in words.chars() {
        let id = glyph(letter);
        // A space has no outline.
        if let Some(outline) = glyphs.get(id) {
            let settings = DrawSettings::unhinted(Size::unscaled(), LocationRef::default())
                .with_path_style(PathStyle::HarfBuzz);
            outline
                .draw(settings, &mut pen)
                .expect("the bundled font has whole outlines");
        }
        pen.x += advance(id) * pen.scale;
    }
    pen.data
}

fn metrics() -> GlyphMetrics<'static> {
    FACE.glyph_metrics(Size::unscaled(), LocationRef::default())
}

fn scale(size: f64) -> f64 {
    let font = FACE.metrics(Size::unscaled(), LocationRef::default());
    size / f64::from(font.units_per_em)
}

/// A letter that the font lacks is a question mark.
fn glyph(letter: char) -> GlyphId {
    let letters = FACE.charmap();
    let found = letters.map(letter).or_else(|| letters.map('?'));
    found.unwrap_or(GlyphId::NOTDEF)
}

fn advance(glyph: GlyphId) -> f64 {
    f64::from(metrics().advance_width(glyph).unwrap_or(0.0))
}

struct Pen {
    data: Data,
    scale: f64,
    x: f64,
    y: f64,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (
            rounded(self.x + f64::from(x) * self.scale),
            rounded(self.y - f64::from(y) * self.scale),
        )
    }

    fn add(&mut self, command: impl FnOnce(Data) -> Data) {
        self.data = command(std::mem::take(&mut self.data));
    }
}

impl OutlinePen for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let to = self.at(x, y);
        self.add(|data| data.move_to(to));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let to = self.at(x, y);
        self.add(|data| data.line_to(to));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (control, to) = (self.at(x1, y1), self.at(x, y));
        self.add(|data| data.quadratic_curve_to((control, to)));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (first, second, to) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.add(|data| data.cubic_curve_to((first, second, to)));
    }

    fn close(&mut self) {
        self.add(Data::close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_as_wide_as_their_letters_and_grow_with_the_size() {
        let (one, two) = (width("line", 10.0), width("lineline", 10.0));
        assert!((2.0 * one - two).abs() < 1e-9, "{one} {two}");
        assert!((width("line", 20.0) - two).abs() < 1e-9);
    }

    #[test]
    fn every_letter_that_pictures_use_is_in_the_font() {
        let used = (' '..='~').chain("·×–…−".chars());
        let missing: String = used.filter(|&c| FACE.charmap().map(c).is_none()).collect();
        assert_eq!(missing, "");
    }
}
