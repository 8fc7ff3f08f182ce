//! Progress of a run, shown as a bar, lines, JSON, or not at all.

use crate::output;
use clap::ValueEnum;
use console::Term;
use indicatif::{ProgressBar, ProgressStyle};
use minimal_surprise_evolution::experiment::GenerationRecord;
use minimal_surprise_evolution::settings::Settings;
use minimal_surprise_sim::Scenario;
use std::time::{Duration, Instant};

/// Minimum number of terminal columns for a bar beside the numbers.
const COLUMNS_FOR_BAR: u16 = 40;

/// Display of the progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProgressMode {
    /// A bar if standard error is a terminal that can draw one, otherwise lines.
    #[default]
    Auto,
    /// The same as auto.
    Bar,
    /// One line per generation, on standard error.
    Lines,
    /// One JSON object per generation, on standard output; no other text is printed there.
    Json,
    /// No progress.
    None,
}

/// Progress display for one run.
#[derive(Debug)]
pub struct Progress {
    shown: Shown,
    started: Instant,
    generations_before: u32,
    generations: u32,
    robot_steps_per_generation: u64,
    scored_bits: f64,
    population: f64,
}

/// The display in use.
#[derive(Debug)]
pub(super) enum Shown {
    Bar(ProgressBar),
    Lines,
    Json,
    Nothing,
}

impl Shown {
    /// Chooses the display for a mode and standard error; `numbers` is the text beside a bar.
    pub(super) fn new(mode: ProgressMode, numbers: &str, of: impl FnOnce() -> ProgressBar) -> Self {
        match mode {
            ProgressMode::Auto | ProgressMode::Bar if output::stderr_is_screen() => {
                Self::Bar(bar(of(), numbers))
            }
            ProgressMode::Auto | ProgressMode::Bar | ProgressMode::Lines => Self::Lines,
            ProgressMode::Json => Self::Json,
            ProgressMode::None => Self::Nothing,
        }
    }
}

/// Number of robot-steps above which the computation of a run takes seconds.
const LONG_ROBOT_STEPS: u64 = 2_000_000;

/// Computes a run, and shows its progress if it takes seconds; `compute` receives a callback to
/// call after every step.
pub fn computing<T>(scenario: &Scenario, compute: impl FnOnce(&dyn Fn()) -> T) -> T {
    let bar = steps_bar(scenario);
    let computed = compute(&|| bar.inc(1));
    bar.finish_and_clear();
    computed
}

/// Creates a bar for the steps of a run, hidden if the run is short. If no bar can be drawn, prints
/// a line instead.
#[must_use]
fn steps_bar(scenario: &Scenario) -> ProgressBar {
    let (robots, steps) = (scenario.robots(), scenario.steps());
    if u64::from(robots) * u64::from(steps) < LONG_ROBOT_STEPS {
        return ProgressBar::hidden();
    }
    let bar = || ProgressBar::new(steps.into());
    match Shown::new(ProgressMode::Auto, "{pos}/{len} steps", bar) {
        Shown::Bar(bar) => bar,
        _ => {
            tell!("computing {steps} steps of {robots} robots");
            ProgressBar::hidden()
        }
    }
}

/// Creates a bar on standard error, hidden if it cannot be drawn; `numbers` is the text beside the
/// bar.
pub(crate) fn bar(bar: ProgressBar, numbers: &str) -> ProgressBar {
    if !output::stderr_is_screen() {
        return ProgressBar::hidden();
    }
    let is_narrow = Term::stderr().size().1 < COLUMNS_FOR_BAR;
    let gauge = if is_narrow { "" } else { "{bar:16} " };
    let style = ProgressStyle::with_template(&format!("{gauge}{numbers}  {{wide_msg}}"))
        .expect("the template is well-formed");
    let style = match output::stderr_is_ascii() {
        true => style.progress_chars("#-"),
        false => style,
    };
    let bar = bar.with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

impl Progress {
    /// Starts the display and its clock; `done` is the number of generations completed before.
    #[must_use]
    pub fn start(mode: ProgressMode, settings: &Settings, done: u32) -> Self {
        let bar = || ProgressBar::new(settings.generations().into()).with_position(done.into());
        Self {
            shown: Shown::new(mode, "{pos}/{len}", bar),
            started: Instant::now(),
            generations_before: done,
            generations: settings.generations(),
            robot_steps_per_generation: settings.robot_steps_per_generation(),
            scored_bits: settings.scored_bits() as f64,
            population: f64::from(settings.population()),
        }
    }

    /// Shows a completed generation.
    pub fn generation(&self, record: &GenerationRecord) {
        let best = record.best_matches as f64 / self.scored_bits;
        let mean = record.total_matches as f64 / self.scored_bits / self.population;
        let done = record.generation + 1;
        let elapsed = self.started.elapsed();
        let here = done.saturating_sub(self.generations_before).max(1);
        let left = elapsed.mul_f64(f64::from(self.generations - done) / f64::from(here));
        let speed = u64::from(here) as f64 * self.robot_steps_per_generation as f64
            / elapsed.as_secs_f64().max(1e-9);
        let millions = speed / 1e6;
        match &self.shown {
            Shown::Bar(bar) => {
                bar.set_position(done.into());
                bar.set_message(format!(
                    "best {best:.3}  mean {mean:.3}  {millions:.0} M robot-steps/s  {} left",
                    seconds(left)
                ));
            }
            Shown::Lines => tell!(
                "generation {done}/{}  best {best:.4}  mean {mean:.4}  \
                 {millions:.1} M robot-steps/s  {} left",
                self.generations,
                seconds(left)
            ),
            Shown::Json => show_event!(
                "{}",
                serde_json::json!({
                    "event": "generation",
                    "generation": record.generation,
                    "generations": self.generations,
                    "best_fitness": best,
                    "mean_fitness": mean,
                    "robot_steps_per_second": speed.round(),
                    "seconds_left": left.as_secs_f64(),
                })
            ),
            Shown::Nothing => {}
        }
    }

    /// Clears the bar.
    pub fn end(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

/// Formats a duration in hours, minutes and seconds.
pub(crate) fn seconds(duration: Duration) -> String {
    let seconds = duration.as_secs_f64().round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}
