//! Progress of a run: a bar, lines, JSON, or nothing.

use crate::experiment::GenerationRecord;
use crate::settings::Settings;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProgressMode {
    /// A bar on a terminal, lines elsewhere.
    #[default]
    Auto,
    /// A bar, on standard error.
    Bar,
    /// A line a generation, on standard error.
    Lines,
    /// A JSON object a generation, on standard output; nothing else is printed there.
    Json,
    /// Nothing.
    None,
}

/// Shows the progress of one run.
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

#[derive(Debug)]
enum Shown {
    Bar(ProgressBar),
    Lines,
    Json,
    Nothing,
}

impl Progress {
    /// Starts the clock. `done` generations lie before this process.
    #[must_use]
    pub fn start(mode: ProgressMode, settings: &Settings, done: u32) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let shown = match mode {
            ProgressMode::Bar => Shown::Bar(bar(settings.generations, done)),
            ProgressMode::Auto if terminal => Shown::Bar(bar(settings.generations, done)),
            ProgressMode::Auto | ProgressMode::Lines => Shown::Lines,
            ProgressMode::Json => Shown::Json,
            ProgressMode::None => Shown::Nothing,
        };
        Self {
            shown,
            started: Instant::now(),
            generations_before: done,
            generations: settings.generations,
            robot_steps_per_generation: settings.robot_steps_per_generation(),
            scored_bits: settings.scored_bits() as f64,
            population: f64::from(settings.population),
        }
    }

    /// Shows a generation.
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
            Shown::Lines => eprintln!(
                "generation {done}/{}  best {best:.4}  mean {mean:.4}  \
                 {millions:.1} M robot-steps/s  {} left",
                self.generations,
                seconds(left)
            ),
            Shown::Json => show_line!(
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

fn bar(generations: u32, done: u32) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:16} {pos}/{len}  {wide_msg}")
        .expect("the template is well-formed");
    let bar = ProgressBar::new(generations.into()).with_style(style);
    bar.set_position(done.into());
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// A duration as people say it.
pub(crate) fn seconds(duration: Duration) -> String {
    let seconds = duration.as_secs_f64().round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}
