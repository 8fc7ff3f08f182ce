//! One state of a run, ready to draw: positions and inks of the robots, and marked cells. Back ends
//! draw scenes without any other access to the run. The page's script repeats the rules of this
//! file; a test compares the two.

use super::recording::Recording;
use minimal_surprise_controller::SensorBits;
use minimal_surprise_sim::structures::classify;
use minimal_surprise_sim::{Grid, Pose, Structure};
use serde::Serialize;

/// Meaning of the robots' colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Colouring {
    /// Membership in the run's dominant structure, a different one, or none.
    #[default]
    Structure,
    /// Share of mispredicted sensors.
    Surprise,
    /// None: all robots have the same colour.
    Plain,
}

/// A state to draw.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// Cells per row.
    pub width: u16,
    /// Rows.
    pub height: u16,
    /// The robots, in index order.
    pub robots: Vec<Robot>,
    /// Marked cells: the sensor cells of the selected robot.
    pub marks: Vec<MarkedCell>,
    /// Cells of the damaged area.
    pub area: Vec<[u16; 2]>,
    /// The selected robot.
    pub picked: Option<usize>,
}

/// A robot, drawn as an arrow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Robot {
    /// Number of cells from the west edge.
    pub x: u16,
    /// Number of cells from the south edge.
    pub y: u16,
    /// Heading: 0 east, 1 north, 2 west, 3 south.
    pub heading: u8,
    /// Colour and shape.
    pub ink: Ink,
}

/// Meaning of a robot's colour and shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ink {
    /// No meaning.
    Plain,
    /// The robot belongs to the run's dominant structure.
    Named,
    /// The robot belongs to a different structure.
    Other,
    /// The robot belongs to no structure: drawn hollow.
    Outside,
    /// The robot mispredicted none (0), up to 1/8 (1), up to 1/4 (2) or more (3) of its sensors.
    Surprise(u8),
}

/// A marked cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MarkedCell {
    /// Number of cells from the west edge.
    pub x: u16,
    /// Number of cells from the south edge.
    pub y: u16,
    /// The reading and prediction for this cell.
    pub mark: Mark,
}

/// A robot's reading and prediction for a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mark {
    /// Occupied, as predicted.
    HitOccupied,
    /// Empty, as predicted.
    HitEmpty,
    /// Occupied, but predicted to be empty.
    MissOccupied,
    /// Empty, but predicted to be occupied.
    MissEmpty,
    /// Predicted to be occupied; the run ends before the robot senses the cell.
    ExpectsOccupied,
    /// Predicted to be empty; the run ends before the robot senses the cell.
    ExpectsEmpty,
}

impl Scene {
    /// Creates the scene of state `t` of a recording.
    #[must_use]
    pub fn of(
        recording: &Recording,
        t: usize,
        colouring: Colouring,
        picked: Option<usize>,
    ) -> Self {
        let grid = recording.grid;
        let picked = picked.filter(|&robot| robot < recording.robots());
        let robots = recording.poses(t).iter().enumerate();
        let robots =
            robots.map(|(robot, &pose)| robot_at(pose, ink(recording, t, robot, colouring)));
        let area = recording.damaged_area().map_or_else(Vec::new, |area| {
            let cells = (0..grid.height()).flat_map(|y| (0..grid.width()).map(move |x| [x, y]));
            cells.filter(|&[x, y]| area.contains(x, y)).collect()
        });
        Self {
            width: grid.width(),
            height: grid.height(),
            robots: robots.collect(),
            marks: picked.map_or_else(Vec::new, |robot| marks(recording, t, robot)),
            area,
            picked,
        }
    }

    /// Creates the scene of a swarm with known poses only. Its robots are coloured by membership in
    /// `structure`, a different structure, or none.
    #[must_use]
    pub fn of_swarm(grid: Grid, poses: &[Pose], structure: Option<Structure>) -> Self {
        let members = classify(grid, poses).map(|found| found.memberships());
        let members = members.unwrap_or_default();
        let robots = poses.iter().enumerate().map(|(robot, &pose)| {
            let ink = members.get(robot).map_or(Ink::Plain, |members| {
                ink_of_member(|s| members.contains(s), structure)
            });
            robot_at(pose, ink)
        });
        Self {
            width: grid.width(),
            height: grid.height(),
            robots: robots.collect(),
            marks: Vec::new(),
            area: Vec::new(),
            picked: None,
        }
    }

    /// Creates the scene of the swarm before the damage. Its robots are coloured by structure or not
    /// at all.
    #[must_use]
    pub fn before_damage(recording: &Recording, poses: &[Pose], colouring: Colouring) -> Self {
        let mut scene = Self::of_swarm(recording.grid, poses, recording.name());
        scene.area = Self::of(recording, 0, Colouring::Plain, None).area;
        if colouring != Colouring::Structure {
            for robot in &mut scene.robots {
                robot.ink = Ink::Plain;
            }
        }
        scene
    }
}

fn robot_at(pose: Pose, ink: Ink) -> Robot {
    Robot {
        x: pose.x,
        y: pose.y,
        heading: pose.heading as u8,
        ink,
    }
}

fn ink(recording: &Recording, t: usize, robot: usize, colouring: Colouring) -> Ink {
    match colouring {
        Colouring::Plain => Ink::Plain,
        Colouring::Structure => {
            ink_of_member(|s| recording.is_member(t, robot, s), recording.name())
        }
        Colouring::Surprise => surprise(recording, t, robot).map_or(Ink::Plain, Ink::Surprise),
    }
}

fn ink_of_member(is_member: impl Fn(Structure) -> bool, name: Option<Structure>) -> Ink {
    if name.is_some_and(&is_member) {
        Ink::Named
    } else if Structure::ALL.into_iter().any(is_member) {
        Ink::Other
    } else {
        Ink::Outside
    }
}

/// Returns the surprise of a robot in state `t`, in four levels; `None` if the robot sensed
/// nothing.
fn surprise(recording: &Recording, t: usize, robot: usize) -> Option<u8> {
    let sensors = recording.controller.as_ref()?.topology.sensors() as u32;
    let sensed = recording.sensed(t, robot)?;
    let missed = sensed.differing(recording.predicted(t, robot)?);
    Some(match missed {
        0 => 0,
        few if 8 * few <= sensors => 1,
        some if 4 * some <= sensors => 2,
        _ => 3,
    })
}

fn marks(recording: &Recording, t: usize, robot: usize) -> Vec<MarkedCell> {
    let (Some(controller), Some(&pose)) = (&recording.controller, recording.poses(t).get(robot))
    else {
        return Vec::new();
    };
    let sensed = recording.sensed(t, robot);
    let predicted = recording.predicted(t, robot).unwrap_or(SensorBits::NONE);
    let cells = controller.topology.model().cells().iter().enumerate();
    cells
        .map(|(sensor, &cell)| {
            let (dx, dy) = pose.heading.offset(cell);
            let (x, y) = recording.grid.moved(pose.x, pose.y, dx, dy);
            let mark = match (sensed.map(|bits| bits.get(sensor)), predicted.get(sensor)) {
                (Some(true), true) => Mark::HitOccupied,
                (Some(false), false) => Mark::HitEmpty,
                (Some(true), false) => Mark::MissOccupied,
                (Some(false), true) => Mark::MissEmpty,
                (None, true) => Mark::ExpectsOccupied,
                (None, false) => Mark::ExpectsEmpty,
            };
            MarkedCell { x, y, mark }
        })
        .collect()
}
