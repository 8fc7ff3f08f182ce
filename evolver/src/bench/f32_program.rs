//! The baseline: a straightforward `f32` implementation of the same model.
//!
//! The program uses the standard library's tanh, and computes input activations once per genome and
//! hidden activations once per step. It runs in the plain world. Its results differ from the
//! integer results only by rounding.

use minimal_surprise_controller::network::Shape;
use minimal_surprise_controller::{Action, Decision, Genome, SensorBits, Turn};

/// A network with `f32` weights.
struct Network {
    shape: Shape,
    /// Activation of each input for bit values 0 and 1.
    input: Vec<[f32; 2]>,
    /// Rows of input weights, each followed by the self-loop weight if the network is recurrent.
    hidden: Vec<f32>,
    output: Vec<f32>,
}

impl Network {
    fn new(shape: Shape, weights: &[i16]) -> Self {
        let weights: Vec<f32> = weights.iter().map(|&w| f32::from(w) / 4096.0).collect();
        let (input, rest) = weights.split_at(2 * shape.inputs());
        let (hidden, output) = rest.split_at(shape.hidden() * shape.hidden_row());
        let levels = input
            .chunks(2)
            .map(|pair| [(-pair[1]).tanh(), (pair[0] - pair[1]).tanh()]);
        Self {
            shape,
            input: levels.collect(),
            hidden: hidden.to_vec(),
            output: output.to_vec(),
        }
    }

    /// Computes the outputs; bit k of the result is set if output k is not negative.
    fn forward(&self, inputs: u16, hidden: &mut [f32]) -> u16 {
        let row = self.shape.hidden_row();
        for (value, weights) in hidden.iter_mut().zip(self.hidden.chunks(row)) {
            let mut sum = 0.0;
            for (index, (levels, weight)) in self.input.iter().zip(weights).enumerate() {
                sum += weight * levels[usize::from(inputs >> index & 1)];
            }
            if self.shape.recurrent() {
                sum += weights[row - 1] * *value;
            }
            *value = sum.tanh();
        }
        let mut outputs = 0;
        for (index, weights) in self.output.chunks(self.shape.hidden()).enumerate() {
            let sum: f32 = weights.iter().zip(&*hidden).map(|(w, h)| w * h).sum();
            outputs |= u16::from(sum >= 0.0) << index;
        }
        outputs
    }
}

/// The two networks of a genome with free predictions.
pub struct Networks {
    action: Network,
    prediction: Network,
    sensors: usize,
}

impl Networks {
    /// Converts a genome.
    ///
    /// # Panics
    /// If the genome's predictions are not free.
    #[must_use]
    pub fn new(genome: &Genome) -> Self {
        let topology = genome.topology();
        assert!(topology.fixed() == SensorBits::NONE, "predictions are free");
        let shape = topology.prediction_shape().expect("predictions are free");
        Self {
            action: Network::new(topology.action_shape(), genome.action_weights()),
            prediction: Network::new(shape, genome.prediction_weights()),
            sensors: topology.sensors(),
        }
    }
}

/// The states of all robots of a swarm.
pub struct Robots {
    hidden: Vec<Vec<f32>>,
    actions: Vec<Action>,
    predictions: Vec<SensorBits>,
    matches: u64,
}

impl Robots {
    /// Creates the states at the start of a run.
    #[must_use]
    pub fn new(networks: &Networks, robots: usize) -> Self {
        Self {
            hidden: vec![vec![0.0; networks.prediction.shape.hidden()]; robots],
            actions: vec![Action::Straight; robots],
            predictions: vec![SensorBits::NONE; robots],
            matches: 0,
        }
    }

    /// Performs one step of all robots.
    pub fn step(&mut self, networks: &Networks, readings: &[SensorBits]) -> Vec<Decision> {
        let robots = self.hidden.iter_mut().zip(&mut self.actions);
        let robots = robots.zip(&mut self.predictions).zip(readings);
        let mut action_hidden = vec![0.0; networks.action.shape.hidden()];
        let mut decisions = Vec::with_capacity(readings.len());
        for (((hidden, last_action), prediction), &reading) in robots {
            let differing = prediction.differing(reading) as usize;
            self.matches += (networks.sensors - differing) as u64;
            let with = |action: Action| reading.bits() | (action as u16) << networks.sensors;
            let outputs = networks
                .action
                .forward(with(*last_action), &mut action_hidden);
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
            *last_action = action;
            *prediction = SensorBits::new(networks.prediction.forward(with(action), hidden));
            decisions.push(Decision {
                action,
                turn,
                prediction: *prediction,
            });
        }
        decisions
    }

    /// Returns the number of bits predicted correctly so far.
    #[must_use]
    pub fn matches(&self) -> u64 {
        self.matches
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::populations;
    use minimal_surprise_controller::{Controller, State};
    use rand_chacha::rand_core::{Rng, SeedableRng};

    #[test]
    fn the_yardstick_does_the_same_work_as_the_controller() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let (mut bits, mut equal) = (0_u32, 0_u32);
        for genome in populations::c_15x15().iter().step_by(10) {
            let controller = Controller::new(genome);
            let networks = Networks::new(genome);
            let mut state = State::new(&controller);
            let mut robots = Robots::new(&networks, 1);
            for _ in 0..300 {
                let reading = SensorBits::new(rng.next_u32() as u16 & 0x3fff);
                let ours = controller.step(&mut state, reading);
                let theirs = robots.step(&networks, &[reading])[0];
                bits += 16;
                equal += 14 - ours.prediction.differing(theirs.prediction);
                equal += u32::from(ours.action == theirs.action);
                equal += u32::from(ours.turn == theirs.turn);
            }
        }
        let share = f64::from(equal) / f64::from(bits);
        println!("{share}");
        assert!(share > 0.999, "{share}");
    }
}
