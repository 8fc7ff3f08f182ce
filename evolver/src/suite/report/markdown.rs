//! The report as Markdown.

use super::contents::SuiteReport;
use super::numbers::p_value;
use super::tables::{Table, Value};
use super::wording::{SHARED, VERDICTS, heading, opening, reading, sentence, to_look_at};
use minimal_surprise_evolution::text::{markdown, markdown_code_cell};
use std::fmt::Write;

/// Creates the whole report.
#[must_use]
pub fn text(report: &SuiteReport) -> String {
    let mut text = format!("# Report of the suite {}\n", markdown(&report.suite));
    for (heading, paragraphs) in opening(report) {
        let _ = write!(text, "\n## {heading}\n\n");
        for paragraph in paragraphs {
            let _ = writeln!(text, "{paragraph}");
        }
    }
    if !report.findings.is_empty() {
        let _ = writeln!(text, "\n## Main findings\n\n{}\n", VERDICTS);
        text += "| the paper's finding | ours | test | p | verdict |\n|---|---|---|---|---|\n";
        for finding in &report.findings {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | *{}* |",
                markdown(&finding.claim),
                markdown(&finding.ours),
                markdown(&finding.test),
                finding.p.map_or("–".to_owned(), p_value),
                finding.verdict.name()
            );
        }
    }
    let reading = reading(
        report,
        "Ours [95 % interval] · paper's.",
        "Value [95 % interval].",
    );
    let _ = writeln!(text, "\n## Tables\n\n{reading}");
    for table in &report.tables {
        write_table(&mut text, table);
    }
    text += "\n## Figures\n";
    for figure in &report.figures {
        let _ = write!(
            text,
            "\n![{}]({}.svg)\n\n{} Data: [{}.csv]({}.csv).\n",
            markdown(&figure.title),
            figure.id,
            markdown(&sentence(&figure.title)),
            figure.id,
            figure.id
        );
    }
    text += "\n## Provenance\n\n| experiment | setting | runs | seeds | minutes, CPU / clock | command | program | SHA-256 of the outcomes |\n|---|---|---|---|---|---|---|---|\n";
    for making in &report.making {
        let _ = writeln!(
            text,
            "| {} | {} | {} of {} | {} | {} | {} | {} | `{}` |",
            markdown(&making.experiment),
            markdown(&making.setting),
            making.finished,
            making.planned,
            making.seeds,
            making.minutes(),
            markdown_code_cell(&making.command),
            markdown(&making.programs),
            making.hash
        );
    }
    if let Some(time) = report.time_in_words() {
        let _ = writeln!(text, "\n{time}");
    }
    if report.shares_runs {
        let _ = writeln!(text, "\n{}", SHARED);
    }
    text += "\nEvery run with its seed and hash: [runs.csv](runs.csv).\n";
    if report.has_gallery {
        let _ = writeln!(
            text,
            "All runs, with final states and replays: [gallery](gallery/index.html)."
        );
    } else {
        let _ = writeln!(text, "\n{}", to_look_at(report));
    }
    text
}

fn write_table(text: &mut String, table: &Table) {
    let _ = write!(text, "\n### {}\n\n| |", markdown(&heading(table)));
    for column in &table.columns {
        let _ = write!(text, " {} |", markdown(column));
    }
    let _ = writeln!(text, "\n|---|{}", "---|".repeat(table.columns.len()));
    for row in &table.rows {
        let _ = write!(text, "| {} |", markdown(&name(&row.name, &row.counted)));
        for value in &row.values {
            let _ = write!(text, " {} |", value.as_ref().map_or(String::new(), cell));
        }
        text.push('\n');
    }
    text.push('\n');
    for note in &table.notes {
        let _ = writeln!(text, "- {}", markdown(note));
    }
    let _ = writeln!(text, "- Data: [{}.csv]({}.csv).", table.id, table.id);
}

fn name(name: &str, counted: &str) -> String {
    if counted.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({counted})")
    }
}

fn cell(value: &Value) -> String {
    let parts = [
        value
            .ours_in_words()
            .or_else(|| value.paper.map(|_| "–".to_owned())),
        value
            .interval_in_words()
            .map(|interval| format!("[{interval}]")),
        value.theirs_in_words().map(|paper| format!("· {paper}")),
        value.verdict_in_words(),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    if parts.is_empty() {
        "–".to_owned()
    } else {
        parts.join(" ")
    }
}
