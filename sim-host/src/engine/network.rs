//! The prediction network in window order, before its conversion to the layout of a vector unit.
//!
//! An input neuron has two values, so the sum of a hidden neuron's inputs is a constant plus one
//! addend for each bit that is set; sums are exact in any order.

use super::window::{WINDOW_BITS, WindowOrder};
use minimal_surprise_controller::controller::spread;
use minimal_surprise_controller::fixed::ROUNDING_Q24;
use minimal_surprise_controller::network::{MAX_HIDDEN, MAX_OUTPUTS, Network, SELF_LOOP};
use minimal_surprise_controller::{Controller, Topology};

/// The input sum of a hidden neuron as a function of the window, Q24.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HiddenSum {
    /// The sum for an empty window, including the rounding term.
    pub(super) empty: i32,
    /// Addend of each window bit that is set.
    pub(super) addends: [i32; WINDOW_BITS],
}

impl HiddenSum {
    /// Returns the input sums of a network's hidden neurons.
    pub(super) fn of<const H: usize, const O: usize>(
        network: &Network<H, O>,
        order: &WindowOrder,
    ) -> [Self; H] {
        let levels = network.input_levels();
        let mut sums = [Self::default(); H];
        for (sum, row) in sums.iter_mut().zip(network.hidden_rows()) {
            sum.empty = ROUNDING_Q24;
            let inputs = order.inputs().zip(levels).zip(row);
            for ((bit, [low, high]), &weight) in inputs {
                let weight = i32::from(weight);
                sum.empty += weight * i32::from(low);
                sum.addends[bit] = weight * (i32::from(high) - i32::from(low));
            }
        }
        sums
    }

    /// Tabulates the contribution of the n bits starting at `first` to the sum, for each of their
    /// 2ⁿ = `N` values. The first table includes the sum of an empty window.
    ///
    /// The values of one table may exceed `i32`; the values and the totals are correct modulo 2³²,
    /// and the final sums fit.
    pub(super) fn table<const N: usize>(&self, first: usize) -> [i32; N] {
        let mut table = [0; N];
        table[0] = if first == 0 { self.empty } else { 0 };
        for (bit, addend) in self.addends[first..]
            .iter()
            .enumerate()
            .take(N.trailing_zeros() as usize)
        {
            for value in 0..1 << bit {
                table[value | 1 << bit] = i32::wrapping_add(table[value], *addend);
            }
        }
        table
    }
}

/// Returns the window bits that a robot predicts to be *empty* before its first step. In this form,
/// a predicted bit matches if it differs from the next reading.
pub(super) fn expected_empty_at_start(topology: Topology, order: &WindowOrder) -> u16 {
    order.sensors() & !order.window(topology.fixed().bits())
}

/// The prediction network of one genome.
#[derive(Clone, Debug)]
pub(super) struct PredictionWeights {
    /// Window bits that are sensors.
    pub(super) sensors: u16,
    /// Window bits predicted to be empty before the first step.
    pub(super) expected_empty_at_start: u16,
    /// Number of hidden neurons in use.
    pub(super) hidden: usize,
    pub(super) sums: [HiddenSum; MAX_HIDDEN],
    pub(super) self_loops: [i16; MAX_HIDDEN],
    /// Output rows with the window bit that each row predicts; the highest bit first.
    pub(super) outputs: Vec<(u32, [i16; MAX_HIDDEN])>,
}

impl PredictionWeights {
    /// Converts the prediction network of a controller; `None` if all predictions are fixed.
    pub(super) fn new(controller: &Controller, order: &WindowOrder) -> Option<Self> {
        let network = controller.prediction_network()?;
        let predicted = controller.topology().predicted().bits();
        let mut outputs: Vec<(u32, [i16; MAX_HIDDEN])> = network
            .output_rows()
            .iter()
            .take(network.shape().outputs())
            .enumerate()
            .map(|(output, &row)| {
                let sensor = spread(1 << output, predicted);
                (order.window(sensor).trailing_zeros(), row)
            })
            .collect();
        outputs.sort_unstable_by_key(|&(bit, _)| core::cmp::Reverse(bit));
        debug_assert!(outputs.len() <= MAX_OUTPUTS);
        Some(Self {
            sensors: order.sensors(),
            expected_empty_at_start: expected_empty_at_start(controller.topology(), order),
            hidden: network.shape().hidden(),
            sums: HiddenSum::of(network, order),
            self_loops: network.hidden_rows().map(|row| row[SELF_LOOP]),
            outputs,
        })
    }
}
