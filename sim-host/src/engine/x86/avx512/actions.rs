//! The whole action table, 32 windows at once: the windows of a batch differ only in their lowest
//! five bits, so the rest of each hidden sum is constant.

use super::super::super::network::HiddenSum;
use super::super::super::robot_word::{STRAIGHT, TURN_LEFT, TURN_RIGHT};
use super::super::super::window::{WINDOWS, WindowOrder};
use super::activation::Activation;
use core::arch::x86_64::*;
use minimal_surprise_controller::Controller;

/// Maximum number of hidden neurons of an action network.
const HIDDEN: usize = 8;
/// Number of windows processed at once.
const BATCH: usize = 32;

/// Fills the entries of all windows.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
pub(in super::super) fn fill_table(
    controller: &Controller,
    order: &WindowOrder,
    entries: &mut [u8],
) {
    let activation = Activation::new();
    let network = controller.action_network();
    let sums: [HiddenSum; HIDDEN] = HiddenSum::of(network, order);
    let tables = sums.map(|sum| [0, 5, 10].map(|first| sum.table(first)));
    let lowest = tables.map(|[lowest, ..]| in_packing_order(&lowest));
    let weights = network
        .output_rows()
        .map(|row| [0, 1, 2, 3].map(|p| pair(row[2 * p], row[2 * p + 1])));
    for (batch, entries) in entries[..WINDOWS].chunks_exact_mut(BATCH).enumerate() {
        let mut low = [_mm512_setzero_si512(); HIDDEN / 2];
        let mut high = low;
        for p in 0..HIDDEN / 2 {
            let [even, odd] = [2 * p, 2 * p + 1].map(|neuron| {
                let [_, middle, highest] = &tables[neuron];
                let rest = middle[batch % 32].wrapping_add(highest[batch / 32]);
                let rest = _mm512_set1_epi32(rest);
                let (first, second) = lowest[neuron];
                activation.activate_sums(
                    _mm512_add_epi32(first, rest),
                    _mm512_add_epi32(second, rest),
                )
            });
            low[p] = _mm512_unpacklo_epi16(even, odd);
            high[p] = _mm512_unpackhi_epi16(even, odd);
        }
        let [action, turn] = weights.map(|weights| {
            let sum = |hidden: [__m512i; HIDDEN / 2]| {
                let mut sum = _mm512_setzero_si512();
                for (hidden, weights) in hidden.into_iter().zip(weights) {
                    sum = _mm512_dpwssd_epi32(sum, hidden, weights);
                }
                sum
            };
            _mm512_movepi16_mask(_mm512_packs_epi32(sum(low), sum(high)))
        });
        let turns = _mm256_mask_mov_epi8(
            _mm256_set1_epi8(TURN_RIGHT as i8),
            turn,
            _mm256_set1_epi8(TURN_LEFT as i8),
        );
        let batch = _mm256_mask_mov_epi8(turns, action, _mm256_set1_epi8(STRAIGHT as i8));
        // SAFETY: a chunk is 32 bytes.
        unsafe { _mm256_storeu_si256(entries.as_mut_ptr().cast(), batch) }
    }
}

/// Packs two weights into every lane.
#[target_feature(enable = "avx512f")]
#[inline]
fn pair(even: i16, odd: i16) -> __m512i {
    _mm512_set1_epi32((u32::from(even as u16) | u32::from(odd as u16) << 16) as i32)
}

/// Loads a table into two registers, arranged so that packing restores the order of the table.
#[target_feature(enable = "avx512f")]
#[inline]
fn in_packing_order(table: &[i32; 32]) -> (__m512i, __m512i) {
    let half = |second: usize| -> [i32; 16] {
        core::array::from_fn(|lane| table[lane / 4 * 8 + lane % 4 + 4 * second])
    };
    let (first, second) = (half(0), half(1));
    // SAFETY: 16 32-bit words fill a register.
    unsafe {
        (
            _mm512_loadu_si512(first.as_ptr().cast()),
            _mm512_loadu_si512(second.as_ptr().cast()),
        )
    }
}
