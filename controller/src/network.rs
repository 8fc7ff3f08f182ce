//! The three-layer networks: shape, weight order, and one forward pass.
//!
//! With `act` = [`activate`] and all values in Q3.12:
//!
//! - input neuron j: `u_j = act(w_j · x_j − θ_j)`, where x_j is a bit. Its two possible values are
//!   precomputed;
//! - hidden neuron i: `h_i = act(Σ_j W_ij · u_j + r_i · h_i(t−1))`, the last term in the
//!   prediction network only (paper, Fig. 1b);
//! - output neuron k: the sign of the exact sum `Σ_i V_ki · h_i`.
//!
//! Genome order of the weights: `w₀, θ₀, w₁, θ₁, …`; hidden rows, each with its self-loop last if
//! it has one; output rows.

use crate::activation::activate;
use crate::fixed::{Aligned, FRACTION_BITS, MAX_TERMS, ONE_Q3_12, saturate};
#[cfg(not(has_smlad))]
use crate::fixed::{ROUNDING_Q24, sum_to_q3_12};

/// Maximum number of inputs of a network: 14 sensors and the action value.
pub const MAX_INPUTS: usize = 15;
/// Maximum number of hidden neurons of a network.
pub const MAX_HIDDEN: usize = 14;
/// Maximum number of outputs of a network.
pub const MAX_OUTPUTS: usize = 14;
/// Index of the self-loop among a hidden neuron's terms.
pub const SELF_LOOP: usize = MAX_TERMS - 1;

/// Sizes of a network. The last input is the action value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shape {
    inputs: u8,
    hidden: u8,
    outputs: u8,
    recurrent: bool,
}

/// Error: a network of these sizes cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ShapeError {
    /// A sum has too many terms to be exact in `i32`.
    #[error("a sum of {terms} terms; at most {MAX_TERMS} are exact")]
    TooManyTerms {
        /// Number of terms of the longest sum.
        terms: usize,
    },
    /// A layer is empty or exceeds the memory reserved for it.
    #[error(
        "{inputs}-{hidden}-{outputs} does not fit 1..={MAX_INPUTS} inputs, \
         1..={MAX_HIDDEN} hidden and 1..={MAX_OUTPUTS} output neurons"
    )]
    DoesNotFit {
        /// Number of inputs requested.
        inputs: usize,
        /// Number of hidden neurons requested.
        hidden: usize,
        /// Number of outputs requested.
        outputs: usize,
    },
}

impl Shape {
    /// Creates a shape after checking that every sum stays exact and every layer fits.
    ///
    /// # Errors
    /// [`ShapeError`] if a sum has too many terms, or a layer is empty or too large.
    pub const fn new(
        inputs: usize,
        hidden: usize,
        outputs: usize,
        recurrent: bool,
    ) -> Result<Self, ShapeError> {
        let input_terms = inputs + recurrent as usize;
        let terms = if input_terms > hidden {
            input_terms
        } else {
            hidden
        };
        if terms > MAX_TERMS {
            return Err(ShapeError::TooManyTerms { terms });
        }
        if inputs == 0
            || inputs > MAX_INPUTS
            || hidden == 0
            || hidden > MAX_HIDDEN
            || outputs == 0
            || outputs > MAX_OUTPUTS
        {
            return Err(ShapeError::DoesNotFit {
                inputs,
                hidden,
                outputs,
            });
        }
        Ok(Self {
            inputs: inputs as u8,
            hidden: hidden as u8,
            outputs: outputs as u8,
            recurrent,
        })
    }

    /// Creates a shape for use in a constant; an invalid shape does not compile.
    pub(crate) const fn checked(
        inputs: usize,
        hidden: usize,
        outputs: usize,
        recurrent: bool,
    ) -> Self {
        match Self::new(inputs, hidden, outputs, recurrent) {
            Ok(shape) => shape,
            Err(_) => panic!("a network of this shape cannot be built"),
        }
    }

    /// Returns the number of inputs, including the action value.
    #[must_use]
    pub const fn inputs(self) -> usize {
        self.inputs as usize
    }

    /// Returns the number of hidden neurons.
    #[must_use]
    pub const fn hidden(self) -> usize {
        self.hidden as usize
    }

    /// Returns the number of output neurons.
    #[must_use]
    pub const fn outputs(self) -> usize {
        self.outputs as usize
    }

    /// Returns whether every hidden neuron has a self-loop.
    #[must_use]
    pub const fn recurrent(self) -> bool {
        self.recurrent
    }

    /// Returns the number of weights of one hidden neuron.
    #[must_use]
    pub const fn hidden_row(self) -> usize {
        self.inputs() + self.recurrent as usize
    }

    /// Returns the number of weights of the whole network.
    #[must_use]
    pub const fn weights(self) -> usize {
        2 * self.inputs() + self.hidden() * self.hidden_row() + self.outputs() * self.hidden()
    }
}

/// A network with memory for `H` hidden neurons and `O` outputs; entries beyond the shape are zero
/// and add nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Network<const H: usize, const O: usize> {
    shape: Shape,
    /// Activations of each pair of input neurons, for every value of their two bits.
    input: Aligned<[[[i16; 2]; 4]; MAX_TERMS / 2]>,
    /// The inputs' weights, starting at 0, and the self-loop at [`SELF_LOOP`].
    hidden: Aligned<[[i16; MAX_TERMS]; H]>,
    output: Aligned<[[i16; H]; O]>,
}

/// The action network of any topology.
pub type ActionNetwork = Network<8, 2>;
/// The prediction network of any topology.
pub type PredictionNetwork = Network<MAX_HIDDEN, MAX_OUTPUTS>;

impl<const H: usize, const O: usize> Network<H, O> {
    const TERMS_ARE_EXACT: () = assert!(H <= MAX_TERMS && O <= 16, "more than 16 terms in a sum");

    /// Creates a network with all rows zero.
    #[inline]
    pub(crate) const fn zeroed(shape: Shape) -> Self {
        let () = Self::TERMS_ARE_EXACT;
        Self {
            shape,
            input: Aligned([[[0; 2]; 4]; MAX_TERMS / 2]),
            hidden: Aligned([[0; MAX_TERMS]; H]),
            output: Aligned([[0; H]; O]),
        }
    }

    /// Reads the shape's weights, in genome order, from `weights`. Missing weights are zero;
    /// surplus weights stay in the iterator. Neurons beyond `H` and `O` are skipped. All rows must
    /// be zero before the call.
    pub(crate) fn read_weights(&mut self, weights: &mut dyn Iterator<Item = i16>) {
        read_weights(
            self.shape,
            weights,
            &mut self.input.0,
            &mut self.hidden.0,
            self.output.0.as_flattened_mut(),
            H,
        );
    }

    /// Returns the network's sizes.
    #[must_use]
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Returns the activations (Q3.12) of each input neuron for bit values 0 and 1; zero beyond the
    /// shape.
    #[must_use]
    pub fn input_levels(&self) -> [[i16; 2]; MAX_INPUTS] {
        core::array::from_fn(|input| {
            let pairs = &self.input.0[input / 2];
            [0, 1].map(|bit| pairs[bit << (input % 2)][input % 2])
        })
    }

    /// Returns the hidden weights (Q3.12): one row per neuron, the self-loop at [`SELF_LOOP`]; zero
    /// beyond the shape.
    #[must_use]
    pub fn hidden_rows(&self) -> &[[i16; MAX_TERMS]; H] {
        &self.hidden.0
    }

    /// Returns the output weights (Q3.12): one row per output; zero beyond the shape.
    #[must_use]
    pub fn output_rows(&self) -> &[[i16; H]; O] {
        &self.output.0
    }

    /// Runs one forward pass: bit j of `inputs` is input j; bit k of the result is set if output k
    /// is not negative. `hidden` holds the previous hidden activations and receives the new ones;
    /// without self-loops, the previous activations are not used.
    #[inline]
    pub(crate) fn forward(&self, inputs: u32, hidden: &mut Aligned<[i16; H]>) -> u16 {
        let mut terms = Aligned([0; MAX_TERMS]);
        select_terms(&self.input, inputs, &mut terms);
        let neurons = self.shape.hidden();
        hidden_sums(&self.hidden, &mut terms, &mut hidden.0, neurons);
        activate_all(&mut hidden.0, neurons);
        output_signs(&self.output, hidden, self.shape.outputs())
    }
}

/// Fills the layers of a network of any size. Not generic, so that a robot's flash holds only one
/// copy. An output row has `output_row` weights.
#[inline(never)]
fn read_weights(
    shape: Shape,
    weights: &mut dyn Iterator<Item = i16>,
    input: &mut [[[i16; 2]; 4]; MAX_TERMS / 2],
    hidden: &mut [[i16; MAX_TERMS]],
    output: &mut [i16],
    output_row: usize,
) {
    let mut next = || weights.next().unwrap_or(0);
    for index in 0..shape.inputs().min(MAX_INPUTS) {
        let weight = i32::from(next());
        let threshold = i32::from(next());
        let levels = [
            activate(saturate(-threshold)),
            activate(saturate(weight - threshold)),
        ];
        for (bits, pair) in input[index / 2].iter_mut().enumerate() {
            pair[index % 2] = levels[bits >> (index % 2) & 1];
        }
    }
    for row in hidden.iter_mut().take(shape.hidden()) {
        for weight in row.iter_mut().take(shape.inputs()) {
            *weight = next();
        }
        if shape.recurrent() {
            row[SELF_LOOP] = next();
        }
    }
    let rows = output.chunks_exact_mut(output_row.max(1));
    for row in rows.take(shape.outputs()) {
        for weight in row.iter_mut().take(shape.hidden()) {
            *weight = next();
        }
    }
}

/// Selects each pair of terms by the pair's two bits in `inputs`.
#[cfg(not(has_smlad))]
#[inline]
fn select_terms(
    pairs: &Aligned<[[[i16; 2]; 4]; MAX_TERMS / 2]>,
    inputs: u32,
    terms: &mut Aligned<[i16; MAX_TERMS]>,
) {
    let mut bits = inputs as usize;
    for (terms, pairs) in terms.0.as_chunks_mut().0.iter_mut().zip(&pairs.0) {
        *terms = pairs[bits & 3];
        bits >>= 2;
    }
}

/// Replaces each of the first `count` values with the Q3.12 sum of its row's products with `terms`;
/// the value itself is the last term.
#[cfg(not(has_smlad))]
#[inline]
fn hidden_sums<const H: usize>(
    rows: &Aligned<[[i16; MAX_TERMS]; H]>,
    terms: &mut Aligned<[i16; MAX_TERMS]>,
    values: &mut [i16; H],
    count: usize,
) {
    for (row, value) in rows.0.iter().zip(values).take(count) {
        terms.0[SELF_LOOP] = *value;
        *value = sum_to_q3_12(ROUNDING_Q24 + dot(row, &terms.0));
    }
}

/// Replaces the first `count` values with their activations.
#[cfg(not(has_smlad))]
#[inline]
fn activate_all<const H: usize>(values: &mut [i16; H], count: usize) {
    for value in values.iter_mut().take(count) {
        *value = activate(*value);
    }
}

#[cfg(has_smlad)]
use crate::dsp::{activate_all, hidden_sums, select_terms};

/// Sets bit k if the sum of row k's products with `terms` is not negative, for the first `count`
/// rows.
#[inline]
fn output_signs<const H: usize, const O: usize>(
    rows: &Aligned<[[i16; H]; O]>,
    terms: &Aligned<[i16; H]>,
    count: usize,
) -> u16 {
    #[cfg(has_smlad)]
    if H == crate::dsp::OUTPUT_TERMS {
        return crate::dsp::output_signs(rows, terms, count);
    }
    #[cfg(has_smlad)]
    if H == crate::dsp::ACTION_TERMS {
        return crate::dsp::action_signs(rows, terms, count);
    }
    let mut outputs = 0;
    for (index, row) in rows.0.iter().enumerate().take(count) {
        outputs |= u16::from(dot(row, &terms.0) >= 0) << index;
    }
    outputs
}

/// Computes the exact sum of products, Q24. Callers pass at most [`MAX_TERMS`] terms, with one
/// factor of each within ±[`ONE_Q3_12`].
#[inline]
fn dot<const N: usize>(weights: &[i16; N], values: &[i16; N]) -> i32 {
    let mut sum = 0;
    for (&weight, &value) in weights.iter().zip(values) {
        sum += i32::from(weight) * i32::from(value);
    }
    sum
}

const _: () = assert!(ONE_Q3_12 as i32 == 1 << FRACTION_BITS);

#[cfg(test)]
mod tests {
    use super::*;

    fn network<const H: usize, const O: usize>(
        shape: Shape,
        weights: &mut dyn Iterator<Item = i16>,
    ) -> Network<H, O> {
        let mut network = Network::zeroed(shape);
        network.read_weights(weights);
        network
    }

    #[test]
    fn more_than_sixteen_terms_cannot_be_built() {
        assert!(Shape::new(15, 14, 14, true).is_ok());
        assert_eq!(
            Shape::new(16, 8, 2, true),
            Err(ShapeError::TooManyTerms { terms: 17 })
        );
        assert_eq!(
            Shape::new(15, 17, 2, false),
            Err(ShapeError::TooManyTerms { terms: 17 })
        );
        assert!(matches!(
            Shape::new(16, 8, 2, false),
            Err(ShapeError::DoesNotFit { .. })
        ));
        assert!(matches!(
            Shape::new(0, 8, 2, false),
            Err(ShapeError::DoesNotFit { .. })
        ));
    }

    #[test]
    fn a_forward_pass_matches_one_computed_by_hand() {
        // One input (w = 1, θ = 0.5), one hidden neuron (W = 2, r = −1), one output (V = 1).
        let shape = Shape::new(1, 1, 1, true).unwrap();
        let mut weights = [4096, 2048, 8192, -4096, 4096].into_iter();
        let network = network::<1, 1>(shape, &mut weights);
        let u1 = activate(2048);
        assert_eq!(network.input_levels()[0], [-u1, u1]);

        let mut hidden = Aligned([0]);
        assert_eq!(network.forward(1, &mut hidden), 1);
        let first = activate(((8192 * i32::from(u1) + 2048) >> 12) as i16);
        assert_eq!(hidden.0, [first]);

        assert_eq!(network.forward(0, &mut hidden), 0);
        let sum = -8192 * i32::from(u1) - 4096 * i32::from(first);
        assert_eq!(hidden.0, [activate(((sum + 2048) >> 12) as i16)]);
    }

    #[test]
    fn an_output_of_exactly_zero_counts_as_not_negative() {
        let shape = Shape::new(1, 1, 1, false).unwrap();
        let network = network::<1, 1>(shape, &mut core::iter::empty());
        assert_eq!(network.forward(0, &mut Aligned([0])), 1);
    }

    #[test]
    fn the_largest_sums_are_exact() {
        let shape = Shape::new(15, 14, 14, true).unwrap();
        for (level, weight) in [(1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let (level, weight) = (level * 32767, weight * 32767);
            // The thresholds make every input neuron's activation equal to the self-loop's value.
            let inputs = [0, -level].into_iter().cycle().take(30);
            let mut weights = inputs.chain(core::iter::repeat(weight));
            let network: PredictionNetwork = network(shape, &mut weights);
            let value = activate(level);
            assert!(value.abs() >= ONE_Q3_12 - 1);
            let mut hidden = Aligned([value; MAX_HIDDEN]);
            let outputs = network.forward(0, &mut hidden);
            let sum = 16 * i64::from(value) * i64::from(weight) + 2048;
            let sum = (sum >> 12).clamp(i16::MIN.into(), i16::MAX.into());
            let expected = activate(sum as i16);
            assert_eq!(hidden.0, [expected; MAX_HIDDEN], "{level} {weight}");
            let positive = 14 * i64::from(expected) * i64::from(weight) >= 0;
            assert_eq!(outputs, if positive { 0x3fff } else { 0 });
        }
    }
}
