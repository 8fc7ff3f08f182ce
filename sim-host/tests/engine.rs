//! Tests that the fast engine returns the same results as the plain engine, on every path that this
//! processor can run.

use minimal_surprise_controller::{Controller, Genome, MutationRate, Topology};
use minimal_surprise_sim::seed::Stream;
use minimal_surprise_sim::{
    Engine, EnginePath, Evaluator, Grid, Measures, NoiseRate, Purpose, Scenario, SeedTree,
    TrialSet, evaluate, run,
};
use rand_core::Rng as _;

/// Draws a genome to test: random, mutated, with large weights or with very small weights.
fn genome(topology: Topology, rng: &mut Stream) -> Genome {
    let mut genome = Genome::random(topology, rng);
    let shift = match rng.next_u32() % 4 {
        0 => return genome,
        1 => {
            for _ in 0..30 {
                genome.mutate(MutationRate::ratio(1, 10).unwrap(), rng);
            }
            return genome;
        }
        2 => 0,
        _ => 10,
    };
    let weights: Vec<i16> = (0..topology.weights())
        .map(|_| ((rng.next_u32() as i16) >> shift).max(-32767))
        .collect();
    Genome::from_weights(topology, &weights).unwrap()
}

struct Case {
    side: (u32, u32),
    robots: u32,
    steps: u32,
    noise: f64,
    repetitions: u32,
}

impl Case {
    fn check(&self, seed: u64, topology: Topology) {
        let grid = Grid::new(self.side.0, self.side.1).unwrap();
        let noise = NoiseRate::new(self.noise).unwrap();
        let scenario = Scenario::new(grid, self.robots, self.steps, noise).unwrap();
        let seeds = SeedTree::new(seed);
        let trials = (0..self.repetitions)
            .map(|repetition| scenario.trial(seeds, 0, repetition))
            .collect();
        let trials = TrialSet::new(scenario, topology.model(), trials);
        let genome = genome(topology, &mut seeds.stream(Purpose::InitialGenome, 0, 0));
        let expected = evaluate(&genome, &scenario, trials.trials());
        let trial = &trials.trials()[0];
        let mut measures = Measures::starting_from(grid, topology, &trial.starts);
        let controller = Controller::new(&genome);
        run(&controller, &scenario, trial, |world| {
            measures.observe(world);
        })
        .unwrap();
        for path in EnginePath::available() {
            let (motion, final_poses) =
                Evaluator::new(Engine::Fast, path).motion(&genome, &trials, 0);
            assert_eq!(
                (&motion, &final_poses[..]),
                (measures.motion(), measures.poses()),
                "seed {seed}, {topology:?}, {grid}, path {}",
                path.name()
            );
            for skips in [true, false] {
                let mut fast = Evaluator::new(Engine::Fast, path).with_repeats_skipped(skips);
                // Two evaluations, because the second one reuses the state left by the first.
                for _ in 0..2 {
                    assert_eq!(
                        fast.evaluate(&genome, &trials),
                        expected,
                        "seed {seed}, {topology:?}, {grid}, {} robots, {} steps, noise {}, path {}, \
                         repeats skipped: {skips}",
                        self.robots,
                        self.steps,
                        self.noise,
                        path.name(),
                    );
                }
            }
        }
    }
}

const SIDES: [(u32, u32); 14] = [
    (3, 3),
    (3, 7),
    (4, 3),
    (5, 5),
    (15, 15),
    (20, 20),
    (11, 18),
    (25, 8),
    (28, 28),
    (29, 28),
    (70, 3),
    (31, 33),
    (60, 61),
    (130, 64),
];

#[test]
fn every_topology_on_every_kind_of_grid_gives_the_plain_results() {
    let mut seed = 1;
    for topology in Topology::ALL {
        for side in SIDES {
            let cells = side.0 * side.1;
            let robots = match seed % 5 {
                0 => 1,
                1 => cells.min(101),
                2 => cells.min(900),
                _ => 1 + (seed as u32).wrapping_mul(0x9e37_79b9) % cells.min(500),
            };
            let case = Case {
                side,
                robots,
                steps: [1, 2, 3, 4, 5, 30, 50][seed as usize % 7],
                noise: [0.0, 0.1, 0.0, 1.0][seed as usize % 4],
                repetitions: 1 + seed as u32 % 3,
            };
            case.check(seed, topology);
            seed += 1;
        }
    }
}

#[test]
fn full_length_evaluations_give_the_plain_results() {
    let topologies = Topology::ALL.into_iter().cycle().skip(6);
    for (seed, topology) in (1000..1036).zip(topologies) {
        let case = Case {
            side: [(15, 15), (7, 9), (20, 20), (5, 5)][seed as usize % 4],
            robots: [20, 7, 33, 12][seed as usize % 4],
            steps: [500, 333, 250, 402][seed as usize / 4 % 4],
            noise: if seed % 5 == 0 { 0.1 } else { 0.0 },
            repetitions: 3,
        };
        case.check(seed, topology);
    }
}

#[test]
fn full_grids_and_lone_robots_give_the_plain_results() {
    for (seed, topology) in (2000..).zip(Topology::ALL) {
        for (side, robots) in [((3, 3), 9), ((15, 15), 225), ((6, 30), 180), ((9, 9), 1)] {
            let case = Case {
                side,
                robots,
                steps: 41,
                noise: 0.0,
                repetitions: 2,
            };
            case.check(seed, topology);
        }
    }
}

#[test]
fn the_plain_engine_is_the_plain_evaluation() {
    let grid = Grid::new(5, 5).unwrap();
    let scenario = Scenario::new(grid, 9, 20, NoiseRate::NONE).unwrap();
    let trials = vec![scenario.trial(SeedTree::new(1), 0, 0)];
    let topology = Topology::default();
    let trials = TrialSet::new(scenario, topology.model(), trials);
    let genome = Genome::zeroed(topology);
    let mut plain = Evaluator::new(Engine::Plain, EnginePath::best());
    assert_eq!(
        plain.evaluate(&genome, &trials),
        evaluate(&genome, &scenario, trials.trials())
    );
}
