//! Text around the report's tables, findings and figures, in Markdown; the same for every format.

use super::contents::SuiteReport;
use super::numbers::plural;
use super::statistics::{RUNS_MIN, SIGNIFICANT};
use super::tables::Table;
use minimal_surprise_evolution::text::{markdown, markdown_code};
use std::fmt::Write;

/// Text before the findings.
pub(super) const VERDICTS: &str = "*Holds* and *differs* state whether the claim, as worded, is \
                                   true of our runs. The p-value only indicates whether a \
                                   tendency may be due to chance: a tendency that is present with \
                                   p ≥ 0.05 is marked *not significant*, and a missing tendency \
                                   counts as *differs* only with p < 0.05. *Chance gives as much* \
                                   if the share of runs is not significantly larger (Fisher's \
                                   test) than the share of random placements or of the final \
                                   states of random genomes; for a number of structures, if at \
                                   least 5 % of equally large samples of either have as many.";

/// Returns the explanation of the numbers in a table.
pub(super) fn reading<'a>(report: &SuiteReport, beside_paper: &'a str, alone: &'a str) -> &'a str {
    if report.has_paper {
        beside_paper
    } else {
        alone
    }
}

/// Note for experiments that share runs.
pub(super) const SHARED: &str = "Experiments with the same settings and seeds share their \
                                 runs, so their results are not independent.";

/// Returns the note on how to create the gallery, for reports without a gallery.
pub(super) fn to_look_at(report: &SuiteReport) -> String {
    format!(
        "{} creates a gallery of all runs: final states and replays.",
        markdown_code(&format!("{} report --gallery", report.called))
    )
}

/// Creates the opening sections: damaged and missing runs, and differences.
pub(super) fn opening(report: &SuiteReport) -> Vec<(&'static str, Vec<String>)> {
    let mut opening = Vec::new();
    if !report.damaged.is_empty() {
        let runs: Vec<String> = report.damaged.iter().map(|id| markdown_code(id)).collect();
        let line = format!(
            "Excluded from this report, because they are damaged or unreadable: {}, {}.",
            plural(runs.len(), "run"),
            runs.join(", ")
        );
        opening.push(("Damaged runs", vec![line]));
    }
    if !report.missing.is_empty() {
        let mut lines = vec![
            "Not all runs are finished; this report covers only the finished runs.".to_owned(),
            String::new(),
        ];
        lines.extend(report.missing.iter().map(|line| format!("- {line}")));
        opening.push(("Missing runs", lines));
    }
    if report.tests > 0 || !report.findings.is_empty() {
        let mut lines = Vec::new();
        for finding in report.different_findings() {
            let mut line = format!(
                "- {}: *differs*: {}",
                markdown(&finding.claim),
                markdown(&finding.ours)
            );
            let detail = finding.detail.in_words(markdown, markdown_code);
            if !detail.is_empty() {
                let _ = write!(line, ". {detail}.");
            }
            lines.push(line);
        }
        if lines.is_empty() {
            lines.push("No main finding of the paper that these runs can test differs.".into());
        } else {
            lines.insert(
                0,
                "Main findings of the paper that do not hold in our runs:\n".into(),
            );
        }
        lines.push(String::new());
        lines.push(format!(
            "Of {} of our numbers against the paper's, {} p < {}; at most about {:.0} would be \
             expected by chance. Sign tests with fewer than {} runs cannot reach this and are left \
             out; a value in two tables counts once.\n",
            plural(report.tests, "test"),
            match report.differences.len() {
                1 => "1 has".to_owned(),
                more => format!("{more} have"),
            },
            SIGNIFICANT,
            SIGNIFICANT * report.tests as f64,
            RUNS_MIN
        ));
        lines.extend(report.differences.iter().map(|line| format!("- {line}")));
        opening.push(("Differences from the paper", lines));
    }
    if !report.looked_into.is_empty() {
        opening.push(("Notes on the differences", report.looked_into.clone()));
    }
    opening
}

/// Returns the heading of a table.
pub(super) fn heading(table: &Table) -> String {
    if table.source.is_empty() {
        table.title.clone()
    } else {
        format!("{} — {}", table.source, table.title)
    }
}

/// Returns the text with a full stop appended.
pub(super) fn sentence(words: &str) -> String {
    format!("{words}.")
}
