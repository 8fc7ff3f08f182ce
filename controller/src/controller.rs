//! The controller of one robot: immutable weights, a small state, and one step.

use crate::codec::EncodedGenome;
use crate::fixed::Aligned;
use crate::genome::Genome;
use crate::network::{ActionNetwork, MAX_HIDDEN, PredictionNetwork};
use crate::sensor::SensorBits;
use crate::topology::Topology;
use serde::{Deserialize, Serialize};

/// Action of a robot in one step. Stopping is not an action.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// Move one cell ahead if that cell is free. Action value 0.
    #[default]
    Straight,
    /// Make a quarter turn. Action value 1.
    Turn,
}

/// Direction of a turn; decided in every step, used only with [`Action::Turn`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Turn {
    /// To the left.
    #[default]
    CounterClockwise,
    /// To the right.
    Clockwise,
}

/// Decisions of one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Decision {
    /// The action.
    pub action: Action,
    /// Direction of the turn, if the action is a turn.
    pub turn: Turn,
    /// Predicted next reading, including fixed predictions.
    pub prediction: SensorBits,
}

/// The two networks of a genome, ready to run. Shared by all robots of a swarm.
///
/// ```
/// use minimal_surprise_controller::{Action, Controller, Genome, SensorBits, State, Topology};
///
/// let controller = Controller::new(&Genome::zeroed(Topology::default()));
/// let mut first = State::new(&controller);
/// let mut second = State::new(&controller);
///
/// let decision = controller.step(&mut first, SensorBits::new(0b1001));
/// assert_eq!(decision.action, Action::Turn);
/// controller.step(&mut second, SensorBits::NONE);
///
/// // The first readings were two occupied cells, neither of them predicted.
/// assert_eq!(first.surprise().mispredicted_bits, 2);
/// assert_eq!(second.surprise().mispredicted_bits, 0);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Controller {
    topology: Topology,
    action: ActionNetwork,
    prediction: Option<PredictionNetwork>,
}

/// The state of one robot between steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct State {
    hidden_q3_12: Aligned<[i16; MAX_HIDDEN]>,
    last_action: Action,
    prediction: SensorBits,
    surprise: Surprise,
}

/// Counts of the bits that a robot sensed and mispredicted.
///
/// One minus their ratio, over all robots, is the fitness of Eq. 1 of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Surprise {
    /// Number of mispredicted bits.
    pub mispredicted_bits: u64,
    /// Number of bits sensed.
    pub seen_bits: u64,
}

impl Controller {
    /// Builds the controller of a genome and precomputes everything that is constant.
    #[must_use]
    pub fn new(genome: &Genome) -> Self {
        Self::build(genome.topology(), &mut genome.weights().iter().copied())
    }

    /// Builds a controller from a decoded container, without copying the weights.
    #[must_use]
    pub fn from_encoded(genome: &EncodedGenome<'_>) -> Self {
        Self::build(genome.topology(), &mut genome.weights())
    }

    /// Builds the controller of a genome with all weights zero, which turns clockwise in every
    /// step.
    #[must_use]
    pub fn zeroed(topology: Topology) -> Self {
        Self::build(topology, &mut core::iter::empty())
    }

    #[inline(never)]
    fn build(topology: Topology, weights: &mut dyn Iterator<Item = i16>) -> Self {
        let mut controller = Self {
            topology,
            action: ActionNetwork::zeroed(topology.action_shape()),
            prediction: None,
        };
        // Built in place: returning a network would copy it, and stacks are small.
        controller.action.read_weights(weights);
        if let Some(shape) = topology.prediction_shape() {
            let network = PredictionNetwork::zeroed(shape);
            controller.prediction.insert(network).read_weights(weights);
        }
        controller
    }

    /// Runs one control step: scores the previous prediction against `sensors`, chooses an action
    /// from `sensors` and the previous action, and predicts the next reading from `sensors` and the
    /// new action.
    ///
    /// Ignores bits beyond the model's sensors. Cannot fail, panic or allocate.
    // Compiled only once, in this crate, so that a firmware can optimise this crate for speed and
    // the rest for size.
    #[cfg_attr(has_smlad, inline(never))]
    #[cfg_attr(not(has_smlad), inline)]
    pub fn step(&self, state: &mut State, sensors: SensorBits) -> Decision {
        let (action, turn) = self.decide(sensors, state.last_action);
        let prediction = self.predict(state, sensors, action);
        Decision {
            action,
            turn,
            prediction,
        }
    }

    /// Runs only the action network: a function of the sensor bits and the previous action.
    #[inline]
    #[must_use]
    pub fn decide(&self, sensors: SensorBits, last_action: Action) -> (Action, Turn) {
        let outputs = self
            .action
            .forward(self.inputs(sensors, last_action), &mut Aligned([0; 8]));
        let action = if outputs & 1 == 0 {
            Action::Straight
        } else {
            Action::Turn
        };
        let turn = if outputs & 2 == 0 {
            Turn::CounterClockwise
        } else {
            Turn::Clockwise
        };
        (action, turn)
    }

    /// Completes a step after the action is chosen: scores the previous prediction and makes the
    /// next one.
    #[inline]
    pub fn predict(&self, state: &mut State, sensors: SensorBits, action: Action) -> SensorBits {
        let sensors = SensorBits::new(sensors.bits() & self.topology.model().mask().bits());
        state.surprise.mispredicted_bits += u64::from(state.prediction.differing(sensors));
        state.surprise.seen_bits += self.topology.sensors() as u64;
        state.last_action = action;
        if let Some(network) = &self.prediction {
            let outputs = network.forward(self.inputs(sensors, action), &mut state.hidden_q3_12);
            let free = spread(outputs, self.topology.predicted().bits());
            state.prediction = SensorBits::new(self.topology.fixed().bits() | free);
        }
        state.prediction
    }

    /// Returns the genome's topology.
    #[must_use]
    pub fn topology(&self) -> Topology {
        self.topology
    }

    /// Returns the action network.
    #[must_use]
    pub fn action_network(&self) -> &ActionNetwork {
        &self.action
    }

    /// Returns the prediction network, or `None` if all predictions are fixed.
    #[must_use]
    pub fn prediction_network(&self) -> Option<&PredictionNetwork> {
        self.prediction.as_ref()
    }

    /// Returns the input bits of a network: the sensor bits followed by the action value.
    #[inline]
    fn inputs(&self, sensors: SensorBits, action: Action) -> u32 {
        let model = self.topology.model();
        u32::from(sensors.bits() & model.mask().bits()) | (action as u32) << model.sensors()
    }
}

/// Distributes the lowest bits of `bits` to the positions where `mask` has ones, in order.
#[inline]
#[must_use]
pub fn spread(bits: u16, mask: u16) -> u16 {
    if mask & (mask.wrapping_add(1)) == 0 {
        return bits & mask;
    }
    let mut left = mask;
    let mut bits = bits;
    let mut spread = 0;
    while left != 0 {
        let lowest = left & left.wrapping_neg();
        if bits & 1 == 1 {
            spread |= lowest;
        }
        bits >>= 1;
        left ^= lowest;
    }
    spread
}

impl State {
    /// Creates the state of a robot before its first step: hidden values zero, previous action
    /// straight, and only the fixed predictions.
    #[must_use]
    pub fn new(controller: &Controller) -> Self {
        Self {
            hidden_q3_12: Aligned([0; MAX_HIDDEN]),
            last_action: Action::Straight,
            prediction: controller.topology.fixed(),
            surprise: Surprise::default(),
        }
    }

    /// Returns the prediction for the next reading.
    #[must_use]
    pub fn prediction(&self) -> SensorBits {
        self.prediction
    }

    /// Returns the action of the latest step; straight before the first step.
    #[must_use]
    pub fn last_action(&self) -> Action {
        self.last_action
    }

    /// Returns the prediction network's hidden activations, Q3.12; zero beyond its neurons.
    #[must_use]
    pub fn hidden_q3_12(&self) -> &[i16; MAX_HIDDEN] {
        &self.hidden_q3_12.0
    }

    /// Returns the surprise since the start, as a robot reports it.
    #[must_use]
    pub fn surprise(&self) -> Surprise {
        self.surprise
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::genome::Genome;
    use crate::sensor::SensorModel;
    use crate::topology::{Prediction, Template};
    use rand_chacha::ChaCha8Rng;
    use rand_core::{Rng, SeedableRng};

    #[test]
    fn spread_fills_the_ones_of_the_mask_in_order() {
        assert_eq!(spread(0b101, 0b0011_0110), 0b0001_0010);
        assert_eq!(spread(0xffff, 0x3fff), 0x3fff);
        assert_eq!(spread(0xffff, 0), 0);
    }

    #[test]
    fn a_zeroed_controller_is_that_of_a_zeroed_genome_and_only_turns() {
        for topology in Topology::ALL {
            let controller = Controller::zeroed(topology);
            assert_eq!(controller, Controller::new(&Genome::zeroed(topology)));
            let decided = controller.decide(SensorBits::NONE, Action::Straight);
            assert_eq!(decided, (Action::Turn, Turn::Clockwise));
        }
    }

    #[test]
    fn surprise_counts_the_bits_that_were_not_predicted() {
        let topology = Topology::new(SensorModel::B, Prediction::Predefined(Template::Line));
        let controller = Controller::new(&Genome::zeroed(topology.unwrap()));
        let mut state = State::new(&controller);
        controller.step(&mut state, SensorBits::new(0b00_1001));
        controller.step(&mut state, SensorBits::new(0b11_0001));
        let surprise = state.surprise();
        assert_eq!((surprise.mispredicted_bits, surprise.seen_bits), (3, 12));
    }

    #[test]
    fn bits_beyond_the_sensors_change_nothing() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for topology in Topology::ALL {
            let controller = Controller::new(&Genome::random(topology, &mut rng));
            let (mut with, mut without) = (State::new(&controller), State::new(&controller));
            for _ in 0..200 {
                let bits = rng.next_u32() as u16;
                let masked = bits & topology.model().mask().bits();
                assert_eq!(
                    controller.step(&mut with, SensorBits::new(bits)),
                    controller.step(&mut without, SensorBits::new(masked))
                );
            }
            assert_eq!(with, without);
        }
    }

    #[test]
    fn fixed_predictions_never_change() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for topology in Topology::ALL {
            let controller = Controller::new(&Genome::random(topology, &mut rng));
            let mut state = State::new(&controller);
            let predicted = topology.predicted().bits();
            for _ in 0..100 {
                let decision = controller.step(&mut state, SensorBits::new(rng.next_u32() as u16));
                assert_eq!(
                    decision.prediction.bits() & !predicted,
                    topology.fixed().bits()
                );
            }
        }
    }
}
