//! The activation, for 32 values at once.

use core::arch::x86_64::*;
use minimal_surprise_controller::activation::{SEGMENT_SCALE, SEGMENTS};
use minimal_surprise_controller::fixed::FRACTION_BITS;

/// Coefficients by segment: the eight cubics, then the constant tail for larger magnitudes. One
/// permutation selects from 32 entries; 16 are used.
#[repr(align(64))]
struct Coefficients([[i16; 32]; 4]);

static COEFFICIENTS: Coefficients = {
    let tail = 4095 << 3;
    let mut rows = [[0; 32]; 4];
    let mut entry = 0;
    while entry < 32 {
        if entry % 16 < 8 {
            let mut power = 0;
            while power < 4 {
                rows[power][entry] = SEGMENTS[entry % 16][power];
                power += 1;
            }
        } else {
            rows[0][entry] = tail;
        }
        entry += 1;
    }
    Coefficients(rows)
};

/// The activation's constants in registers.
#[derive(Clone, Copy)]
pub(super) struct Activation {
    coefficients: [__m512i; 4],
    scale: __m512i,
    half: __m512i,
}

impl Activation {
    #[target_feature(enable = "avx512f,avx512bw")]
    #[inline]
    pub(super) fn new() -> Self {
        Self {
            coefficients: COEFFICIENTS.0.map(|row| {
                // SAFETY: a row is 64 bytes.
                unsafe { _mm512_loadu_si512(row.as_ptr().cast()) }
            }),
            scale: _mm512_set1_epi16(SEGMENT_SCALE as i16),
            half: _mm512_set1_epi16(i16::MIN),
        }
    }

    /// Computes `activate` of every 16-bit lane.
    #[target_feature(enable = "avx512f,avx512bw")]
    #[inline]
    pub(super) fn activate(self, x: __m512i) -> __m512i {
        let magnitude = _mm512_abs_epi16(x);
        let segment = _mm512_mulhi_epu16(magnitude, self.scale);
        let t = _mm512_xor_si512(_mm512_mullo_epi16(magnitude, self.scale), self.half);
        let [c0, c1, c2, c3] = self
            .coefficients
            .map(|row| _mm512_permutexvar_epi16(segment, row));
        let r = _mm512_add_epi16(_mm512_mulhi_epi16(c3, t), c2);
        let r = _mm512_add_epi16(_mm512_mulhi_epi16(r, t), c1);
        let r = _mm512_add_epi16(_mm512_mulhi_epi16(r, t), c0);
        let r = _mm512_srai_epi16::<3>(r);
        _mm512_mask_sub_epi16(r, _mm512_movepi16_mask(x), _mm512_setzero_si512(), r)
    }

    /// Computes `activate` of two registers of sums (Q24, including the rounding term). Each 128
    /// bits of the result have four lanes of `low`, then four lanes of `high`.
    #[target_feature(enable = "avx512f,avx512bw")]
    #[inline]
    pub(super) fn activate_sums(self, low: __m512i, high: __m512i) -> __m512i {
        self.activate(_mm512_packs_epi32(
            _mm512_srai_epi32::<FRACTION_BITS>(low),
            _mm512_srai_epi32::<FRACTION_BITS>(high),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Avx512;
    use super::*;
    use minimal_surprise_controller::activate;

    #[target_feature(enable = "avx512f,avx512bw")]
    fn activate_32(x: &[i16; 32]) -> [i16; 32] {
        let mut result = [0; 32];
        // SAFETY: both arrays are 64 bytes.
        unsafe {
            let x = _mm512_loadu_si512(x.as_ptr().cast());
            let y = Activation::new().activate(x);
            _mm512_storeu_si512(result.as_mut_ptr().cast(), y);
        }
        result
    }

    #[test]
    fn all_65_536_activations_are_the_controllers() {
        if Avx512::detect().is_none() {
            return;
        }
        for first in (i16::MIN..=i16::MAX).step_by(32) {
            let x: [i16; 32] = core::array::from_fn(|lane| first + lane as i16);
            // SAFETY: AVX-512 was detected on this processor.
            assert_eq!(unsafe { activate_32(&x) }, x.map(activate));
        }
    }
}
