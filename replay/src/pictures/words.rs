//! Text as outlines in the bundled font, so that a picture looks the same whichever fonts are
//! installed.

use std::collections::BTreeMap;
use std::sync::LazyLock;
use svg::node::element::path::{Command, Data};

/// Inter: the ASCII characters and a few signs; see `fonts/README.md`.
static FONT: LazyLock<Font> = LazyLock::new(|| {
    let font = Font::parse(include_str!("../../fonts/inter-outlines.tsv"));
    font.expect("the bundled font is well-formed")
});

/// Outlines of a font. Lengths are in font units, y upwards.
struct Font {
    units_per_em: f64,
    letters: BTreeMap<char, Letter>,
}

struct Letter {
    advance: f64,
    outline: Data,
}

impl Font {
    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let units_per_em = lines.next()?.strip_prefix("units\t")?.parse().ok()?;
        let letters = lines.map(|line| {
            let mut columns = line.split('\t');
            let code = u32::from_str_radix(columns.next()?, 16).ok()?;
            let advance = columns.next()?.parse().ok()?;
            let outline = Data::parse(columns.next()?).ok()?;
            Some((char::from_u32(code)?, Letter { advance, outline }))
        });
        Some(Self {
            units_per_em,
            letters: letters.collect::<Option<_>>()?,
        })
    }

    /// Returns a letter; a question mark if the font lacks it.
    fn letter(&self, letter: char) -> &Letter {
        let found = self.letters.get(&letter);
        found.unwrap_or_else(|| &self.letters[&'?'])
    }

    fn scale(&self, size: f64) -> f64 {
        size / self.units_per_em
    }
}

/// Height of capitals and digits, relative to the font size.
pub(super) const CAPITALS: f64 = 0.727;

/// Returns the width of a text at this font size.
pub(super) fn width(words: &str, size: f64) -> f64 {
    let advances = words.chars().map(|letter| FONT.letter(letter).advance);
    advances.sum::<f64>() * FONT.scale(size)
}

/// Returns the outlines of a text that starts at `x` with its baseline at `y`.
pub(super) fn outlines(words: &str, size: f64, (mut x, y): (f64, f64)) -> Data {
    let scale = FONT.scale(size);
    let mut data = Data::new();
    for letter in words.chars() {
        let letter = FONT.letter(letter);
        for command in letter.outline.iter() {
            let points = |lengths: &[f32]| -> Vec<f32> {
                let placed = lengths.chunks_exact(2).flat_map(|point| {
                    [
                        rounded(x + f64::from(point[0]) * scale),
                        rounded(y - f64::from(point[1]) * scale),
                    ]
                });
                placed.collect()
            };
            data = match command {
                Command::Move(_, to) => data.move_to(points(to)),
                Command::Line(_, to) => data.line_to(points(to)),
                Command::QuadraticCurve(_, to) => data.quadratic_curve_to(points(to)),
                _ => data.close(),
            };
        }
        x += letter.advance * scale;
    }
    data
}

/// Rounds a length to three decimals; more would only make the file larger.
pub(super) fn rounded(length: f64) -> f32 {
    // Turns negative zero into zero.
    ((length * 1000.0).round() / 1000.0 + 0.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_as_wide_as_its_letters_and_grows_with_the_size() {
        let (one, two) = (width("line", 10.0), width("lineline", 10.0));
        assert!((2.0 * one - two).abs() < 1e-9, "{one} {two}");
        assert!((width("line", 20.0) - two).abs() < 1e-9);
    }

    #[test]
    fn every_character_that_pictures_use_is_in_the_font() {
        let used = (' '..='~').chain("·×–…−".chars());
        let missing: String = used.filter(|c| !FONT.letters.contains_key(c)).collect();
        assert_eq!(missing, "");
    }
}
