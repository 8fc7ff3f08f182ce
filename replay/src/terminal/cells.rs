//! A scene as text, two characters per cell: the mark on the left, the robot on the right.

use super::paints::{Paints, soft};
use crate::palette::is_hollow;
use crate::scene::{Ink, Mark, Robot, Scene};
use minimal_surprise_sim::Heading;
use minimal_surprise_sim::drawing::{EMPTY, arrow, hollow_arrow};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use std::ops::Range;

/// Columns per cell.
pub const COLUMNS: u16 = 2;

/// Character that shades the damaged area.
pub const AREA: char = '░';

/// Character next to a robot with the highest level of surprise, for which no larger arrow exists.
pub const MOST_SURPRISED: char = '!';

/// Returns the arrow of a robot: small for structures other than the dominant one, hollow for no
/// structure; larger with increasing surprise.
#[must_use]
pub fn robot(robot: Robot) -> char {
    let heading = Heading::ALL[usize::from(robot.heading) % Heading::ALL.len()];
    match robot.ink {
        Ink::Other | Ink::Surprise(1) => small_arrow(heading),
        ink if is_hollow(ink) => hollow_arrow(heading),
        _ => arrow(heading),
    }
}

fn small_arrow(heading: Heading) -> char {
    match heading {
        Heading::East => '▸',
        Heading::North => '▴',
        Heading::West => '◂',
        Heading::South => '▾',
    }
}

/// Returns the character of a mark: squares for hits, crosses for misses, rings for cells not yet
/// sensed; filled or thick where there is a robot.
#[must_use]
pub fn mark(mark: Mark) -> char {
    match mark {
        Mark::HitOccupied => '■',
        Mark::HitEmpty => '□',
        Mark::MissOccupied => '✘',
        Mark::MissEmpty => '×',
        Mark::ExpectsOccupied => '●',
        Mark::ExpectsEmpty => '○',
    }
}

/// Draws part of a scene as lines of text, from north to south.
#[must_use]
pub fn lines(scene: &Scene, x: Range<u16>, y: Range<u16>, paints: Paints) -> Vec<Line<'static>> {
    let width = usize::from(scene.width);
    let at = |x: u16, y: u16| usize::from(y) * width + usize::from(x);
    let nothing = [(' ', Style::new()), (EMPTY, soft())];
    let mut cells = vec![nothing; width * usize::from(scene.height)];
    for &[x, y] in &scene.area {
        cells[at(x, y)][0] = (AREA, paints.area());
    }
    for (index, &drawn) in scene.robots.iter().enumerate() {
        let cell = &mut cells[at(drawn.x, drawn.y)];
        let mut style = paints.ink(drawn.ink);
        if scene.picked == Some(index) {
            // Uses the terminal's own colours: a coloured background would hide the arrow.
            style = Style::new().bold().reversed();
            cell[0] = (' ', style);
        }
        if drawn.ink == Ink::Surprise(3) {
            cell[0] = (MOST_SURPRISED, style);
        }
        cell[1] = (robot(drawn), style);
    }
    for marked in &scene.marks {
        cells[at(marked.x, marked.y)][0] = (mark(marked.mark), paints.mark(marked.mark));
    }
    let rows = y.rev().map(|y| {
        let row = &cells[at(x.start, y)..at(x.end, y)];
        let drawn = row.iter().flatten();
        Line::from_iter(drawn.map(|&(drawn, style)| Span::styled(drawn.to_string(), style)))
    });
    rows.collect()
}
