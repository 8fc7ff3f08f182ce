//! Repeated states: the world is deterministic, so once all robot words equal those of an earlier
//! step, all later states repeat too.
//!
//! States are looked up by hash and then compared in full.

/// All states of a swarm so far.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    hashes: Vec<u32>,
    states: Vec<u32>,
}

impl History {
    pub(super) fn clear(&mut self) {
        self.hashes.clear();
        self.states.clear();
    }

    /// Returns the index of an equal earlier state; if none is found, adds the state.
    pub(super) fn find_or_add(&mut self, state: &[u32]) -> Option<usize> {
        let hash = hash(state);
        for (place, _) in self
            .hashes
            .iter()
            .enumerate()
            .rev()
            .filter(|&(_, &earlier)| earlier == hash)
        {
            if self.states[place * state.len()..][..state.len()] == *state {
                return Some(place);
            }
        }
        self.hashes.push(hash);
        self.states.extend_from_slice(state);
        None
    }
}

/// Computes the hash of a state: a sum in which every robot has a different odd factor, so that it
/// can be computed in any order.
fn hash(state: &[u32]) -> u32 {
    let mut factor = 0x9e37_79b9_u32;
    let mut sum = 0_u32;
    for &word in state {
        sum = sum.wrapping_add((word ^ word >> 15).wrapping_mul(factor));
        factor = factor.wrapping_add(0x6c07_8966);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_equal_states_are_found() {
        let mut history = History::default();
        assert_eq!(history.find_or_add(&[1, 2, 3]), None);
        assert_eq!(history.find_or_add(&[3, 2, 1]), None);
        assert_eq!(history.find_or_add(&[1, 2, 4]), None);
        assert_eq!(history.find_or_add(&[3, 2, 1]), Some(1));
        history.clear();
        assert_eq!(history.find_or_add(&[3, 2, 1]), None);
    }

    #[test]
    fn states_with_equal_hashes_are_distinguished() {
        let mut history = History::default();
        history.find_or_add(&[7, 8]);
        history.hashes[0] = hash(&[9, 9]);
        assert_eq!(history.find_or_add(&[9, 9]), None);
    }
}
