//! Colours and outlines, the same in every picture. The hues (Okabe and Ito's) can be distinguished
//! by colour-blind readers; where colour is not enough, shapes differ.

use super::scene::{Ink, Mark};
use serde::Serialize;

/// Colours on a light or dark background.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Theme {
    /// Background.
    pub ground: &'static str,
    /// Empty cells.
    pub cell: &'static str,
    /// Lines between cells.
    pub line: &'static str,
    /// Text.
    pub text: &'static str,
    /// Secondary text, and axes.
    pub soft: &'static str,
    /// Robots of [`Ink::Plain`].
    pub plain: &'static str,
    /// Robots of the dominant structure.
    pub named: &'static str,
    /// Robots of other structures.
    pub other: &'static str,
    /// Robots of no structure; drawn as outlines.
    pub outside: &'static str,
    /// Robots by surprise, from none to highest.
    pub surprise: [&'static str; 4],
    /// Correct predictions.
    pub hit: &'static str,
    /// Mispredictions.
    pub miss: &'static str,
    /// Predictions not yet sensed, and the damaged area.
    pub expects: &'static str,
}

/// Colours on a light background.
pub const LIGHT: Theme = Theme {
    ground: "#ffffff",
    cell: "#f4f4f2",
    line: "#dcdcd8",
    text: "#1c1c1a",
    soft: "#6a6a66",
    plain: "#2b2b29",
    named: "#0072b2",
    other: "#c47a00",
    outside: "#6a6a66",
    surprise: ["#4b4b48", "#0072b2", "#c47a00", "#c2410c"],
    hit: "#00805e",
    miss: "#c2410c",
    expects: "#8a5aa8",
};

/// Colours on a dark background.
pub const DARK: Theme = Theme {
    ground: "#161615",
    cell: "#20201f",
    line: "#343432",
    text: "#ececea",
    soft: "#a3a39e",
    plain: "#dcdcd8",
    named: "#56b4e9",
    other: "#e69f00",
    outside: "#a3a39e",
    surprise: ["#b4b4b0", "#56b4e9", "#e69f00", "#ff7f50"],
    hit: "#2fc89f",
    miss: "#ff7f50",
    expects: "#cc9ee0",
};

/// Outline of a robot facing east: an arrowhead in a cell from (0, 0), north-west, to (1, 1).
pub const ARROW: [[f64; 2]; 4] = [[0.88, 0.5], [0.16, 0.84], [0.32, 0.5], [0.16, 0.16]];

impl Theme {
    /// Returns the colour of a robot.
    #[must_use]
    pub fn ink(&self, ink: Ink) -> &'static str {
        match ink {
            Ink::Plain => self.plain,
            Ink::Named => self.named,
            Ink::Other => self.other,
            Ink::Outside => self.outside,
            Ink::Surprise(level) => self.surprise[usize::from(level.min(3))],
        }
    }

    /// Returns the colour of a mark. Hits are squares, misses are crosses, expectations are rings;
    /// filled or thick where a robot was sensed or is expected, otherwise hollow or thin.
    #[must_use]
    pub fn mark(&self, mark: Mark) -> &'static str {
        match mark {
            Mark::HitOccupied | Mark::HitEmpty => self.hit,
            Mark::MissOccupied | Mark::MissEmpty => self.miss,
            Mark::ExpectsOccupied | Mark::ExpectsEmpty => self.expects,
        }
    }
}

/// Checks whether a robot is drawn as an outline only.
#[must_use]
pub fn is_hollow(ink: Ink) -> bool {
    matches!(ink, Ink::Outside | Ink::Surprise(0))
}
