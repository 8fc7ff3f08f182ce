//! Compares a control step with the definitions in `network` and in the paper, implemented as plain
//! loops.

use minimal_surprise_controller::network::{MAX_HIDDEN, Network, SELF_LOOP};
use minimal_surprise_controller::{
    Action, Controller, Genome, Prediction, SensorBits, SensorModel, State, Topology, Turn,
    activate,
};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

const SEED: u64 = 2014;

/// Computes the activation of a sum, saturated to 16 bits.
fn act(sum: i64) -> i64 {
    activate(sum.clamp(i16::MIN.into(), i16::MAX.into()) as i16).into()
}

/// Returns the signs of the outputs and the new hidden values. `last` holds the previous hidden
/// values if the network has self-loops.
fn forward(
    weights: &mut impl Iterator<Item = i16>,
    inputs: &[bool],
    neurons: usize,
    outputs: usize,
    last: Option<&[i64]>,
) -> (Vec<bool>, Vec<i64>) {
    let mut next = || i64::from(weights.next().expect("a genome has all weights"));
    let u: Vec<i64> = inputs
        .iter()
        .map(|&x| {
            let (w, threshold) = (next(), next());
            act(w * i64::from(x) - threshold)
        })
        .collect();
    let hidden: Vec<i64> = (0..neurons)
        .map(|neuron| {
            let sum: i64 = u.iter().map(|u| next() * u).sum();
            let sum = sum + last.map_or(0, |last| next() * last[neuron]);
            act((sum + 2048).div_euclid(4096))
        })
        .collect();
    let outputs = (0..outputs)
        .map(|_| hidden.iter().map(|h| next() * h).sum::<i64>() >= 0)
        .collect();
    (outputs, hidden)
}

/// Returns the numbers of inputs, hidden neurons and outputs of both networks, as in the paper.
fn sizes(topology: Topology) -> ([usize; 2], Option<[usize; 2]>) {
    let [action, free] = match topology.model() {
        SensorModel::A => [[9, 6], [8, 8]],
        SensorModel::B => [[7, 4], [6, 6]],
        SensorModel::C => [[15, 8], [14, 14]],
    };
    let prediction = match topology.prediction() {
        Prediction::Free => Some(free),
        Prediction::PartlyPredefined(_) => Some([12, 10]),
        Prediction::Predefined(_) => None,
    };
    (action, prediction)
}

/// Draws a genome with small weights, weights across the whole range, or saturated weights.
fn genome(topology: Topology, kind: usize, rng: &mut ChaCha8Rng) -> Genome {
    let weights: Vec<i16> = (0..topology.weights())
        .map(|_| {
            let random = rng.next_u32();
            match kind {
                0 => random as i16 / 16,
                1 => (random as i16).max(-32767),
                _ if random & 1 == 0 => 32767,
                _ => -32767,
            }
        })
        .collect();
    Genome::from_weights(topology, &weights).unwrap()
}

#[test]
fn every_step_follows_the_equations() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for topology in Topology::ALL {
        for kind in [0, 0, 1, 1, 2] {
            let genome = genome(topology, kind, &mut rng);
            let controller = Controller::new(&genome);
            assert_eq!(controller.topology(), topology);
            let mut state = State::new(&controller);
            let sensors = topology.sensors();
            let ([inputs, neurons], prediction_sizes) = sizes(topology);
            assert_eq!(inputs, sensors + 1);

            let mut hidden = vec![0; prediction_sizes.map_or(0, |[neurons, _]| neurons)];
            let mut last_action = Action::Straight;
            let mut predicted = topology.fixed().bits();
            let (mut mispredicted_bits, mut seen_bits) = (0, 0);
            for step in 0..100 {
                let case = format!("{topology:?}, weights {kind}, seed {SEED}, step {step}");
                let bits = rng.next_u32() as u16;
                let decision = controller.step(&mut state, SensorBits::new(bits));

                let read: Vec<bool> = (0..sensors).map(|k| bits >> k & 1 == 1).collect();
                for (sensor, &reading) in read.iter().enumerate() {
                    seen_bits += 1;
                    mispredicted_bits += u64::from((predicted >> sensor & 1 == 1) != reading);
                }
                let with = |action| [&read[..], &[action == Action::Turn]].concat();
                let weights = &mut genome.weights().iter().copied();
                let (signs, _) = forward(weights, &with(last_action), neurons, 2, None);
                last_action = [Action::Straight, Action::Turn][usize::from(signs[0])];
                let turn = [Turn::CounterClockwise, Turn::Clockwise][usize::from(signs[1])];
                if let Some([neurons, outputs]) = prediction_sizes {
                    let inputs = with(last_action);
                    let (signs, new) =
                        forward(weights, &inputs, neurons, outputs, Some(&hidden[..]));
                    hidden = new;
                    let mut signs = signs.into_iter();
                    for sensor in 0..sensors {
                        if topology.predicted().get(sensor) {
                            let sign = signs.next().expect("one output per predicted sensor");
                            predicted = predicted & !(1 << sensor) | u16::from(sign) << sensor;
                        }
                    }
                    assert_eq!(signs.next(), None);
                }
                assert_eq!(weights.next(), None, "all weights are used");

                assert_eq!(
                    (decision.action, decision.turn),
                    (last_action, turn),
                    "{case}"
                );
                assert_eq!(decision.prediction.bits(), predicted, "{case}");
                assert_eq!(state.prediction(), decision.prediction, "{case}");
                assert_eq!(state.last_action(), last_action, "{case}");
                hidden.resize(MAX_HIDDEN, 0);
                let found = state.hidden_q3_12().map(i64::from);
                assert_eq!(found[..], hidden, "{case}");
                let surprise = state.surprise();
                assert_eq!(
                    (surprise.mispredicted_bits, surprise.seen_bits),
                    (mispredicted_bits, seen_bits),
                    "{case}"
                );
            }
        }
    }
}

/// Asserts that a network exposes the next weights, and zeros beyond its neurons.
fn assert_shows<const H: usize, const O: usize>(
    network: &Network<H, O>,
    weights: &mut impl Iterator<Item = i16>,
) {
    let shape = network.shape();
    let mut next = || weights.next().expect("a genome has all weights");
    for (input, levels) in network.input_levels().into_iter().enumerate() {
        let expected = if input < shape.inputs() {
            let (w, threshold) = (i64::from(next()), i64::from(next()));
            [act(-threshold), act(w - threshold)]
        } else {
            [0; 2]
        };
        assert_eq!(levels.map(i64::from), expected, "{shape:?}, input {input}");
    }
    for (neuron, row) in network.hidden_rows().iter().enumerate() {
        let mut expected = [0; SELF_LOOP + 1];
        if neuron < shape.hidden() {
            expected[..shape.inputs()].fill_with(&mut next);
            if shape.recurrent() {
                expected[SELF_LOOP] = next();
            }
        }
        assert_eq!(*row, expected, "{shape:?}, neuron {neuron}");
    }
    for (output, row) in network.output_rows().iter().enumerate() {
        let mut expected = [0; H];
        if output < shape.outputs() {
            expected[..shape.hidden()].fill_with(&mut next);
        }
        assert_eq!(*row, expected, "{shape:?}, output {output}");
    }
}

#[test]
fn a_controller_exposes_the_weights_of_its_genome() {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for topology in Topology::ALL {
        let genome = genome(topology, 1, &mut rng);
        let controller = Controller::new(&genome);
        let mut weights = genome.weights().iter().copied();
        assert_shows(controller.action_network(), &mut weights);
        let left = genome.prediction_weights();
        assert!(weights.clone().eq(left.iter().copied()), "{topology:?}");
        if let Some(network) = controller.prediction_network() {
            assert_shows(network, &mut weights);
        }
        assert_eq!(weights.next(), None);
    }
}
