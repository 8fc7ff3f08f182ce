//! Selection of the genomes that become parents. All draws are of integers.

use minimal_surprise_sim::seed::{Stream, uniform_below};
use std::fmt;

/// Maximum tournament size.
const TOURNAMENT_MAX: u32 = 1_000_000;

/// Selection method for parents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Selection {
    /// Probability proportional to fitness, as in the paper.
    #[default]
    Roulette,
    /// The best of this many genomes, drawn with replacement; ties go to the first drawn.
    Tournament(u32),
}

impl Selection {
    /// Reads `roulette` or `tournament:K`.
    ///
    /// # Errors
    /// A description of the valid methods if `text` is invalid.
    pub fn parse(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "roulette" => Ok(Self::Roulette),
            Some(("tournament", size)) => match size.parse() {
                Ok(size) if (1..=TOURNAMENT_MAX).contains(&size) => Ok(Self::Tournament(size)),
                _ => Err(format!(
                    "expected tournament:K with K from 1 to {TOURNAMENT_MAX}"
                )),
            },
            _ => Err("expected roulette, or tournament:K as in tournament:3".to_owned()),
        }
    }

    /// Prepares to draw parents of genomes with these fitness values, by slot.
    ///
    /// # Panics
    /// If `fitness` is empty, or its sum does not fit in 64 bits.
    #[must_use]
    pub fn of(self, fitness: &[u64]) -> Parents<'_> {
        match self {
            Self::Roulette => Parents::Roulette(Roulette::new(fitness)),
            Self::Tournament(size) => Parents::Tournament { fitness, size },
        }
    }
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Roulette => f.write_str("roulette"),
            Self::Tournament(size) => write!(f, "tournament:{size}"),
        }
    }
}

/// Draws parents one after the other; implement this trait for a custom selection.
pub trait SelectParent {
    /// Draws a parent and returns its slot.
    fn draw(&self, rng: &mut Stream) -> usize;
}

/// A [`Selection`] applied to a generation.
#[derive(Clone, Debug)]
pub enum Parents<'a> {
    /// See [`Selection::Roulette`].
    Roulette(Roulette),
    /// See [`Selection::Tournament`].
    Tournament {
        /// Fitness by slot.
        fitness: &'a [u64],
        /// Number of genomes drawn for each parent.
        size: u32,
    },
}

impl SelectParent for Parents<'_> {
    fn draw(&self, rng: &mut Stream) -> usize {
        match self {
            Self::Roulette(wheel) => wheel.draw(rng),
            Self::Tournament { fitness, size } => {
                let mut slot = || uniform_below(rng, fitness.len() as u64) as usize;
                let first = slot();
                (1..*size).map(|_| slot()).fold(first, |best, drawn| {
                    if fitness[drawn] > fitness[best] {
                        drawn
                    } else {
                        best
                    }
                })
            }
        }
    }
}

/// A wheel with one sector per slot, proportional to the slot's fitness; all equal if all are 0.
#[derive(Clone, Debug)]
pub struct Roulette {
    /// Upper bounds of the sectors.
    ends: Vec<u64>,
}

impl Roulette {
    /// Creates a wheel for these fitness values.
    ///
    /// # Panics
    /// If the sum of the fitness values does not fit in 64 bits.
    #[must_use]
    pub fn new(fitness: &[u64]) -> Self {
        let uniform = fitness.iter().all(|&count| count == 0);
        let mut end = 0_u64;
        let ends = fitness
            .iter()
            .map(|&count| {
                let width = if uniform { 1 } else { count };
                end = end
                    .checked_add(width)
                    .expect("the sum of all fitnesses fits 64 bits");
                end
            })
            .collect();
        Self { ends }
    }
}

impl SelectParent for Roulette {
    fn draw(&self, rng: &mut Stream) -> usize {
        let total = self.ends.last().copied().unwrap_or(0);
        let at = uniform_below(rng, total);
        self.ends.partition_point(|&end| end <= at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_sim::{Purpose, SeedTree};

    fn shares(selection: Selection, fitness: &[u64]) -> Vec<f64> {
        let mut rng = SeedTree::new(3).stream(Purpose::Selection, 0, 0);
        let parents = selection.of(fitness);
        let mut drawn = vec![0_u32; fitness.len()];
        for _ in 0..20_000 {
            drawn[parents.draw(&mut rng)] += 1;
        }
        drawn.iter().map(|&n| f64::from(n) / 20_000.0).collect()
    }

    fn assert_near(shares: &[f64], expected: &[f64]) {
        for (share, expected) in shares.iter().zip(expected) {
            assert!((share - expected).abs() < 0.015, "{shares:?}");
        }
    }

    #[test]
    fn slots_are_drawn_in_proportion_to_their_fitness() {
        let shares = shares(Selection::Roulette, &[10, 0, 30, 60]);
        assert_near(&shares, &[0.1, 0.0, 0.3, 0.6]);
        assert_eq!(shares[1], 0.0);
    }

    #[test]
    fn slots_are_drawn_uniformly_if_no_genome_matched_anything() {
        assert_near(&shares(Selection::Roulette, &[0; 4]), &[0.25; 4]);
    }

    #[test]
    fn of_k_drawn_genomes_the_best_wins() {
        // With 4 genomes: the best of ranks up to r wins with probability (r/4)^k - ((r-1)/4)^k.
        let fitness = [5, 40, 20, 30];
        assert_near(&shares(Selection::Tournament(1), &fitness), &[0.25; 4]);
        let pairs = [1.0, 7.0, 3.0, 5.0].map(|wins| wins / 16.0);
        assert_near(&shares(Selection::Tournament(2), &fitness), &pairs);
        let triples = [1.0, 37.0, 7.0, 19.0].map(|wins| wins / 64.0);
        assert_near(&shares(Selection::Tournament(3), &fitness), &triples);
    }

    #[test]
    fn the_text_of_a_selection_is_read_back_and_others_are_refused() {
        for selection in [
            Selection::Roulette,
            Selection::Tournament(1),
            Selection::Tournament(1_000_000),
        ] {
            assert_eq!(Selection::parse(&selection.to_string()), Ok(selection));
        }
        for bad in [
            "",
            "rank",
            "roulette:2",
            "tournament",
            "tournament:0",
            "tournament:x",
        ] {
            assert!(Selection::parse(bad).is_err(), "{bad}");
        }
    }
}
