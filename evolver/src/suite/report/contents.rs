//! The contents of a report, independent of the output format.

use super::figures::{self, Figure, FigureError};
use super::findings::{self, Finding, Verdict};
use super::gather::{Gathered, GatheredRun, Group};
use super::numbers::{p_value, plural};
use super::paper::PaperValues;
use super::tables::{self, Table, Value};
use crate::data::ExportedRun;
use crate::report::progress::seconds;
use crate::suite::Suite;
use minimal_surprise_evolution::text::{hex, markdown, new_file_name, shell_word};
use minimal_surprise_evolution::time_spent::TimeSpent;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::time::Duration;

/// Names of a report's other files, without their extensions.
const OTHER_FILES: [&str; 4] = ["report", "runs", "findings", "how-made"];

/// Provenance of a setting's runs, evolved or re-evaluated.
#[derive(Clone, Debug, Serialize)]
pub struct ProvenanceRow {
    /// The experiment.
    pub experiment: String,
    /// The setting.
    pub setting: String,
    /// Number of finished runs.
    pub finished: usize,
    /// Number of planned runs.
    pub planned: usize,
    /// First and last seed of the finished runs.
    pub seeds: String,
    /// Programs that executed the runs.
    pub programs: String,
    /// SHA-256 of the runs' hashes, in order of their seeds; if the runs have no hash, SHA-256 of
    /// their outcomes.
    pub hash: String,
    /// The command that executes the runs.
    pub command: String,
    /// CPU time in seconds, summed over all threads; 0 if it was not measured.
    pub cpu_s: f64,
    /// Elapsed time in seconds.
    pub wall_s: f64,
}

impl ProvenanceRow {
    /// Formats CPU time and elapsed time in minutes.
    pub(super) fn minutes(&self) -> String {
        if self.cpu_s == 0.0 {
            "–".to_owned()
        } else {
            format!("{:.1} / {:.1}", self.cpu_s / 60.0, self.wall_s / 60.0)
        }
    }
}

/// The complete contents of a report.
#[derive(Clone, Debug, Default)]
pub struct SuiteReport {
    /// Name of the suite.
    pub suite: String,
    /// Descriptions of settings with missing runs.
    pub missing: Vec<String>,
    /// IDs of damaged runs, which are left out.
    pub damaged: Vec<String>,
    /// The findings.
    pub findings: Vec<Finding>,
    /// Descriptions of significant differences between our numbers and the paper's.
    pub differences: Vec<String>,
    /// Notes on the differences: the lines of `looked-into.md` in the report's folder.
    pub looked_into: Vec<String>,
    /// True if the report's folder contains a gallery of the runs.
    pub has_gallery: bool,
    /// True if experiments share runs.
    pub shares_runs: bool,
    /// Number of different tests in the tables that could find a difference.
    pub tests: usize,
    /// True if the tables include numbers from the paper.
    pub has_paper: bool,
    /// Beginning of every command line for this suite.
    pub called: String,
    /// The tables.
    pub tables: Vec<Table>,
    /// The figures.
    pub figures: Vec<Figure>,
    /// Time spent on all runs; a shared run is counted once.
    pub time: TimeSpent,
    /// Provenance of the runs.
    pub making: Vec<ProvenanceRow>,
}

impl SuiteReport {
    /// Creates the report of gathered runs.
    ///
    /// # Errors
    /// [`FigureError`] if a figure cannot be drawn.
    pub fn new(gathered: &Gathered, suite: &Suite, called: &str) -> Result<Self, FigureError> {
        let paper = PaperValues::for_suite(suite.compare_with);
        let mut tables = tables::all(gathered, &paper);
        let mut figures = figures::all(gathered, &paper)?;
        let mut taken = OTHER_FILES.map(str::to_owned).into();
        let table_ids = tables.iter_mut().map(|table| &mut table.id);
        for id in table_ids.chain(figures.iter_mut().map(|figure| &mut figure.id)) {
            *id = new_file_name(id, &mut taken);
        }
        let missing = gathered
            .groups
            .iter()
            .filter(|group| !group.is_complete())
            .map(|group| {
                let place = format!("{}, {}", group.experiment, group.label);
                format!("{}: {}", markdown(&place), group.counted())
            });
        let mut seen = BTreeSet::new();
        let (mut shares_runs, mut time) = (false, TimeSpent::default());
        let groups = gathered.groups.iter().chain(&gathered.further);
        for run in groups.clone().flat_map(|group| &group.runs) {
            if seen.insert(&run.id) {
                time = time.and(run.finished.time);
            } else {
                shares_runs = true;
            }
        }
        let tests = tests(&tables);
        Ok(Self {
            suite: suite.name.clone(),
            looked_into: Vec::new(),
            has_gallery: false,
            shares_runs,
            time,
            missing: missing.collect(),
            damaged: gathered
                .damaged
                .iter()
                .filter_map(|(run, _)| Some(run.file_name()?.to_string_lossy().into_owned()))
                .collect(),
            findings: findings::all(gathered, &paper),
            differences: differences(&tests),
            tests: tests.len(),
            has_paper: tables.iter().any(has_paper),
            called: called.to_owned(),
            figures,
            making: groups
                .map(|group| provenance(group, called))
                .chain(made_again(gathered, called))
                .collect(),
            tables,
        })
    }

    /// Describes the time spent on all runs; `None` if it was not measured.
    pub(super) fn time_in_words(&self) -> Option<String> {
        let in_words = |s: f64| seconds(Duration::from_secs_f64(s));
        (self.time.sittings > 0).then(|| {
            format!(
                "All runs took {} of CPU time and {} of elapsed time, summed over {} sittings of one \
                 run each.",
                in_words(self.time.cpu_s),
                in_words(self.time.wall_s),
                self.time.sittings
            )
        })
    }

    /// Returns the findings of the paper that do not hold in our runs.
    pub fn different_findings(&self) -> impl Iterator<Item = &Finding> {
        self.findings
            .iter()
            .filter(|finding| finding.verdict == Verdict::Differs)
    }
}

fn has_paper(table: &Table) -> bool {
    table.values().any(|value| value.paper.is_some())
}

/// Returns the tests that could find a difference, with their tables; a test in two tables counts
/// once.
fn tests(tables: &[Table]) -> Vec<(&Table, &Value)> {
    let mut tests: Vec<(&Table, &Value)> = Vec::new();
    for table in tables {
        for value in table.values().filter(|value| value.could_differ()) {
            if !tests.iter().any(|(_, other)| other.repeats(value)) {
                tests.push((table, value));
            }
        }
    }
    tests
}

fn differences(tests: &[(&Table, &Value)]) -> Vec<String> {
    let different = tests.iter().filter(|(_, v)| v.compatible == Some(false));
    let words = different.map(|(table, value)| {
        let source = if table.source.is_empty() {
            &table.id
        } else {
            &table.source
        };
        let numbers = match (value.ours_in_words(), value.theirs_in_words()) {
            (Some(ours), Some(paper)) => format!(": {ours}, paper {paper}"),
            _ => String::new(),
        };
        format!(
            "{}, {}, {}{numbers} ({}, {})",
            markdown(source),
            markdown(&value.setting),
            value.what,
            value.test.unwrap_or_default(),
            p_value(value.p.unwrap_or(1.0))
        )
    });
    words.collect()
}

fn provenance(group: &Group, called: &str) -> ProvenanceRow {
    let programs: BTreeSet<&str> = group
        .runs
        .iter()
        .map(|run| run.finished.program.as_str())
        .collect();
    let mut hash = Sha256::new();
    for run in &group.runs {
        hash.update(run.finished.hash.as_bytes());
        hash.update(b"\n");
    }
    let times = group.runs.iter().map(|run| run.finished.time);
    let time = times.fold(TimeSpent::default(), TimeSpent::and);
    ProvenanceRow {
        experiment: group.experiment.clone(),
        setting: group.setting(),
        finished: group.runs.len(),
        planned: group.planned,
        seeds: seeds(&group.runs),
        programs: programs.into_iter().collect::<Vec<_>>().join("; "),
        hash: if group.runs.is_empty() {
            String::new()
        } else {
            hex(&hash.finalize())
        },
        command: format!("{called} run --only {}", shell_word(&group.experiment)),
        cpu_s: time.cpu_s,
        wall_s: time.wall_s,
    }
}

/// Formats the first and last seed.
fn seeds(runs: &[GatheredRun]) -> String {
    let mut seeds = runs.iter().map(|run| run.finished.settings.seed());
    match (seeds.next(), seeds.next_back()) {
        (Some(first), Some(last)) => format!("{first} to {last}"),
        (Some(only), None) => only.to_string(),
        _ => String::new(),
    }
}

/// Returns the provenance of the runs that the report itself executes, from new starts and after
/// damage.
fn made_again(gathered: &Gathered, called: &str) -> Vec<ProvenanceRow> {
    let program = format!(
        "{} {}, revision {}",
        env!("CARGO_PKG_NAME"),
        env!("CARGO_PKG_VERSION"),
        env!("BUILD_REVISION")
    );
    let again = |experiment: &str, setting, seeds, (finished, planned), hash: &str| ProvenanceRow {
        experiment: experiment.to_owned(),
        setting,
        finished,
        planned,
        seeds,
        programs: program.clone(),
        hash: hash.to_owned(),
        command: format!("{called} report"),
        cpu_s: 0.0,
        wall_s: 0.0,
    };
    let mut makings = Vec::new();
    for reevaluated in &gathered.reevaluations {
        let Some(group) = gathered.group(&reevaluated.experiment, &reevaluated.label) else {
            continue;
        };
        let starts = reevaluated.starts as usize;
        makings.push(again(
            &reevaluated.name,
            format!(
                "{}: {}, {} of each genome",
                group.experiment,
                group.label,
                plural(starts, "new start")
            ),
            seeds(&group.runs),
            (reevaluated.genomes.len() * starts, group.planned * starts),
            &reevaluated.hash,
        ));
    }
    for resilient in &gathered.resiliences {
        let name = &resilient.asked.name;
        if let Some(damaged) = &resilient.damaged {
            let runs = damaged.repetitions();
            makings.push(again(
                name,
                format!(
                    "{}: {}, from new starts and after damage",
                    resilient.asked.of, damaged.label
                ),
                damaged.run.finished.settings.seed().to_string(),
                (runs, runs),
                &damaged.hash(),
            ));
        }
        let overall = &resilient.overall;
        if overall.repetitions > 0 {
            makings.push(again(
                name,
                format!(
                    "{}: all runs dominated by the structure ({}), after damage",
                    resilient.asked.of, resilient.structure
                ),
                plural(resilient.named, "run"),
                (overall.repetitions, overall.repetitions),
                &overall.hash,
            ));
        }
    }
    makings
}

/// Returns the runs for the table of runs.
pub(super) fn exported(gathered: &Gathered) -> impl Iterator<Item = ExportedRun> {
    let groups = gathered.groups.iter().chain(&gathered.further);
    groups.flat_map(|group| {
        group.runs.iter().map(|run| ExportedRun {
            experiment: group.experiment.clone(),
            setting: group.setting(),
            id: run.id.clone(),
            finished: run.finished.clone(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::statistics::SIGN_TEST;
    use super::*;

    #[test]
    fn tests_that_cannot_find_a_difference_or_are_repeated_do_not_count() {
        let value = |of, p| Value {
            setting: "a setting".to_owned(),
            what: "a median".to_owned(),
            of,
            test: Some(SIGN_TEST),
            p: Some(p),
            compatible: Some(p >= 0.05),
            ..Value::default()
        };
        let table = |values: Vec<Value>| Table {
            id: "table".to_owned(),
            source: String::new(),
            title: String::new(),
            notes: Vec::new(),
            columns: Vec::new(),
            rows: vec![tables::Row {
                name: String::new(),
                counted: String::new(),
                values: values.into_iter().map(Some).collect(),
            }],
        };
        let both = [
            table(vec![value(5, 0.0625), value(6, 0.03125)]),
            table(vec![value(6, 0.03125), value(7, 1.0)]),
        ];
        let counted: Vec<usize> = super::tests(&both)
            .iter()
            .map(|(_, value)| value.of)
            .collect();
        assert_eq!(counted, [6, 7]);
        assert_eq!(differences(&super::tests(&both)).len(), 1);
    }
}
