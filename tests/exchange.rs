//! Reads, reruns and writes the text files of the authors' program in `fixtures/exchange`.

use minimal_surprise_controller::{Controller, Prediction, SensorModel, Template, Topology};
use minimal_surprise_sim::exchange::{
    AgentsOfGeneration, ImportedGenome, Trajectory, import_genome, read_agents, read_genomes,
};
use minimal_surprise_sim::structures::{Structure, classify};
use minimal_surprise_sim::{
    Grid, Measures, NoiseRate, NoiseStream, Outcome, Pose, Purpose, Scenario, SeedTree, Trace,
    Trial, World, run,
};
use std::path::Path;

/// A folder of `fixtures/exchange`.
struct Sample {
    folder: &'static str,
    topology: Topology,
}

fn samples() -> [Sample; 4] {
    let sample = |folder, model, prediction| Sample {
        folder,
        topology: Topology::new(model, prediction).unwrap(),
    };
    let partly = Prediction::PartlyPredefined(Template::Line);
    [
        sample("a", SensorModel::A, Prediction::Free),
        sample("b", SensorModel::B, Prediction::Free),
        sample("c", SensorModel::C, Prediction::Free),
        sample("c-partly-predefined", SensorModel::C, partly),
    ]
}

impl Sample {
    fn text(&self, file: &str) -> String {
        let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/exchange");
        let path = fixtures.join(self.folder).join(file);
        std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    }

    /// Reads the best genome of each generation.
    fn genomes(&self) -> Vec<ImportedGenome> {
        let action = read_genomes(&self.text("action_genomes")).unwrap();
        let prediction = read_genomes(&self.text("prediction_genomes")).unwrap();
        let rows = action.iter().zip(&prediction);
        rows.map(|(action, prediction)| {
            import_genome(self.topology, action, Some(prediction)).unwrap()
        })
        .collect()
    }

    fn agents(&self) -> Vec<AgentsOfGeneration> {
        read_agents(&self.text("agents")).unwrap()
    }
}

fn scenario(grid: Grid, starts: &[Pose], steps: u32) -> (Scenario, Trial) {
    let noise = SeedTree::new(0).stream(Purpose::Noise, 0, 0);
    let trial = Trial {
        starts: starts.to_vec(),
        noise: NoiseStream::new(noise, NoiseRate::NONE),
    };
    let robots = starts.len() as u32;
    let scenario = Scenario::new(grid, robots, steps, NoiseRate::NONE).unwrap();
    (scenario, trial)
}

fn rerun(
    imported: &ImportedGenome,
    grid: Grid,
    starts: &[Pose],
    steps: u32,
    observe: impl FnMut(&World),
) -> Outcome {
    let (scenario, trial) = scenario(grid, starts, steps);
    let controller = Controller::new(&imported.genome);
    run(&controller, &scenario, &trial, observe).unwrap()
}

#[test]
fn the_genomes_of_all_four_samples_are_imported() {
    for sample in samples() {
        let genomes = sample.genomes();
        assert_eq!(genomes.len(), 3, "{}", sample.folder);
        for (generation, imported) in genomes.iter().enumerate() {
            println!(
                "{}, generation {generation}: {} weights, largest rounding {:.6}, {} do not fit",
                sample.folder,
                imported.genome.weights().len(),
                imported.rounding_error_max,
                imported.saturated.len()
            );
            assert!(imported.rounding_error_max <= 0.5 / 4096.0);
            assert_eq!(imported.saturated, []);
        }
    }
}

#[test]
fn imported_genomes_rerun_from_the_recorded_starts_end_as_recorded() {
    let (mut runs, mut same, mut close) = (0, 0, 0);
    for sample in samples() {
        for (imported, agents) in sample.genomes().iter().zip(sample.agents()) {
            let outcome = rerun(imported, agents.grid, &agents.starts, 500, |_| {});
            let finals = outcome.final_poses.iter().zip(&agents.finals);
            let equal = finals.filter(|(ours, recorded)| ours == recorded).count();
            let difference = outcome.fitness() - agents.fitness;
            println!(
                "{}, generation {}: {equal} of {} final poses equal, fitness {:.6}, recorded {:.6}",
                sample.folder,
                agents.generation,
                agents.finals.len(),
                outcome.fitness(),
                agents.fitness
            );
            runs += 1;
            same += usize::from(equal == agents.finals.len());
            close += usize::from(difference.abs() <= 0.005);
        }
    }
    println!("{runs} runs: {same} with all final poses equal, {close} with fitness within 0.005");
    assert_eq!((runs, same, close), (12, 12, 12));
}

#[test]
fn the_trajectory_is_read_its_structure_named_and_its_run_repeated() {
    let [_, _, sample, _] = samples();
    let trajectory = Trajectory::read(&sample.text("agent_trajectory")).unwrap();
    assert_eq!(trajectory.steps(), 500);
    let structures = classify(trajectory.grid(), trajectory.final_poses()).unwrap();
    for structure in Structure::ALL {
        let count = structures.count(structure);
        println!("{structure}: {count} of {} robots", structures.swarm_size());
    }
    let names: Vec<&str> = structures.names().iter().map(|s| s.name()).collect();
    println!("final state: {}", names.join(" and "));
    assert_eq!(names.len(), 1);

    let genomes = sample.genomes();
    let imported = genomes.last().unwrap();
    let starts = &trajectory.states()[0];
    let mut states = vec![starts.clone()];
    let mut measures = Measures::starting_from(trajectory.grid(), sample.topology, starts);
    rerun(
        imported,
        trajectory.grid(),
        starts,
        trajectory.steps(),
        |world| {
            states.push(world.poses().to_vec());
            measures.observe(world);
        },
    );
    let pairs = || states.iter().zip(trajectory.states()).skip(1);
    let equal = pairs()
        .take_while(|(ours, recorded)| ours == recorded)
        .count();
    println!(
        "{equal} of {} steps equal from the start",
        trajectory.steps()
    );
    println!(
        "fitness {:.6}, M = {:.3}, I = {:.3}",
        measures.fitness(),
        measures.movement(),
        measures.intended_movement()
    );
    assert_eq!(states.len(), trajectory.states().len());
    assert_eq!(equal as u32, trajectory.steps());
}

#[test]
fn a_trajectory_is_written_as_it_was_read() {
    let [_, _, sample, _] = samples();
    let text = sample.text("agent_trajectory");
    let mut written = Vec::new();
    let trajectory = Trajectory::read(&text).unwrap();
    trajectory.write(&mut written).unwrap();
    assert!(written == text.as_bytes());
}

#[test]
fn a_trajectory_is_read_back_with_the_states_written() {
    for sample in samples() {
        let agents = sample.agents().remove(2);
        let imported = sample.genomes().remove(2);
        let controller = Controller::new(&imported.genome);
        let (_, mut trial) = scenario(agents.grid, &agents.starts, 60);
        let mut world = World::new(agents.grid, &trial.starts, &controller).unwrap();
        let mut trace = Trace::starting_from(&world);
        for _ in 0..60 {
            world.step(&controller, &mut trial.noise);
            trace.record(&world);
        }
        let ours = Trajectory::of_trace(2, agents.grid, &trace);
        let mut written = Vec::new();
        ours.write(&mut written).unwrap();
        let text = String::from_utf8(written).unwrap();
        let read = Trajectory::read(&text).unwrap();
        assert_eq!(read, ours);
        assert_eq!(read.states().len(), 61);
        assert_eq!(read.final_poses(), world.poses());
    }
}

#[test]
fn truncated_text_is_refused_with_a_line_or_read_as_a_shorter_run() {
    let [_, _, sample, _] = samples();
    let text = sample.text("agent_trajectory");
    let text: String = text.split_inclusive('\n').take(3 + 300).collect();
    for end in (0..text.len()).step_by(7) {
        match Trajectory::read(&text[..end]) {
            Ok(read) => {
                let robots = text[..end].lines().count() - 3;
                assert_eq!(robots, 100 * read.states().len(), "cut after {end} bytes");
            }
            Err(error) => {
                let lines = text[..end].lines().count();
                assert!((1..=lines + 1).contains(&error.line), "{error}");
            }
        }
    }
}
