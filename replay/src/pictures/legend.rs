//! Legends: the meaning of a picture's colours and marks.

use super::drawing::{Anchor, Drawing, Size};
use super::style::Style;
use super::symbols::{area_stroke, arrow, mark, square};
use super::words;
use crate::recording::Recording;
use crate::scene::{Colouring, Ink, Mark, Scene};
use minimal_surprise_sim::damage::Damage;

/// Width of a symbol in front of its meaning, in text heights.
const SYMBOL: f64 = 1.6;

/// Symbol of a legend entry.
enum Key {
    Words,
    Robot(Ink),
    Mark(Mark),
    Area,
}

/// Entries of a legend, in order.
pub(super) struct Legend {
    entries: Vec<(Key, String)>,
}

const MARKS: [Mark; 6] = [
    Mark::HitOccupied,
    Mark::HitEmpty,
    Mark::MissOccupied,
    Mark::MissEmpty,
    Mark::ExpectsOccupied,
    Mark::ExpectsEmpty,
];

impl Legend {
    /// Creates the legend for the contents of the scenes.
    pub(super) fn of<'a>(
        scenes: impl IntoIterator<Item = &'a Scene>,
        colouring: Colouring,
        recording: &Recording,
    ) -> Self {
        let mut inks = Vec::new();
        let mut marks = Vec::new();
        for scene in scenes {
            inks.extend(scene.robots.iter().map(|robot| robot.ink));
            marks.extend(scene.marks.iter().map(|marked| marked.mark));
        }
        Self::with(
            colouring,
            recording,
            |ink| inks.contains(&ink),
            |mark| marks.contains(&mark),
        )
    }

    /// Creates the legend for everything that can appear during the run.
    pub(super) fn whole(recording: &Recording, style: &Style) -> Self {
        let picked = style.robot.is_some();
        let last = style.colouring != Colouring::Surprise;
        Self::with(
            style.colouring,
            recording,
            |ink| ink != Ink::Named || recording.name().is_some(),
            |mark| match mark {
                Mark::ExpectsOccupied | Mark::ExpectsEmpty => picked && last,
                _ => picked,
            },
        )
    }

    fn with(
        colouring: Colouring,
        recording: &Recording,
        has_ink: impl Fn(Ink) -> bool,
        has_mark: impl Fn(Mark) -> bool,
    ) -> Self {
        let name = recording.name().map_or("", |name| name.name());
        let inks: &[(Ink, &str)] = match colouring {
            Colouring::Plain => &[],
            Colouring::Structure => &[
                (Ink::Named, name),
                (Ink::Other, "another structure"),
                (Ink::Outside, "no structure"),
            ],
            Colouring::Surprise => &[
                (Ink::Surprise(0), "none"),
                (Ink::Surprise(1), "up to 1/8"),
                (Ink::Surprise(2), "up to 1/4"),
                (Ink::Surprise(3), "more"),
            ],
        };
        let mut entries = Vec::new();
        for (ink, meaning) in inks.iter().filter(|(ink, _)| has_ink(*ink)) {
            entries.push((Key::Robot(*ink), (*meaning).to_owned()));
        }
        if colouring == Colouring::Surprise && !entries.is_empty() {
            entries.insert(0, (Key::Words, "sensors mispredicted:".to_owned()));
        }
        for mark in MARKS.into_iter().filter(|&mark| has_mark(mark)) {
            let meaning = match mark {
                Mark::HitOccupied => "robot, as predicted",
                Mark::HitEmpty => "empty, as predicted",
                Mark::MissOccupied => "robot, predicted empty",
                Mark::MissEmpty => "empty, predicted a robot",
                Mark::ExpectsOccupied => "a robot is expected",
                Mark::ExpectsEmpty => "expected to be empty",
            };
            entries.push((Key::Mark(mark), meaning.to_owned()));
        }
        if let Some(damaged) = &recording.origin.damage {
            let done = match damaged.damage {
                Damage::Remove(_) => "robots were removed here",
                Damage::Reposition(_) => "robots were repositioned from here",
            };
            entries.push((Key::Area, done.to_owned()));
        }
        Self { entries }
    }

    fn entry_width((key, meaning): &(Key, String), words: f64) -> f64 {
        Self::symbol_width(key, words) + words::width(meaning, words)
    }

    fn symbol_width(key: &Key, words: f64) -> f64 {
        match key {
            Key::Words => 0.0,
            Key::Robot(_) | Key::Mark(_) | Key::Area => SYMBOL * words,
        }
    }

    /// Returns the width of the widest entry.
    pub(super) fn widest(&self, size: Size) -> f64 {
        let widths = self.entries.iter();
        let widths = widths.map(|entry| Self::entry_width(entry, size.words()));
        widths.fold(0.0, f64::max)
    }

    /// Draws the legend in rows; returns the lower end of the last row.
    pub(super) fn draw(&self, drawing: &mut Drawing, (west, north): (f64, f64), width: f64) -> f64 {
        let theme = drawing.theme;
        let words = drawing.size.words();
        let row = drawing.size.whole(1.6 * words);
        let symbol = drawing.size.whole(1.25 * words);
        let (mut x, mut y) = (west, north);
        for entry in &self.entries {
            let needed = Self::entry_width(entry, words);
            if x > west && x + needed > west + width {
                (x, y) = (west, y + row);
            }
            let corner = (drawing.size.floor(x), drawing.size.floor(y - symbol / 2.0));
            let (key, meaning) = entry;
            match key {
                Key::Words => {}
                Key::Robot(ink) => arrow(drawing, corner, symbol, 0, *ink),
                Key::Mark(of) => {
                    mark(drawing, *of, corner, symbol);
                }
                Key::Area => {
                    let stroke = area_stroke(drawing, symbol);
                    drawing.stroked(square(corner, symbol, 0.1), stroke);
                }
            }
            let room = Self::symbol_width(key, words);
            drawing.words(meaning, Anchor::Start, (x + room, y), theme.text);
            x += needed + 1.3 * words;
        }
        if self.entries.is_empty() {
            north - words
        } else {
            y + 0.8 * words
        }
    }
}
