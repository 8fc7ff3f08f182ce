//! State of the display of a recording, and the keys that change it.

use crate::recording::Recording;
use crate::scene::{Colouring, Scene};
use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::ops::Range;
use std::time::Duration;

/// Available speeds, in steps per second.
pub const SPEEDS: [u32; 8] = [1, 2, 5, 10, 20, 50, 100, 200];

/// Number of steps per jump.
pub const JUMP: usize = 10;

/// Number of cells by which a key scrolls the view.
const SCROLL: i32 = 5;

/// Number of cells around a robot that stay in view: no sensor reaches farther.
const MARGIN: u16 = 3;

/// Playback state of a recording.
#[derive(Clone, Debug)]
pub struct Player<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// The displayed state, 0 to T.
    pub t: usize,
    /// True while the recording is playing.
    pub playing: bool,
    /// True if the swarm before the damage is shown.
    pub before: bool,
    /// Meaning of the robots' colours.
    pub colouring: Colouring,
    /// The selected robot.
    pub picked: Option<usize>,
    speed: usize,
    /// The south-west cell of the view, if the view does not show the whole grid.
    corner: [u16; 2],
    /// True if the view follows the selected robot.
    following: bool,
}

impl<'a> Player<'a> {
    /// Creates a player that is paused at the start.
    #[must_use]
    pub fn new(recording: &'a Recording, colouring: Colouring) -> Self {
        Self {
            recording,
            t: 0,
            playing: false,
            before: false,
            colouring,
            picked: None,
            speed: 3,
            corner: [0, u16::MAX],
            following: false,
        }
    }

    /// Returns the scene to draw.
    #[must_use]
    pub fn scene(&self) -> Scene {
        match &self.recording.origin.damage {
            Some(damage) if self.before => {
                Scene::before_damage(self.recording, &damage.before, self.colouring)
            }
            _ => Scene::of(self.recording, self.t, self.colouring, self.picked),
        }
    }

    /// Returns the speed in steps per second.
    #[must_use]
    pub fn speed(&self) -> u32 {
        SPEEDS[self.speed]
    }

    /// Returns the time from one step to the next; `None` while paused.
    #[must_use]
    pub fn pause(&self) -> Option<Duration> {
        self.playing.then(|| Duration::from_secs(1) / self.speed())
    }

    /// Advances by one step, and pauses at the last state.
    pub fn go_on(&mut self) {
        self.t = (self.t + 1).min(self.recording.steps());
        self.playing = self.t < self.recording.steps();
    }

    /// Handles a key; returns true if the player should quit.
    pub fn key(&mut self, key: KeyEvent) -> bool {
        if key.kind == KeyEventKind::Release {
            return false;
        }
        let steps = self.recording.steps();
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return true,
            KeyCode::Char('q') => return true,
            KeyCode::Char(' ') => {
                if !self.playing && self.t == steps {
                    self.t = 0;
                }
                self.playing = !self.playing;
                self.before = false;
            }
            KeyCode::Right => self.seek(self.t + 1),
            KeyCode::Left => self.seek(self.t.saturating_sub(1)),
            KeyCode::PageDown | KeyCode::Down => self.seek(self.t + JUMP),
            KeyCode::PageUp | KeyCode::Up => self.seek(self.t.saturating_sub(JUMP)),
            KeyCode::Home => self.seek(0),
            KeyCode::End => self.seek(steps),
            KeyCode::Char(digit @ '0'..='9') => {
                self.seek(steps * (digit as usize - '0' as usize) / 10);
            }
            KeyCode::Char('+' | '=') => self.speed = (self.speed + 1).min(SPEEDS.len() - 1),
            KeyCode::Char('-') => self.speed = self.speed.saturating_sub(1),
            KeyCode::Char('n') | KeyCode::Tab => self.pick(1),
            KeyCode::Char('p') | KeyCode::BackTab => self.pick(-1),
            KeyCode::Esc => self.picked = None,
            KeyCode::Char('c') => self.colouring = self.next_colouring(),
            KeyCode::Char('b') if self.recording.origin.damage.is_some() => {
                self.before = !self.before;
                self.playing = false;
            }
            KeyCode::Char('h') => self.scroll(-SCROLL, 0),
            KeyCode::Char('j') => self.scroll(0, -SCROLL),
            KeyCode::Char('k') => self.scroll(0, SCROLL),
            KeyCode::Char('l') => self.scroll(SCROLL, 0),
            _ => {}
        }
        false
    }

    fn seek(&mut self, t: usize) {
        self.t = t.min(self.recording.steps());
        self.playing = false;
        self.before = false;
    }

    /// Selects the next or previous robot; if none is selected, the first or last.
    fn pick(&mut self, by: i64) {
        let robots = self.recording.robots() as i64;
        let from = self.picked.map_or(by.min(0), |robot| robot as i64 + by);
        self.picked = from.checked_rem_euclid(robots).map(|robot| robot as usize);
        self.following = true;
    }

    /// Returns the next colouring; surprise is skipped for trajectories.
    fn next_colouring(&self) -> Colouring {
        match self.colouring {
            Colouring::Structure if self.recording.controller.is_some() => Colouring::Surprise,
            Colouring::Structure | Colouring::Surprise => Colouring::Plain,
            Colouring::Plain => Colouring::Structure,
        }
    }

    fn scroll(&mut self, east: i32, north: i32) {
        let on = |from: u16, by: i32| (i32::from(from) + by).clamp(0, u16::MAX.into()) as u16;
        self.corner = [on(self.corner[0], east), on(self.corner[1], north)];
        self.following = false;
    }

    /// Returns the columns and rows of cells in a view of this size, including a followed robot.
    pub fn view(&mut self, columns: u16, rows: u16) -> [Range<u16>; 2] {
        let grid = self.recording.grid;
        let poses = self.recording.poses(self.t);
        let followed = self.picked.filter(|_| self.following);
        let followed = followed.and_then(|robot| poses.get(robot));
        let axes = [
            (0, columns, grid.width(), followed.map(|pose| pose.x)),
            (1, rows, grid.height(), followed.map(|pose| pose.y)),
        ];
        axes.map(|(axis, room, cells, robot)| {
            let shown = room.min(cells);
            let mut from = self.corner[axis].min(cells - shown);
            if let Some(robot) = robot {
                let margin = MARGIN.min(shown.saturating_sub(1) / 2);
                let most = robot.saturating_sub(margin);
                let least = (robot + margin + 1).saturating_sub(shown);
                from = from.min(most).max(least).min(cells - shown);
            }
            self.corner[axis] = from;
            from..from + shown
        })
    }
}
