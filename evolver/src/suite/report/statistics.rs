//! Statistical intervals and tests.
//!
//! All random draws use a fixed seed, so that the same runs give the same report.

use minimal_surprise_evolution::statistics::{median, quantile};
use minimal_surprise_sim::seed::uniform_below;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use statrs::distribution::{Binomial, ContinuousCDF, Discrete, DiscreteCDF, Normal};
use statrs::function::factorial::ln_factorial;

/// Seed of all random draws in this module.
const SEED: u64 = 2021;
/// Number of resamples of a bootstrap.
const RESAMPLES: usize = 10_000;
/// Maximum number of tables that an exact test enumerates; above it, tables are sampled at random.
const EXACT_TABLES_MAX: u64 = 3_000_000;
/// Number of tables drawn if an exact test would have to enumerate too many.
const DRAWN_TABLES: u32 = 100_000;
/// Normal quantile for a two-sided 95 % interval.
const Z_95: f64 = 1.959_963_984_540_054;
/// Significance level: a difference with a smaller p-value is significant.
pub const SIGNIFICANT: f64 = 0.05;
/// Minimum number of runs for a test of a median: with five runs, all are on the same side of the
/// median by chance in one of sixteen cases, so p < 0.05 is impossible.
pub const RUNS_MIN: usize = 6;
/// Name of the sign test.
pub const SIGN_TEST: &str = "sign test";
/// Relative difference below which two table probabilities are considered equal, because of
/// rounding.
const SAME_PROBABILITY: f64 = 1e-7;

/// An interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A test's name and its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Test {
    /// Name of the test.
    pub name: &'static str,
    /// Probability of a result at least as extreme if there is no difference.
    pub p: f64,
}

impl Test {
    /// Returns true if the test finds no significant difference between the groups.
    #[must_use]
    pub fn compatible(self) -> bool {
        self.p >= SIGNIFICANT
    }
}

/// Computes Wilson's 95 % interval of a share; ties may make the number of successes fractional.
/// Returns `None` if `of` is 0.
#[must_use]
pub fn wilson(successes: f64, of: f64) -> Option<Interval> {
    if of <= 0.0 {
        return None;
    }
    let share = successes / of;
    let z2 = Z_95 * Z_95;
    let middle = (share + z2 / (2.0 * of)) / (1.0 + z2 / of);
    let half = Z_95 / (1.0 + z2 / of) * (share * (1.0 - share) / of + z2 / (4.0 * of * of)).sqrt();
    Some(Interval {
        low: (middle - half).max(0.0),
        high: (middle + half).min(1.0),
    })
}

/// Computes the 95 % interval of a median: the 2.5 % and 97.5 % quantiles of the medians of
/// resamples. Returns `None` for fewer than [`RUNS_MIN`] values: the interval would be the range of
/// the values, which contains the median with less than 95 % (of five values, with 93.75 %).
#[must_use]
pub fn median_interval(values: &[f64]) -> Option<Interval> {
    if values.len() < RUNS_MIN {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut sample = vec![0.0; values.len()];
    let mut medians: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            for drawn in &mut sample {
                *drawn = values[uniform_below(&mut rng, values.len() as u64) as usize];
            }
            median(&sample)
        })
        .collect();
    medians.sort_by(f64::total_cmp);
    Some(Interval {
        low: quantile(&medians, 0.025),
        high: quantile(&medians, 0.975),
    })
}

/// Tests whether two rows of counts may come from the same distribution: Fisher's exact test in
/// Freeman and Halton's form for 2 × c tables. Enumerates all tables with the same margins, or
/// draws such tables if there are too many. p is 1 if a row is empty or at most one column is not.
#[must_use]
pub fn fisher(first: &[u32], second: &[u32]) -> Test {
    assert_eq!(first.len(), second.len(), "both rows have the same columns");
    let columns: Vec<(u32, u32)> = first
        .iter()
        .zip(second)
        .map(|(&one, &two)| (one, one + two))
        .filter(|&(_, total)| total > 0)
        .collect();
    let row: u32 = columns.iter().map(|&(one, _)| one).sum();
    let totals: Vec<u32> = columns.iter().map(|&(_, total)| total).collect();
    let observed: f64 = columns
        .iter()
        .map(|&(one, total)| ln_choose(total, one))
        .sum();
    let largest = totals.iter().copied().max().unwrap_or(0);
    let tables = totals.iter().fold(1_u64, |product, &total| {
        product.saturating_mul(u64::from(total) + 1)
    }) / (u64::from(largest) + 1);
    if tables <= EXACT_TABLES_MAX {
        Test {
            name: "Fisher's exact test",
            p: exact(&totals, row, observed),
        }
    } else {
        Test {
            name: "Fisher's test by 100,000 drawn tables",
            p: drawn(&totals, row, observed),
        }
    }
}

fn ln_choose(of: u32, chosen: u32) -> f64 {
    ln_factorial(of.into()) - ln_factorial(chosen.into()) - ln_factorial((of - chosen).into())
}

fn exact(totals: &[u32], row: u32, observed: f64) -> f64 {
    // Put the largest column last, since its count follows from the others.
    let mut totals = totals.to_vec();
    totals.sort_unstable();
    let all: u32 = totals.iter().sum();
    let least = observed + SAME_PROBABILITY;
    let norm = ln_choose(all, row);
    let mut p = 0.0;
    let mut visit = |ln_probability: f64| {
        if ln_probability <= least {
            p += (ln_probability - norm).exp();
        }
    };
    every_table(&totals, row, 0.0, &mut visit);
    p.min(1.0)
}

/// Calls `visit` for every possible first row with this sum, with the logarithm of the row's number
/// of arrangements.
fn every_table(totals: &[u32], row: u32, ways: f64, visit: &mut impl FnMut(f64)) {
    match totals {
        [] if row == 0 => visit(ways),
        [last] if row <= *last => visit(ways + ln_choose(*last, row)),
        [first, rest @ ..] if !rest.is_empty() => {
            for count in 0..=row.min(*first) {
                every_table(rest, row - count, ways + ln_choose(*first, count), visit);
            }
        }
        _ => {}
    }
}

fn drawn(totals: &[u32], row: u32, observed: f64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut items: Vec<usize> = totals
        .iter()
        .enumerate()
        .flat_map(|(column, &total)| std::iter::repeat_n(column, total as usize))
        .collect();
    let mut extreme = 0_u32;
    for _ in 0..DRAWN_TABLES {
        let mut counts = vec![0_u32; totals.len()];
        for place in 0..row as usize {
            let left = (items.len() - place) as u64;
            items.swap(place, place + uniform_below(&mut rng, left) as usize);
            counts[items[place]] += 1;
        }
        let ways: f64 = totals
            .iter()
            .zip(&counts)
            .map(|(&total, &count)| ln_choose(total, count))
            .sum();
        extreme += u32::from(ways <= observed + SAME_PROBABILITY);
    }
    f64::from(extreme + 1) / f64::from(DRAWN_TABLES + 1)
}

/// Tests whether successes and failures may be equally likely: exact binomial test, two-sided.
#[must_use]
pub fn sign(successes: u32, failures: u32) -> Test {
    let of = u64::from(successes) + u64::from(failures);
    let p = Binomial::new(0.5, of).map_or(1.0, |even| {
        let observed = even.pmf(successes.into()) * (1.0 + SAME_PROBABILITY);
        let extreme = (0..=of).map(|k| even.pmf(k)).filter(|&p| p <= observed);
        extreme.sum::<f64>().min(1.0)
    });
    Test { name: SIGN_TEST, p }
}

/// Tests whether the median is consistent with this value, which is known to within `rounding`
/// (two-sided sign test). Values within the rounding count neither as larger nor as smaller.
#[must_use]
pub fn median_is(values: &[f64], median: f64, rounding: f64) -> Test {
    let above = values.iter().filter(|&&v| v > median + rounding).count();
    let below = values.iter().filter(|&&v| v < median - rounding).count();
    let most = above.max(below) as u64;
    let p = match Binomial::new(0.5, values.len() as u64) {
        Ok(even) if most > 0 => (2.0 * even.sf(most - 1)).min(1.0),
        _ => 1.0,
    };
    Test { name: SIGN_TEST, p }
}

/// Tests whether one sample tends to have larger values than the other: the Mann–Whitney test,
/// two-sided, normal approximation with correction for ties and continuity.
#[must_use]
pub fn mann_whitney(first: &[f64], second: &[f64]) -> Test {
    let (n, m) = (first.len() as f64, second.len() as f64);
    let mut u = 0.0;
    for one in first {
        for two in second {
            u += match one.total_cmp(two) {
                std::cmp::Ordering::Greater => 1.0,
                std::cmp::Ordering::Equal => 0.5,
                std::cmp::Ordering::Less => 0.0,
            };
        }
    }
    let mut all: Vec<f64> = first.iter().chain(second).copied().collect();
    all.sort_by(f64::total_cmp);
    let total = n + m;
    let ties: f64 = all
        .chunk_by(|a, b| a == b)
        .map(|tied| {
            let t = tied.len() as f64;
            t * t * t - t
        })
        .sum();
    let variance = n * m / 12.0 * (total + 1.0 - ties / (total * (total - 1.0)));
    let distance = ((u - n * m / 2.0).abs() - 0.5).max(0.0);
    let p = if variance > 0.0 {
        2.0 * Normal::standard().sf(distance / variance.sqrt())
    } else {
        1.0
    };
    Test {
        name: "Mann–Whitney test",
        p: p.min(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: f64, expected: f64, within: f64) {
        assert!((found - expected).abs() <= within, "{found} for {expected}");
    }

    #[test]
    fn wilson_gives_the_published_intervals() {
        // The last two are Newcombe's examples (1998); the others follow from the formula.
        for (successes, of, low, high) in [
            (0.0, 20.0, 0.0, 0.161_125),
            (10.0, 20.0, 0.299_298, 0.700_702),
            (81.0, 263.0, 0.255_288, 0.366_165),
            (15.0, 148.0, 0.062_386, 0.160_538),
        ] {
            let interval = wilson(successes, of).unwrap();
            assert_close(interval.low, low, 1e-4);
            assert_close(interval.high, high, 1e-4);
        }
        assert_eq!(wilson(0.0, 0.0), None);
    }

    #[test]
    fn fisher_gives_the_published_values() {
        // Examples: Fisher's tea tasting, and the convictions of twins in R's documentation.
        assert_close(fisher(&[3, 1], &[1, 3]).p, 0.485_714, 1e-6);
        assert_close(fisher(&[2, 15], &[10, 3]).p, 0.000_536_7, 1e-7);
        // Computed by hand for the rows 3, 0, 0 and 0, 2, 1: 2 of all 20 arrangements belong to
        // tables that have a single arrangement.
        assert_close(fisher(&[3, 0, 0], &[0, 2, 1]).p, 0.1, 1e-9);
        assert_eq!(fisher(&[4, 0], &[9, 0]).p, 1.0);
        assert_eq!(fisher(&[0, 0], &[9, 1]).p, 1.0);
    }

    #[test]
    fn drawn_tables_agree_with_all_tables() {
        let (totals, row) = ([10, 12, 8, 6], 18);
        let observed = [8, 6, 3, 1];
        let ways: f64 = totals
            .iter()
            .zip(observed)
            .map(|(&total, count)| ln_choose(total, count))
            .sum();
        assert_close(drawn(&totals, row, ways), exact(&totals, row, ways), 0.003);
    }

    #[test]
    fn the_sign_test_is_the_binomial_test() {
        // 2 · 11 / 2¹⁰ and 2 · 12,616 / 2¹⁸, sums of binomial coefficients.
        assert_close(sign(9, 1).p, 0.021_484, 1e-6);
        assert_close(sign(5, 13).p, 0.096_252, 1e-6);
        assert_close(sign(0, 0).p, 1.0, 0.0);
    }

    #[test]
    fn a_median_is_told_by_the_values_beyond_its_rounding() {
        assert_close(median_is(&[0.1, 0.2, 0.31, 0.9], 0.3, 0.02).p, 1.0, 1e-9);
        assert_close(median_is(&[0.4; 9], 0.3, 0.02).p, 2.0 / 512.0, 1e-9);
        // Seven of twenty values are above the printed median, none are below, and the others equal
        // it: the median is as printed.
        let mut values = [0.0; 20];
        values[..7].fill(0.5);
        assert_eq!(median_is(&values, 0.0, 0.005).p, 1.0);
    }

    #[test]
    fn mann_whitney_gives_the_value_worked_out_by_hand() {
        // U = 35 of 50 pairs, standard deviation √(50 · 16 / 12), continuity 0.5: z = 1.1635.
        let first = [0.80, 0.83, 1.89, 1.04, 1.45, 1.38, 1.91, 1.64, 0.73, 1.46];
        let second = [1.15, 0.88, 0.90, 0.74, 1.21];
        assert_close(mann_whitney(&first, &second).p, 0.2446, 1e-4);
        assert_eq!(mann_whitney(&[1.0, 1.0], &[1.0]).p, 1.0);
    }

    #[test]
    fn a_medians_interval_holds_it_and_is_the_same_every_time() {
        let values: Vec<f64> = (0..41).map(f64::from).collect();
        let interval = median_interval(&values).unwrap();
        assert_eq!(median_interval(&values), Some(interval));
        // Order statistics 14 and 28 of 41, the values 13 and 27, contain the median with 97.2 %.
        assert_close(interval.low, 13.0, 1.5);
        assert_close(interval.high, 27.0, 1.5);
        assert_eq!(median_interval(&[0.1, 0.2, 0.3, 0.4, 0.5]), None);
    }
}
