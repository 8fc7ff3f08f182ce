//! `status`: counts the complete runs.

use super::choice::Chosen;
use crate::commands::errors::name_damaged;
use crate::exit::Exit;
use crate::suite::plan::Plan;
use crate::suite::search::{Search, look};
use crate::suite::status::{Counts, Status};
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::finished_run::ReadRunError;
use std::path::Path;

/// Prints the number of complete runs and the state of the searches.
///
/// # Errors
/// If a directory cannot be read. Damaged runs are reported but are not errors.
pub(super) fn print(chosen: &Chosen) -> anyhow::Result<Exit> {
    let mut damaged = print_runs(&chosen.plan, &chosen.directory)?;
    print_searches(chosen, &mut damaged);
    Ok(name_damaged(&damaged, Some(&chosen.command())))
}

/// Prints the numbers of complete runs, and returns the damaged ones.
fn print_runs(plan: &Plan, directory: &Path) -> Result<DamagedRuns, ReadRunError> {
    let status = Status::read(plan, directory)?;
    for (experiment, settings) in &status.experiments {
        show_line!("{experiment}");
        for counts in settings {
            let damaged = match counts.damaged {
                0 => String::new(),
                number => format!(", {number} damaged"),
            };
            let Counts {
                label,
                number,
                done,
                begun,
                ..
            } = counts;
            show_line!("  {label:<40} {done:>4} of {number} done, {begun} begun{damaged}");
        }
    }
    let number = plan.runs().number();
    show_line!("\n{} of {number} different runs done", status.done);
    if let Some(hash) = &status.hash {
        show_line!("hash {hash}");
    }
    Ok(status.damaged)
}

fn print_searches(chosen: &Chosen, damaged: &mut DamagedRuns) {
    let command = chosen.command();
    for asked in chosen.searches() {
        let said = match look(&chosen.plan, asked, &chosen.directory, 0, damaged) {
            Search::NotNeeded => continue,
            Search::Waits => format!(
                "waiting for the planned runs; then, if none of them has a {}, continue with: \
                 {command}",
                asked.structure
            ),
            Search::Next(_, number) => format!(
                "no {} yet; {} runs beyond the plan done; continue with: {command}",
                asked.structure,
                number - 1
            ),
            Search::Found(run, number) => format!(
                "{} in run {number} beyond the plan, seed {}",
                asked.structure, run.seed
            ),
            Search::NotFound(number) => {
                format!("no {} in {number} runs beyond the plan", asked.structure)
            }
        };
        show_line!("{}\n  {said}", asked.name);
    }
}
