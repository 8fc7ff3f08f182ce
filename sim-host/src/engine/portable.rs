//! Predictions without processor-specific vector instructions: one lane after the other, with the
//! neurons of a layer side by side in arrays.

use super::lanes::{BLOCK_STEPS, Blocks, Lanes, Matches};
use super::network::PredictionWeights;
use minimal_surprise_controller::activate;
use minimal_surprise_controller::fixed::sum_to_q3_12;

/// Maximum number of neurons of a layer.
const WIDTH: usize = 16;

/// A prediction network as rows of neurons.
pub(super) struct Network {
    sensors: u16,
    expected_empty_at_start: u16,
    hidden: usize,
    /// Addends to every hidden sum, for every value of each group of five window bits.
    inputs: [[[i32; WIDTH]; 32]; 3],
    self_loops: [i32; WIDTH],
    /// Weights of each output and the window bit that it predicts.
    outputs: Vec<(u32, [i16; WIDTH])>,
}

impl Network {
    pub(super) fn new(weights: &PredictionWeights) -> Self {
        let mut network = Self {
            sensors: weights.sensors,
            expected_empty_at_start: weights.expected_empty_at_start,
            hidden: weights.hidden,
            inputs: [[[0; WIDTH]; 32]; 3],
            self_loops: [0; WIDTH],
            outputs: Vec::with_capacity(weights.outputs.len()),
        };
        for neuron in 0..weights.hidden {
            for (group, rows) in network.inputs.iter_mut().enumerate() {
                let table: [i32; 32] = weights.sums[neuron].table(5 * group);
                for (row, value) in rows.iter_mut().zip(table) {
                    row[neuron] = value;
                }
            }
            network.self_loops[neuron] = weights.self_loops[neuron].into();
        }
        for (bit, row) in &weights.outputs {
            let mut padded = [0; WIDTH];
            padded[..row.len()].copy_from_slice(row);
            network.outputs.push((*bit, padded));
        }
        network
    }

    /// Runs one block; see [`super::lanes::Predictor::run_block`].
    pub(super) fn run_block(
        &self,
        lanes: &mut Lanes,
        blocks: &Blocks,
        matches: &mut Matches,
    ) -> u32 {
        let mut unchanged = 0;
        for (lane, &inputs) in blocks.inputs.iter().enumerate() {
            let mut hidden = [0_i16; WIDTH];
            for (pair, values) in lanes.hidden.iter().zip(hidden.chunks_exact_mut(2)) {
                (values[0], values[1]) = (pair[lane] as i16, (pair[lane] >> 16) as i16);
            }
            let before = hidden;
            let mut matched = 0;
            for step in 0..BLOCK_STEPS {
                if step == blocks.first_steps {
                    matches.first_steps[lane] = matched;
                }
                let window = (inputs >> (16 * step)) as u16;
                let expected_empty = if step == 0 && blocks.starting >> lane & 1 == 1 {
                    self.expected_empty_at_start
                } else {
                    self.expected_empty(&hidden)
                };
                matched += ((expected_empty ^ window) & self.sensors).count_ones() as u16;
                self.update_hidden(window, &mut hidden);
            }
            matches.block[lane] = matched;
            for (pair, values) in lanes.hidden.iter_mut().zip(hidden.chunks_exact(2)) {
                pair[lane] = u32::from(values[0] as u16) | u32::from(values[1] as u16) << 16;
            }
            unchanged |= u32::from(hidden == before) << lane;
        }
        unchanged
    }

    #[inline]
    fn update_hidden(&self, window: u16, hidden: &mut [i16; WIDTH]) {
        let rows = [0, 1, 2].map(|g| &self.inputs[g][usize::from(window >> (5 * g) & 31)]);
        let mut sums = [0_i32; WIDTH];
        for neuron in 0..WIDTH {
            sums[neuron] = rows[0][neuron]
                .wrapping_add(rows[1][neuron])
                .wrapping_add(rows[2][neuron])
                .wrapping_add(self.self_loops[neuron] * i32::from(hidden[neuron]));
        }
        for (value, sum) in hidden.iter_mut().zip(sums).take(self.hidden) {
            *value = activate(sum_to_q3_12(sum));
        }
    }

    /// Returns the window bits that the activations predict to be empty.
    #[inline]
    fn expected_empty(&self, hidden: &[i16; WIDTH]) -> u16 {
        let mut expected_empty = 0;
        for (bit, row) in &self.outputs {
            let mut sum = 0;
            for (&weight, &value) in row.iter().zip(hidden) {
                sum += i32::from(weight) * i32::from(value);
            }
            expected_empty |= u16::from(sum < 0) << bit;
        }
        expected_empty
    }
}
