//! Noise, drawn once for all genomes of a generation: the flipped bits depend only on trial, step
//! and robot.

use super::window::WindowOrder;
use crate::noise::NoiseStream;
use minimal_surprise_controller::SensorBits;

/// Source of a swarm's flipped bits, in window order.
pub(super) enum FlipSource<'a> {
    /// No noise.
    None,
    /// One row per step, already drawn.
    Known(&'a [u16]),
    /// Too many flips to store; they are drawn on demand.
    Drawn(Box<Drawer<'a>>),
}

impl FlipSource<'_> {
    /// Returns the flipped bits of all robots in one step; `None` without noise.
    pub(super) fn row(&mut self, step: usize, robots: usize) -> Option<&[u16]> {
        match self {
            Self::None => None,
            Self::Known(flips) => Some(&flips[step * robots..][..robots]),
            Self::Drawn(drawer) => Some(drawer.draw(step, robots)),
        }
    }
}

/// Generator of flipped bits, step by step.
pub(super) struct Drawer<'a> {
    noise: NoiseStream,
    order: &'a WindowOrder,
    readings: Vec<SensorBits>,
    row: Vec<u16>,
}

impl<'a> Drawer<'a> {
    pub(super) fn new(noise: &NoiseStream, order: &'a WindowOrder) -> Self {
        Self {
            noise: noise.clone(),
            order,
            readings: Vec::new(),
            row: Vec::new(),
        }
    }

    fn draw(&mut self, step: usize, robots: usize) -> &[u16] {
        self.readings.clear();
        self.readings.resize(robots, SensorBits::NONE);
        let sensors = self.order.model().mask();
        self.noise.flip(step as u32, sensors, &mut self.readings);
        self.row.clear();
        let order = self.order;
        self.row
            .extend(self.readings.iter().map(|flips| order.window(flips.bits())));
        &self.row
    }

    /// Draws the rows of all steps.
    pub(super) fn draw_all(mut self, steps: usize, robots: usize) -> Vec<u16> {
        let mut rows = Vec::with_capacity(steps * robots);
        for step in 0..steps {
            rows.extend_from_slice(self.draw(step, robots));
        }
        rows
    }
}
