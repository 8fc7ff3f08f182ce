//! Symbols for robots and marks, each in a cell given by its north-west corner and side.

use super::drawing::{Drawing, Stroke, line, polygon};
use crate::palette::{ARROW, is_hollow};
use crate::scene::{Ink, Mark};
use std::f64::consts::TAU;
use svg::node::element::path::Data;

/// Draws a robot.
pub(super) fn arrow(drawing: &mut Drawing, corner: (f64, f64), side: f64, heading: u8, ink: Ink) {
    let outline = outline(corner, side, heading);
    let colour = drawing.theme.ink(ink);
    if is_hollow(ink) {
        let stroke = Stroke {
            colour,
            width: (0.07 * side).max(drawing.size.hair()),
        };
        drawing.stroked(outline, stroke);
    } else {
        drawing.filled(outline, colour);
    }
}

/// Draws a border that separates a robot from a mark under it, which may have the same colour.
pub(super) fn set_off(drawing: &mut Drawing, corner: (f64, f64), side: f64, heading: u8) {
    let outline = outline(corner, side, heading);
    let colour = drawing.theme.cell;
    drawing.filled(outline.clone(), colour);
    let stroke = Stroke {
        colour,
        width: 0.22 * side,
    };
    drawing.stroked(outline, stroke);
}

fn outline((west, north): (f64, f64), side: f64, heading: u8) -> Data {
    polygon(&ARROW.map(|[x, y]| {
        let (ahead, right) = (x - 0.5, y - 0.5);
        let (x, y) = match heading {
            0 => (ahead, right),
            1 => (right, -ahead),
            2 => (-ahead, -right),
            _ => (-right, ahead),
        };
        (west + (x + 0.5) * side, north + (y + 0.5) * side)
    }))
}

/// Draws a mark. Marks lie under the robots so that headings stay visible.
pub(super) fn mark(drawing: &mut Drawing, mark: Mark, (west, north): (f64, f64), side: f64) {
    let colour = drawing.theme.mark(mark);
    let stroke = |share: f64| Stroke {
        colour,
        width: share * side,
    };
    let square = |inset: f64| square((west, north), side, inset);
    match mark {
        Mark::HitOccupied => {
            drawing.tinted(square(0.06), colour);
            drawing.stroked(square(0.08), stroke(0.1));
        }
        Mark::HitEmpty => drawing.stroked(square(0.22), stroke(0.07)),
        Mark::ExpectsOccupied => {
            let ring = ring((west, north), side, 0.44);
            drawing.tinted(ring.clone(), colour);
            drawing.stroked(ring, stroke(0.09));
        }
        Mark::ExpectsEmpty => drawing.stroked(ring((west, north), side, 0.25), stroke(0.06)),
        Mark::MissOccupied => cross(drawing, (west, north), side, stroke(0.16)),
        Mark::MissEmpty => cross(drawing, (west, north), side, stroke(0.08)),
    }
}

/// Draws a cross to the corners of a cell, which the robot's arrow does not cover.
fn cross(drawing: &mut Drawing, (west, north): (f64, f64), side: f64, stroke: Stroke<'_>) {
    let (near, far) = (0.06 * side, 0.94 * side);
    let mut cross = line(&[(west + near, north + near), (west + far, north + far)]);
    let other = line(&[(west + near, north + far), (west + far, north + near)]);
    for command in other.iter() {
        cross.append(command.clone());
    }
    drawing.stroked(cross, stroke);
}

/// Returns the stroke that outlines the damaged area.
pub(super) fn area_stroke(drawing: &Drawing, side: f64) -> Stroke<'static> {
    Stroke {
        colour: drawing.theme.expects,
        width: (0.12 * side).max(2.0 * drawing.size.hair()),
    }
}

/// Returns a circle, as a polygon that looks round at this size.
fn ring((west, north): (f64, f64), side: f64, radius: f64) -> Data {
    const CORNERS: u32 = 24;
    let corners = (0..CORNERS).map(|corner| {
        let angle = TAU * f64::from(corner) / f64::from(CORNERS);
        (
            west + (0.5 + radius * angle.cos()) * side,
            north + (0.5 + radius * angle.sin()) * side,
        )
    });
    polygon(&corners.collect::<Vec<_>>())
}

/// Returns a square that leaves this share of the cell free on each side.
pub(super) fn square((west, north): (f64, f64), side: f64, inset: f64) -> Data {
    let (near, far) = (inset * side, (1.0 - inset) * side);
    polygon(&[
        (west + near, north + near),
        (west + far, north + near),
        (west + far, north + far),
        (west + near, north + far),
    ])
}
