//! Progress of a suite: suite, experiment and run level, with the time left by what was measured.

use super::progress::{ProgressMode, Shown, seconds};
use crate::output::for_stderr;
use crate::suite::plan::{Plan, PlannedRun, Runs, label};
use indicatif::ProgressBar;
use std::cell::Cell;
use std::time::{Duration, Instant};

/// Shows the progress of the runs of one process.
#[derive(Debug)]
pub struct SuiteProgress<'a> {
    shown: Shown,
    started: Instant,
    plan: &'a Plan,
    runs: u64,
    done_before: u64,
    /// Runs completed, and robot-steps worked and to be worked, by this process.
    completed: Cell<u64>,
    worked: Cell<u64>,
    to_work: u64,
}

impl<'a> SuiteProgress<'a> {
    /// Starts the clock: of these runs, so many are not done.
    #[must_use]
    pub fn start(mode: ProgressMode, plan: &'a Plan, runs: Runs<'_>, waiting: u64) -> Self {
        let number = runs.number();
        let bar = || ProgressBar::new(number).with_position(number - waiting);
        let steps_of_a_run = runs.iter().next().map_or(0, |run| robot_steps(&run));
        Self {
            shown: Shown::new(mode, "{pos}/{len} runs", bar),
            started: Instant::now(),
            plan,
            runs: number,
            done_before: number - waiting,
            completed: Cell::new(0),
            worked: Cell::new(0),
            to_work: steps_of_a_run.saturating_mul(waiting),
        }
    }

    /// A run begins, or is gone on with.
    pub fn begins(&self, run: &PlannedRun) {
        if let Shown::Bar(bar) = &self.shown {
            bar.set_message(for_stderr(&self.label(run)).into_owned());
        }
    }

    /// A run has done so many generations.
    pub fn generation(&self, run: &PlannedRun, generation: u32) {
        self.worked
            .set(self.worked.get() + run.settings.robot_steps_per_generation());
        match &self.shown {
            Shown::Bar(bar) => bar.set_message(format!(
                "{}  generation {generation}/{}  {} left",
                for_stderr(&self.label(run)),
                run.settings.generations,
                seconds(self.left())
            )),
            Shown::Json => show_event!(
                "{}",
                serde_json::json!({
                    "event": "generation",
                    "run": run.id,
                    "label": self.label(run),
                    "generation": generation,
                    "generations": run.settings.generations,
                })
            ),
            Shown::Lines | Shown::Nothing => {}
        }
    }

    /// A run is complete.
    pub fn completed(&self, run: &PlannedRun) {
        self.completed.set(self.completed.get() + 1);
        let done = self.done_before + self.completed.get();
        match &self.shown {
            Shown::Bar(bar) => bar.set_position(done),
            Shown::Lines => tell!(
                "{done}/{} runs  {}  {} left",
                self.runs,
                self.label(run),
                seconds(self.left())
            ),
            Shown::Json => show_event!(
                "{}",
                serde_json::json!({
                    "event": "run",
                    "run": run.id,
                    "label": self.label(run),
                    "runs_done": done,
                    "runs": self.runs,
                    "seconds_left": self.left().as_secs_f64(),
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

    fn label(&self, run: &PlannedRun) -> String {
        self.plan.title(run)
    }

    fn left(&self) -> Duration {
        let worked = self.worked.get().max(1);
        let left = self.to_work.saturating_sub(worked) as f64 / worked as f64;
        self.started.elapsed().mul_f64(left)
    }
}

/// Shows runs beyond a plan, of which nobody knows how many there will be.
#[derive(Debug)]
pub struct SearchProgress {
    shown: Shown,
}

impl SearchProgress {
    /// For the experiment that searches.
    #[must_use]
    pub fn start(mode: ProgressMode, experiment: &str) -> Self {
        let prefix = for_stderr(experiment).into_owned();
        let bar = || ProgressBar::no_length().with_prefix(prefix);
        Self {
            shown: Shown::new(mode, "{prefix}: {pos} runs beyond the plan", bar),
        }
    }

    /// A run begins, the so many-th beyond the plan.
    pub fn begins(&self, run: &PlannedRun, number: u32, experiment: &str) {
        let label = label(&run.settings);
        match &self.shown {
            Shown::Bar(bar) => {
                bar.set_position(number.into());
                bar.set_message(format!("{}, seed {}", for_stderr(&label), run.seed));
            }
            Shown::Lines => tell!(
                "{experiment}: run {number} beyond the plan, {label}, seed {}",
                run.seed
            ),
            Shown::Json => show_event!(
                "{}",
                serde_json::json!({
                    "event": "further-run",
                    "experiment": experiment,
                    "number": number,
                    "run": run.id,
                    "label": label,
                    "seed": run.seed,
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

fn robot_steps(run: &PlannedRun) -> u64 {
    let generations = u64::from(run.settings.generations);
    run.settings
        .robot_steps_per_generation()
        .saturating_mul(generations)
}
