//! What a command takes of this machine, estimated from its settings before anything is allocated
//! or written, and refused where there is less.
//!
//! Estimates are of the peak, and right within a factor of two from some ten megabytes on: the test
//! `limits` measures it. Where the system does not tell what there is, nothing is refused.

#[cfg(feature = "files")]
mod machine;

use crate::experiment::GenerationRecord;
use crate::files::TEXT_BYTES_MAX;
use crate::run_files::{FINAL, GENERATIONS};
use crate::settings::Settings;
use minimal_surprise_controller::{Decision, Genome, SensorBits, State};
use minimal_surprise_sim::{Pose, Scenario, TraceStep, Trial};
use std::cmp::Ordering;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use unit_prefix::NumberPrefix;

/// Least that is announced before it is used, in bytes.
const WORTH_SAYING: f64 = 1e9;
/// Files take whole blocks of a disk.
const BLOCK_BYTES: f64 = 4096.0;

/// A command needs more than this machine has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{setting}: too much for this machine: about {} of {} would be needed, {} of it for {what}; {} \
     are {}",
    decimal_bytes(*needed), place.name(), decimal_bytes(*part), decimal_bytes(*available), place.rest()
)]
pub struct TooMuch {
    /// The settings to change.
    pub setting: String,
    /// What takes most.
    pub what: &'static str,
    /// Bytes that takes.
    pub part: u64,
    /// Bytes estimated, of everything.
    pub needed: u64,
    /// Bytes there are.
    pub available: u64,
    /// Of what.
    pub place: Place,
}

/// Where bytes are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In memory.
    Memory,
    /// On the disk that holds, or will hold, this directory.
    Disk(PathBuf),
}

impl Place {
    const fn name(&self) -> &'static str {
        match self {
            Self::Memory => "memory",
            Self::Disk(_) => "disk",
        }
    }

    /// How the available bytes are described.
    fn rest(&self) -> String {
        match self {
            Self::Memory => "available".to_owned(),
            Self::Disk(directory) => format!("free in {}", directory.display()),
        }
    }

    fn available(&self) -> Option<u64> {
        match self {
            Self::Memory => machine::memory_available(),
            Self::Disk(directory) => machine::disk_available(directory),
        }
    }
}

/// Something that takes memory or disk.
#[derive(Clone, Debug)]
struct Part {
    bytes: f64,
    what: &'static str,
    /// The settings that it grows with.
    setting: String,
}

/// What a command takes at most at any moment.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    memory: Vec<Part>,
    disk: Vec<Part>,
}

/// Number of threads, by default one per core.
#[must_use]
pub fn threads(given: Option<u32>) -> f64 {
    let cores = || std::thread::available_parallelism().map_or(1, NonZero::get);
    given.map_or_else(|| cores() as f64, f64::from)
}

/// Bytes in the unit that suits them.
fn decimal_bytes(bytes: u64) -> String {
    match NumberPrefix::decimal(bytes as f64) {
        NumberPrefix::Standalone(bytes) => format!("{bytes:.0} B"),
        NumberPrefix::Prefixed(prefix, number) => format!("{number:.2} {prefix}B"),
    }
}

/// Size of a type, in bytes.
const fn size<T>() -> f64 {
    size_of::<T>() as f64
}

impl Needs {
    /// An evolution and its run directory.
    #[must_use]
    pub fn of_evolution(settings: &Settings, threads: f64) -> Self {
        let scenario = settings.scenario();
        // One evaluates a genome at a time, or half of its repetitions.
        let tasks = u64::from(settings.population()) * u64::from(settings.repetitions().min(2));
        let threads = threads.min(tasks as f64);
        let population = f64::from(settings.population());
        let repetitions = f64::from(settings.repetitions());
        let checkpoint = checkpoint_bytes(settings);
        // Two generations, and a checkpoint that is being written.
        let genomes = population * 2.0 * size::<Genome>() + checkpoint;
        // All trials, their copy in the set that is evaluated, and in halves if there is no noise.
        let copies = if scenario.noise().is_none() { 3.0 } else { 2.0 };
        let trials = repetitions * copies * trial_bytes(scenario);
        // In memory and as they are packed into the checkpoint, and the table's text.
        let records = 2.0 * (size::<GenerationRecord>() + 32.0) + 64.0;
        let history = f64::from(settings.generations()) * records + 2.0 * table_bytes(settings);
        let [robots, cells, steps] = world(scenario);
        Self {
            memory: vec![
                part(
                    genomes,
                    "genomes and their checkpoint",
                    [("population", settings.population())],
                ),
                part(
                    trials + repetitions * flips(scenario),
                    "the starts of a generation",
                    [
                        ("repetitions", settings.repetitions()),
                        ("robots", scenario.robots()),
                    ],
                ),
                part(
                    history,
                    "the generations",
                    [("generations", settings.generations())],
                ),
                part(
                    robots * (threads * swarm_bytes(scenario)).max(ROBOT_BYTES),
                    "the robots",
                    [("robots", scenario.robots())],
                ),
                Part {
                    bytes: cells * (4.5 + threads * 0.25),
                    what: "the grid",
                    setting: format!("grid = {}", scenario.grid()),
                },
                part(
                    // Of every step a few numbers, which are also in final.json.
                    steps * (60.0 + 1.5 * STEP_TEXT_BYTES) + threads * evaluator(scenario),
                    "the steps",
                    [("steps", scenario.steps())],
                ),
            ],
            disk: vec![
                part(
                    2.0 * checkpoint,
                    "the checkpoint",
                    [("population", settings.population())],
                ),
                part(
                    2.0 * table_bytes(settings),
                    GENERATIONS,
                    [("generations", settings.generations())],
                ),
                part(
                    final_state_bytes(settings),
                    FINAL,
                    [("steps", scenario.steps()), ("robots", scenario.robots())],
                ),
            ],
        }
    }

    /// A genome from new starts, whose outcomes are kept.
    #[must_use]
    pub fn of_starts<T>(
        scenarios: &[(Scenario, T)],
        (key, starts): (&str, u32),
        threads: f64,
    ) -> Self {
        let mut memory = Vec::new();
        // Which is used for one scenario after the other.
        let mut worlds = Vec::new();
        for (scenario, _) in scenarios {
            let [robots, cells, _] = world(scenario);
            let outcome = 200.0 + 1.2 * robots * size::<Pose>();
            let setting = format!("{key} = {starts} or robots = {}", scenario.robots());
            memory.push(Part {
                bytes: f64::from(starts) * outcome,
                what: "the outcomes",
                setting,
            });
            worlds.push(swarm(
                scenario,
                threads * (robots * ROBOT_BYTES + cells * 5.0),
            ));
        }
        memory.extend(worlds.into_iter().max_by(by_bytes));
        Self {
            memory,
            disk: Vec::new(),
        }
    }

    /// A run of which every state is kept.
    #[must_use]
    pub fn of_recording(scenario: &Scenario) -> Self {
        let [robots, cells, steps] = world(scenario);
        let robot_step = size::<Pose>() + size::<SensorBits>() + size::<Decision>() + 1.0;
        // Each of the four is a vector of its own; then the measures of the step.
        let step = size::<TraceStep>() + size::<Vec<u8>>() + 4.0 * 16.0 + 48.0;
        Self {
            memory: vec![
                part(
                    steps * (robots * robot_step + step),
                    "the states",
                    [("steps", scenario.steps()), ("robots", scenario.robots())],
                ),
                swarm(scenario, robots * ROBOT_BYTES + cells * 5.0),
            ],
            disk: Vec::new(),
        }
    }

    /// A run of which every state is kept, and written as the authors' text.
    #[must_use]
    pub fn of_trajectory(scenario: &Scenario) -> Self {
        let mut needs = Self::of_recording(scenario);
        let [robots, _, steps] = world(scenario);
        let digits = |number: f64| number.max(1.0).log10().floor() + 1.0;
        let grid = scenario.grid();
        let place = digits(grid.width().into()) + digits(grid.height().into());
        // The step, the place, the heading, and what is between them.
        let line = digits(steps) + place + 11.0;
        let text = part(
            (steps + 1.0) * robots * line,
            "the text",
            [("steps", scenario.steps()), ("robots", scenario.robots())],
        );
        needs.memory.push(text.clone());
        needs.disk.push(text);
        needs
    }

    /// The same, this many times at once.
    #[must_use]
    pub fn times(mut self, number: f64) -> Self {
        for part in self.memory.iter_mut().chain(&mut self.disk) {
            part.bytes *= number;
        }
        self
    }

    /// A run with a robot in it: what robot 0 decides, there and in the simulation.
    #[must_use]
    pub fn of_hil(scenario: &Scenario) -> Self {
        let [robots, cells, steps] = world(scenario);
        let settings = [("steps", scenario.steps()), ("robots", scenario.robots())];
        let bytes = 2.0 * steps * size::<Decision>() + robots * ROBOT_BYTES + cells * 5.0;
        Self {
            memory: vec![part(bytes, "the decisions", settings)],
            disk: Vec::new(),
        }
    }

    /// Bytes of memory.
    #[must_use]
    pub fn memory(&self) -> f64 {
        total(&self.memory)
    }

    /// Bytes of disk.
    #[must_use]
    pub fn disk(&self) -> f64 {
        total(&self.disk)
    }

    /// Checks that there is enough memory.
    ///
    /// # Errors
    /// [`TooMuch`] names the settings to change.
    pub fn check_memory(&self) -> Result<(), TooMuch> {
        check(&self.memory, Place::Memory)
    }

    /// Checks that there is enough space on the disk of a directory, which need not exist.
    ///
    /// # Errors
    /// [`TooMuch`] names the settings to change.
    pub fn check_disk(&self, directory: &Path) -> Result<(), TooMuch> {
        check(&self.disk, Place::Disk(directory.to_owned()))
    }

    /// A line for who would be surprised by what is going to be used; none if that is little.
    #[must_use]
    pub fn announcement(&self) -> Option<String> {
        let [memory, disk] = [self.memory(), self.disk()];
        (memory.max(disk) >= WORTH_SAYING).then(|| {
            let [memory, disk] = [memory, disk].map(|bytes| decimal_bytes(bytes as u64));
            format!("about {memory} of memory and {disk} of disk are needed")
        })
    }
}

/// What runs take that are done one after the other.
#[derive(Clone, Debug, Default)]
pub struct NeedsOfRuns {
    /// Of memory, and of disk until it is complete, what the largest run takes.
    largest: Needs,
    runs: u64,
    /// Bytes of disk that all leave, and the largest.
    left: f64,
    left_most: f64,
}

impl NeedsOfRuns {
    /// Adds this many runs with these settings.
    pub fn add(&mut self, settings: &Settings, runs: u64, threads: f64) {
        if runs == 0 {
            return;
        }
        let Needs { memory, disk } = Needs::of_evolution(settings, threads);
        let left = finished_bytes(settings);
        self.runs += runs;
        self.left += runs as f64 * left;
        self.left_most = self.left_most.max(left);
        let largest = std::mem::take(&mut self.largest);
        self.largest = Needs {
            memory: larger(memory, largest.memory),
            disk: larger(disk, largest.disk),
        };
    }

    /// Returns the memory and disk they need.
    #[must_use]
    pub fn needs(&self) -> Needs {
        let mut needs = self.largest.clone();
        needs.disk.push(self.files(self.left));
        needs
    }

    /// The least disk they need if this many of them are done.
    #[must_use]
    pub fn at_least_without(&self, done: u64) -> Needs {
        let left = (self.left - done as f64 * self.left_most).max(0.0);
        Needs {
            memory: Vec::new(),
            disk: vec![self.files(left)],
        }
    }

    fn files(&self, bytes: f64) -> Part {
        Part {
            bytes,
            what: "their files",
            setting: format!("{} runs to do", self.runs),
        }
    }
}

/// Checks that all parts fit.
fn check(parts: &[Part], place: Place) -> Result<(), TooMuch> {
    let needed = total(parts) as u64;
    match (
        place.available(),
        parts.iter().max_by(|one, other| by_bytes(one, other)),
    ) {
        (Some(available), Some(largest)) if needed > available => Err(TooMuch {
            setting: largest.setting.clone(),
            what: largest.what,
            part: largest.bytes as u64,
            needed,
            available,
            place,
        }),
        _ => Ok(()),
    }
}

/// Robots on their grid.
fn swarm(scenario: &Scenario, bytes: f64) -> Part {
    let (robots, grid) = (scenario.robots(), scenario.grid());
    Part {
        bytes,
        what: "the robots on their grid",
        setting: format!("robots = {robots} or grid = {grid}"),
    }
}

fn part<const N: usize>(bytes: f64, what: &'static str, settings: [(&str, u32); N]) -> Part {
    let settings = settings.map(|(key, value)| format!("{key} = {value}"));
    Part {
        bytes,
        what,
        setting: settings.join(" or "),
    }
}

fn total(parts: &[Part]) -> f64 {
    parts.iter().map(|part| part.bytes).sum()
}

fn larger(one: Vec<Part>, other: Vec<Part>) -> Vec<Part> {
    if total(&one) > total(&other) {
        one
    } else {
        other
    }
}

fn by_bytes(one: &Part, other: &Part) -> Ordering {
    one.bytes.total_cmp(&other.bytes)
}

/// Robots, cells and steps.
fn world(scenario: &Scenario) -> [f64; 3] {
    [scenario.robots(), scenario.grid().cells(), scenario.steps()].map(f64::from)
}

/// Of a robot in the world, and in the measures of a run.
const ROBOT_BYTES: f64 = size::<State>() + 4.0 * size::<Pose>() + 8.0;

/// Of a robot in the fast engine, for each thread: its swarm, its lane, and a part of the recording.
fn swarm_bytes(scenario: &Scenario) -> f64 {
    let blocks = scenario.steps().div_ceil(4).min(4);
    60.0 + 8.0 * f64::from(blocks)
}

/// Bytes of a step in `final.json`: temperature and surprise, a line each.
const STEP_TEXT_BYTES: f64 = 45.0;

fn trial_bytes(scenario: &Scenario) -> f64 {
    size::<Trial>() + f64::from(scenario.robots()) * size::<Pose>()
}

/// Noise that is kept for all genomes of a generation: nothing beyond 8 MB a repetition.
fn flips(scenario: &Scenario) -> f64 {
    let [robots, _, steps] = world(scenario);
    let bytes = 2.0 * robots * steps;
    if scenario.noise().is_none() || bytes > 8e6 {
        0.0
    } else {
        bytes
    }
}

/// What the fast engine keeps of a few repetitions of a small swarm: at most 12 MB a thread.
fn evaluator(scenario: &Scenario) -> f64 {
    let [robots, _, steps] = world(scenario);
    (3.0 * robots * steps).min(12e6)
}

/// Bytes of a checkpoint.
#[must_use]
pub fn checkpoint_bytes(settings: &Settings) -> f64 {
    // Most weights take two bytes.
    let genome = 2.1 * settings.topology().weights() as f64 + 2.0;
    f64::from(settings.population()) * genome + f64::from(settings.generations()) * 70.0
}

/// Maximum number of bytes read from a file with this estimate.
#[must_use]
pub fn most(estimate: f64) -> u64 {
    // As no estimate is off by more than a factor of two; small files have a head.
    (2.0 * estimate) as u64 + TEXT_BYTES_MAX
}

/// Bytes of `generations.csv`.
#[must_use]
pub fn table_bytes(settings: &Settings) -> f64 {
    f64::from(settings.generations()) * 140.0
}

/// Bytes of `final.json`.
#[must_use]
pub fn final_state_bytes(settings: &Settings) -> f64 {
    let scenario = settings.scenario();
    let [robots, _, steps] = world(scenario);
    let digits = scenario.grid().to_string().len() as f64 - 1.0;
    1500.0 + 2.0 * robots * (6.0 + digits) + steps * STEP_TEXT_BYTES
}

/// Bytes of the directory of a complete run.
fn finished_bytes(settings: &Settings) -> f64 {
    let files = [final_state_bytes(settings), table_bytes(settings)];
    // The others, and the directory itself, take a block each.
    files
        .map(|bytes| (bytes / BLOCK_BYTES).ceil())
        .iter()
        .sum::<f64>()
        * BLOCK_BYTES
        + 6.0 * BLOCK_BYTES
}

/// Without an operating system to ask, nothing is refused.
#[cfg(not(feature = "files"))]
mod machine {
    use std::path::Path;

    pub(super) fn memory_available() -> Option<u64> {
        None
    }

    pub(super) fn disk_available(_: &Path) -> Option<u64> {
        None
    }
}
