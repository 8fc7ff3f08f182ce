//! AVX2: predictions with 16 robots per register of activations and 8 robots per register of sums.

use super::super::lanes::{BLOCK_STEPS, Blocks, LANES, Lanes, Matches, PAIRS};
use super::super::network::PredictionWeights;
use core::arch::x86_64::*;
use minimal_surprise_controller::activation::{MAGNITUDE_CLAMP, SEGMENT_SCALE, SEGMENTS};
use minimal_surprise_controller::fixed::FRACTION_BITS;

/// Number of window bits that select from a table: a permutation has eight entries.
const TABLE_BITS: usize = 3;
/// Number of tables of a hidden neuron.
const TABLES: usize = 5;
/// Number of robots processed at once.
const HALF: usize = 16;

/// A prediction network laid out for [`run_block`].
#[repr(align(64))]
pub(in super::super) struct Network {
    /// For each hidden neuron, the sums for every value of each group of three window bits.
    inputs: [[[i32; 8]; TABLES]; 2 * PAIRS],
    /// Self-loop of each hidden neuron, in its half of a pair; zero in the other half.
    self_loops: [i32; 2 * PAIRS],
    /// Weights of each output in pairs, and the window bit that the output predicts.
    outputs: Vec<(u32, [i32; PAIRS])>,
    pairs_used: usize,
    sensors: u16,
    expected_empty_at_start: u16,
}

/// Packs two weights into one factor of a product of pairs.
fn pair(even: i16, odd: i16) -> i32 {
    (u32::from(even as u16) | u32::from(odd as u16) << 16) as i32
}

impl Network {
    pub(in super::super) fn new(weights: &PredictionWeights) -> Self {
        let mut network = Self {
            inputs: [[[0; 8]; TABLES]; 2 * PAIRS],
            self_loops: [0; 2 * PAIRS],
            outputs: Vec::with_capacity(weights.outputs.len()),
            pairs_used: weights.hidden.div_ceil(2),
            sensors: weights.sensors,
            expected_empty_at_start: weights.expected_empty_at_start,
        };
        for neuron in 0..weights.hidden {
            for (index, table) in network.inputs[neuron].iter_mut().enumerate() {
                *table = weights.sums[neuron].table(TABLE_BITS * index);
            }
            let weight = weights.self_loops[neuron];
            network.self_loops[neuron] = if neuron % 2 == 0 {
                pair(weight, 0)
            } else {
                pair(0, weight)
            };
        }
        for (bit, row) in &weights.outputs {
            let pairs = core::array::from_fn(|p| pair(row[2 * p], row[2 * p + 1]));
            network.outputs.push((*bit, pairs));
        }
        network
    }
}

/// Runs one block; see [`super::super::lanes::Predictor::run_block`].
#[target_feature(enable = "avx2")]
pub(super) fn run_block(
    network: &Network,
    lanes: &mut Lanes,
    blocks: &Blocks,
    matches: &mut Matches,
) -> u32 {
    let mut windows = [[0_u16; LANES]; BLOCK_STEPS];
    for (lane, &block) in blocks.inputs.iter().enumerate() {
        for (step, windows) in windows.iter_mut().enumerate() {
            windows[lane] = (block >> (16 * step)) as u16;
        }
    }
    let mut unchanged = 0;
    for half in 0..LANES / HALF {
        let first = half * HALF;
        unchanged |= run_half(network, lanes, &windows, blocks, matches, first) << first;
    }
    unchanged
}

#[target_feature(enable = "avx2")]
#[inline]
fn run_half(
    network: &Network,
    lanes: &mut Lanes,
    windows: &[[u16; LANES]; BLOCK_STEPS],
    blocks: &Blocks,
    matches: &mut Matches,
    first: usize,
) -> u32 {
    let activation = Activation::new();
    let sensors = _mm256_set1_epi16(network.sensors as i16);
    let mut low = [_mm256_setzero_si256(); PAIRS];
    let mut high = low;
    for p in 0..network.pairs_used {
        (low[p], high[p]) = load_two(&lanes.hidden[p], first);
    }
    let mut matched = _mm256_setzero_si256();
    store(&mut matches.first_steps, first, matched);
    for (step, windows) in windows.iter().enumerate() {
        if step == blocks.first_steps {
            store(&mut matches.first_steps, first, matched);
        }
        let window = load(windows, first);
        let mut expected_empty = _mm256_setzero_si256();
        for (bit, row) in &network.outputs {
            let mut sums = [_mm256_setzero_si256(); 2];
            for p in 0..network.pairs_used {
                let weights = _mm256_set1_epi32(row[p]);
                sums[0] = _mm256_add_epi32(sums[0], _mm256_madd_epi16(low[p], weights));
                sums[1] = _mm256_add_epi32(sums[1], _mm256_madd_epi16(high[p], weights));
            }
            let signs = _mm256_srai_epi16::<15>(_mm256_packs_epi32(sums[0], sums[1]));
            let bit = _mm256_set1_epi16((1_u16 << bit) as i16);
            expected_empty = _mm256_or_si256(expected_empty, _mm256_and_si256(signs, bit));
        }
        // Packed signs are in packed order; windows are in the order of the robots.
        expected_empty = _mm256_permute4x64_epi64::<0b11_01_10_00>(expected_empty);
        if step == 0 {
            let at_start = _mm256_set1_epi16(network.expected_empty_at_start as i16);
            let starting = mask_of_bits(blocks.starting >> first);
            expected_empty = _mm256_blendv_epi8(expected_empty, at_start, starting);
        }
        let differing = _mm256_and_si256(_mm256_xor_si256(expected_empty, window), sensors);
        matched = _mm256_add_epi16(matched, ones(differing));
        let low_window = _mm256_cvtepu16_epi32(_mm256_castsi256_si128(window));
        let high_window = _mm256_cvtepu16_epi32(_mm256_extracti128_si256::<1>(window));
        for p in 0..network.pairs_used {
            let mut values = [_mm256_setzero_si256(); 2];
            for (odd, value) in values.iter_mut().enumerate() {
                let neuron = 2 * p + odd;
                let sums = [
                    hidden_sum(network, neuron, low_window, low[p]),
                    hidden_sum(network, neuron, high_window, high[p]),
                ];
                *value = activation.activate(_mm256_packs_epi32(
                    _mm256_srai_epi32::<{ FRACTION_BITS as i32 }>(sums[0]),
                    _mm256_srai_epi32::<{ FRACTION_BITS as i32 }>(sums[1]),
                ));
            }
            // Unpacking undoes the interleaving of packing.
            low[p] = _mm256_unpacklo_epi16(values[0], values[1]);
            high[p] = _mm256_unpackhi_epi16(values[0], values[1]);
        }
    }
    store(&mut matches.block, first, matched);
    let mut unchanged = [_mm256_set1_epi32(-1); 2];
    for p in 0..network.pairs_used {
        let before = load_two(&lanes.hidden[p], first);
        unchanged[0] = _mm256_and_si256(unchanged[0], _mm256_cmpeq_epi32(before.0, low[p]));
        unchanged[1] = _mm256_and_si256(unchanged[1], _mm256_cmpeq_epi32(before.1, high[p]));
        store_two(&mut lanes.hidden[p], first, low[p], high[p]);
    }
    let [low_unchanged, high_unchanged] =
        unchanged.map(|lanes| _mm256_movemask_ps(_mm256_castsi256_ps(lanes)) as u32);
    low_unchanged | high_unchanged << 8
}

#[target_feature(enable = "avx2")]
#[inline]
fn hidden_sum(network: &Network, neuron: usize, window: __m256i, hidden: __m256i) -> __m256i {
    let self_loop = _mm256_set1_epi32(network.self_loops[neuron]);
    let mut sum = _mm256_madd_epi16(hidden, self_loop);
    let mut index = window;
    for table in &network.inputs[neuron] {
        // SAFETY: a table is 32 bytes.
        let table = unsafe { _mm256_loadu_si256(table.as_ptr().cast()) };
        sum = _mm256_add_epi32(sum, _mm256_permutevar8x32_epi32(table, index));
        index = _mm256_srli_epi32::<{ TABLE_BITS as i32 }>(index);
    }
    sum
}

/// Sets all bits of the 16-bit lanes that are selected by the lowest bits of `bits`.
#[target_feature(enable = "avx2")]
#[inline]
fn mask_of_bits(bits: u32) -> __m256i {
    let mask =
        core::array::from_fn::<u16, HALF, _>(|lane| 0_u16.wrapping_sub((bits >> lane) as u16 & 1));
    // SAFETY: 16 16-bit words fill a register.
    unsafe { _mm256_loadu_si256(mask.as_ptr().cast()) }
}

/// Counts the ones in every 16-bit lane.
#[target_feature(enable = "avx2")]
#[inline]
fn ones(x: __m256i) -> __m256i {
    let of_nibble = _mm256_setr_epi8(
        0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3,
        3, 4,
    );
    let nibble = _mm256_set1_epi8(15);
    let low = _mm256_shuffle_epi8(of_nibble, _mm256_and_si256(x, nibble));
    let high = _mm256_and_si256(_mm256_srli_epi16::<4>(x), nibble);
    let bytes = _mm256_add_epi8(low, _mm256_shuffle_epi8(of_nibble, high));
    _mm256_maddubs_epi16(bytes, _mm256_set1_epi8(1))
}

/// Coefficients by segment, stored twice because a byte shuffle selects within 128 bits.
#[repr(align(64))]
struct Coefficients([[i16; 16]; 4]);

static COEFFICIENTS: Coefficients = {
    let mut rows = [[0; 16]; 4];
    let mut entry = 0;
    while entry < 16 {
        let mut power = 0;
        while power < 4 {
            rows[power][entry] = SEGMENTS[entry % 8][power];
            power += 1;
        }
        entry += 1;
    }
    Coefficients(rows)
};

/// The activation's constants in registers.
#[derive(Clone, Copy)]
struct Activation {
    coefficients: [__m256i; 4],
    clamp: __m256i,
    scale: __m256i,
    half: __m256i,
    /// Factor and addend that convert a segment into the indices of its two bytes.
    to_bytes: [__m256i; 2],
}

impl Activation {
    #[target_feature(enable = "avx2")]
    #[inline]
    fn new() -> Self {
        Self {
            coefficients: COEFFICIENTS.0.map(|row| {
                // SAFETY: a row is 32 bytes.
                unsafe { _mm256_loadu_si256(row.as_ptr().cast()) }
            }),
            clamp: _mm256_set1_epi16(MAGNITUDE_CLAMP as i16),
            scale: _mm256_set1_epi16(SEGMENT_SCALE as i16),
            half: _mm256_set1_epi16(i16::MIN),
            to_bytes: [_mm256_set1_epi16(0x0202), _mm256_set1_epi16(0x0100)],
        }
    }

    /// Computes `activate` of every 16-bit lane.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn activate(self, x: __m256i) -> __m256i {
        let magnitude = _mm256_min_epu16(_mm256_abs_epi16(x), self.clamp);
        let segment = _mm256_mulhi_epu16(magnitude, self.scale);
        let t = _mm256_xor_si256(_mm256_mullo_epi16(magnitude, self.scale), self.half);
        let bytes = _mm256_add_epi16(
            _mm256_mullo_epi16(segment, self.to_bytes[0]),
            self.to_bytes[1],
        );
        let [c0, c1, c2, c3] = self.coefficients.map(|row| _mm256_shuffle_epi8(row, bytes));
        let r = _mm256_add_epi16(_mm256_mulhi_epi16(c3, t), c2);
        let r = _mm256_add_epi16(_mm256_mulhi_epi16(r, t), c1);
        let r = _mm256_add_epi16(_mm256_mulhi_epi16(r, t), c0);
        _mm256_sign_epi16(_mm256_srai_epi16::<3>(r), x)
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn load(words: &[u16; LANES], first: usize) -> __m256i {
    // SAFETY: a slice of 16 16-bit words fills a register.
    unsafe { _mm256_loadu_si256(words[first..first + HALF].as_ptr().cast()) }
}

#[target_feature(enable = "avx2")]
#[inline]
fn store(words: &mut [u16; LANES], first: usize, value: __m256i) {
    // SAFETY: a slice of 16 16-bit words fills a register.
    unsafe { _mm256_storeu_si256(words[first..first + HALF].as_mut_ptr().cast(), value) }
}

#[target_feature(enable = "avx2")]
#[inline]
fn load_two(words: &[u32; LANES], first: usize) -> (__m256i, __m256i) {
    let words = &words[first..first + HALF];
    // SAFETY: 16 32-bit words fill two registers.
    unsafe {
        let first = words.as_ptr().cast::<__m256i>();
        (_mm256_loadu_si256(first), _mm256_loadu_si256(first.add(1)))
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn store_two(words: &mut [u32; LANES], first: usize, low: __m256i, high: __m256i) {
    let words = &mut words[first..first + HALF];
    // SAFETY: 16 32-bit words fill two registers.
    unsafe {
        let first = words.as_mut_ptr().cast::<__m256i>();
        _mm256_storeu_si256(first, low);
        _mm256_storeu_si256(first.add(1), high);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Avx2;
    use super::*;
    use minimal_surprise_controller::activate;

    #[target_feature(enable = "avx2")]
    fn activate_16(x: &[i16; 16]) -> [i16; 16] {
        let mut result = [0; 16];
        // SAFETY: both arrays are 32 bytes.
        unsafe {
            let x = _mm256_loadu_si256(x.as_ptr().cast());
            let y = Activation::new().activate(x);
            _mm256_storeu_si256(result.as_mut_ptr().cast(), y);
        }
        result
    }

    #[test]
    fn all_65_536_activations_are_the_controllers() {
        if Avx2::detect().is_none() {
            return;
        }
        for first in (i16::MIN..=i16::MAX).step_by(16) {
            let x: [i16; 16] = core::array::from_fn(|lane| first + lane as i16);
            // SAFETY: AVX2 was detected on this processor.
            assert_eq!(unsafe { activate_16(&x) }, x.map(activate));
        }
    }
}
