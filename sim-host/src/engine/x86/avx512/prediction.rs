//! Prediction networks of 32 robots: sums of 16 robots a register, activations of 32.
//!
//! Packing two registers of sums into one of activations interleaves them by fours, and unpacking
//! undoes that. So hidden activations are in the robots' order wherever they are 32 bits wide, and
//! windows are brought into the packed order when blocks are taken apart.

use super::super::super::lanes::{BLOCK_STEPS, LANES, Lanes, Matches, PAIRS};
use super::super::super::network::PredictionWeights;
use super::activation::Activation;
use core::arch::x86_64::*;

/// A prediction network laid out for [`Network::run_block`].
#[repr(align(64))]
pub(in super::super::super) struct Network {
    /// For each hidden neuron, the sums that each value of each five bits of a window gives.
    inputs: [[[i32; 32]; 3]; 2 * PAIRS],
    /// Self-loop of each hidden neuron, in its half of a pair; zero in the other half.
    self_loops: [i32; 2 * PAIRS],
    /// Weights of each output in pairs.
    outputs: [[i32; PAIRS]; 2 * PAIRS],
    /// By how many bits the predictions before an output move on when it is added: 1, and 1 more
    /// for each window bit between them that no output predicts.
    gaps: [u32; 2 * PAIRS],
    outputs_used: usize,
    pairs_used: usize,
    /// How far the last output's bit is from bit 0.
    last_bit: u32,
    sensors: u16,
}

/// Two weights as one factor of a product of pairs.
fn pair(even: i16, odd: i16) -> i32 {
    (u32::from(even as u16) | u32::from(odd as u16) << 16) as i32
}

impl Network {
    pub(in super::super::super) fn new(weights: &PredictionWeights, sensors: u16) -> Self {
        let mut network = Self {
            inputs: [[[0; 32]; 3]; 2 * PAIRS],
            self_loops: [0; 2 * PAIRS],
            outputs: [[0; PAIRS]; 2 * PAIRS],
            gaps: [0; 2 * PAIRS],
            outputs_used: weights.outputs.len(),
            pairs_used: weights.hidden.div_ceil(2),
            last_bit: weights.outputs.last().map_or(0, |&(bit, _)| bit),
            sensors,
        };
        for neuron in 0..weights.hidden {
            network.inputs[neuron] = [0, 5, 10].map(|first| weights.sums[neuron].table(first));
            let weight = weights.self_loops[neuron];
            network.self_loops[neuron] = if neuron % 2 == 0 {
                pair(weight, 0)
            } else {
                pair(0, weight)
            };
        }
        let mut bit_before = None;
        for (output, (bit, row)) in weights.outputs.iter().enumerate() {
            for (to, from) in network.outputs[output].iter_mut().zip(row.chunks_exact(2)) {
                *to = pair(from[0], from[1]);
            }
            network.gaps[output] = bit_before.map_or(1, |before: u32| before - bit);
            bit_before = Some(*bit);
        }
        network
    }

    /// See [`super::super::super::lanes::Predictor::run_block`].
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni,avx512bitalg")]
    pub(in super::super) fn run_block(
        &self,
        lanes: &mut Lanes,
        blocks: &[u64; LANES],
        first_steps: usize,
        matches: &mut Matches,
    ) -> u32 {
        match self.pairs_used {
            7 => self.run_block_of::<7>(lanes, blocks, first_steps, matches),
            6 => self.run_block_of::<6>(lanes, blocks, first_steps, matches),
            4 => self.run_block_of::<4>(lanes, blocks, first_steps, matches),
            3 => self.run_block_of::<3>(lanes, blocks, first_steps, matches),
            _ => unreachable!("hidden layers have 6, 8, 12 or 14 neurons"),
        }
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni,avx512bitalg")]
    #[inline]
    fn run_block_of<const USED: usize>(
        &self,
        lanes: &mut Lanes,
        blocks: &[u64; LANES],
        first_steps: usize,
        matches: &mut Matches,
    ) -> u32 {
        let activation = Activation::new();
        let sensors = _mm512_set1_epi16(self.sensors as i16);
        let to_packed = load(&PACKED_ORDER.0);
        let windows = windows_in_packed_order(blocks);
        let mut expected_empty = _mm512_permutexvar_epi16(to_packed, load(&lanes.expected_empty));
        let mut low = [_mm512_setzero_si512(); USED];
        let mut high = [_mm512_setzero_si512(); USED];
        for pair in 0..USED {
            (low[pair], high[pair]) = load_two(&lanes.hidden[pair]);
        }
        let mut matched = _mm512_setzero_si512();
        let mut matched_first = matched;
        for (step, &window) in windows.iter().enumerate() {
            if step == first_steps {
                matched_first = matched;
            }
            let differing = _mm512_xor_si512(expected_empty, window);
            let matching = _mm512_popcnt_epi16(_mm512_and_si512(differing, sensors));
            matched = _mm512_add_epi16(matched, matching);

            let zero = _mm512_setzero_si512();
            let low_window = _mm512_unpacklo_epi16(window, zero);
            let high_window = _mm512_unpackhi_epi16(window, zero);
            self.hidden_layer(activation, low_window, high_window, &mut low, &mut high);
            expected_empty = self.output_layer(&low, &high);
        }
        let to_robots = load(&ROBOT_ORDER.0);
        store(
            &mut matches.block,
            _mm512_permutexvar_epi16(to_robots, matched),
        );
        store(
            &mut matches.first_steps,
            _mm512_permutexvar_epi16(to_robots, matched_first),
        );
        store(
            &mut lanes.expected_empty,
            _mm512_permutexvar_epi16(to_robots, expected_empty),
        );
        let mut low_unchanged = u16::MAX;
        let mut high_unchanged = u16::MAX;
        for pair in 0..USED {
            let (low_before, high_before) = load_two(&lanes.hidden[pair]);
            low_unchanged &= _mm512_cmpeq_epi32_mask(low_before, low[pair]);
            high_unchanged &= _mm512_cmpeq_epi32_mask(high_before, high[pair]);
            store_two(&mut lanes.hidden[pair], low[pair], high[pair]);
        }
        u32::from(low_unchanged) | u32::from(high_unchanged) << 16
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    #[inline]
    fn hidden_layer<const USED: usize>(
        &self,
        activation: Activation,
        low_window: __m512i,
        high_window: __m512i,
        low: &mut [__m512i; USED],
        high: &mut [__m512i; USED],
    ) {
        // A permutation by the lowest five bits of an index needs no mask.
        let by_fives = |window| {
            [
                window,
                _mm512_srli_epi32::<5>(window),
                _mm512_srli_epi32::<10>(window),
            ]
        };
        let low_windows = by_fives(low_window);
        let high_windows = by_fives(high_window);
        for pair in 0..USED {
            let mut values = [_mm512_setzero_si512(); 2];
            for (odd, value) in values.iter_mut().enumerate() {
                let neuron = 2 * pair + odd;
                let self_loop = _mm512_set1_epi32(self.self_loops[neuron]);
                let sum = |windows: &[__m512i; 3], hidden: __m512i| {
                    let [a, b, c] = core::array::from_fn(|five| {
                        let (first, second) = load_two_i32(&self.inputs[neuron][five]);
                        _mm512_permutex2var_epi32(first, windows[five], second)
                    });
                    let sum = _mm512_dpwssd_epi32(a, hidden, self_loop);
                    _mm512_add_epi32(sum, _mm512_add_epi32(b, c))
                };
                *value = activation
                    .activate_sums(sum(&low_windows, low[pair]), sum(&high_windows, high[pair]));
            }
            low[pair] = _mm512_unpacklo_epi16(values[0], values[1]);
            high[pair] = _mm512_unpackhi_epi16(values[0], values[1]);
        }
    }

    /// The window bits predicted not occupied, in packed order.
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni")]
    #[inline]
    fn output_layer<const USED: usize>(
        &self,
        low: &[__m512i; USED],
        high: &[__m512i; USED],
    ) -> __m512i {
        let mut expected_empty = _mm512_setzero_si512();
        for (row, &gap) in self.outputs.iter().zip(&self.gaps).take(self.outputs_used) {
            let mut low_sum = _mm512_setzero_si512();
            let mut high_sum = _mm512_setzero_si512();
            for pair in 0..USED {
                let weights = _mm512_set1_epi32(row[pair]);
                low_sum = _mm512_dpwssd_epi32(low_sum, low[pair], weights);
                high_sum = _mm512_dpwssd_epi32(high_sum, high[pair], weights);
            }
            for _ in 1..gap {
                expected_empty = _mm512_slli_epi16::<1>(expected_empty);
            }
            // Packing saturates, which keeps the sign; the sign bit is shifted in.
            let sums = _mm512_packs_epi32(low_sum, high_sum);
            expected_empty = _mm512_shldi_epi16::<1>(expected_empty, sums);
        }
        _mm512_sll_epi16(expected_empty, _mm_cvtsi32_si128(self.last_bit as i32))
    }
}

/// A register in memory.
#[repr(align(64))]
struct Lookup([u16; LANES]);

/// The robot in each place of the packed order.
static PACKED_ORDER: Lookup = {
    let mut order = [0; LANES];
    let mut place = 0;
    while place < LANES {
        order[place] = (place / 8 * 4 + place % 4 + place % 8 / 4 * 16) as u16;
        place += 1;
    }
    Lookup(order)
};

/// The place of each robot in the packed order.
static ROBOT_ORDER: Lookup = {
    let mut order = [0; LANES];
    let mut place = 0;
    while place < LANES {
        order[PACKED_ORDER.0[place] as usize] = place as u16;
        place += 1;
    }
    Lookup(order)
};

/// Takes two steps of eight robots from each of two registers of blocks: the first 16 places of
/// the packed order, for the first step and for the second.
static TWO_STEPS: Lookup = {
    let mut places = [0; LANES];
    let mut place = 0;
    while place < LANES {
        let robot = PACKED_ORDER.0[place % 16] as usize;
        // Robots from 16 on are in the second register.
        let block = robot % 16 + robot / 16 * 8;
        places[place] = (block * BLOCK_STEPS + place / 16) as u16;
        place += 1;
    }
    Lookup(places)
};

/// The windows of each step of some blocks.
#[target_feature(enable = "avx512f,avx512bw")]
#[inline]
fn windows_in_packed_order(blocks: &[u64; LANES]) -> [__m512i; BLOCK_STEPS] {
    // SAFETY: 32 words of 64 bits are four registers.
    let quarter =
        |q: usize| unsafe { _mm512_loadu_si512(blocks.as_ptr().cast::<__m512i>().add(q)) };
    let [a, b, c, d] = core::array::from_fn(quarter);
    let steps_0_1 = load(&TWO_STEPS.0);
    let steps_2_3 = _mm512_add_epi16(steps_0_1, _mm512_set1_epi16(2));
    let two_steps = |places| {
        let first = _mm512_permutex2var_epi16(a, places, c);
        let second = _mm512_permutex2var_epi16(b, places, d);
        (
            _mm512_shuffle_i64x2::<0b01_00_01_00>(first, second),
            _mm512_shuffle_i64x2::<0b11_10_11_10>(first, second),
        )
    };
    let (zeroth, first) = two_steps(steps_0_1);
    let (second, third) = two_steps(steps_2_3);
    [zeroth, first, second, third]
}

#[target_feature(enable = "avx512f")]
#[inline]
fn load(words: &[u16; LANES]) -> __m512i {
    // SAFETY: 32 words of 16 bits are a register.
    unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn store(words: &mut [u16; LANES], value: __m512i) {
    // SAFETY: 32 words of 16 bits are a register.
    unsafe { _mm512_storeu_si512(words.as_mut_ptr().cast(), value) }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn load_two(words: &[u32; LANES]) -> (__m512i, __m512i) {
    // SAFETY: 32 words of 32 bits are two registers.
    unsafe {
        let first = words.as_ptr().cast::<__m512i>();
        (_mm512_loadu_si512(first), _mm512_loadu_si512(first.add(1)))
    }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn load_two_i32(words: &[i32; 32]) -> (__m512i, __m512i) {
    // SAFETY: 32 words of 32 bits are two registers.
    unsafe {
        let first = words.as_ptr().cast::<__m512i>();
        (_mm512_loadu_si512(first), _mm512_loadu_si512(first.add(1)))
    }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn store_two(words: &mut [u32; LANES], low: __m512i, high: __m512i) {
    // SAFETY: 32 words of 32 bits are two registers.
    unsafe {
        let first = words.as_mut_ptr().cast::<__m512i>();
        _mm512_storeu_si512(first, low);
        _mm512_storeu_si512(first.add(1), high);
    }
}
