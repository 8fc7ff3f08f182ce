//! The report as a self-contained HTML page: inline pictures, no script, light and dark mode.

use super::contents::SuiteReport;
use super::findings::Verdict;
use super::numbers::p_value;
use super::tables::{Table, Value};
use super::wording::{SHARED, VERDICTS, heading, opening, reading, sentence, to_look_at};
use minimal_surprise_evolution::text::html as escape;
use pulldown_cmark::{Event, Parser, html::push_html};
use std::fmt::Write;

const STYLE: &str = "
:root { color-scheme: light dark; --line: #8886; --soft: #777; --good: #2a7d2a; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --soft: #aaa; --good: #7ac77a; --bad: #ff8a80; } }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1100px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.6em; } h2 { margin-top: 2em; border-bottom: 1px solid var(--line); }
h3 { margin: 2em 0 .5em; font-size: 1.05em; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9em; }
th, td { padding: .35em .7em; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
thead th { border-bottom-width: 2px; }
td b { white-space: nowrap; } small { color: var(--soft); display: block; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; } .open { color: var(--soft); }
figure { margin: 2em 0; overflow-x: auto; } figcaption { color: var(--soft); font-size: .9em; }
svg { max-width: 100%; height: auto; } code { font-size: .9em; overflow-wrap: anywhere; }
";

/// Mark of the program that created the page.
const MARK: &str = "<meta name=\"generator\" content=\"minimal-surprise-evolver\">";

/// Creates the whole page.
#[must_use]
pub fn page(report: &SuiteReport) -> String {
    let title = format!("Report of the suite {}", report.suite);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{MARK}\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{0}</h1>\n",
        escape(&title)
    );
    if report.has_gallery {
        page += "<p><a href=\"gallery/index.html\">All runs</a>: final states and replays.</p>\n";
    } else {
        page += &rendered(&to_look_at(report));
    }
    for (heading, paragraphs) in opening(report) {
        let _ = writeln!(page, "<h2>{}</h2>", escape(heading));
        page += &rendered(&paragraphs.join("\n"));
    }
    write_findings(&mut page, report);
    let reading = reading(
        report,
        "Ours in bold, below it the 95 % interval and the paper's number.",
        "Values in bold, below them the 95 % interval.",
    );
    let _ = writeln!(page, "<h2>Tables</h2>\n<p>{reading}</p>");
    for table in &report.tables {
        write_table(&mut page, table);
    }
    page += "<h2>Figures</h2>\n";
    for figure in &report.figures {
        let _ = writeln!(
            page,
            "<figure role=\"img\" aria-label=\"{0}\">{1}<figcaption>{0} Data: \
             <a href=\"{2}.csv\">{2}.csv</a>.</figcaption></figure>",
            escape(&sentence(&figure.title)),
            figure.svg,
            escape(&figure.id)
        );
    }
    write_making(&mut page, report);
    page += "</body>\n</html>\n";
    page
}

/// Converts Markdown to HTML; escapes any HTML in it.
fn rendered(markdown: &str) -> String {
    let mut page = String::new();
    let events = Parser::new(markdown).map(|event| match event {
        Event::Html(text) | Event::InlineHtml(text) => Event::Text(text),
        event => event,
    });
    push_html(&mut page, events);
    page
}

fn write_findings(page: &mut String, report: &SuiteReport) {
    if report.findings.is_empty() {
        return;
    }
    let _ = writeln!(page, "<h2>Main findings</h2>\n{}", rendered(VERDICTS));
    page.push_str(
        "<div class=\"wide\"><table><thead><tr><th>the paper's finding</th>\
         <th>ours</th><th>test</th><th>verdict</th></tr></thead><tbody>\n",
    );
    for finding in &report.findings {
        let class = match finding.verdict {
            Verdict::Holds | Verdict::HoldsNotSignificantly => "good",
            Verdict::Differs => "bad",
            Verdict::HoldsAsByChance | Verdict::NotEnoughRuns => "open",
        };
        let p = finding.p.map_or(String::new(), |p| {
            format!("<small>{}</small>", escape(&p_value(p)))
        });
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{}{p}</td><td class=\"{class}\">{}</td></tr>",
            escape(&finding.claim),
            escape(&finding.ours),
            escape(&finding.test),
            finding.verdict.name()
        );
    }
    page.push_str("</tbody></table></div>\n");
}

fn write_table(page: &mut String, table: &Table) {
    let _ = write!(
        page,
        "<h3>{}</h3>\n<div class=\"wide\"><table><thead><tr><th></th>",
        escape(&heading(table))
    );
    for column in &table.columns {
        let _ = write!(page, "<th>{}</th>", escape(column));
    }
    page.push_str("</tr></thead><tbody>\n");
    for row in &table.rows {
        let _ = write!(
            page,
            "<tr><th>{}<small>{}</small></th>",
            escape(&row.name),
            escape(&row.counted)
        );
        for value in &row.values {
            let _ = write!(
                page,
                "<td>{}</td>",
                value.as_ref().map_or(String::new(), cell)
            );
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table></div>\n<p>");
    for note in &table.notes {
        let _ = write!(page, "<small>{}</small>", escape(note));
    }
    let _ = writeln!(
        page,
        "<small>Data: <a href=\"{0}.csv\">{0}.csv</a>.</small></p>",
        escape(&table.id)
    );
}

fn cell(value: &Value) -> String {
    let mut cell = value
        .ours_in_words()
        .map_or("–".to_owned(), |ours| format!("<b>{}</b>", escape(&ours)));
    if value.ours.is_none() && value.test.is_some() {
        cell.clear();
    }
    if let Some(interval) = value.interval_in_words() {
        let _ = write!(cell, "<small>{}</small>", escape(&interval));
    }
    if let Some(paper) = value.theirs_in_words() {
        let _ = write!(cell, "<small>paper {}</small>", escape(&paper));
    }
    if let Some(verdict) = value.verdict_in_words() {
        let class = if value.compatible == Some(true) {
            "good"
        } else {
            "bad"
        };
        let _ = write!(
            cell,
            "<small class=\"{class}\">{}</small>",
            escape(&verdict)
        );
    }
    cell
}

fn write_making(page: &mut String, report: &SuiteReport) {
    page.push_str(
        "<h2>Provenance</h2>\n<div class=\"wide\"><table><thead><tr><th>runs</th><th>seeds</th>\
         <th>minutes, CPU / clock</th><th>command and program</th><th>SHA-256 of the outcomes</th></tr></thead><tbody>\n",
    );
    for making in &report.making {
        let _ = writeln!(
            page,
            "<tr><td>{}: {}<small>{} of {}</small></td><td>{}</td><td>{}</td><td><code>{}</code>\
             <small>{}</small></td><td><code>{}</code></td></tr>",
            escape(&making.experiment),
            escape(&making.setting),
            making.finished,
            making.planned,
            escape(&making.seeds),
            making.minutes(),
            escape(&making.command),
            escape(&making.programs),
            making.hash
        );
    }
    page.push_str("</tbody></table></div>\n");
    if let Some(time) = report.time_in_words() {
        let _ = writeln!(page, "<p>{}</p>", escape(&time));
    }
    if report.shares_runs {
        let _ = writeln!(page, "<p>{SHARED}</p>");
    }
    page.push_str("<p>Every run with its seed and hash: <a href=\"runs.csv\">runs.csv</a>.</p>\n");
}

#[cfg(test)]
mod tests {
    use super::super::findings::{Contradiction, Detail, Finding};
    use super::*;

    #[test]
    fn a_run_that_contradicts_a_finding_is_code_and_what_it_formed_is_text() {
        let run = Contradiction {
            seed: 12,
            run: "f24ee6c408f704a9".to_owned(),
            formed: "pair 2 %, fitness 0.670 *".to_owned(),
        };
        let report = SuiteReport {
            findings: vec![Finding {
                claim: "All are lines".to_owned(),
                ours: "lines in 19 of 20 runs".to_owned(),
                detail: Detail::Contradicted(vec![run]),
                test: String::new(),
                p: None,
                verdict: Verdict::Differs,
            }],
            ..SuiteReport::default()
        };
        let said = |by: &str, text: &str| {
            let written = format!("lines in 19 of 20 runs. Contradicted by {by}.");
            assert!(text.contains(&written), "{text}");
        };
        let markdown = super::super::markdown::text(&report);
        said(
            "seed 12 (`f24ee6c408f704a9`), pair 2 %, fitness 0.670 \\*",
            &markdown,
        );
        said(
            "seed 12 (<code>f24ee6c408f704a9</code>), pair 2 %, fitness 0.670 *",
            &page(&report),
        );
    }

    #[test]
    fn backticks_are_code_stars_stress_and_html_is_text() {
        assert_eq!(
            rendered("a < b: *differs*, see `run *` and\n<i>`x`\n\n- one\n- \\*two"),
            "<p>a &lt; b: <em>differs</em>, see <code>run *</code> and\n&lt;i&gt;<code>x</code></p>\n\
             <ul>\n<li>one</li>\n<li>*two</li>\n</ul>\n"
        );
    }
}
