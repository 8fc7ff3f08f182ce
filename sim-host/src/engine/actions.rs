//! Table of actions: the action network is a function of the window, so all robots and repetitions
//! of a genome share one table.

use super::path::EnginePath;
use super::robot_word::{ENTRY_SHIFT, Entry, to_entry};
use super::window::{WINDOWS, WindowOrder};
use minimal_surprise_controller::Controller;

/// An entry that is not computed yet.
const NOT_ASKED: Entry = 1;

/// The actions of one action network, each computed on first use or all at once.
#[derive(Clone, Debug)]
pub(super) struct ActionTable {
    /// One entry per window, plus three bytes so that each entry can be read as part of a word.
    entries: Vec<Entry>,
}

impl ActionTable {
    pub(super) fn new() -> Self {
        Self {
            entries: vec![NOT_ASKED; WINDOWS + 3],
        }
    }

    /// Prepares the table for a new genome. On AVX-512, all entries are computed at once; on other
    /// paths, each on first use, because only a few are used.
    pub(super) fn prepare(
        &mut self,
        path: EnginePath,
        controller: &Controller,
        order: &WindowOrder,
    ) {
        match path {
            #[cfg(target_arch = "x86_64")]
            EnginePath::Avx512(cpu) => cpu.fill_action_table(controller, order, &mut self.entries),
            _ => self.entries.fill(NOT_ASKED),
        }
    }

    /// Returns all entries, plus three bytes.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Returns the entry of a window; computes it with the controller if missing.
    #[inline]
    pub(super) fn get(&mut self, window: u16, order: &WindowOrder, controller: &Controller) -> u32 {
        let entry = &mut self.entries[usize::from(window)];
        if *entry == NOT_ASKED {
            let (reading, last_action) = order.reading(window);
            let (action, turn) = controller.decide(reading, last_action);
            *entry = to_entry(action, turn);
        }
        u32::from(*entry) << ENTRY_SHIFT
    }
}

#[cfg(test)]
mod tests {
    use super::super::window::ACTION_BIT;
    use super::*;
    use crate::seed::{Purpose, SeedTree};
    use minimal_surprise_controller::{Genome, Topology};
    use rand_core::Rng as _;

    #[test]
    fn all_windows_of_random_genomes_have_the_actions_of_the_controller() {
        for (seed, topology) in (0..).zip(Topology::ALL) {
            let mut rng = SeedTree::new(seed).stream(Purpose::InitialGenome, 0, 0);
            let weights: Vec<i16> = (0..topology.weights())
                .map(|_| ((rng.next_u32() as i16) >> (3 * (seed % 3))).max(-32767))
                .collect();
            let controller = Controller::new(&Genome::from_weights(topology, &weights).unwrap());
            let order = WindowOrder::new(topology.model());
            for path in EnginePath::available() {
                let mut table = ActionTable::new();
                table.prepare(path, &controller, &order);
                for window in 0..WINDOWS as u16 {
                    let (reading, last_action) = order.reading(window);
                    let (action, turn) = controller.decide(reading, last_action);
                    assert_eq!(
                        table.get(
                            order.window(reading.bits()) | window & ACTION_BIT,
                            &order,
                            &controller
                        ) >> ENTRY_SHIFT,
                        u32::from(to_entry(action, turn)),
                        "seed {seed}, {topology:?}, window {window:015b}, path {}",
                        path.name()
                    );
                }
            }
        }
    }
}
