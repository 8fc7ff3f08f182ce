//! `report`: writes tables, figures and findings.

use super::choice::Chosen;
use crate::commands::BadInput;
use crate::commands::errors::{name_damaged, unusable};
use crate::exit::Exit;
use crate::suite::Suite;
use crate::suite::plan::Plan;
use crate::suite::report;
use crate::suite::report::gather::Gathered;
use clap::Args;
use minimal_surprise_evolution::damaged_runs::DamagedRuns;
use minimal_surprise_evolution::files::Existing;
use minimal_surprise_evolution::limits::{self, Needs};
use minimal_surprise_evolution::text::terminal_path;
use minimal_surprise_replay::gallery;
use std::path::{Path, PathBuf};

/// Location and extent of the report.
#[derive(Debug, Args)]
pub struct ReportOptions {
    /// Directory of the report [default: report/ in the directory of the suite].
    #[arg(long, value_name = "DIR")]
    to: Option<PathBuf>,
    /// Also write a page with every run's final state, linked to its replay: gallery/ in the
    /// report.
    #[arg(long)]
    gallery: bool,
}

/// Writes the report.
///
/// # Errors
/// [`BadInput`] if the directory contains anything other than a report, no run is complete, or
/// memory is insufficient. Other errors if a run cannot be read or a file cannot be written.
pub(super) fn write(chosen: &Chosen, options: &ReportOptions) -> anyhow::Result<Exit> {
    let out = options
        .to
        .clone()
        .unwrap_or_else(|| chosen.directory.join("report"));
    if !report::may_be_written(&out).map_err(unusable)? {
        return Err(BadInput::new(format!(
            "{}: not marked as a report that may be replaced (earlier versions set no mark); \
             choose a new directory with --to",
            out.display()
        ))
        .into());
    }
    let needs = needs_of_report(&chosen.plan, &chosen.source.suite);
    needs.check_memory().map_err(BadInput::new)?;
    let again = chosen.command();
    let gathered =
        Gathered::read(&chosen.plan, &chosen.source.suite, &chosen.directory).map_err(unusable)?;
    let finished = gathered.directories(&chosen.directory);
    if finished.is_empty() && !gathered.damaged.is_empty() {
        return Ok(name_damaged(&gathered.damaged, Some(&again)));
    }
    if finished.is_empty() {
        return Err(chosen.nothing_finished().into());
    }
    let mut damaged = gathered.damaged.clone();
    if options.gallery {
        damaged.extend(write_gallery(&finished, &out.join(report::GALLERY))?);
    }
    let written = report::write(&gathered, &chosen.source.suite, &out, &chosen.source.called)
        .map_err(unusable)?;
    show_line!(
        "{} of {} runs; {}",
        written.finished,
        written.planned,
        terminal_path(&written.html)
    );
    Ok(name_damaged(&damaged, Some(&again)))
}

/// Returns the memory needs of the largest evaluation that a report repeats.
fn needs_of_report(plan: &Plan, suite: &Suite) -> Needs {
    let mut most = Needs::default();
    for experiment in &plan.experiments {
        let of_it = |of: &String| *of == experiment.name;
        let again = suite.reevaluations.iter();
        let again = again.filter(|asked| asked.of.iter().any(of_it));
        let damage = suite.resiliences.iter().filter(|asked| of_it(&asked.of));
        let starts = again.map(|asked| ("starts", asked.starts));
        let starts: Vec<_> = starts
            .chain(damage.map(|asked| ("repeat", asked.repeat)))
            .collect();
        for settings in experiment.settings().filter(|_| !starts.is_empty()) {
            let scenario = [(*settings.settings.scenario(), ())];
            for &starts in &starts {
                let needs = Needs::of_starts(&scenario, starts, limits::threads(None));
                if needs.memory() > most.memory() {
                    most = needs;
                }
            }
        }
    }
    most
}

/// Writes the gallery of finished runs; replaces an earlier gallery.
fn write_gallery(finished: &[PathBuf], out: &Path) -> anyhow::Result<DamagedRuns> {
    let written = gallery::write(finished, out, Existing::Replace).map_err(unusable)?;
    show_line!(
        "{} runs, {:.1} MB; {}",
        written.runs,
        written.bytes as f64 / 1e6,
        terminal_path(&written.index)
    );
    Ok(written.damaged)
}
