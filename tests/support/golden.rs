//! Reads recorded traces.

use minimal_surprise_controller::{
    Action, Decision, Genome, Prediction, SensorBits, SensorModel, Template, Topology, Turn,
};
use minimal_surprise_sim::{Grid, Heading, Pose};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The first line of a file.
#[derive(Deserialize)]
struct Header {
    sensor_model: String,
    grid: (u32, u32),
    steps: u32,
    predictions: String,
    template: Option<String>,
    start: Vec<Pose>,
    action_input: Vec<i16>,
    action_hidden: Vec<i16>,
    action_output: Vec<i16>,
    #[serde(default)]
    prediction_input: Vec<i16>,
    #[serde(default)]
    prediction_hidden: Vec<i16>,
    #[serde(default)]
    prediction_output: Vec<i16>,
}

/// A recorded step, as stored in the file.
#[derive(Deserialize)]
struct StepLine {
    t: u32,
    x: Vec<u16>,
    y: Vec<u16>,
    heading: Vec<Heading>,
    sensors: Vec<u16>,
    action: Vec<u8>,
    turn: Vec<i8>,
    prediction: Vec<u16>,
}

/// The last line of a file.
#[derive(Deserialize)]
struct Footer {
    fitness: f64,
    mean_prediction: Vec<f64>,
    r#final: Vec<Pose>,
}

/// A recorded step.
pub struct Step {
    /// Poses before the step.
    pub poses: Vec<Pose>,
    /// The robots' readings.
    pub readings: Vec<SensorBits>,
    /// The robots' decisions and predictions.
    pub decisions: Vec<Decision>,
}

/// A recorded run.
pub struct Recording {
    /// Name of the file.
    pub name: String,
    /// The weights.
    pub genome: Genome,
    /// The grid.
    pub grid: Grid,
    /// Number of steps.
    pub steps: u32,
    /// Starting poses.
    pub start: Vec<Pose>,
    /// The steps; empty for long recordings.
    pub trace: Vec<Step>,
    /// Recorded fitness.
    pub fitness: f64,
    /// Recorded average prediction per sensor.
    pub mean_prediction: Vec<f64>,
    /// Recorded final poses.
    pub final_poses: Vec<Pose>,
}

/// Returns the folder of the recordings: `GOLDEN_DIR` if set, otherwise the project's own copy.
#[must_use]
pub fn directory() -> PathBuf {
    std::env::var_os("GOLDEN_DIR").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/golden"),
        PathBuf::from,
    )
}

/// Reads all recordings; returns them by name.
///
/// # Panics
/// If the folder or a file in it cannot be read.
#[must_use]
pub fn recordings() -> Vec<Recording> {
    let directory = directory();
    let entries = std::fs::read_dir(&directory)
        .unwrap_or_else(|error| panic!("{}: {error}", directory.display()));
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|end| end == "jsonl"))
        .collect();
    paths.sort();
    assert!(
        !paths.is_empty(),
        "no recordings in {}",
        directory.display()
    );
    paths.iter().map(|path| read(path)).collect()
}

fn read(path: &Path) -> Recording {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let lines: Vec<&str> = text.lines().collect();
    let [first, middle @ .., last] = lines.as_slice() else {
        panic!("{name}: fewer than two lines");
    };
    let parse_error = |error| -> ! { panic!("{name}: {error}") };
    let header: Header = serde_json::from_str(first).unwrap_or_else(|e| parse_error(e));
    let footer: Footer = serde_json::from_str(last).unwrap_or_else(|e| parse_error(e));
    let topology = topology(&header);
    let weights = [
        header.action_input,
        header.action_hidden,
        header.action_output,
        header.prediction_input,
        header.prediction_hidden,
        header.prediction_output,
    ]
    .concat();
    let trace = middle.iter().enumerate().map(|(t, line)| {
        let step: StepLine = serde_json::from_str(line).unwrap_or_else(|e| parse_error(e));
        assert_eq!(step.t as usize, t, "{name}");
        step.into_step()
    });
    Recording {
        trace: trace.collect(),
        genome: Genome::from_weights(topology, &weights)
            .unwrap_or_else(|error| panic!("{name}: {error}")),
        grid: Grid::new(header.grid.0, header.grid.1)
            .unwrap_or_else(|error| panic!("{name}: {error}")),
        steps: header.steps,
        start: header.start,
        fitness: footer.fitness,
        mean_prediction: footer.mean_prediction,
        final_poses: footer.r#final,
        name,
    }
}

fn topology(header: &Header) -> Topology {
    let model = match header.sensor_model.as_str() {
        "A" => SensorModel::A,
        "B" => SensorModel::B,
        "C" => SensorModel::C,
        other => panic!("sensor model {other}"),
    };
    let template = || {
        let name = header.template.as_deref().expect("a template");
        Template::ALL
            .into_iter()
            .find(|template| template.name() == name)
            .unwrap_or_else(|| panic!("template {name}"))
    };
    let prediction = match header.predictions.as_str() {
        "free" => Prediction::Free,
        "partly predefined" => Prediction::PartlyPredefined(template()),
        "predefined" => Prediction::Predefined(template()),
        other => panic!("predictions {other}"),
    };
    Topology::new(model, prediction).expect("a known topology")
}

impl StepLine {
    fn into_step(self) -> Step {
        let poses = self
            .x
            .iter()
            .zip(&self.y)
            .zip(&self.heading)
            .map(|((&x, &y), &heading)| Pose { x, y, heading });
        let decisions = self
            .action
            .iter()
            .zip(&self.turn)
            .zip(&self.prediction)
            .map(|((&action, &turn), &prediction)| Decision {
                action: if action == 0 {
                    Action::Straight
                } else {
                    Action::Turn
                },
                turn: if turn == 1 {
                    Turn::CounterClockwise
                } else {
                    Turn::Clockwise
                },
                prediction: SensorBits::new(prediction),
            });
        Step {
            poses: poses.collect(),
            readings: self
                .sensors
                .iter()
                .map(|&bits| SensorBits::new(bits))
                .collect(),
            decisions: decisions.collect(),
        }
    }
}
