//! Progress of a suite, with an estimate of the remaining time.

use super::progress::{ProgressMode, Shown, seconds};
use crate::output::for_stderr;
use crate::suite::plan::{Plan, PlannedRun};
use crate::suite::worker::Watch;
use indicatif::ProgressBar;
use minimal_surprise_evolution::lock::{self, Holder};
use minimal_surprise_evolution::settings::add_seed;
use std::cell::{Cell, RefCell};
use std::path::Path;
use std::time::{Duration, Instant};

/// Progress display for the runs of one process.
#[derive(Debug)]
pub struct SuiteProgress<'a> {
    shown: Shown,
    started: Instant,
    plan: &'a Plan,
    runs: u64,
    done_before: u64,
    /// Number of runs that this process has completed.
    completed: Cell<u64>,
    worked: Cell<u64>,
    /// Number of remaining robot-steps.
    left: Cell<u64>,
    /// ID of the current run, and the number of its robot-steps already subtracted from `left`.
    settled: RefCell<(String, u64)>,
}

impl<'a> SuiteProgress<'a> {
    /// Starts the display and its clock. Of `runs` runs, `waiting` must still be executed; they
    /// need `left` robot-steps.
    #[must_use]
    pub fn start(mode: ProgressMode, plan: &'a Plan, runs: u64, waiting: u64, left: u64) -> Self {
        let bar = || ProgressBar::new(runs).with_position(runs - waiting);
        Self {
            shown: Shown::new(mode, "{pos}/{len} runs", bar),
            started: Instant::now(),
            plan,
            runs,
            done_before: runs - waiting,
            completed: Cell::new(0),
            worked: Cell::new(0),
            left: Cell::new(left),
            settled: RefCell::default(),
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

    fn left_in_words(&self) -> String {
        let words = |left| format!("  {} left", seconds(left));
        self.left().map_or_else(String::new, words)
    }

    /// Estimates the remaining time; `None` if this process has not completed a generation yet or
    /// the time overflows a [`Duration`].
    fn left(&self) -> Option<Duration> {
        let left = self.started.elapsed().as_secs_f64() * self.share_left()?;
        Duration::try_from_secs_f64(left).ok()
    }

    /// Returns the remaining work relative to the work done by this process.
    fn share_left(&self) -> Option<f64> {
        let worked = self.worked.get();
        (worked > 0).then(|| self.left.get() as f64 / worked as f64)
    }

    /// Subtracts the completed generations of a run from the remaining work, including generations
    /// completed by other processes.
    fn settle(&self, run: &PlannedRun, generation: u32) {
        let mut settled = self.settled.borrow_mut();
        if settled.0 != run.id {
            *settled = (run.id.clone(), 0);
        }
        let (before, now) = (settled.1, until(run, generation));
        settled.1 = now;
        let done = now.saturating_sub(before);
        self.left.set(self.left.get().saturating_sub(done));
    }
}

impl Watch for SuiteProgress<'_> {
    fn begins(&self, run: &PlannedRun, _further: Option<u32>) {
        if let Shown::Bar(bar) = &self.shown {
            bar.set_message(for_stderr(&self.label(run)).into_owned());
        }
    }

    fn generation(&self, run: &PlannedRun, generation: u32) {
        self.worked
            .set(self.worked.get() + run.settings.robot_steps_per_generation());
        self.settle(run, generation);
        match &self.shown {
            Shown::Bar(bar) => bar.set_message(format!(
                "{}  generation {generation}/{}{}",
                for_stderr(&self.label(run)),
                run.settings.generations(),
                self.left_in_words()
            )),
            Shown::Json => show_event!(
                "{}",
                serde_json::json!({
                    "event": "generation",
                    "run": run.id,
                    "label": self.label(run),
                    "generation": generation,
                    "generations": run.settings.generations(),
                })
            ),
            Shown::Lines | Shown::Nothing => {}
        }
    }

    fn completed(&self, run: &PlannedRun) {
        self.completed.set(self.completed.get() + 1);
        self.settle(run, run.settings.generations());
        let done = self.done_before + self.completed.get();
        match &self.shown {
            Shown::Bar(bar) => bar.set_position(done),
            Shown::Lines => tell!(
                "{done}/{} runs  {}{}",
                self.runs,
                self.label(run),
                self.left_in_words()
            ),
            Shown::Json => show_event!(
                "{}",
                serde_json::json!({
                    "event": "run",
                    "run": run.id,
                    "label": self.label(run),
                    "runs_done": done,
                    "runs": self.runs,
                    "seconds_left": self.left().map(|left| left.as_secs_f64()),
                })
            ),
            Shown::Nothing => {}
        }
    }

    fn waits(&self, run: &PlannedRun, directory: &Path, holder: Option<&Holder>) {
        waits(&self.shown, run, directory, holder);
    }
}

/// Progress display for runs beyond a plan; their number is not known in advance.
#[derive(Debug)]
pub struct SearchProgress {
    shown: Shown,
    experiment: String,
}

impl SearchProgress {
    /// Starts the display for a search; `experiment` is the experiment that needs the structure.
    #[must_use]
    pub fn start(mode: ProgressMode, experiment: &str) -> Self {
        let prefix = for_stderr(experiment).into_owned();
        let bar = || ProgressBar::no_length().with_prefix(prefix);
        Self {
            shown: Shown::new(mode, "{prefix}: {pos} runs beyond the plan", bar),
            experiment: experiment.to_owned(),
        }
    }

    /// Clears the bar.
    pub fn end(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

impl Watch for SearchProgress {
    fn begins(&self, run: &PlannedRun, further: Option<u32>) {
        let (experiment, number) = (&self.experiment, further.unwrap_or(0));
        let label = &run.label;
        match &self.shown {
            Shown::Bar(bar) => {
                bar.set_position(number.into());
                bar.set_message(format!("{}, seed {}", for_stderr(label), run.seed));
            }
            Shown::Lines => tell!(
                "{experiment}: run {number} beyond the plan, {label}, seed {}",
                run.seed
            ),
            Shown::Json => {
                let mut event = serde_json::json!({
                    "event": "further-run",
                    "experiment": experiment,
                    "number": number,
                    "run": run.id,
                    "label": label,
                });
                add_seed(&mut event, run.seed);
                show_event!("{event}");
            }
            Shown::Nothing => {}
        }
    }

    fn waits(&self, run: &PlannedRun, directory: &Path, holder: Option<&Holder>) {
        waits(&self.shown, run, directory, holder);
    }
}

fn waits(shown: &Shown, run: &PlannedRun, directory: &Path, holder: Option<&Holder>) {
    let who = lock::named(holder);
    let say = || {
        tell!(
            "waiting for {}: {who} is working on it",
            directory.display()
        )
    };
    match shown {
        Shown::Bar(bar) => bar.suspend(say),
        Shown::Json => {
            say();
            show_event!(
                "{}",
                serde_json::json!({
                    "event": "waiting",
                    "run": run.id,
                    "host": holder.map(|holder| &holder.host),
                    "process": holder.map(|holder| holder.process),
                })
            );
        }
        Shown::Lines | Shown::Nothing => say(),
    }
}

fn until(run: &PlannedRun, generation: u32) -> u64 {
    let steps = run.settings.robot_steps_per_generation();
    steps.saturating_mul(generation.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::Suite;

    #[test]
    fn what_is_left_is_counted_by_what_each_run_costs() {
        let text = "
            name = \"own\"
            [[experiment]]
            name = \"small-and-large\"
            runs = 1
            grids = [\"8x8\"]
            robots = [10, 40]
            population = 2
            generations = 4
            repetitions = 1
            steps = 10
        ";
        let suite = Suite::parse(Path::new("own.toml"), text).unwrap();
        let plan = Plan::new(&suite, None, None, false).unwrap();
        let runs: Vec<_> = plan.runs().iter().collect();
        let (small, large) = (&runs[0], &runs[1]);
        let all = runs.iter().map(|run| run.settings.robot_steps()).sum();
        let shown = SuiteProgress::start(ProgressMode::None, &plan, 2, 2, all);
        assert_eq!(shown.left(), None, "unknown before the first generation");
        for generation in 1..=4 {
            shown.generation(small, generation);
        }
        shown.completed(small);
        assert_eq!(
            shown.share_left(),
            Some(4.0),
            "the large run costs four times as much"
        );
        // Two generations of the large run were completed before, by another process.
        shown.generation(large, 3);
        assert_eq!(shown.share_left(), Some(0.5));
        shown.generation(large, 4);
        shown.completed(large);
        assert_eq!(shown.share_left(), Some(0.0));
    }
}
