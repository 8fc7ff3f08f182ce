//! The world of one repetition: robots as words, the board as bits.
//!
//! The prediction network never affects the world, so a swarm runs with only action tables and
//! records each robot's inputs; predictions are computed from the recorded inputs.

use super::actions::ActionTable;
use super::board::Board;
use super::path::EnginePath;
use super::robot_word::{self, ACTION, ROBOTS_AT_ONCE};
use super::window::{ACTION_BIT, AHEAD_BIT, WindowOrder};
#[cfg(target_arch = "x86_64")]
use super::x86;
use crate::torus::{Grid, Pose};
use minimal_surprise_controller::Controller;

/// The behaviour of a genome, shared by all swarms of an evaluation.
pub(super) struct Behaviour<'a> {
    pub(super) controller: &'a Controller,
    pub(super) order: &'a WindowOrder,
    pub(super) actions: &'a mut ActionTable,
}

/// A swarm on its torus.
#[derive(Clone, Debug, Default)]
pub(super) struct Swarm {
    robots: usize,
    words: Vec<u32>,
    board: Board,
    /// Robots that go straight and have an empty cell ahead, in index order.
    movers: Vec<u32>,
}

impl Swarm {
    /// Places the robots at their starting poses.
    pub(super) fn reset(&mut self, grid: Grid, starts: &[Pose]) {
        self.robots = starts.len();
        self.board.reset(grid);
        self.words.clear();
        self.words
            .extend(starts.iter().map(|&pose| robot_word::from_pose(pose)));
        for &word in &self.words {
            self.board.place(word);
        }
        let padded = self.robots.next_multiple_of(ROBOTS_AT_ONCE);
        self.words.resize(padded, 0);
        self.movers.clear();
        self.movers.resize(padded + ROBOTS_AT_ONCE, 0);
    }

    /// Returns everything that determines the swarm's future, except noise.
    pub(super) fn state(&self) -> &[u32] {
        &self.words[..self.robots]
    }

    /// Runs one step. `flips` are the robots' flipped bits in window order; `inputs` receives the
    /// windows for their prediction networks, with the action just chosen.
    pub(super) fn step(
        &mut self,
        path: EnginePath,
        behaviour: &mut Behaviour<'_>,
        flips: Option<&[u16]>,
        inputs: &mut [u16],
    ) {
        let movers = match path {
            #[cfg(target_arch = "x86_64")]
            EnginePath::Avx512(cpu) => {
                if !self.board.is_narrow() {
                    self.board.close_edges();
                }
                cpu.sense_and_decide(x86::Sensing {
                    board: &self.board,
                    robots: self.robots,
                    words: &mut self.words,
                    entries: behaviour.actions.entries(),
                    sensors: behaviour.order.sensors(),
                    flips,
                    inputs,
                    movers: &mut self.movers,
                })
            }
            _ => {
                self.board.close_edges();
                self.sense_and_decide(behaviour, flips, inputs)
            }
        };
        self.board.advance(&self.movers[..movers], &mut self.words);
    }

    /// Applies all turns and lists the robots that may move; returns the length of the list.
    fn sense_and_decide(
        &mut self,
        behaviour: &mut Behaviour<'_>,
        flips: Option<&[u16]>,
        inputs: &mut [u16],
    ) -> usize {
        let sensors = behaviour.order.sensors();
        let mut movers = 0;
        for (robot, (word, input)) in self.words[..self.robots].iter_mut().zip(inputs).enumerate() {
            let occupied = self.board.window(*word);
            let reading = (occupied ^ flips.map_or(0, |flips| flips[robot])) & sensors;
            let last_action = (*word >> ENTRY_TO_WINDOW) as u16 & ACTION_BIT;
            let entry =
                behaviour
                    .actions
                    .get(reading | last_action, behaviour.order, behaviour.controller);
            *word = word.wrapping_add(entry) & !ACTION | entry & ACTION;
            *input = reading | (entry >> ENTRY_TO_WINDOW) as u16 & ACTION_BIT;
            self.movers[movers] = robot as u32;
            movers += usize::from(entry & ACTION == 0 && occupied & AHEAD_BIT == 0);
        }
        movers
    }
}

/// Shift from the action bit of a robot word to the action bit of a window.
const ENTRY_TO_WINDOW: u32 = ACTION.trailing_zeros() - ACTION_BIT.trailing_zeros();
