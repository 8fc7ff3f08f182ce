//! Pictures of one swarm, or two side by side: every robot is drawn as an arrow in its cell; marked
//! cells are drawn too.

use super::drawing::{Anchor, Drawing, Size, Stroke, line};
use super::legend::Legend;
use super::style::{PictureError, Style, named};
use super::symbols::{area_stroke, arrow, set_off, square};
use super::{symbols, words};
use crate::recording::Recording;
use crate::scene::{Colouring, Ink, Scene};
use minimal_surprise_sim::damage::Damage;
use svg::node::element::path::Data;

/// A swarm in a picture.
struct Panel {
    scene: Scene,
    left: Caption,
    right: Caption,
}

/// Text above a swarm.
struct Caption {
    words: String,
    /// The longest text during the run, which determines the reserved space.
    longest: String,
}

impl Caption {
    fn unchanging(words: String) -> Self {
        Self {
            longest: words.clone(),
            words,
        }
    }

    fn of_members(recording: &Recording, members: usize) -> Self {
        let robots = recording.robots();
        match recording.name() {
            None => Self::unchanging(named(recording)),
            Some(name) => Self {
                words: format!("{name}: {members} of {robots} robots"),
                longest: format!("{name}: {robots} of {robots} robots"),
            },
        }
    }

    fn width(&self, size: Size) -> f64 {
        let of = |text: &str| words::width(text, size.words());
        of(&self.words).max(of(&self.longest))
    }
}

/// Draws state `t`.
pub(super) fn state(
    recording: &Recording,
    t: usize,
    style: &Style,
) -> Result<Drawing, PictureError> {
    let scene = scene(recording, t, style)?;
    let legend = Legend::of([&scene], style.colouring, recording);
    of_state(recording, t, style, scene, &legend)
}

/// Draws state `t` as a frame: all frames have the same legend and size.
pub(super) fn frame(
    recording: &Recording,
    t: usize,
    style: &Style,
) -> Result<Drawing, PictureError> {
    let scene = scene(recording, t, style)?;
    let legend = Legend::whole(recording, style);
    of_state(recording, t, style, scene, &legend)
}

fn of_state(
    recording: &Recording,
    t: usize,
    style: &Style,
    scene: Scene,
    legend: &Legend,
) -> Result<Drawing, PictureError> {
    let steps = recording.steps();
    let panel = Panel {
        scene,
        left: Caption::of_members(recording, recording.in_structure(t)),
        right: Caption {
            words: format!("step {t} of {steps}"),
            longest: format!("step {steps} of {steps}"),
        },
    };
    let title = format!("{}, {}", panel.left.words, panel.right.words);
    panels(&title, &[panel], legend, style)
}

/// Draws the swarm before the damage, and state `t` after it.
pub(super) fn damage(
    recording: &Recording,
    t: usize,
    style: &Style,
) -> Result<Drawing, PictureError> {
    let damaged = recording
        .origin
        .damage
        .as_ref()
        .ok_or(PictureError::NoDamage)?;
    let scenes = [
        Scene::before_damage(recording, &damaged.before, style.colouring),
        scene(recording, t, style)?,
    ];
    let legend = Legend::of(&scenes, style.colouring, recording);
    let [before, after] = scenes;
    let what = match damaged.damage {
        Damage::Remove(_) => "removal",
        Damage::Reposition(_) => "repositioning",
    };
    let panels = [
        (before, format!("before the {what}")),
        (after, format!("{t} steps after")),
    ];
    let panels = panels.map(|(scene, when)| {
        let members = scene.robots.iter().filter(|robot| robot.ink == Ink::Named);
        let (members, robots) = (members.count(), scene.robots.len());
        let count = match (style.colouring, recording.name()) {
            (Colouring::Structure, Some(name)) => format!("{name} {members} of {robots}"),
            _ => format!("{robots} robots"),
        };
        Panel {
            scene,
            left: Caption::unchanging(when),
            right: Caption::unchanging(count),
        }
    });
    let title = format!("{}; {}", panels[0].left.words, panels[1].left.words);
    self::panels(&title, &panels, &legend, style)
}

fn scene(recording: &Recording, t: usize, style: &Style) -> Result<Scene, PictureError> {
    let robots = recording.robots();
    if let Some(asked) = style.robot.filter(|&robot| robot >= robots) {
        return Err(PictureError::NoRobot {
            asked,
            last: robots.saturating_sub(1),
        });
    }
    if recording.controller.is_none()
        && (style.robot.is_some() || style.colouring == Colouring::Surprise)
    {
        return Err(PictureError::NoController);
    }
    Ok(Scene::of(recording, t, style.colouring, style.robot))
}

/// Returns the width of a panel and the side of a cell. On a screen, the cells determine the size
/// of the picture; on paper, the width of the picture determines the size of the cells.
fn layout(
    panels: &[Panel],
    legend: &Legend,
    size: Size,
    gap: f64,
) -> Result<(f64, f64), PictureError> {
    let count = panels.len() as f64;
    let (columns, rows) = cells(panels);
    let captions = panels.iter().flat_map(|panel| [&panel.left, &panel.right]);
    let widest = captions.map(|caption| caption.width(size));
    let widest = widest.fold(0.0, f64::max);
    match size {
        Size::Paper(width) => {
            let between = gap * (count - 1.0);
            // Text may extend into the gap between panels.
            let captions = count * widest + between / 2.0;
            let needed = captions.max(legend.widest(size)) + 2.0 * size.margin();
            if needed > width {
                let needed = needed.ceil() as u32;
                return Err(PictureError::TooNarrow { needed });
            }
            let panel = (width - 2.0 * size.margin() - between) / count;
            Ok((panel, panel / columns.max(rows)))
        }
        Size::Screen(side) => {
            let side = f64::from(side);
            let words = widest.max(legend.widest(size));
            // One more pixel, for the last grid line.
            Ok((size.whole((columns * side + 1.0).max(words)), side))
        }
    }
}

/// Returns the columns of the widest panel and the rows of the tallest.
fn cells(panels: &[Panel]) -> (f64, f64) {
    let most = |of: fn(&Scene) -> u16| {
        let sides = panels.iter().map(|panel| f64::from(of(&panel.scene)));
        sides.fold(1.0, f64::max)
    };
    (most(|scene| scene.width), most(|scene| scene.height))
}

fn panels(
    title: &str,
    panels: &[Panel],
    legend: &Legend,
    style: &Style,
) -> Result<Drawing, PictureError> {
    let size = style.size;
    let (words, margin) = (size.words(), size.margin());
    let gap = size.whole(1.5 * words);
    let count = panels.len() as f64;
    let (panel, side) = layout(panels, legend, size, gap)?;
    let (columns, rows) = cells(panels);
    let width = panel * count + gap * (count - 1.0) + 2.0 * margin;
    let line_height = size.whole(1.5 * words);
    let one_line = panels
        .iter()
        .all(|of| of.left.width(size) + of.right.width(size) + 1.5 * words <= panel);
    let header = margin + line_height * if one_line { 1.0 } else { 2.0 };
    // A one-pixel line is sharp at the middle of a pixel.
    let half = match size {
        Size::Paper(_) => 0.0,
        Size::Screen(_) => 0.5,
    };
    let mut drawing = Drawing::new(size, style.theme, title);
    for (index, of) in panels.iter().enumerate() {
        let west = margin + (panel + gap) * index as f64;
        let first = margin + line_height * 0.4;
        drawing.words(
            &of.left.words,
            Anchor::Start,
            (west, first),
            style.theme.text,
        );
        let (anchor, at) = if one_line {
            (Anchor::End, (west + panel, first))
        } else {
            (Anchor::Start, (west, first + line_height))
        };
        drawing.words(&of.right.words, anchor, at, style.theme.soft);
        let inside = panel - columns * side;
        let corner = (west + size.floor(inside / 2.0) + half, header + half);
        swarm(&mut drawing, &of.scene, corner, side);
    }
    let below = header + size.whole(rows * side) + 1.1 * words;
    let last = legend.draw(&mut drawing, (margin, below), width - 2.0 * margin);
    drawing.set_size(width, size.whole(last + margin));
    Ok(drawing)
}

/// Draws a swarm; the north-west corner of its grid is at (`west`, `north`).
pub(super) fn swarm(drawing: &mut Drawing, scene: &Scene, (west, north): (f64, f64), side: f64) {
    let theme = drawing.theme;
    let hair = drawing.size.hair();
    let (width, height) = (f64::from(scene.width), f64::from(scene.height));
    let (east, south) = (west + width * side, north + height * side);
    drawing.area((west, north), (east - west, south - north), theme.cell);
    // Grid rows are counted from the south, picture rows from the north.
    let corner = |x: u16, y: u16| {
        (
            west + f64::from(x) * side,
            south - (f64::from(y) + 1.0) * side,
        )
    };
    let mut grid = Data::new();
    let upright = (0..=scene.width).map(|x| {
        let x = west + f64::from(x) * side;
        [(x, north), (x, south)]
    });
    let level = (0..=scene.height).map(|y| {
        let y = north + f64::from(y) * side;
        [(west, y), (east, y)]
    });
    for ends in upright.chain(level) {
        for command in line(&ends).iter() {
            grid.append(command.clone());
        }
    }
    let thin = Stroke {
        colour: theme.line,
        width: hair,
    };
    drawing.stroked(grid, thin);
    for mark in &scene.marks {
        symbols::mark(drawing, mark.mark, corner(mark.x, mark.y), side);
    }
    for robot in &scene.robots {
        let at = corner(robot.x, robot.y);
        if scene
            .marks
            .iter()
            .any(|mark| (mark.x, mark.y) == (robot.x, robot.y))
        {
            set_off(drawing, at, side, robot.heading);
        }
        arrow(drawing, at, side, robot.heading, robot.ink);
    }
    if let Some(robot) = scene.picked.and_then(|robot| scene.robots.get(robot)) {
        let frame = square(corner(robot.x, robot.y), side, 0.0);
        let stroke = Stroke {
            colour: theme.text,
            width: (0.09 * side).max(1.5 * hair),
        };
        drawing.stroked(frame, stroke);
    }
    area(drawing, scene, corner, side);
}

/// Draws the outline of the damaged cells, which is open where the area continues across the edge.
fn area(drawing: &mut Drawing, scene: &Scene, corner: impl Fn(u16, u16) -> (f64, f64), side: f64) {
    let is_inside = |x: u16, y: u16| scene.area.contains(&[x % scene.width, y % scene.height]);
    let mut outline = Data::new();
    for &[x, y] in &scene.area {
        let (west, north) = corner(x, y);
        let (east, south) = (west + side, north + side);
        let sides = [
            (is_inside(x + 1, y), [(east, north), (east, south)]),
            (is_inside(x, y + 1), [(west, north), (east, north)]),
            (
                is_inside(x + scene.width - 1, y),
                [(west, north), (west, south)],
            ),
            (
                is_inside(x, y + scene.height - 1),
                [(west, south), (east, south)],
            ),
        ];
        for (_, ends) in sides.iter().filter(|(goes_on, _)| !goes_on) {
            for command in line(ends).iter() {
                outline.append(command.clone());
            }
        }
    }
    if !scene.area.is_empty() {
        let stroke = area_stroke(drawing, side);
        drawing.stroked(outline, stroke);
    }
}
