//! Benchmarks, reported as speed ratios within one run.
//!
//! All speeds are measured on early, middle and late populations of real evolutions
//! ([`populations`]), in robot-steps per CPU-second on one thread. The baseline is a
//! straightforward floating-point implementation of the same model ([`f32_program`]).

pub mod f32_program;
pub mod populations;

use minimal_surprise_controller::{Controller, Genome, SensorModel, Topology};
use minimal_surprise_evolution::usage::{self, Stopwatch};
use minimal_surprise_sim::{
    Engine, EnginePath, Evaluator, Grid, NoiseRate, Scenario, SeedTree, Trial, TrialSet, World,
};
use serde::Serialize;
use std::io;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

/// The output of `evolver bench`. Speeds are robot-steps per CPU-second with model C on 15 × 15
/// unless the name indicates otherwise.
#[derive(Clone, Copy, Debug, Serialize)]
#[allow(missing_docs)]
pub struct Report {
    pub plain: f64,
    pub fast: f64,
    pub fast_20x20: f64,
    pub fast_no_shortcut: f64,
    pub fast_noise: f64,
    pub f32: f64,
    /// `fast` relative to `f32`.
    pub ratio_fast_f32: f64,
    /// Speed of one evolution on two threads relative to two one-thread evolutions in parallel.
    pub threads_2_efficiency: f64,
    /// Cost of a robot-step with 1,000,000 robots on 1500 × 1500 relative to 100 on 15 × 15, both
    /// without the shortcut.
    pub million_robots_over_100: f64,
    /// Peak memory use of a default evolution, in MB; `None` if the system does not report it.
    pub peak_rss_mb: Option<f64>,
}

/// Repetitions and steps of an evaluation, as in the paper.
const REPETITIONS: u32 = 10;
const STEPS: u32 = 500;
/// Level of sensor noise in the measurement with noise.
const NOISE: f64 = 0.1;
/// Minimum duration of a measurement, in CPU-seconds.
const SECONDS_MIN: f64 = 1.5;

/// Runs all measurements; calls `say` with the name of each.
///
/// # Errors
/// If this program cannot be started as a child process to measure complete evolutions.
pub fn run(path: EnginePath, mut say: impl FnMut(&str)) -> io::Result<Report> {
    let on_15 = populations::c_15x15();
    let on_20 = populations::c_20x20();
    let noisy = populations::c_15x15_noise();
    let quiet = trials(15, 0.0);
    let fast = |skips| Evaluator::new(Engine::Fast, path).with_repeats_skipped(skips);

    // Measure memory first, while this process is small: a child's memory initially includes its
    // parent's.
    say("memory");
    let peak_rss_mb = peak_rss_mb()?;
    say("fast");
    let fast_15 = speed(&on_15, &quiet, &mut fast(true));
    say("fast, 20x20");
    let fast_20x20 = speed(&on_20, &trials(20, 0.0), &mut fast(true));
    say("fast, without the shortcut for repeated states");
    let fast_no_shortcut = speed(&on_15, &quiet, &mut fast(false));
    say("fast, with noise");
    let fast_noise = speed(&noisy, &trials(15, NOISE), &mut fast(true));
    say("plain");
    let plain = speed(
        &some_of_each(&on_15),
        &quiet,
        &mut Evaluator::new(Engine::Plain, path),
    );
    say("f32");
    let f32 = f32_speed(&some_of_each(&on_15), &quiet);
    say("a million robots");
    let million = million_robots_speed(&on_15[on_15.len() / 2], &mut fast(false));
    say("two threads");
    let threads_2_efficiency = threads_2_efficiency()?;
    Ok(Report {
        plain,
        fast: fast_15,
        fast_20x20,
        fast_no_shortcut,
        fast_noise,
        f32,
        ratio_fast_f32: fast_15 / f32,
        threads_2_efficiency,
        million_robots_over_100: fast_no_shortcut / million,
        peak_rss_mb,
    })
}

fn scenario(side: u32, robots: u32, steps: u32, noise: f64) -> Scenario {
    let grid = Grid::new(side, side).expect("a valid grid");
    let noise = NoiseRate::new(noise).expect("a valid rate");
    Scenario::new(grid, robots, steps, noise).expect("a valid scenario")
}

fn trials(side: u32, noise: f64) -> TrialSet {
    let scenario = scenario(side, 100, STEPS, noise);
    let seeds = SeedTree::new(1);
    let trials: Vec<Trial> = (0..REPETITIONS)
        .map(|repetition| scenario.trial(seeds, 0, repetition))
        .collect();
    TrialSet::new(scenario, SensorModel::C, trials)
}

/// Selects a few genomes of early, middle and late generations, for slow measurements.
fn some_of_each(genomes: &[Genome]) -> Vec<Genome> {
    genomes.iter().step_by(6).cloned().collect()
}

/// Measures robot-steps per CPU-second over all genomes; repeats the work for at least
/// [`SECONDS_MIN`].
fn speed(genomes: &[Genome], trials: &TrialSet, evaluator: &mut Evaluator) -> f64 {
    let steps = robot_steps(trials) * genomes.len() as f64;
    // Run once without timing: noise and memory are prepared only once per generation.
    evaluator.evaluate(&genomes[0], trials);
    let watch = Stopwatch::start();
    for round in 1.. {
        for genome in genomes {
            std::hint::black_box(evaluator.evaluate(genome, trials));
        }
        if watch.cpu_seconds() > SECONDS_MIN {
            return steps * f64::from(round) / watch.cpu_seconds();
        }
    }
    0.0
}

fn robot_steps(trials: &TrialSet) -> f64 {
    let scenario = trials.scenario();
    f64::from(scenario.robots()) * f64::from(scenario.steps()) * trials.trials().len() as f64
}

/// Measures the speed of the floating-point program in the plain world.
fn f32_speed(genomes: &[Genome], trials: &TrialSet) -> f64 {
    let scenario = trials.scenario();
    let trial = &trials.trials()[0];
    let watch = Stopwatch::start();
    let mut steps = 0.0;
    for genome in genomes {
        let controller = Controller::new(genome);
        let program = f32_program::Networks::new(genome);
        let mut world =
            World::new(scenario.grid(), &trial.starts, &controller).expect("a drawn start");
        let mut noise = trial.noise.clone();
        let mut robots = f32_program::Robots::new(&program, trial.starts.len());
        for _ in 0..scenario.steps() {
            world.step_with(&mut noise, |readings| robots.step(&program, readings));
        }
        std::hint::black_box(robots.matches());
        steps += f64::from(scenario.robots()) * f64::from(scenario.steps());
    }
    steps / watch.cpu_seconds()
}

/// Measures the speed with a million robots for a few steps.
fn million_robots_speed(genome: &Genome, evaluator: &mut Evaluator) -> f64 {
    let scenario = scenario(1500, 1_000_000, 40, 0.0);
    let trial = scenario.trial(SeedTree::new(1), 0, 0);
    let trials = TrialSet::new(scenario, Topology::default().model(), vec![trial]);
    speed(std::slice::from_ref(genome), &trials, evaluator)
}

/// Starts an evolution in a child process, in a temporary folder.
fn evolution(folder: &tempfile::TempDir, name: &str, flags: &[&str]) -> io::Result<Child> {
    Command::new(std::env::current_exe()?)
        .args(["evolve", "--seed", "1", "--progress", "none", "--out"])
        .arg(folder.path().join(name))
        .args(flags)
        .stdout(Stdio::null())
        .spawn()
}

/// Measures one evolution on two threads and two evolutions in parallel, alternately, so that
/// changes in the machine's speed affect both.
fn threads_2_efficiency() -> io::Result<f64> {
    const ROUNDS: u32 = 3;
    let folder = tempfile::tempdir()?;
    let (mut together, mut apart) = (0.0, 0.0);
    for round in 0..ROUNDS {
        let flags = |threads| ["--generations", "40", "--threads", threads];
        let watch = Instant::now();
        evolution(&folder, &format!("{round}-two"), &flags("2"))?.wait()?;
        together += watch.elapsed().as_secs_f64();
        let watch = Instant::now();
        let mut first = evolution(&folder, &format!("{round}-first"), &flags("1"))?;
        let mut second = evolution(&folder, &format!("{round}-second"), &flags("1"))?;
        first.wait()?;
        second.wait()?;
        apart += watch.elapsed().as_secs_f64();
    }
    // One evolution takes `together` seconds; two in parallel take `apart` seconds.
    Ok(apart / 2.0 / together)
}

/// Measures the memory use of a default evolution; a few generations are enough, since memory use
/// does not grow with the number of generations.
fn peak_rss_mb() -> io::Result<Option<f64>> {
    let folder = tempfile::tempdir()?;
    evolution(&folder, "memory", &["--generations", "10"])?.wait()?;
    Ok(usage::children_peak_rss_mb())
}
