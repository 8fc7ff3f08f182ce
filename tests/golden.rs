//! Compares our controller with recordings of the program published by the paper's authors. The
//! recordings are in `fixtures/golden` or in the folder named by `GOLDEN_DIR`.

use minimal_surprise_controller::{Action, Controller, State};
use minimal_surprise_sim::evaluation::run;
use minimal_surprise_sim::{NoiseRate, NoiseStream, Purpose, Scenario, SeedTree, Trial, World};
use tests::golden::{Recording, recordings};

fn no_noise() -> NoiseStream {
    NoiseStream::new(
        SeedTree::new(0).stream(Purpose::Noise, 0, 0),
        NoiseRate::NONE,
    )
}

fn traced(recordings: &[Recording]) -> impl Iterator<Item = &Recording> {
    recordings
        .iter()
        .filter(|recording| !recording.trace.is_empty())
}

#[test]
fn the_world_driven_by_recorded_decisions_equals_the_recorded_world() {
    let recordings = recordings();
    let (mut steps, mut error_max) = (0, 0.0_f64);
    for recording in traced(&recordings) {
        let name = &recording.name;
        let controller = Controller::new(&recording.genome);
        let mut world = World::new(recording.grid, &recording.start, &controller).unwrap();
        let topology = recording.genome.topology();
        let mut expected = vec![topology.fixed(); recording.start.len()];
        let (mut matches, mut scored) = (0_u64, 0_u64);
        let mut occupied = vec![0_u64; topology.sensors()];
        for (t, step) in recording.trace.iter().enumerate() {
            assert_eq!(world.poses(), step.poses, "{name}, poses at t = {t}");
            world.step_with(&mut no_noise(), |readings| {
                assert_eq!(readings, step.readings, "{name}, sensors at t = {t}");
                step.decisions.clone()
            });
            for (prediction, reading) in expected.iter().zip(&step.readings) {
                let differing = u64::from(prediction.differing(*reading));
                matches += topology.sensors() as u64 - differing;
                scored += topology.sensors() as u64;
                for (sensor, count) in occupied.iter_mut().enumerate() {
                    *count += u64::from(prediction.get(sensor));
                }
            }
            expected = step.decisions.iter().map(|d| d.prediction).collect();
            steps += 1;
        }
        assert_eq!(world.poses(), recording.final_poses, "{name}, final poses");
        let mut compare = |ours: f64, theirs: f64| {
            error_max = error_max.max((ours - theirs).abs());
            assert!(
                (ours - theirs).abs() <= 1e-6,
                "{name}: {ours}, recorded {theirs}"
            );
        };
        compare(matches as f64 / scored as f64, recording.fitness);
        let readings = scored as f64 / topology.sensors() as f64;
        for (count, theirs) in occupied.iter().zip(&recording.mean_prediction) {
            compare(*count as f64 / readings, *theirs);
        }
    }
    println!("{steps} steps equal; fitness and average predictions off by at most {error_max:.1e}");
    assert!(steps > 0);
}

#[test]
fn the_controller_with_recorded_readings_decides_and_predicts_as_recorded() {
    let (mut bits, mut equal) = (0_u64, 0_u64);
    for recording in traced(&recordings()) {
        let controller = Controller::new(&recording.genome);
        let topology = recording.genome.topology();
        let mut states = vec![State::new(&controller); recording.start.len()];
        for step in &recording.trace {
            for ((state, reading), theirs) in
                states.iter_mut().zip(&step.readings).zip(&step.decisions)
            {
                let ours = controller.step(state, *reading);
                bits += 1;
                equal += u64::from(ours.action == theirs.action);
                if theirs.action == Action::Turn {
                    bits += 1;
                    equal += u64::from(ours.turn == theirs.turn);
                }
                let free = u64::from(topology.predicted().bits().count_ones());
                bits += free;
                equal += free - u64::from(ours.prediction.differing(theirs.prediction));
            }
        }
    }
    let share = equal as f64 / bits as f64;
    println!("{equal} of {bits} bits equal: {:.4} %", 100.0 * share);
    assert!(share >= 0.9997, "{share}");
}

#[test]
fn running_freely_for_500_steps_ends_with_the_recorded_fitness() {
    let mut close = 0;
    let recordings: Vec<Recording> = recordings()
        .into_iter()
        .filter(|recording| recording.steps == 500)
        .collect();
    for recording in &recordings {
        let robots = recording.start.len() as u32;
        let scenario = Scenario::new(recording.grid, robots, 500, NoiseRate::NONE).unwrap();
        let trial = Trial {
            starts: recording.start.clone(),
            noise: no_noise(),
        };
        let controller = Controller::new(&recording.genome);
        let outcome = run(&controller, &scenario, &trial, |_| {}).unwrap();
        let difference = outcome.fitness() - recording.fitness;
        println!(
            "{}: fitness {:.5}, recorded {:.5}, difference {difference:+.5}",
            recording.name,
            outcome.fitness(),
            recording.fitness
        );
        assert!(difference.abs() <= 0.05, "{}", recording.name);
        close += usize::from(difference.abs() <= 0.005);
    }
    println!("{close} of {} within 0.005", recordings.len());
    assert!(4 * close >= 3 * recordings.len() && !recordings.is_empty());
}
