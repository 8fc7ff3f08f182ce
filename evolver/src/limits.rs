//! What a command takes of this machine, estimated from its settings before anything is allocated
//! or written, and refused where there is less.
//!
//! Estimates are of the peak, and right within a factor of two from some ten megabytes on: the test
//! `limits` measures it. Where the system does not tell what there is, nothing is refused.

use crate::experiment::GenerationRecord;
use crate::files::TEXT_BYTES_MAX;
use crate::run_files::{FINAL, GENERATIONS};
use crate::settings::Settings;
use indicatif::DecimalBytes;
use minimal_surprise_controller::{Decision, Genome, SensorBits, State};
use minimal_surprise_sim::{Pose, Scenario, TraceStep, Trial};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};

/// Least that is announced before it is used, in bytes.
const WORTH_SAYING: f64 = 1e9;
/// Files take whole blocks of a disk.
const BLOCK_BYTES: f64 = 4096.0;

/// A command needs more than this machine has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TooMuch {
    /// Of memory.
    #[error(
        "{setting}: too much for this machine: about {} of memory would be needed, {} of it for \
         {what}; {} are available", DecimalBytes(*needed), DecimalBytes(*part), DecimalBytes(*available)
    )]
    Memory {
        /// The settings to change.
        setting: String,
        /// What takes most.
        what: &'static str,
        /// Bytes that takes.
        part: u64,
        /// Bytes estimated, of everything.
        needed: u64,
        /// Bytes there are.
        available: u64,
    },
    /// Of disk.
    #[error(
        "{setting}: too much for this machine: about {} of disk would be needed, {} of it for \
         {what}; {} are free in {}",
        DecimalBytes(*needed), DecimalBytes(*part), DecimalBytes(*available), directory.display()
    )]
    Disk {
        /// The settings to change.
        setting: String,
        /// What takes most.
        what: &'static str,
        /// Bytes that takes.
        part: u64,
        /// Bytes estimated, of everything.
        needed: u64,
        /// Bytes there are.
        available: u64,
        /// Where.
        directory: PathBuf,
    },
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

/// Threads if no number is given: one a core.
#[must_use]
pub fn threads(given: Option<u32>) -> f64 {
    let cores = || std::thread::available_parallelism().map_or(1, NonZero::get);
    given.map_or_else(|| cores() as f64, f64::from)
}

/// Size of a type, in bytes.
const fn size<T>() -> f64 {
    size_of::<T>() as f64
}

impl Needs {
    /// An evolution and its run directory.
    #[must_use]
    pub fn of_evolution(settings: &Settings, threads: f64) -> Self {
        let scenario = &settings.scenario;
        // One evaluates a genome at a time, or half of its repetitions.
        let tasks = u64::from(settings.population) * u64::from(settings.repetitions.min(2));
        let threads = threads.min(tasks as f64);
        let population = f64::from(settings.population);
        let repetitions = f64::from(settings.repetitions);
        let checkpoint = checkpoint_bytes(settings);
        // Two generations, and a checkpoint that is being written.
        let genomes = population * 2.0 * size::<Genome>() + checkpoint;
        // All trials, their copy in the set that is evaluated, and in halves if there is no noise.
        let copies = if scenario.noise().is_none() { 3.0 } else { 2.0 };
        let trials = repetitions * copies * trial_bytes(scenario);
        // In memory and as they are packed into the checkpoint, and the table's text.
        let records = 2.0 * (size::<GenerationRecord>() + 32.0) + 64.0;
        let history = f64::from(settings.generations) * records + 2.0 * table_bytes(settings);
        let [robots, cells, steps] = world(scenario);
        Self {
            memory: vec![
                part(
                    genomes,
                    "genomes and their checkpoint",
                    [("population", settings.population)],
                ),
                part(
                    trials + repetitions * flips(scenario),
                    "the starts of a generation",
                    [
                        ("repetitions", settings.repetitions),
                        ("robots", scenario.robots()),
                    ],
                ),
                part(
                    history,
                    "the generations",
                    [("generations", settings.generations)],
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
                    [("population", settings.population)],
                ),
                part(
                    2.0 * table_bytes(settings),
                    GENERATIONS,
                    [("generations", settings.generations)],
                ),
                part(
                    final_state_bytes(settings),
                    FINAL,
                    [("steps", scenario.steps()), ("robots", scenario.robots())],
                ),
            ],
        }
    }

    /// Runs done one after the other, of which a share, 0 to 1, is still to be done here.
    #[must_use]
    pub fn of_runs(runs: impl Iterator<Item = (Settings, u32)>, share: f64, threads: f64) -> Self {
        let (mut largest, mut finished, mut all) = (Self::default(), 0.0, 0.0);
        for (settings, number) in runs {
            let one = Self::of_evolution(&settings, threads);
            all += f64::from(number);
            finished += f64::from(number) * finished_bytes(&settings);
            if total(&one.memory) > total(&largest.memory) {
                largest.memory = one.memory;
            }
            if total(&one.disk) > total(&largest.disk) {
                largest.disk = one.disk;
            }
        }
        largest.disk.push(Part {
            bytes: share * finished,
            what: "the runs to do",
            setting: format!("{all} runs in the suite"),
        });
        largest
    }

    /// A genome from new starts, whose outcomes are kept.
    #[must_use]
    pub fn of_starts<T>(
        scenarios: &[(Scenario, T)],
        (key, starts): (&str, u32),
        threads: f64,
    ) -> Self {
        let mut memory = Vec::new();
        for (scenario, _) in scenarios {
            let [robots, cells, _] = world(scenario);
            let outcome = 200.0 + 1.2 * robots * size::<Pose>();
            let grid = scenario.grid();
            let setting = format!("{key} = {starts} or robots = {}", scenario.robots());
            memory.push(Part {
                bytes: f64::from(starts) * outcome,
                what: "the outcomes",
                setting,
            });
            memory.push(Part {
                bytes: threads * (robots * ROBOT_BYTES + cells * 5.0),
                what: "the robots on their grid",
                setting: format!("robots = {} or grid = {grid}", scenario.robots()),
            });
        }
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
                Part {
                    bytes: robots * ROBOT_BYTES + cells * 5.0,
                    what: "the robots on their grid",
                    setting: format!(
                        "robots = {} or grid = {}",
                        scenario.robots(),
                        scenario.grid()
                    ),
                },
            ],
            disk: Vec::new(),
        }
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

    /// Whether the memory is there.
    ///
    /// # Errors
    /// [`TooMuch`] names the settings to change.
    pub fn check_memory(&self) -> Result<(), TooMuch> {
        let needed = self.memory() as u64;
        match (memory_available(), largest(&self.memory)) {
            (
                Some(available),
                Some(Part {
                    bytes,
                    what,
                    setting,
                }),
            ) if needed > available => Err(TooMuch::Memory {
                setting: setting.clone(),
                what,
                part: *bytes as u64,
                needed,
                available,
            }),
            _ => Ok(()),
        }
    }

    /// Whether the disk that a directory is on, or will be, has the room.
    ///
    /// # Errors
    /// [`TooMuch`] names the settings to change.
    pub fn check_disk(&self, directory: &Path) -> Result<(), TooMuch> {
        let needed = self.disk() as u64;
        match (disk_available(directory), largest(&self.disk)) {
            (
                Some(available),
                Some(Part {
                    bytes,
                    what,
                    setting,
                }),
            ) if needed > available => Err(TooMuch::Disk {
                setting: setting.clone(),
                what,
                part: *bytes as u64,
                needed,
                available,
                directory: directory.to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// A line for who would be surprised by what is going to be used; none if that is little.
    #[must_use]
    pub fn announcement(&self) -> Option<String> {
        let [memory, disk] = [self.memory(), self.disk()];
        (memory.max(disk) >= WORTH_SAYING).then(|| {
            let [memory, disk] = [memory, disk].map(|bytes| DecimalBytes(bytes as u64));
            format!("about {memory} of memory and {disk} of disk are needed")
        })
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

fn largest(parts: &[Part]) -> Option<&Part> {
    parts.iter().max_by(|a, b| a.bytes.total_cmp(&b.bytes))
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
    let genome = 2.1 * settings.topology.weights() as f64 + 2.0;
    f64::from(settings.population) * genome + f64::from(settings.generations) * 70.0
}

/// Most bytes that are read of a file with such an estimate.
#[must_use]
pub fn most(estimate: f64) -> u64 {
    // As no estimate is off by more than a factor of two; small files have a head.
    (2.0 * estimate) as u64 + TEXT_BYTES_MAX
}

/// Bytes of `generations.csv`.
#[must_use]
pub fn table_bytes(settings: &Settings) -> f64 {
    f64::from(settings.generations) * 140.0
}

/// Bytes of `final.json`.
#[must_use]
pub fn final_state_bytes(settings: &Settings) -> f64 {
    let scenario = &settings.scenario;
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

/// Memory that this process can still get: of the machine, of its cgroup, of its address space.
fn memory_available() -> Option<u64> {
    let mut system = System::new().ok()?;
    system.refresh_memory();
    let machine = Some(system.available_memory()).filter(|&bytes| bytes > 0);
    let pid = sysinfo::get_current_pid().ok();
    let memory = ProcessRefreshKind::nothing().with_memory();
    let processes = ProcessesToUpdate::Some(pid.as_slice());
    system.refresh_processes_specifics(processes, false, memory);
    let process = pid.and_then(|pid| system.process(pid));
    // What a cgroup has cached of files, it can drop.
    let cgroup = process
        .and_then(|process| process.cgroup_limits())
        .map(|limits| limits.total_memory.saturating_sub(limits.rss));
    let in_use = process.map_or(0, |process| process.virtual_memory());
    let address_space = address_space_max().map(|most| most.saturating_sub(in_use));
    [machine, cgroup, address_space].into_iter().flatten().min()
}

#[cfg(unix)]
fn address_space_max() -> Option<u64> {
    use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
    let (most, _) = getrlimit(Resource::RLIMIT_AS).ok()?;
    (most != RLIM_INFINITY).then_some(most)
}

#[cfg(not(unix))]
fn address_space_max() -> Option<u64> {
    None
}

/// Free bytes of the disk that a path is on; of its first ancestor that there is, if it is to be
/// made.
fn disk_available(path: &Path) -> Option<u64> {
    let absolute = std::path::absolute(path).ok()?;
    let existing = absolute.ancestors().find(|path| path.exists())?;
    // A file system that is no disk, as /proc, says nothing of what it could hold.
    let disk = fs4::statvfs(existing).ok()?;
    (disk.total_space() > 0).then(|| disk.available_space())
}
