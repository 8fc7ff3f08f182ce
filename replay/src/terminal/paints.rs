//! Colours for terminals with an unknown background: readable on light and dark, in as many colours
//! as the terminal supports.

use crate::palette::{LIGHT, Theme};
use crate::scene::{Ink, Mark};
use anstyle::RgbColor;
use ratatui::style::{Color, Modifier, Style};

/// The hues for a light background are readable on light and dark. The terminal's own text colour
/// replaces the theme's greys.
const HUES: Theme = LIGHT;

/// Number of colours to use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paints {
    /// No colours.
    None,
    /// The 16 basic colours, which the user's terminal defines.
    Sixteen,
    /// The 256 indexed colours.
    Indexed,
    /// 24-bit colours.
    True,
}

impl Paints {
    fn paint(self, hue: &str, of_sixteen: Color) -> Style {
        let colour = match (self, hue.parse()) {
            (Self::None, _) => return Style::new(),
            (Self::Indexed, Ok(Color::Rgb(r, g, b))) => {
                Color::Indexed(anstyle_lossy::rgb_to_xterm(RgbColor(r, g, b)).0)
            }
            (Self::True, Ok(colour)) => colour,
            _ => of_sixteen,
        };
        Style::new().fg(colour)
    }

    /// Returns the hue of the dominant structure.
    #[must_use]
    pub fn named(self) -> Style {
        self.paint(HUES.named, Color::Cyan)
    }

    /// Returns the hue of other structures.
    #[must_use]
    pub fn other(self) -> Style {
        self.paint(HUES.other, Color::Yellow)
    }

    /// Returns the hue of correct predictions.
    #[must_use]
    pub fn hit(self) -> Style {
        self.paint(HUES.hit, Color::Green)
    }

    /// Returns the style of a robot.
    #[must_use]
    pub fn ink(self, ink: Ink) -> Style {
        match ink {
            Ink::Plain | Ink::Surprise(0) => Style::new(),
            Ink::Outside => soft(),
            Ink::Named => self.named().bold(),
            Ink::Other => self.other(),
            Ink::Surprise(1) => self.paint(HUES.surprise[1], Color::Cyan),
            Ink::Surprise(2) => self.paint(HUES.surprise[2], Color::Yellow),
            Ink::Surprise(_) => self.paint(HUES.surprise[3], Color::Red).bold(),
        }
    }

    /// Returns the style of a mark.
    #[must_use]
    pub fn mark(self, mark: Mark) -> Style {
        let of_sixteen = match mark {
            Mark::HitOccupied | Mark::HitEmpty => Color::Green,
            Mark::MissOccupied | Mark::MissEmpty => Color::Red,
            Mark::ExpectsOccupied | Mark::ExpectsEmpty => Color::Magenta,
        };
        self.paint(HUES.mark(mark), of_sixteen).bold()
    }

    /// Returns the style of the damaged area.
    #[must_use]
    pub fn area(self) -> Style {
        self.paint(HUES.expects, Color::Magenta)
    }

    /// Returns the style of warnings.
    #[must_use]
    pub fn warning(self) -> Style {
        self.paint(HUES.miss, Color::Red).bold()
    }
}

/// Returns the style of secondary text.
#[must_use]
pub fn soft() -> Style {
    Style::new().add_modifier(Modifier::DIM)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inks_and_marks_differ_in_few_colours_and_have_none_if_none_are_wanted() {
        for paints in [Paints::Sixteen, Paints::Indexed, Paints::True] {
            let inks = [
                paints.named(),
                paints.other(),
                paints.warning(),
                paints.hit(),
            ];
            for (index, ink) in inks.iter().enumerate() {
                assert!(ink.fg.is_some(), "{paints:?}");
                assert!(!inks[..index].contains(ink), "{paints:?}: {ink:?}");
            }
        }
        assert_eq!(Paints::None.named(), Style::new());
        assert_eq!(Paints::None.mark(Mark::MissEmpty).fg, None);
    }
}
