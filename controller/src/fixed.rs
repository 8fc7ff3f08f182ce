//! Q3.12 fixed point: the number format of all weights, thresholds and activations.
//!
//! A value `v` stands for `v / 4096`. A product of two values is Q24 in `i32`; sums of up to
//! [`MAX_TERMS`] products are exact in any order.

/// 1.0 in Q3.12.
pub const ONE_Q3_12: i16 = 4096;

/// Number of fraction bits of Q3.12.
pub const FRACTION_BITS: u32 = 12;

/// Largest weight, in Q3.12; the smallest is its negative. −32768 is not a weight.
pub const WEIGHT_MAX_Q3_12: i16 = 32767;

/// Maximum number of terms in a sum: 15 inputs and a self-loop.
///
/// Activations stay within ±4096 and weights within ±32767, so
/// 16 · 4096 · 32767 + 2048 < 2³¹: a sum cannot overflow.
pub const MAX_TERMS: usize = 16;

/// Initial value of an accumulator, so that the shift in [`sum_to_q3_12`] rounds to nearest.
pub const ROUNDING_Q24: i32 = 1 << (FRACTION_BITS - 1);

const _: () = assert!(
    MAX_TERMS as i64 * ONE_Q3_12 as i64 * WEIGHT_MAX_Q3_12 as i64 + ROUNDING_Q24 as i64
        <= i32::MAX as i64
);

/// A word-aligned array, so that several weights can be loaded at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C, align(4))]
pub(crate) struct Aligned<T>(pub(crate) T);

/// Saturates a value to the range of `i16`.
#[inline]
#[must_use]
pub const fn saturate(value: i32) -> i16 {
    if value > i16::MAX as i32 {
        i16::MAX
    } else if value < i16::MIN as i32 {
        i16::MIN
    } else {
        value as i16
    }
}

/// Converts a Q24 sum that started from [`ROUNDING_Q24`] to Q3.12: arithmetic shift right by 12,
/// then saturation to `i16` (one `ssat` on a Cortex-M4).
#[inline]
#[must_use]
pub const fn sum_to_q3_12(sum_q24: i32) -> i16 {
    saturate(sum_q24 >> FRACTION_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_round_to_nearest_with_ties_up_and_saturate() {
        let rounded = |sum: i32| sum_to_q3_12(sum + ROUNDING_Q24);
        assert_eq!(rounded(2047), 0);
        assert_eq!(rounded(2048), 1);
        assert_eq!(rounded(-2048), 0);
        assert_eq!(rounded(-2049), -1);
        assert_eq!(rounded(16 * 4096 * 32767), i16::MAX);
        assert_eq!(rounded(-16 * 4096 * 32767), i16::MIN);
    }
}
