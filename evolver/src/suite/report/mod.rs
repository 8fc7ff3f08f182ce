//! The report of a suite: its tables, figures and findings beside the paper's, with intervals and
//! tests.
//!
//! [`gather`] reads the finished runs and does what is made of them afterwards; [`tables`],
//! [`figures`] and [`findings`] compute from that and from [`paper`]'s numbers; [`mod@markdown`] and
//! [`html`] only write it down.

pub mod damage_areas;
pub mod figures;
pub mod findings;
pub mod gather;
pub mod html;
pub mod markdown;
pub mod paper;
pub mod statistics;
pub mod tables;

use super::Suite;
use crate::report::progress::seconds;
use figures::{Figure, FigureError};
use findings::{Finding, Verdict};
use gather::{Gathered, Group, Run};
use minimal_surprise_evolution::files::{self, FileError, TEXT_BYTES_MAX};
use minimal_surprise_evolution::text::{hex, markdown, new_file_name, shell_word};
use minimal_surprise_evolution::time_spent::TimeSpent;
use minimal_surprise_replay::gallery;
use minimal_surprise_sim::{DamageError, Structure, WorldError};
use paper::PaperValues;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tables::{Table, Value};

/// Names of a report's other files, without their ends.
const OTHER_FILES: [&str; 4] = ["report", "runs", "findings", "how-made"];

/// What people found out about differences, in the report's folder.
const LOOKED_INTO: &str = "looked-into.md";

/// A report cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A final state is not one.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A structure cannot be damaged.
    #[error(transparent)]
    Damage(#[from] DamageError),
    /// A suite names a structure that there is not.
    #[error("structure = {name:?}: structures are {}", Structure::ALL.map(Structure::name).join(", "))]
    UnknownStructure {
        /// What it is called there.
        name: String,
    },
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The report as a page.
    pub html: PathBuf,
    /// The report as text.
    pub markdown: PathBuf,
    /// Every file.
    pub files: Vec<PathBuf>,
    /// Runs that are finished, each experiment's counted.
    pub finished: usize,
    /// Runs that are planned.
    pub planned: usize,
}

/// How the runs of a setting were made, the evolved ones or those that were run again.
#[derive(Clone, Debug, Serialize)]
pub struct Making {
    /// The experiment.
    pub experiment: String,
    /// The setting.
    pub setting: String,
    /// Runs that are finished.
    pub finished: usize,
    /// Runs that are planned.
    pub planned: usize,
    /// First and last seed of those finished.
    pub seeds: String,
    /// Programs that did them.
    pub programs: String,
    /// SHA-256 of the runs' hashes, in order of their seeds; of runs that have none, of their
    /// outcomes.
    pub hash: String,
    /// The command that does them.
    pub command: String,
    /// Seconds of computing, all threads together; 0 if it was not measured.
    pub cpu_s: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
}

impl Making {
    /// Minutes of computing and on the clock, in words.
    fn minutes(&self) -> String {
        if self.cpu_s == 0.0 {
            "–".to_owned()
        } else {
            format!("{:.1} / {:.1}", self.cpu_s / 60.0, self.wall_s / 60.0)
        }
    }
}

/// Everything that a report says.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Name of the suite.
    pub suite: String,
    /// Experiments that lack runs, in words.
    pub missing: Vec<String>,
    /// Names of damaged runs, which are left out.
    pub damaged: Vec<String>,
    /// The findings.
    pub findings: Vec<Finding>,
    /// Where tests speak against our numbers and the paper's being the same, in words.
    pub differences: Vec<String>,
    /// What was looked into where we differ: the lines of a text that lies in the report's folder.
    pub looked_into: Vec<String>,
    /// Whether a gallery of the runs lies in the report's folder.
    pub has_gallery: bool,
    /// Whether experiments share runs.
    pub shares_runs: bool,
    /// Tests made in the tables that could find a difference, each counted once.
    pub tests: usize,
    /// Whether there are numbers of the paper beside ours.
    pub has_paper: bool,
    /// How the program was called with this suite.
    pub called: String,
    /// The tables.
    pub tables: Vec<Table>,
    /// The figures.
    pub figures: Vec<Figure>,
    /// How long all runs took, each counted once.
    pub time: TimeSpent,
    /// How it was made.
    pub making: Vec<Making>,
}

#[derive(Serialize)]
struct RunRow<'a> {
    experiment: &'a str,
    setting: String,
    id: &'a str,
    seed: u64,
    structures: String,
    share: f64,
    fitness: f64,
    movement: f64,
    intended_movement: f64,
    horizontal_lines: u32,
    vertical_lines: u32,
    spanning_lines: u32,
    hash: &'a str,
    program: &'a str,
}

/// Where a report links to, in its directory, if there is a gallery of its runs.
pub const GALLERY: &str = "gallery";

/// Says that a directory holds a report, which another may replace.
const MARKER: &str = ".evolver-report";

/// Whether a report would replace nothing but a report: the directory is new, marked as that of a
/// report, or empty but for what is to be said in the report. A gallery in it must be marked, too.
///
/// # Errors
/// [`FileError`] if it cannot be looked into.
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

/// Writes the report of gathered runs, with the data of its tables and figures as CSV. `out` is the
/// directory of the report, which is made; `called` is how the program was called with this suite,
/// for the commands in it. If `out` has a
/// `looked-into.md`, its text comes after the differences: paragraphs, and list items with a dash.
///
/// # Errors
/// [`ReportError`] if a file cannot be written.
pub fn write(
    gathered: &Gathered,
    suite: &Suite,
    out: &Path,
    called: &str,
) -> Result<Written, ReportError> {
    let mut report = Report::of(gathered, suite, called)?;
    report.has_gallery = files::exists(&out.join(GALLERY).join(gallery::INDEX))?;
    let looked_into = out.join(LOOKED_INTO);
    if files::exists(&looked_into)? {
        let text = files::read_text(&looked_into, TEXT_BYTES_MAX)?;
        report.looked_into = text.lines().map(str::to_owned).collect();
    }
    let mut files = vec![
        ("report.html".to_owned(), html::page(&report)),
        ("report.md".to_owned(), markdown::text(&report)),
        ("runs.csv".to_owned(), csv_text(&run_rows(gathered))),
        ("findings.csv".to_owned(), csv_text(&report.findings)),
        ("how-made.csv".to_owned(), csv_text(&report.making)),
    ];
    for table in &report.tables {
        let values: Vec<_> = table.values().collect();
        files.push((format!("{}.csv", table.id), csv_text(&values)));
    }
    for figure in &report.figures {
        files.push((format!("{}.svg", figure.id), figure.standalone()));
        files.push((format!("{}.csv", figure.id), figure.csv.clone()));
    }
    std::fs::create_dir_all(out).map_err(FileError::at(out))?;
    files::remove_old_parts(out);
    files::replace(
        &out.join(MARKER),
        b"A report of evolver; another may replace it.\n",
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

impl Report {
    /// The report of gathered runs.
    ///
    /// # Errors
    /// [`ReportError`] if a figure cannot be drawn.
    pub fn of(gathered: &Gathered, suite: &Suite, called: &str) -> Result<Self, ReportError> {
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
                .map(|group| making(group, called))
                .chain(made_again(gathered, called))
                .collect(),
            tables,
        })
    }

    /// How long all runs took, in words; nothing if it was not measured.
    fn time_in_words(&self) -> Option<String> {
        let in_words = |s: f64| seconds(Duration::from_secs_f64(s));
        (self.time.sittings > 0).then(|| {
            format!(
                "All runs took {} of computing and {} on the clock, summed over {} sittings of one \
                 run each.",
                in_words(self.time.cpu_s),
                in_words(self.time.wall_s),
                self.time.sittings
            )
        })
    }

    /// Findings of the paper that do not hold here.
    pub fn different_findings(&self) -> impl Iterator<Item = &Finding> {
        self.findings
            .iter()
            .filter(|finding| finding.verdict == Verdict::Differs)
    }
}

fn has_paper(table: &Table) -> bool {
    table.values().any(|value| value.paper.is_some())
}

/// The tests that could find a difference, with their tables; what two tables have counts once.
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
        let numbers = match (markdown::ours(value), markdown::theirs(value)) {
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

/// A number with so many digits after the point, without a sign if it is zero.
fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

/// A p-value in words.
fn p_value(p: f64) -> String {
    if p < 0.001 {
        "p < 0.001".to_owned()
    } else {
        format!("p = {p:.3}")
    }
}

fn making(group: &Group, called: &str) -> Making {
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
    Making {
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

/// First and last seed, in words.
fn seeds(runs: &[Run]) -> String {
    let mut seeds = runs.iter().map(|run| run.finished.settings.seed());
    match (seeds.next(), seeds.next_back()) {
        (Some(first), Some(last)) => format!("{first} to {last}"),
        (Some(only), None) => only.to_string(),
        _ => String::new(),
    }
}

/// How the runs were made that a report itself runs again: from new starts and after damage.
fn made_again(gathered: &Gathered, called: &str) -> Vec<Making> {
    let program = format!(
        "{} {}, revision {}",
        env!("CARGO_PKG_NAME"),
        env!("CARGO_PKG_VERSION"),
        env!("BUILD_REVISION")
    );
    let again = |experiment: &str, setting, seeds, (finished, planned), hash: &str| Making {
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
                    "{}: all runs named after the structure ({}), after damage",
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

/// So many of something.
fn plural(number: usize, what: &str) -> String {
    let s = if number == 1 { "" } else { "s" };
    format!("{number} {what}{s}")
}

fn run_rows(gathered: &Gathered) -> Vec<RunRow<'_>> {
    let mut rows = Vec::new();
    for group in gathered.groups.iter().chain(&gathered.further) {
        for run in &group.runs {
            let names: Vec<&str> = run.names.iter().map(|name| name.name()).collect();
            rows.push(RunRow {
                experiment: &group.experiment,
                setting: group.setting(),
                id: &run.id,
                seed: run.finished.settings.seed(),
                structures: names.join(";"),
                share: run.named_share(),
                fitness: run.fitness(),
                movement: run.finished.movement,
                intended_movement: run.finished.intended_movement,
                horizontal_lines: run.lines.horizontal,
                vertical_lines: run.lines.vertical,
                spanning_lines: run.lines.spanning,
                hash: &run.finished.hash,
                program: &run.finished.program,
            });
        }
    }
    rows
}

/// Rows as CSV.
fn csv_text(rows: &[impl Serialize]) -> String {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        table
            .serialize(row)
            .expect("plain rows are written to memory");
    }
    let bytes = table.into_inner().expect("memory needs no flushing");
    String::from_utf8(bytes).expect("text stays text")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::plan::Plan;
    use crate::suite::work::{Outcome, work_on};
    use minimal_surprise_evolution::finished_run::FinishedRun;
    use minimal_surprise_evolution::reevaluation::median;
    use std::collections::BTreeMap;
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
    fn tests_that_cannot_find_a_difference_or_are_repeated_do_not_count() {
        let value = |of, p| Value {
            setting: "a setting".to_owned(),
            what: "a median".to_owned(),
            of,
            test: Some(statistics::SIGN_TEST),
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
        let counted: Vec<usize> = tests(&both).iter().map(|(_, value)| value.of).collect();
        assert_eq!(counted, [6, 7]);
        assert_eq!(differences(&tests(&both)).len(), 1);
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

    /// The numbers of a table's CSV by setting and column.
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
            "there is no paper to differ from"
        );
        let files: BTreeSet<_> = written.files.iter().collect();
        assert_eq!(files.len(), written.files.len(), "no file is written twice");
        for svg in written
            .files
            .iter()
            .filter(|f| f.extension() == Some("svg".as_ref()))
        {
            let svg = std::fs::read_to_string(svg).unwrap();
            assert!(svg.contains("fill=\"#ffffff\"") && !svg.contains("currentColor"));
        }
        for again in ["| again | two: ", "| damage | two: "] {
            assert!(markdown.contains(again), "{again} is made, too");
        }
        assert!(!markdown.contains("paper's"), "and none to speak of");
        assert!(markdown.contains("Percentage of new starts"), "{markdown}");
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
