//! The report of a suite: tables, figures and findings, compared with the paper's, with intervals
//! and tests.
//!
//! [`gather`] reads the finished runs and executes re-evaluations and damage experiments;
//! [`tables`], [`figures`] and [`findings`] evaluate the runs and compare them with the numbers in
//! [`paper`]; [`contents`] combines the results, which [`mod@markdown`] and [`html`] write.

pub mod contents;
pub mod damage_areas;
pub mod figures;
pub mod findings;
pub mod gather;
pub mod html;
pub mod markdown;
mod numbers;
pub mod paper;
pub mod statistics;
pub mod tables;
mod wording;

use super::Suite;
use crate::data::{self, ExportError};
use contents::{SuiteReport, exported};
use figures::FigureError;
use gather::{GatherError, Gathered};
use minimal_surprise_evolution::files::{self, FileError, TEXT_BYTES_MAX};
use minimal_surprise_replay::gallery;
use numbers::csv_text;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// File with the user's notes on differences, in the report's folder.
const LOOKED_INTO: &str = "looked-into.md";

/// The reason why a report cannot be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A run cannot be read or executed again.
    #[error(transparent)]
    Gather(#[from] GatherError),
    /// The table of runs cannot be created.
    #[error(transparent)]
    Data(#[from] ExportError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// The files and numbers of runs of a written report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// Path of the HTML page.
    pub html: PathBuf,
    /// Path of the Markdown text.
    pub markdown: PathBuf,
    /// Paths of all files.
    pub files: Vec<PathBuf>,
    /// Number of finished runs, summed over all experiments.
    pub finished: usize,
    /// Number of planned runs.
    pub planned: usize,
}

/// Name of the gallery's folder, in the report's directory.
pub const GALLERY: &str = "gallery";

/// File that marks a directory as a report; a new report may replace such a directory.
const MARKER: &str = ".evolver-report";

/// Returns whether a new report would overwrite only an earlier report: the directory must be new,
/// marked as a report, or empty except for notes and a gallery. A gallery in the directory must
/// also be marked.
///
/// # Errors
/// [`FileError`] if the directory cannot be read.
pub fn may_be_written(out: &Path) -> Result<bool, FileError> {
    let entries = match std::fs::read_dir(out) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(true),
        entries => entries.map_err(FileError::at(out))?,
    };
    let gallery = out.join(GALLERY);
    if files::exists(&gallery)? && !gallery::is_marked(&gallery)? {
        return Ok(false);
    }
    if files::exists(&out.join(MARKER))? {
        return Ok(true);
    }
    for entry in entries {
        let name = entry.map_err(FileError::at(out))?.file_name();
        if name != LOOKED_INTO && name != GALLERY && !files::is_part(&name) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Writes the report on the gathered runs, with the data of its tables and figures as CSV. Creates
/// the directory `out`; `called` is the command line prefix for the commands in the report. If
/// `out` contains `looked-into.md`, its text is inserted after the differences: paragraphs, and
/// list items with a dash.
///
/// # Errors
/// [`ReportError`] if a file cannot be written.
pub fn write(
    gathered: &Gathered,
    suite: &Suite,
    out: &Path,
    called: &str,
) -> Result<Written, ReportError> {
    let mut report = SuiteReport::new(gathered, suite, called)?;
    report.has_gallery = files::exists(&out.join(GALLERY).join(gallery::INDEX))?;
    let looked_into = out.join(LOOKED_INTO);
    if files::exists(&looked_into)? {
        let text = files::read_text(&looked_into, TEXT_BYTES_MAX)?;
        report.looked_into = text.lines().map(str::to_owned).collect();
    }
    let mut files = vec![
        ("report.html".to_owned(), html::page(&report)),
        ("report.md".to_owned(), markdown::text(&report)),
        ("runs.csv".to_owned(), data::runs_text(exported(gathered))?),
        ("findings.csv".to_owned(), csv_text(&report.findings)),
        ("how-made.csv".to_owned(), csv_text(&report.making)),
    ];
    for table in &report.tables {
        let values: Vec<_> = table.values().collect();
        files.push((format!("{}.csv", table.id), csv_text(&values)));
    }
    for figure in &report.figures {
        files.push((format!("{}.svg", figure.id), figure.svg.clone()));
        files.push((format!("{}.csv", figure.id), figure.csv.clone()));
    }
    std::fs::create_dir_all(out).map_err(FileError::at(out))?;
    files::remove_old_parts(out);
    files::replace(
        &out.join(MARKER),
        b"A report of evolver; a newer report may replace it.\n",
    )?;
    let mut written = Vec::new();
    for (name, contents) in files {
        let path = out.join(name);
        files::replace(&path, contents.as_bytes())?;
        written.push(path);
    }
    Ok(Written {
        html: out.join("report.html"),
        markdown: out.join("report.md"),
        files: written,
        finished: gathered.groups.iter().map(|group| group.runs.len()).sum(),
        planned: gathered.groups.iter().map(|group| group.planned).sum(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::plan::Plan;
    use crate::suite::work::{Outcome, work_on};
    use minimal_surprise_evolution::finished_run::FinishedRun;
    use minimal_surprise_evolution::statistics::median;
    use std::collections::{BTreeMap, BTreeSet};
    use std::sync::atomic::AtomicBool;

    const OWN: &str = "
        name = \"own\"
        [[experiment]]
        name = \"two\"
        runs = 3
        grids = [\"8x8\"]
        robots = [20, 28]
        population = 6
        generations = 3
        repetitions = 2
        steps = 30
        [[re-evaluation]]
        name = \"again\"
        of = [\"two\"]
        starts = 3
        [[resilience]]
        name = \"damage\"
        of = \"two\"
        structure = \"random dispersion\"
        robots-in-areas = [3, 2]
        repeat = 4
    ";

    fn report_of(
        plan: &Plan,
        suite: &Suite,
        directory: &Path,
        out: &Path,
        called: &str,
    ) -> Written {
        let gathered = Gathered::read(plan, suite, directory).unwrap();
        write(&gathered, suite, out, called).unwrap()
    }

    #[test]
    fn runs_beyond_the_plan_are_listed_as_such() {
        let text = "
            name = \"own\"
            [[experiment]]
            name = \"one\"
            runs = 1
            grids = [\"8x8\"]
            robots = [12]
            population = 4
            generations = 2
            repetitions = 1
            steps = 20
            [[resilience]]
            name = \"damage\"
            of = \"one\"
            structure = \"triangular lattice\"
            robots-in-areas = [2]
            repeat = 1
            further-runs = 2
        ";
        let scratch = tempfile::tempdir().unwrap();
        let suite = Suite::parse(Path::new("own.toml"), text).unwrap();
        let plan = Plan::new(&suite, None, None, false).unwrap();
        let further: Vec<_> = plan.experiments[0].further().take(2).collect();
        for run in plan.runs().iter().chain(further.clone()) {
            let worked = work_on(&run, scratch.path(), &AtomicBool::new(false), |_| {});
            assert_eq!(worked.unwrap(), Outcome::Completed);
        }
        let out = scratch.path().join("report");
        let written = report_of(&plan, &suite, scratch.path(), &out, "evolver");
        assert_eq!((written.finished, written.planned), (1, 1));
        let runs = std::fs::read_to_string(out.join("runs.csv")).unwrap();
        let beyond: Vec<&str> = runs
            .lines()
            .filter(|l| l.contains("beyond the plan"))
            .collect();
        assert_eq!(beyond.len(), 2, "{runs}");
        for (line, run) in beyond.iter().zip(&further) {
            assert!(line.contains(&run.id), "{line}");
        }
        let made = std::fs::read_to_string(out.join("how-made.csv")).unwrap();
        assert!(made.contains("beyond the plan\",2,2,2 to 3,"), "{made}");
    }

    #[test]
    fn figures_stay_in_the_order_of_the_suite_whatever_their_names() {
        let experiment = |name: &str| {
            format!(
                "[[experiment]]\nname = \"{name}\"\nruns = 1\ngrids = [\"8x8\"]\nrobots = [12]\n\
                 population = 4\ngenerations = 2\nrepetitions = 1\nsteps = 20\n"
            )
        };
        let text = format!(
            "name = \"own\"\n{}{}",
            experiment("one-9"),
            experiment("two-1")
        );
        let scratch = tempfile::tempdir().unwrap();
        let suite = Suite::parse(Path::new("own.toml"), &text).unwrap();
        let plan = Plan::new(&suite, None, None, false).unwrap();
        for run in plan.runs().iter() {
            let worked = work_on(&run, scratch.path(), &AtomicBool::new(false), |_| {});
            assert_eq!(worked.unwrap(), Outcome::Completed);
        }
        let out = scratch.path().join("report");
        report_of(&plan, &suite, scratch.path(), &out, "evolver");
        let markdown = std::fs::read_to_string(out.join("report.md")).unwrap();
        let figures: Vec<usize> = [
            "one-9-temperature",
            "one-9-best",
            "two-1-temperature",
            "two-1-best",
        ]
        .map(|id| markdown.find(&format!("({id}.svg)")).expect(id))
        .to_vec();
        assert!(figures.is_sorted(), "{figures:?}");
    }

    /// Reads the numbers of a table's CSV, by setting and column.
    fn ours(out: &Path, table: &str) -> BTreeMap<(String, String), f64> {
        let mut reader = csv::Reader::from_path(out.join(table)).unwrap();
        let rows = reader.deserialize::<BTreeMap<String, String>>();
        rows.map(|row| row.unwrap())
            .filter_map(|row| {
                let key = (row["setting"].clone(), row["what"].clone());
                Some((key, row["ours"].parse().ok()?))
            })
            .collect()
    }

    #[test]
    fn a_reports_numbers_are_those_of_its_runs() {
        let scratch = tempfile::tempdir().unwrap();
        let (directory, out) = (scratch.path().join("suite"), scratch.path().join("report"));
        std::fs::create_dir(&directory).unwrap();
        let file = scratch.path().join("own.toml");
        std::fs::write(&file, OWN).unwrap();
        let suite = Suite::read(&file).unwrap();
        let plan = Plan::new(&suite, None, None, false).unwrap();
        let runs: Vec<_> = plan.runs().iter().collect();
        let (last, others) = runs.split_last().unwrap();
        for run in others {
            let worked = work_on(run, &directory, &AtomicBool::new(false), |_| {});
            assert_eq!(worked.unwrap(), Outcome::Completed);
        }
        assert!(!last.directory(&directory).exists());

        let called = "evolver suite suites/own.toml";
        let written = report_of(&plan, &suite, &directory, &out, called);
        assert_eq!((written.finished, written.planned), (5, 6));
        assert!(written.files.iter().all(|file| file.is_file()));
        let markdown = std::fs::read_to_string(&written.markdown).unwrap();
        assert!(markdown.contains("2 of 3 runs"), "{markdown}");
        assert!(
            markdown.contains("evolver suite suites/own.toml run --only two"),
            "{markdown}"
        );
        assert!(
            !markdown.contains("differs"),
            "without a paper, nothing differs"
        );
        let files: BTreeSet<_> = written.files.iter().collect();
        assert_eq!(files.len(), written.files.len(), "no file is written twice");
        for svg in written
            .files
            .iter()
            .filter(|f| f.extension() == Some("svg".as_ref()))
        {
            let svg = std::fs::read_to_string(svg).unwrap();
            assert!(
                svg.contains("fill=\"#ffffff\""),
                "a figure is dark on white"
            );
        }
        for again in ["| again | two: ", "| damage | two: "] {
            assert!(markdown.contains(again), "{again} has a provenance too");
        }
        assert!(
            !markdown.contains("paper's"),
            "no number of a paper is shown"
        );
        assert!(
            markdown.contains("New starts by final structure"),
            "{markdown}"
        );
        let page = std::fs::read_to_string(&written.html).unwrap();
        assert!(page.contains("<svg") && !page.contains("src="));

        let makes_one = "suites/own.toml report --gallery";
        assert!(page.contains(makes_one) && markdown.contains(makes_one));
        let gallery = scratch.path().join("with-gallery").join(GALLERY);
        std::fs::create_dir_all(&gallery).unwrap();
        std::fs::write(gallery.join("index.html"), "a gallery").unwrap();
        let out_with = gallery.parent().unwrap();
        let with = report_of(&plan, &suite, &directory, out_with, called);
        for report in [&with.html, &with.markdown] {
            let report = std::fs::read_to_string(report).unwrap();
            assert!(report.contains("gallery/index.html") && !report.contains(makes_one));
        }

        let numbers = ours(&out, "numbers-two.csv");
        let shares = ours(&out, "structures-two.csv");
        for settings in plan.experiments[0].settings() {
            let setting = format!("two: {}", settings.label);
            let finished: Vec<_> = settings
                .runs()
                .filter_map(|run| FinishedRun::read(&run.directory(&directory)).ok())
                .collect();
            let fitness: Vec<f64> = finished
                .iter()
                .map(|run| run.measures().unwrap().fitness())
                .collect();
            let what = tables::MEDIAN_BEST_FITNESS.to_owned();
            assert_eq!(numbers[&(setting.clone(), what)], median(&fitness));
            let mut of_runs: BTreeMap<&str, f64> = BTreeMap::new();
            for run in &finished {
                let grid = run.settings.scenario().grid();
                let names = minimal_surprise_sim::classify(grid, &run.final_poses)
                    .unwrap()
                    .names();
                for name in &names {
                    *of_runs.entry(name.name()).or_default() +=
                        100.0 / names.len() as f64 / finished.len() as f64;
                }
            }
            for (name, percent) in of_runs {
                let found = shares[&(setting.clone(), name.to_owned())];
                assert!((found - percent).abs() < 1e-9, "{setting}, {name}");
            }
        }

        let again = scratch.path().join("again");
        let again = report_of(&plan, &suite, &directory, &again, called);
        for (first, second) in written.files.iter().zip(&again.files) {
            assert_eq!(
                std::fs::read(first).unwrap(),
                std::fs::read(second).unwrap(),
                "the same runs give the same report"
            );
        }
    }
}
