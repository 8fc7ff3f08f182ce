//! Searches: evolution of further seeds until a run has the structure that a damage experiment
//! needs.
//!
//! The planned runs of the experiment come first. If the structure dominates none of them, runs
//! with further seeds are executed, of all settings in turn, until the structure dominates a run.
//! The position of that run in this order is the number of runs needed; it does not depend on which
//! processes executed the runs.

use super::file::Resilience;
use super::plan::{Plan, PlannedRun};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_sim::{Structure, classify};
use std::path::Path;

/// State of a search.
#[derive(Clone, Debug)]
pub enum Search {
    /// A planned run has the structure, or no search was requested.
    NotNeeded,
    /// Some planned runs are not complete yet.
    Waits,
    /// The next run to execute: run *k* beyond the plan, counted from 1.
    Next(Box<PlannedRun>, u32),
    /// The run that has the structure: run *k* beyond the plan, counted from 1.
    Found(Box<PlannedRun>, u32),
    /// All further runs are complete, and none has the structure; the value is their maximum
    /// number.
    NotFound(u32),
}

/// Searches the runs of a suite in its directory. Skips the first `after` runs beyond the plan,
/// because they are known not to have the structure. A damaged run counts as incomplete.
pub fn look(
    plan: &Plan,
    asked: &Resilience,
    suite: &Path,
    after: u32,
    damaged: &mut DamagedRuns,
) -> Search {
    let experiment = plan.experiments.iter().find(|e| e.name == asked.of);
    let (Some(experiment), Some(structure), 1..) =
        (experiment, asked.structure(), asked.further_runs)
    else {
        return Search::NotNeeded;
    };
    let mut waits = false;
    for settings in experiment.settings().filter(|_| after == 0) {
        for run in settings.runs() {
            match has(&run, structure, suite, damaged) {
                Some(true) => return Search::NotNeeded,
                Some(false) => {}
                None => waits = true,
            }
        }
    }
    if waits {
        return Search::Waits;
    }
    let further = (1..=asked.further_runs).zip(experiment.further());
    for (number, run) in further.skip(after as usize) {
        match has(&run, structure, suite, damaged) {
            Some(true) => return Search::Found(Box::new(run), number),
            Some(false) => {}
            None => return Search::Next(Box::new(run), number),
        }
    }
    Search::NotFound(asked.further_runs)
}

/// Returns whether a structure dominates a run; `None` if the run is not complete.
fn has(
    run: &PlannedRun,
    structure: Structure,
    suite: &Path,
    damaged: &mut DamagedRuns,
) -> Option<bool> {
    let finished = damaged.read(&run.directory(suite))?;
    let found = classify(run.settings.scenario().grid(), &finished.final_poses);
    Some(found.is_ok_and(|found| found.names().contains(&structure)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::work::{Outcome, work_on};
    use crate::suite::{Suite, plan::PlannedRun};
    use minimal_surprise_evolution::finished_run::FinishedRun;
    use std::collections::BTreeSet;
    use std::sync::atomic::AtomicBool;

    const RUNS: &str = "
        name = \"own\"
        [[experiment]]
        name = \"two-grids\"
        runs = 1
        grids = [\"8x8\", \"9x9\"]
        robots = [12]
        population = 4
        generations = 2
        repetitions = 1
        steps = 20
    ";

    fn suite(structure: &str, further_runs: u32) -> (Suite, Plan) {
        let text = format!(
            "{RUNS}\n[[resilience]]\nname = \"damage\"\nof = \"two-grids\"\nstructure = \
             \"{structure}\"\nrobots-in-areas = [2]\nrepeat = 1\nfurther-runs = {further_runs}\n"
        );
        let suite = Suite::parse(Path::new("own.toml"), &text).unwrap();
        let plan = Plan::new(&suite, None, None, false).unwrap();
        (suite, plan)
    }

    fn looked(plan: &Plan, asked: &Resilience, directory: &Path, after: u32) -> Search {
        look(plan, asked, directory, after, &mut DamagedRuns::default())
    }

    fn done(run: &PlannedRun, directory: &Path) {
        let worked = work_on(run, directory, &AtomicBool::new(false), |_| {});
        assert_eq!(worked.unwrap(), Outcome::Completed);
    }

    fn names(run: &PlannedRun, directory: &Path) -> Vec<Structure> {
        let finished = FinishedRun::read(&run.directory(directory)).unwrap();
        let grid = run.settings.scenario().grid();
        classify(grid, &finished.final_poses).unwrap().names()
    }

    #[test]
    fn a_search_goes_on_with_the_next_seeds_of_all_settings_until_one_has_the_structure() {
        let scratch = tempfile::tempdir().unwrap();
        let everywhere = scratch.path().join("everywhere");
        let (_, plan) = suite("line", 1);
        // The run to find: the first run beyond the plan that is dominated by a new structure.
        let mut known = BTreeSet::new();
        for run in plan.runs().iter() {
            done(&run, &everywhere);
            known.extend(names(&run, &everywhere).iter().map(|s| s.name()));
        }
        let mut further = (1..).zip(plan.experiments[0].further());
        let (number, wanted, found) = further
            .by_ref()
            .take(200)
            .find_map(|(number, run)| {
                done(&run, &everywhere);
                let names = names(&run, &everywhere);
                let new = names.into_iter().find(|s| !known.contains(s.name()))?;
                Some((number, new, run))
            })
            .expect("one of 200 runs forms a structure that the first two did not form");
        let seeds: Vec<u64> = plan.experiments[0]
            .further()
            .take(4)
            .map(|r| r.seed)
            .collect();
        assert_eq!(
            seeds,
            [2, 2, 3, 3],
            "settings alternate, and seeds follow the planned ones"
        );

        let directory = scratch.path().join("searched");
        let (asking, plan) = suite(wanted.name(), number);
        let asked = &asking.resiliences[0];
        assert!(matches!(looked(&plan, asked, &directory, 0), Search::Waits));
        plan.runs().iter().for_each(|run| done(&run, &directory));
        for expected in 1..=number {
            match looked(&plan, asked, &directory, expected - 1) {
                Search::Next(run, next) if next == expected => done(&run, &directory),
                other => panic!("run {expected} beyond the plan is next, not {other:?}"),
            }
        }
        match looked(&plan, asked, &directory, 0) {
            Search::Found(run, taken) => assert_eq!((run.id, taken), (found.id, number)),
            other => panic!("{wanted} is in run {number} beyond the plan, not {other:?}"),
        }
        if number > 1 {
            let (less, plan) = suite(wanted.name(), number - 1);
            let looked = looked(&plan, &less.resiliences[0], &directory, 0);
            assert!(matches!(looked, Search::NotFound(n) if n == number - 1));
        }
        let (_, plan) = suite(wanted.name(), 0);
        let none = Resilience {
            further_runs: 0,
            ..asked.clone()
        };
        let looked = looked(&plan, &none, &directory, 0);
        assert!(
            matches!(looked, Search::NotNeeded),
            "no search was requested"
        );
    }
}
