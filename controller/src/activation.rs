//! The activation: tanh in Q3.12, approximated by eight cubics.
//!
//! The magnitude `m = |x|` is scaled so that one product yields the segment number and the position
//! inside the segment: `z = 30·m`, segment `z >> 16`, position `t = (z & 0xffff) − 32768` in Q16,
//! i.e. −½ ≤ t < ½. A segment is 65536 / 30 ≈ 2184.5 units (0.533) wide. Its cubic is evaluated by
//! Horner's rule in units of 1/8; each step `(r·t >> 16) + c` truncates as `vpmulhw` does on x86.
//! The result is shifted right by 3 and given the sign of x. Every intermediate value fits `i16`,
//! so 16-bit vector lanes are wide enough, and eight 16-bit coefficients fit one 128-bit byte
//! shuffle. [`activate`] computes the same values in 32 bits, with multiply-accumulate instructions
//! and without testing the sign.
//!
//! If x is 17476 units (4.27) or more, the value is 4095, which is within one unit of 4096·tanh.
//!
//! The function is frozen: [`KERNEL_ID`] holds a hash of all its values, and every genome container
//! stores it.

/// Number of segments per 2¹⁶ units: the factor that scales the magnitude.
pub const SEGMENT_SCALE: u16 = 30;

/// Largest distinct magnitude: all larger ones have the same activation.
pub const MAGNITUDE_CLAMP: u16 = 17475;

/// Cubics over the eight segments: `[c0, c1, c2, c3]`, in units of 1/8 of Q3.12.
///
/// Each is a least-squares fit to tanh over its segment, rounded, then adjusted by a few units so
/// that the truncating evaluation is monotone, within one unit of tanh, and has the smallest
/// maximum error.
pub const SEGMENTS: [[i16; 4]; 8] = [
    [8538, 16288, -2171, -1196],
    [21762, 9773, -3406, 266],
    [28515, 4247, -1984, 505],
    [31242, 1595, -824, 263],
    [32238, 566, -303, 104],
    [32587, 198, -106, 37],
    [32708, 68, -37, 13],
    [32751, 24, -12, 5],
];

/// Value of the activation beyond the last segment, in units of 1/8.
const TAIL: i32 = 4095 << 3;

/// The coefficients that [`activate`] uses, highest power first. One row per value of `z >> 16`, in
/// the order 0 … 15 and −16 … −1, so that [`activate`] needs no clamp, bounds check or magnitude.
///
/// For x < 0: if −x has segment s and position t, then x has segment −1 − s and position −t. (−t
/// does not fit if t is −½, but only 0 and −32768 have that t, and their −t is never used.) With
/// −t, the row yields the first result negated, the second unchanged and the third negated; its
/// constants include the d − 1 of ⌊(d − 1 − a) / d⌋ = −⌊a / d⌋.
pub(crate) static ROWS: [[i32; 4]; 32] = {
    let mut rows = [[0; 4]; 32];
    let mut segment = 0;
    while segment < 16 {
        let [c0, c1, c2, c3] = if segment < SEGMENTS.len() {
            let [c0, c1, c2, c3] = SEGMENTS[segment];
            [c0 as i32, c1 as i32, c2 as i32, c3 as i32]
        } else {
            [TAIL, 0, 0, 0]
        };
        rows[segment] = [c3, c2 << 16, c1, c0 << 16];
        rows[31 - segment] = [c3, 0xffff - (c2 << 16), c1, 0x7_ffff - (c0 << 16)];
        segment += 1;
    }
    rows
};

/// Computes tanh in Q3.12: `act(x)` is within 1 unit of 4096·tanh(x / 4096) for every `i16`.
///
/// The function is odd and monotone; its values are in \[−4095, 4095\], and `act(−32768) =
/// act(−32767)`. Tests: `activation_error_max_all_inputs`, `activation_is_odd_and_monotone`,
/// `value_stability_activation`. Departure from the paper: the paper uses tanh in floating point.
#[inline]
#[must_use]
pub fn activate(x_q3_12: i16) -> i16 {
    let scaled = i32::from(x_q3_12) * i32::from(SEGMENT_SCALE);
    let [c3, c2, c1, c0] = ROWS[(scaled >> 16) as usize & 31];
    let t = i32::from((scaled as u16 ^ 0x8000) as i16);
    let r = (c3 * t + c2) >> 16;
    let r = mul_high(r, t) + c1;
    ((r * t + c0) >> 19) as i16
}

/// Computes `(a · b) >> 16` for `b` in the range of `i16`.
#[inline]
fn mul_high(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b)) >> 16) as i32
}

/// Identity of the arithmetic: a controller rejects genomes evolved for a different kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KernelId(pub [u8; 8]);

impl core::fmt::Display for KernelId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for byte in self.0 {
            write!(f, "{byte:02x}")?;
        }
        Ok(())
    }
}

/// The first eight bytes of the SHA-256 of all 65,536 activations, each as a little-endian `i16`,
/// in the order of their inputs from −32768 to 32767.
pub const KERNEL_ID: KernelId = KernelId([197, 199, 55, 187, 57, 61, 226, 137]);

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use sha2::{Digest, Sha256};

    fn all() -> impl Iterator<Item = i16> {
        i16::MIN..=i16::MAX
    }

    #[test]
    fn activation_error_max_all_inputs() {
        let error_max = all()
            .map(|x| {
                let exact = 4096.0 * (f64::from(x) / 4096.0).tanh();
                (f64::from(activate(x)) - exact).abs()
            })
            .fold(0.0, f64::max);
        std::println!("largest error: {error_max:.6} units");
        assert!(error_max < 1.0, "{error_max}");
    }

    #[test]
    fn activation_is_odd_and_monotone() {
        assert_eq!(activate(i16::MIN), activate(-i16::MAX));
        assert_eq!(activate(0), 0);
        for x in 1..=i16::MAX {
            assert_eq!(activate(-x), -activate(x), "x = {x}");
            assert!(activate(x) >= activate(x - 1), "x = {x}");
        }
    }

    #[test]
    fn sixteen_bit_lanes_with_a_clamped_magnitude_give_the_same_values() {
        for x in all() {
            let magnitude = x.unsigned_abs().min(MAGNITUDE_CLAMP);
            let low = magnitude.wrapping_mul(SEGMENT_SCALE);
            let segment = (u32::from(magnitude) * u32::from(SEGMENT_SCALE)) >> 16;
            let t = (low ^ 0x8000) as i16;
            let high = |a: i16| ((i32::from(a) * i32::from(t)) >> 16) as i16;
            let [c0, c1, c2, c3] = SEGMENTS[segment as usize];
            let r = high(c3).checked_add(c2).unwrap();
            let r = high(r).checked_add(c1).unwrap();
            let r = high(r).checked_add(c0).unwrap() >> 3;
            assert_eq!(if x < 0 { -r } else { r }, activate(x), "x = {x}");
        }
    }

    #[test]
    fn value_stability_activation() {
        let mut hash = Sha256::new();
        for x in all() {
            hash.update(activate(x).to_le_bytes());
        }
        assert_eq!(hash.finalize()[..8], KERNEL_ID.0);
    }
}
