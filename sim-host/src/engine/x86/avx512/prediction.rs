//! Prediction networks of 32 robots: 16 sums or 32 activations per register.
//!
//! Packing two registers of sums into one register of activations interleaves them by fours, and
//! unpacking restores the order. So 32-bit hidden activations are in the order of the robots, and
//! windows are converted to the packed order when blocks are split into steps.

use super::super::super::lanes::{BLOCK_STEPS, Blocks, LANES, Lanes, Matches, PAIRS};
use super::super::super::network::PredictionWeights;
use super::activation::Activation;
use core::arch::x86_64::*;

/// A prediction network laid out for [`Network::run_block`].
#[repr(align(64))]
pub(in super::super::super) struct Network {
    /// For each hidden neuron, the sums for every value of each group of five window bits.
    inputs: [[[i32; 32]; 3]; 2 * PAIRS],
    /// Self-loop of each hidden neuron, in its half of a pair; zero in the other half.
    self_loops: [i32; 2 * PAIRS],
    /// Weights of each output in pairs.
    outputs: [[i32; PAIRS]; 2 * PAIRS],
    outputs_used: usize,
    runs: Vec<Run>,
    pairs_used: usize,
    sensors: u16,
    expected_empty_at_start: u16,
}

/// Packs two weights into one factor of a product of pairs.
fn pair(even: i16, odd: i16) -> i32 {
    (u32::from(even as u16) | u32::from(odd as u16) << 16) as i32
}

impl Network {
    pub(in super::super::super) fn new(weights: &PredictionWeights) -> Self {
        let mut network = Self {
            inputs: [[[0; 32]; 3]; 2 * PAIRS],
            self_loops: [0; 2 * PAIRS],
            outputs: [[0; PAIRS]; 2 * PAIRS],
            outputs_used: weights.outputs.len(),
            runs: Run::all(weights.outputs.iter().map(|&(bit, _)| bit)),
            pairs_used: weights.hidden.div_ceil(2),
            sensors: weights.sensors,
            expected_empty_at_start: weights.expected_empty_at_start,
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
        for (pairs, (_, row)) in network.outputs.iter_mut().zip(&weights.outputs) {
            for (to, from) in pairs.iter_mut().zip(row.chunks_exact(2)) {
                *to = pair(from[0], from[1]);
            }
        }
        network
    }

    /// Runs one block; see [`super::super::super::lanes::Predictor::run_block`].
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni,avx512bitalg")]
    pub(in super::super) fn run_block(
        &self,
        lanes: &mut Lanes,
        blocks: &Blocks,
        matches: &mut Matches,
    ) -> u32 {
        match self.pairs_used {
            7 => self.run_block_of::<7>(lanes, blocks, matches),
            6 => self.run_block_of::<6>(lanes, blocks, matches),
            4 => self.run_block_of::<4>(lanes, blocks, matches),
            3 => self.run_block_of::<3>(lanes, blocks, matches),
            _ => unreachable!("hidden layers have 6, 8, 12 or 14 neurons"),
        }
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni,avx512bitalg")]
    #[inline]
    fn run_block_of<const USED: usize>(
        &self,
        lanes: &mut Lanes,
        blocks: &Blocks,
        matches: &mut Matches,
    ) -> u32 {
        let windows = windows_in_packed_order(&blocks.inputs);
        // The two buffers alternate: one holds the previous hidden activations, the other receives
        // the next.
        let mut even = Hidden::<USED>::load(lanes);
        let mut odd = Hidden::<USED>::none();
        let at_start = _mm512_set1_epi16(self.expected_empty_at_start as i16);
        let starting = in_packed_order(blocks.starting);
        let expected = [
            _mm512_mask_mov_epi16(self.step(windows[0], &even, &mut odd), starting, at_start),
            self.step(windows[1], &odd, &mut even),
            self.step(windows[2], &even, &mut odd),
            self.step(windows[3], &odd, &mut even),
        ];
        let sensors = _mm512_set1_epi16(self.sensors as i16);
        let mut matched = _mm512_setzero_si512();
        let mut matched_first = matched;
        for step in 0..BLOCK_STEPS {
            if step == blocks.first_steps {
                matched_first = matched;
            }
            let differing = _mm512_xor_si512(expected[step], windows[step]);
            let matching = _mm512_popcnt_epi16(_mm512_and_si512(differing, sensors));
            matched = _mm512_add_epi16(matched, matching);
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
        even.store_and_compare(lanes)
    }

    /// Runs one step: computes the next hidden activations and returns the window bits that the
    /// previous activations predict to be empty, in packed order.
    ///
    /// Both results depend only on the previous activations, so neither waits for the other.
    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni")]
    #[inline]
    fn step<const USED: usize>(
        &self,
        window: __m512i,
        last: &Hidden<USED>,
        next: &mut Hidden<USED>,
    ) -> __m512i {
        self.hidden_layer(window, last, next);
        self.output_layer(last)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    #[inline]
    fn hidden_layer<const USED: usize>(
        &self,
        window: __m512i,
        last: &Hidden<USED>,
        next: &mut Hidden<USED>,
    ) {
        let activation = Activation::new();
        let zero = _mm512_setzero_si512();
        let low_windows = by_fives(_mm512_unpacklo_epi16(window, zero));
        let high_windows = by_fives(_mm512_unpackhi_epi16(window, zero));
        for pair in 0..USED {
            let (even, odd) = (2 * pair, 2 * pair + 1);
            let (low, high) = (last.low[pair], last.high[pair]);
            let even = activation.activate_sums(
                self.hidden_sum(even, low_windows, low),
                self.hidden_sum(even, high_windows, high),
            );
            let odd = activation.activate_sums(
                self.hidden_sum(odd, low_windows, low),
                self.hidden_sum(odd, high_windows, high),
            );
            next.low[pair] = _mm512_unpacklo_epi16(even, odd);
            next.high[pair] = _mm512_unpackhi_epi16(even, odd);
        }
    }

    /// Computes the hidden sums of 16 robots from their windows and previous activations.
    #[target_feature(enable = "avx512f,avx512vnni")]
    #[inline]
    fn hidden_sum(&self, neuron: usize, windows: [__m512i; 3], last: __m512i) -> __m512i {
        let [a, b, c] = &self.inputs[neuron];
        let a = look_up(a, windows[0]);
        let b = look_up(b, windows[1]);
        let c = look_up(c, windows[2]);
        let self_loop = _mm512_set1_epi32(self.self_loops[neuron]);
        _mm512_add_epi32(add_products(a, last, self_loop), _mm512_add_epi32(b, c))
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi2,avx512vnni")]
    #[inline]
    fn output_layer<const USED: usize>(&self, hidden: &Hidden<USED>) -> __m512i {
        let mut signs = _mm512_setzero_si512();
        for weights in self.outputs.iter().take(self.outputs_used) {
            let mut low = _mm512_setzero_si512();
            let mut high = _mm512_setzero_si512();
            for pair in 0..USED {
                let weights = _mm512_set1_epi32(weights[pair]);
                low = add_products(low, hidden.low[pair], weights);
                high = add_products(high, hidden.high[pair], weights);
            }
            // Packing saturates and keeps the sign; the sign bit is shifted in.
            signs = _mm512_shldi_epi16::<1>(signs, _mm512_packs_epi32(low, high));
        }
        let mut expected_empty = _mm512_setzero_si512();
        for run in &self.runs {
            let signs = _mm512_and_si512(signs, _mm512_set1_epi16(run.signs as i16));
            let signs = _mm512_sll_epi16(signs, _mm_cvtsi32_si128(run.shift as i32));
            expected_empty = _mm512_or_si512(expected_empty, signs);
        }
        expected_empty
    }
}

/// Consecutive outputs that predict neighbouring window bits.
struct Run {
    /// Bits of the run among the signs of all outputs.
    signs: u16,
    /// Distance from these bits to the window bits.
    shift: u32,
}

impl Run {
    /// Returns the runs of outputs that predict these bits, with the highest bits first. The sign
    /// of the last output is bit 0.
    fn all(window_bits: impl DoubleEndedIterator<Item = u32>) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        for (sign, bit) in window_bits.rev().enumerate() {
            let shift = bit - sign as u32;
            match runs.last_mut() {
                Some(run) if run.shift == shift => run.signs |= 1 << sign,
                _ => runs.push(Self {
                    signs: 1 << sign,
                    shift,
                }),
            }
        }
        runs
    }
}

/// Returns windows, and windows shifted by five and by ten bits: indices into tables of 32 entries.
#[target_feature(enable = "avx512f")]
#[inline]
fn by_fives(windows: __m512i) -> [__m512i; 3] {
    [
        windows,
        _mm512_srli_epi32::<5>(windows),
        _mm512_srli_epi32::<10>(windows),
    ]
}

/// Looks up the entries selected by the lowest five bits of the indices.
#[target_feature(enable = "avx512f")]
#[inline]
fn look_up(table: &[i32; 32], indices: __m512i) -> __m512i {
    // SAFETY: 32 32-bit words fill two registers.
    let (first, second) = unsafe {
        let first = table.as_ptr().cast::<__m512i>();
        (_mm512_loadu_si512(first), _mm512_loadu_si512(first.add(1)))
    };
    _mm512_permutex2var_epi32(first, indices, second)
}

/// Hidden activations in pairs: those of the first 16 robots, and those of the others.
struct Hidden<const USED: usize> {
    low: [__m512i; USED],
    high: [__m512i; USED],
}

impl<const USED: usize> Hidden<USED> {
    #[target_feature(enable = "avx512f")]
    #[inline]
    fn none() -> Self {
        Self {
            low: [_mm512_setzero_si512(); USED],
            high: [_mm512_setzero_si512(); USED],
        }
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    fn load(lanes: &Lanes) -> Self {
        let mut hidden = Self::none();
        for pair in 0..USED {
            (hidden.low[pair], hidden.high[pair]) = load_two(&lanes.hidden[pair]);
        }
        hidden
    }

    /// Stores the activations; returns one bit per robot, set if its activations have not changed.
    #[target_feature(enable = "avx512f")]
    #[inline]
    fn store_and_compare(&self, lanes: &mut Lanes) -> u32 {
        let mut low_unchanged = u16::MAX;
        let mut high_unchanged = u16::MAX;
        for pair in 0..USED {
            let (low_before, high_before) = load_two(&lanes.hidden[pair]);
            low_unchanged &= _mm512_cmpeq_epi32_mask(low_before, self.low[pair]);
            high_unchanged &= _mm512_cmpeq_epi32_mask(high_before, self.high[pair]);
            store_two(&mut lanes.hidden[pair], self.low[pair], self.high[pair]);
        }
        u32::from(low_unchanged) | u32::from(high_unchanged) << 16
    }
}

/// Converts one bit per robot to packed order.
#[target_feature(enable = "avx512f,avx512bw")]
#[inline]
fn in_packed_order(robots: u32) -> __mmask32 {
    let bits = _mm512_maskz_set1_epi16(robots, -1);
    _mm512_movepi16_mask(_mm512_permutexvar_epi16(load(&PACKED_ORDER.0), bits))
}

/// Computes `_mm512_dpwssd_epi32`, which the compiler would split into a multiplication and an
/// addition to shorten a dependency chain; but enough independent chains hide the latency.
#[target_feature(enable = "avx512f,avx512vnni")]
#[inline]
fn add_products(mut sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
    // SAFETY: the instruction changes only the register of `sum`.
    unsafe {
        core::arch::asm!(
            "vpdpwssd {sum}, {a}, {b}",
            sum = inout(zmm_reg) sum,
            a = in(zmm_reg) a,
            b = in(zmm_reg) b,
            options(pure, nomem, nostack, preserves_flags),
        );
    }
    sum
}

/// A table that is one register in size.
#[repr(align(64))]
struct Lookup([u16; LANES]);

/// The robot at each index of the packed order.
static PACKED_ORDER: Lookup = {
    let mut order = [0; LANES];
    let mut place = 0;
    while place < LANES {
        order[place] = (place / 8 * 4 + place % 4 + place % 8 / 4 * 16) as u16;
        place += 1;
    }
    Lookup(order)
};

/// The index of each robot in the packed order.
static ROBOT_ORDER: Lookup = {
    let mut order = [0; LANES];
    let mut place = 0;
    while place < LANES {
        order[PACKED_ORDER.0[place] as usize] = place as u16;
        place += 1;
    }
    Lookup(order)
};

/// Indices that select two steps of eight robots from two registers of blocks: the first 16 entries
/// of the packed order, for the first step and for the second.
static TWO_STEPS: Lookup = {
    let mut places = [0; LANES];
    let mut place = 0;
    while place < LANES {
        let robot = PACKED_ORDER.0[place % 16] as usize;
        // Robots 16 and above are in the second register.
        let block = robot % 16 + robot / 16 * 8;
        places[place] = (block * BLOCK_STEPS + place / 16) as u16;
        place += 1;
    }
    Lookup(places)
};

/// Splits blocks into the windows of each step.
#[target_feature(enable = "avx512f,avx512bw")]
#[inline]
fn windows_in_packed_order(blocks: &[u64; LANES]) -> [__m512i; BLOCK_STEPS] {
    // SAFETY: 32 64-bit words fill four registers.
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
    // SAFETY: 32 16-bit words fill a register.
    unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn store(words: &mut [u16; LANES], value: __m512i) {
    // SAFETY: 32 16-bit words fill a register.
    unsafe { _mm512_storeu_si512(words.as_mut_ptr().cast(), value) }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn load_two(words: &[u32; LANES]) -> (__m512i, __m512i) {
    // SAFETY: 32 32-bit words fill two registers.
    unsafe {
        let first = words.as_ptr().cast::<__m512i>();
        (_mm512_loadu_si512(first), _mm512_loadu_si512(first.add(1)))
    }
}

#[target_feature(enable = "avx512f")]
#[inline]
fn store_two(words: &mut [u32; LANES], low: __m512i, high: __m512i) {
    // SAFETY: 32 32-bit words fill two registers.
    unsafe {
        let first = words.as_mut_ptr().cast::<__m512i>();
        _mm512_storeu_si512(first, low);
        _mm512_storeu_si512(first.add(1), high);
    }
}
