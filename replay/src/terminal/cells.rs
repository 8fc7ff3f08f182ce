//! A scene as characters, two to a cell: on the left what is marked there, on the right the robot.

use super::paints::{Paints, soft};
use crate::palette::is_hollow;
use crate::scene::{Ink, Mark, Robot, Scene};
use minimal_surprise_sim::Heading;
use minimal_surprise_sim::drawing::{EMPTY, arrow, hollow_arrow};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use std::ops::Range;

/// Columns of a cell.
pub const COLUMNS: u16 = 2;

/// What the area that was damaged is shaded with.
pub const AREA: char = '░';

/// Beside a robot that is more surprised than its arrow can say.
pub const MOST_SURPRISED: char = '!';

/// The arrow of a robot. A robot of another structure than the named one is small, one of none
/// hollow; the more surprised, the larger.
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

/// Squares are hits, crosses misses, rings are yet to be sensed; filled or thick where there is a
/// robot.
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

/// A part of a scene as lines, the northernmost first.
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
            // In the terminal's own colours: a hue behind the arrow would hide it.
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
