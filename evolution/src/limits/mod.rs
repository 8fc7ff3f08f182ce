//! Memory and disk space that a command needs, estimated from its settings before anything is
//! allocated or written. A command that needs more than is available is rejected.
//!
//! Estimates are of the peak and, above about ten megabytes, accurate to within a factor of two;
//! the `limits` test measures this. If the system does not report how much is available, no command
//! is rejected.

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

/// Smallest estimate that is reported before a command starts, in bytes.
const WORTH_SAYING: f64 = 1e9;
/// Block size of a disk, in bytes: files occupy whole blocks.
const BLOCK_BYTES: f64 = 4096.0;

/// Error: a command needs more than this machine has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{setting}: too much for this machine: about {} of {} would be needed, {} of it for {what}; {} \
     are {}",
    decimal_bytes(*needed), place.name(), decimal_bytes(*part), decimal_bytes(*available), place.rest()
)]
pub struct TooMuch {
    /// The settings to change.
    pub setting: String,
    /// Description of the largest item in the estimate.
    pub what: &'static str,
    /// Size of that item, in bytes.
    pub part: u64,
    /// Total estimate, in bytes.
    pub needed: u64,
    /// Available bytes.
    pub available: u64,
    /// Memory or disk where the bytes are needed.
    pub place: Place,
}

/// Memory or a disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// Memory.
    Memory,
    /// The disk that holds, or will hold, this directory.
    Disk(PathBuf),
}

impl Place {
    const fn name(&self) -> &'static str {
        match self {
            Self::Memory => "memory",
            Self::Disk(_) => "disk",
        }
    }

    /// Describes the available bytes.
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

/// Part of the memory or disk that a command needs.
#[derive(Clone, Debug)]
struct Part {
    bytes: f64,
    what: &'static str,
    /// The settings that determine its size.
    setting: String,
}

/// Peak memory and disk use of a command.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    memory: Vec<Part>,
    disk: Vec<Part>,
}

/// Returns the number of threads, by default one per core.
#[must_use]
pub fn threads(given: Option<u32>) -> f64 {
    let cores = || std::thread::available_parallelism().map_or(1, NonZero::get);
    given.map_or_else(|| cores() as f64, f64::from)
}

/// Formats a number of bytes with a decimal unit.
fn decimal_bytes(bytes: u64) -> String {
    match NumberPrefix::decimal(bytes as f64) {
        NumberPrefix::Standalone(bytes) => format!("{bytes:.0} B"),
        NumberPrefix::Prefixed(prefix, number) => format!("{number:.2} {prefix}B"),
    }
}

/// Returns the size of a type in bytes.
const fn size<T>() -> f64 {
    size_of::<T>() as f64
}

impl Needs {
    /// Estimates the needs of an evolution and its run directory.
    #[must_use]
    pub fn of_evolution(settings: &Settings, threads: f64) -> Self {
        let scenario = settings.scenario();
        // A thread evaluates one genome at a time, or half of its repetitions.
        let tasks = u64::from(settings.population()) * u64::from(settings.repetitions().min(2));
        let threads = threads.min(tasks as f64);
        let population = f64::from(settings.population());
        let repetitions = f64::from(settings.repetitions());
        let checkpoint = checkpoint_bytes(settings);
        // Two generations and the checkpoint being written.
        let genomes = population * 2.0 * size::<Genome>() + checkpoint;
        // All trials, their copy in the trial set and, without noise, a copy split in half.
        let copies = if scenario.noise().is_none() { 3.0 } else { 2.0 };
        let trials = repetitions * copies * trial_bytes(scenario);
        // In memory, in the checkpoint, and in the text of the table.
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
                    // A few numbers per step, which are also in final.json.
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

    /// Estimates the memory and disk space needed to evaluate a genome from new starts, with all
    /// outcomes kept.
    #[must_use]
    pub fn of_starts<T>(
        scenarios: &[(Scenario, T)],
        (key, starts): (&str, u32),
        threads: f64,
    ) -> Self {
        let mut memory = Vec::new();
        // The scenarios are evaluated one after the other, so only the largest world counts.
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

    /// Estimates the needs of a run with every state kept.
    #[must_use]
    pub fn of_recording(scenario: &Scenario) -> Self {
        let [robots, cells, steps] = world(scenario);
        let robot_step = size::<Pose>() + size::<SensorBits>() + size::<Decision>() + 1.0;
        // Four separate vectors per step, and the measures of the step.
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

    /// Estimates the needs of a run with every state kept and exported as text in the authors'
    /// format.
    #[must_use]
    pub fn of_trajectory(scenario: &Scenario) -> Self {
        let mut needs = Self::of_recording(scenario);
        let [robots, _, steps] = world(scenario);
        let digits = |number: f64| number.max(1.0).log10().floor() + 1.0;
        let grid = scenario.grid();
        let place = digits(grid.width().into()) + digits(grid.height().into());
        // The step, the cell, the heading and the separators.
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

    /// Multiplies the estimate, for several copies at once.
    #[must_use]
    pub fn times(mut self, number: f64) -> Self {
        for part in self.memory.iter_mut().chain(&mut self.disk) {
            part.bytes *= number;
        }
        self
    }

    /// Estimates the needs of a hardware-in-the-loop run: the decisions of robot 0, on the robot
    /// and in simulation.
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

    /// Returns the bytes of memory.
    #[must_use]
    pub fn memory(&self) -> f64 {
        total(&self.memory)
    }

    /// Returns the bytes of disk.
    #[must_use]
    pub fn disk(&self) -> f64 {
        total(&self.disk)
    }

    /// Checks that there is enough memory.
    ///
    /// # Errors
    /// [`TooMuch`] if more is needed than available; the message names the settings to change.
    pub fn check_memory(&self) -> Result<(), TooMuch> {
        check(&self.memory, Place::Memory)
    }

    /// Checks that there is enough space on the disk of a directory, which need not exist.
    ///
    /// # Errors
    /// [`TooMuch`] if more is needed than available; the message names the settings to change.
    pub fn check_disk(&self, directory: &Path) -> Result<(), TooMuch> {
        check(&self.disk, Place::Disk(directory.to_owned()))
    }

    /// Describes the estimate if it is large enough to surprise users; otherwise, returns `None`.
    #[must_use]
    pub fn announcement(&self) -> Option<String> {
        let [memory, disk] = [self.memory(), self.disk()];
        (memory.max(disk) >= WORTH_SAYING).then(|| {
            let [memory, disk] = [memory, disk].map(|bytes| decimal_bytes(bytes as u64));
            format!("about {memory} of memory and {disk} of disk are needed")
        })
    }
}

/// Memory and disk space needed by runs that are executed one after the other.
#[derive(Clone, Debug, Default)]
pub struct NeedsOfRuns {
    /// Memory that the largest run needs, and disk space that it needs until it is complete.
    largest: Needs,
    runs: u64,
    /// Bytes of disk space that all runs keep once they are complete.
    left: f64,
    /// Bytes of disk space that the largest of the complete runs keeps.
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

    /// Returns the memory and disk that the runs need.
    #[must_use]
    pub fn needs(&self) -> Needs {
        let mut needs = self.largest.clone();
        needs.disk.push(self.files(self.left));
        needs
    }

    /// Returns the minimum disk space that the runs need once `done` of them are complete.
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

/// Checks that enough memory or disk space is available for all parts together.
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

/// Estimates the memory for the robots on their grid.
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

/// Returns the numbers of robots, cells and steps.
fn world(scenario: &Scenario) -> [f64; 3] {
    [scenario.robots(), scenario.grid().cells(), scenario.steps()].map(f64::from)
}

/// Bytes per robot in the plain world and in the measures of a run.
const ROBOT_BYTES: f64 = size::<State>() + 4.0 * size::<Pose>() + 8.0;

/// Returns the bytes per robot and thread in the fast engine: swarm, lane, and a part of the
/// recording.
fn swarm_bytes(scenario: &Scenario) -> f64 {
    let blocks = scenario.steps().div_ceil(4).min(4);
    60.0 + 8.0 * f64::from(blocks)
}

/// Bytes per step in `final.json`: temperature and surprise, one line each.
const STEP_TEXT_BYTES: f64 = 45.0;

fn trial_bytes(scenario: &Scenario) -> f64 {
    size::<Trial>() + f64::from(scenario.robots()) * size::<Pose>()
}

/// Returns the bytes of noise kept for all genomes of a generation; 0 if that exceeds 8 MB per
/// repetition.
fn flips(scenario: &Scenario) -> f64 {
    let [robots, _, steps] = world(scenario);
    let bytes = 2.0 * robots * steps;
    if scenario.noise().is_none() || bytes > 8e6 {
        0.0
    } else {
        bytes
    }
}

/// Returns the bytes that the fast engine keeps for a few repetitions of a small swarm: at most 12
/// MB per thread.
fn evaluator(scenario: &Scenario) -> f64 {
    let [robots, _, steps] = world(scenario);
    (3.0 * robots * steps).min(12e6)
}

/// Estimates the size of a checkpoint, in bytes.
#[must_use]
pub fn checkpoint_bytes(settings: &Settings) -> f64 {
    // Most weights take two bytes when encoded.
    let genome = 2.1 * settings.topology().weights() as f64 + 2.0;
    f64::from(settings.population()) * genome + f64::from(settings.generations()) * 70.0
}

/// Returns the maximum number of bytes to read from a file with this estimated size.
#[must_use]
pub fn most(estimate: f64) -> u64 {
    // Estimates are accurate to within a factor of two; the constant covers the fixed parts of
    // small files.
    (2.0 * estimate) as u64 + TEXT_BYTES_MAX
}

/// Estimates the size of `generations.csv`, in bytes.
#[must_use]
pub fn table_bytes(settings: &Settings) -> f64 {
    f64::from(settings.generations()) * 140.0
}

/// Estimates the size of `final.json`, in bytes.
#[must_use]
pub fn final_state_bytes(settings: &Settings) -> f64 {
    let scenario = settings.scenario();
    let [robots, _, steps] = world(scenario);
    let digits = scenario.grid().to_string().len() as f64 - 1.0;
    1500.0 + 2.0 * robots * (6.0 + digits) + steps * STEP_TEXT_BYTES
}

/// Estimates the size of a complete run's directory, in bytes.
fn finished_bytes(settings: &Settings) -> f64 {
    let files = [final_state_bytes(settings), table_bytes(settings)];
    // The other files and the directory itself take one block each.
    files
        .map(|bytes| (bytes / BLOCK_BYTES).ceil())
        .iter()
        .sum::<f64>()
        * BLOCK_BYTES
        + 6.0 * BLOCK_BYTES
}

/// Without an operating system to query, no command is rejected.
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
