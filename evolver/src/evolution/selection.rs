//! Fitness-proportionate selection on integers.

use minimal_surprise_sim::seed::{Stream, uniform_below};

/// A wheel with a sector a slot, as wide as the slot's matches; all equal if there is none.
#[derive(Clone, Debug)]
pub struct Roulette {
    /// Where each sector ends.
    ends: Vec<u64>,
}

impl Roulette {
    /// A wheel for these numbers of matches.
    ///
    /// # Panics
    /// If their sum does not fit 64 bits.
    #[must_use]
    pub fn new(matches: &[u64]) -> Self {
        let uniform = matches.iter().all(|&count| count == 0);
        let mut end = 0_u64;
        let ends = matches
            .iter()
            .map(|&count| {
                let width = if uniform { 1 } else { count };
                end = end
                    .checked_add(width)
                    .expect("the sum of all matches fits 64 bits");
                end
            })
            .collect();
        Self { ends }
    }

    /// Draws a slot.
    #[must_use]
    pub fn draw(&self, rng: &mut Stream) -> usize {
        let total = self.ends.last().copied().unwrap_or(0);
        let at = uniform_below(rng, total);
        self.ends.partition_point(|&end| end <= at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_sim::{Purpose, SeedTree};

    fn shares(matches: &[u64]) -> Vec<f64> {
        let mut rng = SeedTree::new(3).stream(Purpose::Selection, 0, 0);
        let wheel = Roulette::new(matches);
        let mut drawn = vec![0_u32; matches.len()];
        for _ in 0..20_000 {
            drawn[wheel.draw(&mut rng)] += 1;
        }
        drawn.iter().map(|&n| f64::from(n) / 20_000.0).collect()
    }

    #[test]
    fn slots_are_drawn_in_proportion_to_their_matches() {
        let shares = shares(&[10, 0, 30, 60]);
        for (share, expected) in shares.iter().zip([0.1, 0.0, 0.3, 0.6]) {
            assert!((share - expected).abs() < 0.015, "{shares:?}");
        }
        assert_eq!(shares[1], 0.0);
    }

    #[test]
    fn slots_are_drawn_uniformly_if_no_genome_matched_anything() {
        for share in shares(&[0, 0, 0, 0]) {
            assert!((share - 0.25).abs() < 0.015, "{share}");
        }
    }
}
