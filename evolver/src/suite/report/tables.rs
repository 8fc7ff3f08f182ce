//! The paper's tables with our numbers, the paper's numbers, intervals and tests.

use super::gather::{
    Gathered, GatheredRun, Group, NewStart, Reevaluated, Resilient, structure_named,
};
use super::numbers::{number, p_value, plural};
use super::paper::{
    DAMAGED_GRID, Distribution, GROUPING, MeanMedian, NONE, Of, PaperValues, Source,
    StructureValues, is_grouping,
};
use super::statistics::{
    Interval, RUNS_MIN, SIGN_TEST, Test, fisher, median_interval, median_is, wilson,
};
use minimal_surprise_controller::{Prediction, Template};
use minimal_surprise_evolution::reevaluation::{mean, median};
use minimal_surprise_sim::structures::{LineOrientation, Structure};
use serde::Serialize;

/// Name of the measure that the paper gives for most settings.
pub const MEDIAN_BEST_FITNESS: &str = "median best fitness";

/// Category of genomes without one line orientation in most of their new starts.
const DIVERSE: &str = "diverse";

/// One of our numbers with the paper's number.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Value {
    /// The row, with its experiment.
    pub setting: String,
    /// The column.
    pub what: String,
    /// Number of runs, genomes or repetitions behind our number.
    pub of: usize,
    /// Our number.
    pub ours: Option<f64>,
    /// Our median, if the number is a mean.
    pub ours_median: Option<f64>,
    /// Lower end of the 95 % interval.
    pub low: Option<f64>,
    /// Upper end of the 95 % interval.
    pub high: Option<f64>,
    /// The paper's number.
    pub paper: Option<f64>,
    /// The paper's median, if the number is a mean.
    pub paper_median: Option<f64>,
    /// Name of the test for a difference between both numbers.
    pub test: Option<&'static str>,
    /// The test's p-value.
    pub p: Option<f64>,
    /// Whether the test finds no significant difference.
    pub compatible: Option<bool>,
    /// Number of decimals to print.
    #[serde(skip)]
    pub digits: usize,
}

impl Value {
    fn new(setting: &str, what: &str) -> Self {
        Self {
            setting: setting.to_owned(),
            what: what.to_owned(),
            ..Self::default()
        }
    }

    /// Returns whether the test could have found a difference.
    pub fn could_differ(&self) -> bool {
        let too_few = self.test == Some(SIGN_TEST) && self.of < RUNS_MIN;
        self.p.is_some() && !too_few
    }

    /// Returns whether a value from a different table is the same.
    pub fn repeats(&self, other: &Self) -> bool {
        (&self.setting, &self.what) == (&other.setting, &other.what)
            && (self.of, self.ours, self.paper, self.p)
                == (other.of, other.ours, other.paper, other.p)
    }

    fn within(mut self, interval: Option<Interval>, scale: f64) -> Self {
        self.low = interval.map(|interval| scale * interval.low);
        self.high = interval.map(|interval| scale * interval.high);
        self
    }

    fn tested(mut self, test: Test) -> Self {
        self.test = Some(test.name);
        self.p = Some(test.p);
        self.compatible = Some(test.compatible());
        self
    }
}

/// A row of a table.
#[derive(Clone, Debug)]
pub struct Row {
    /// The setting.
    pub name: String,
    /// Description of the number of finished runs.
    pub counted: String,
    /// The row's values, one per column; `None` for an empty cell.
    pub values: Vec<Option<Value>>,
}

/// A table.
#[derive(Clone, Debug)]
pub struct Table {
    /// Name of the table's file.
    pub id: String,
    /// Table or section of the paper; empty if the paper has no such table.
    pub source: String,
    /// The title.
    pub title: String,
    /// Notes on the table.
    pub notes: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<Row>,
}

impl Table {
    /// Returns every value of the table.
    pub fn values(&self) -> impl Iterator<Item = &Value> {
        self.rows.iter().flat_map(|row| row.values.iter().flatten())
    }
}

/// Data of a row of shares: each run's categories, several if tied.
struct Shared<'a> {
    name: String,
    setting: String,
    counted: String,
    runs: Vec<Vec<String>>,
    of: Of,
    paper: Option<&'a Distribution>,
}

impl Shared<'_> {
    /// Returns whether the row has a category; groupings are either separate or combined.
    fn has(&self, category: &str) -> bool {
        let together = self.paper.is_some_and(|d| d.percent.contains_key(GROUPING));
        if category == GROUPING {
            together
        } else if category == DIVERSE {
            self.of == Of::NewStarts
        } else {
            !(together && structure_named(category).is_some_and(is_grouping))
        }
    }
}

/// Creates all tables.
#[must_use]
pub fn all(gathered: &Gathered, paper: &PaperValues) -> Vec<Table> {
    let mut tables = Vec::new();
    for experiment in gathered.experiments() {
        let groups: Vec<&Group> = gathered
            .groups
            .iter()
            .filter(|group| group.experiment == experiment)
            .collect();
        tables.extend(structure_tables(experiment, &groups, gathered, paper));
        for group in &groups {
            tables.extend(per_structure(group, paper));
        }
        tables.extend(numbers(experiment, &groups, paper));
    }
    tables.extend(orientations(gathered, paper));
    tables.extend(new_starts(gathered));
    tables.extend(gathered.resiliences.iter().map(|r| resilience(r, paper)));
    tables
}

/// Creates the tables of dominant structures: one for each of the paper's, and one for settings
/// that are not in the paper.
fn structure_tables(
    experiment: &str,
    groups: &[&Group],
    gathered: &Gathered,
    paper: &PaperValues,
) -> Vec<Table> {
    let of_paper =
        |group: &Group| paper.distribution(Of::Structures, &group.experiment, &group.label);
    let source_of = |group: &Group| of_paper(group).map(|d| &d.source);
    let mut sources: Vec<Option<&Source>> = groups.iter().map(|group| source_of(group)).collect();
    // Sort by name; settings that are not in the paper come last.
    sources.sort_by_key(|source| (source.is_none(), in_words(*source)));
    sources.dedup();
    let tables = sources.into_iter().filter_map(|source| {
        let repeated = gathered.groups.iter().filter(|group| {
            of_paper(group).is_some_and(|d| d.also.is_some() && d.also.as_ref() == source)
        });
        let own = groups
            .iter()
            .copied()
            .filter(|group| source_of(group) == source);
        let shared: Vec<Shared<'_>> = repeated
            .chain(own)
            .map(|group| Shared {
                name: group.label.clone(),
                setting: format!("{}: {}", group.experiment, group.label),
                counted: group.counted(),
                runs: structure_categories(group, of_paper(group)),
                of: Of::Structures,
                paper: of_paper(group),
            })
            .collect();
        let id = match source {
            None => format!("structures-{experiment}"),
            Some(table @ Source::Table(_)) => table.file_name(),
            // A section may describe several experiments.
            Some(section) => format!("{}-{experiment}", section.file_name()),
        };
        let title = format!("{experiment}: runs by dominant structure, %");
        let categories = structure_order(&shared);
        let table = share_table(
            id,
            in_words(source),
            title,
            Counted::TiedRuns,
            &shared,
            &categories,
        );
        (!categories.is_empty()).then_some(table)
    });
    tables.collect()
}

/// Formats the source of a table; empty if the paper has no such numbers.
fn in_words(source: Option<&Source>) -> String {
    source.map(Source::to_string).unwrap_or_default()
}

/// Returns the categories of every run; combines the groupings if the paper does.
fn structure_categories(group: &Group, paper: Option<&Distribution>) -> Vec<Vec<String>> {
    let together = paper.is_some_and(|d| d.percent.contains_key(GROUPING));
    let name = |structure: &Structure| {
        if together && is_grouping(*structure) {
            GROUPING.to_owned()
        } else {
            structure.name().to_owned()
        }
    };
    group
        .runs
        .iter()
        .map(|run| match run.names.as_slice() {
            [] => vec![NONE.to_owned()],
            names => names.iter().map(name).collect(),
        })
        .collect()
}

/// Returns the structures that occur, in the paper's order.
fn structure_order(shared: &[Shared<'_>]) -> Vec<String> {
    let names = Structure::ALL.iter().map(|s| s.name());
    let mut order: Vec<String> = names.map(str::to_owned).collect();
    order.insert(2, GROUPING.to_owned());
    order.push(NONE.to_owned());
    order.retain(|name| {
        shared.iter().any(|shared| {
            shared
                .runs
                .iter()
                .flatten()
                .any(|category| category == name)
                || shared.paper.is_some_and(|d| d.percent.contains_key(name))
        })
    });
    order
}

/// Items counted by the percentages of a table.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Counted {
    /// Runs; a tied run counts as a fraction for each of its structures.
    TiedRuns,
    /// Runs; and genomes, by the majority of their new starts.
    RunsAndGenomes,
    /// New starts; a tied start counts as a fraction for each of its structures.
    TiedStarts,
}

impl Counted {
    fn note(self) -> &'static str {
        match self {
            Self::TiedRuns => {
                "Percent with Wilson's 95 % interval; a run tied between k structures counts 1/k \
                 for each."
            }
            Self::RunsAndGenomes => {
                "Percent with Wilson's 95 % interval. A genome from new starts \
                 counts for the orientation of more than half of the starts, otherwise as diverse."
            }
            Self::TiedStarts => {
                "Percent of all starts of all genomes; a start tied between k structures counts 1/k \
                 for each. No interval is given, because the starts of a genome are not \
                 independent; the interval of the fitness is the bootstrap 95 % interval of the \
                 median of the genomes' mean fitnesses."
            }
        }
    }
}

fn share_table(
    id: String,
    source: String,
    title: String,
    counted: Counted,
    shared: &[Shared<'_>],
    categories: &[String],
) -> Table {
    let tested = shared.iter().any(|shared| shared.paper.is_some());
    let rows = shared.iter().map(|shared| {
        let mut values: Vec<Option<Value>> = categories
            .iter()
            .map(|category| shared.has(category).then(|| share(shared, category)))
            .collect();
        if tested {
            values.push(distribution_test(shared, categories));
        }
        Row {
            name: shared.name.clone(),
            counted: shared.counted.clone(),
            values,
        }
    });
    let mut columns = categories.to_vec();
    let mut notes = vec![counted.note().to_owned()];
    if tested {
        columns.push("all together".to_owned());
        if counted == Counted::TiedRuns {
            notes.push(
                "All together: test of both distributions, in which a tied run counts for the \
                 structure that comes first in the paper's Sec. 2.2."
                    .to_owned(),
            );
        }
    }
    notes.extend(shared.iter().filter_map(groupings_together));
    notes.extend(
        shared.iter().filter_map(|shared| {
            Some(format!("{}: {}", shared.name, shared.paper?.note.as_ref()?))
        }),
    );
    Table {
        id,
        source,
        title,
        notes,
        columns,
        rows: rows.collect(),
    }
}

/// Describes the share of runs that form any of the groupings, if the paper separates them.
fn groupings_together(shared: &Shared<'_>) -> Option<String> {
    let paper = shared.paper.filter(|_| shared.of == Of::Structures)?;
    let groupings = Structure::ALL.into_iter().filter(|s| is_grouping(*s));
    let values: Vec<Value> = groupings
        .filter(|structure| shared.has(structure.name()))
        .map(|structure| share(shared, structure.name()))
        .collect();
    let theirs: f64 = values.iter().filter_map(|value| value.paper).sum();
    let told_apart = values.iter().filter(|v| v.paper > Some(0.0)).count();
    (told_apart > 1).then(|| {
        let ours: f64 = values.iter().filter_map(|value| value.ours).sum();
        format!(
            "{}: {ours:.1} % are aggregation, clustering or loose grouping; paper {theirs} % of {}.",
            shared.name,
            plural(paper.runs as usize, "run")
        )
    })
}

/// Computes the share of runs in a category, in percent.
fn share(shared: &Shared<'_>, category: &str) -> Value {
    let count: f64 = shared
        .runs
        .iter()
        .map(|run| {
            let tied = run.iter().filter(|name| *name == category).count();
            tied as f64 / run.len() as f64
        })
        .sum();
    let of = shared.runs.len();
    Value {
        of,
        ours: (of > 0).then(|| 100.0 * count / of as f64),
        paper: shared.paper.map(|d| d.percent(category)),
        digits: 1,
        ..Value::new(&shared.setting, category)
    }
    .within(wilson(count, of as f64), 100.0)
}

/// Tests our distribution against the paper's.
fn distribution_test(shared: &Shared<'_>, categories: &[String]) -> Option<Value> {
    let paper = shared.paper?;
    let value = Value {
        of: shared.runs.len(),
        ..Value::new(&shared.setting, "all together")
    };
    if shared.runs.is_empty() {
        return Some(value);
    }
    let ours: Vec<u32> = categories
        .iter()
        .map(|category| {
            let first = shared
                .runs
                .iter()
                .filter(|run| run.first() == Some(category));
            first.count() as u32
        })
        .collect();
    Some(value.tested(fisher(&ours, &paper.runs(categories))))
}

/// Computes a median with its interval.
fn median_value(setting: &str, what: &str, values: &[f64], digits: usize) -> Value {
    Value {
        of: values.len(),
        ours: (!values.is_empty()).then(|| median(values)),
        digits,
        ..Value::new(setting, what)
    }
    .within(median_interval(values), 1.0)
}

/// Creates Tables 4 and 5 below their first row: measures of the runs of each structure.
fn per_structure(group: &Group, paper: &PaperValues) -> Option<Table> {
    let of_paper = |structure: Structure| {
        paper.structures.iter().find(|values| {
            values.experiment == group.experiment
                && values.setting == group.label
                && values.structure == structure.name()
        })
    };
    let source = &Structure::ALL.into_iter().find_map(of_paper)?.source;
    let present: Vec<Structure> = Structure::ALL
        .into_iter()
        .filter(|s| of_paper(*s).is_some() || group.runs.iter().any(|run| run.names.contains(s)))
        .collect();
    type Ours = fn(&GatheredRun, Structure) -> f64;
    type Theirs = fn(&StructureValues) -> MeanMedian;
    let measures: [(&str, usize, f64, Ours, Theirs); 4] = [
        (
            "robots in the structure, %",
            1,
            0.5,
            |run, structure| 100.0 * run.share(structure),
            |v| v.robots_percent,
        ),
        (
            "fitness F",
            3,
            0.0005,
            |run, _| run.fitness(),
            |v| v.fitness,
        ),
        (
            "movement M",
            3,
            0.0005,
            |run, _| run.finished.movement,
            |v| v.movement,
        ),
        (
            "intended movement I",
            3,
            0.0005,
            |run, _| run.finished.intended_movement,
            |v| v.intended_movement,
        ),
    ];
    let rows = measures.map(|(what, digits, rounding, ours, theirs)| Row {
        name: what.to_owned(),
        counted: String::new(),
        values: present
            .iter()
            .map(|&structure| {
                let named = group
                    .runs
                    .iter()
                    .filter(|run| run.names.contains(&structure));
                let values: Vec<f64> = named.map(|run| ours(run, structure)).collect();
                let paper = of_paper(structure).map(theirs);
                let mut value = Value {
                    of: values.len(),
                    ours: (!values.is_empty()).then(|| mean(&values)),
                    ours_median: (!values.is_empty()).then(|| median(&values)),
                    paper: paper.map(|p| p.mean),
                    paper_median: paper.and_then(|p| p.median),
                    digits,
                    ..Value::new(what, structure.name())
                }
                .within(median_interval(&values), 1.0);
                if let Some(median) = paper.and_then(|p| p.median)
                    && !values.is_empty()
                {
                    value = value.tested(median_is(&values, median, rounding));
                }
                Some(value)
            })
            .collect(),
    });
    Some(Table {
        id: format!("{}-by-structure", source.file_name()),
        source: source.to_string(),
        title: format!(
            "{}, {}: measures of the runs of each structure",
            group.experiment, group.label
        ),
        notes: vec![
            "Mean, and median in brackets with its bootstrap 95 % interval; sign test against the \
             paper's median. With fewer than six runs, a sign test cannot reach p < 0.05."
                .to_owned(),
        ],
        columns: present.iter().map(|s| s.name().to_owned()).collect(),
        rows: rows.to_vec(),
    })
}

/// Runs that a share refers to.
#[derive(Clone, Copy)]
enum Among {
    LineRuns,
    AllRuns,
}

impl Among {
    fn has(self, run: &GatheredRun) -> bool {
        match self {
            Self::LineRuns => run.names.contains(&Structure::Line),
            Self::AllRuns => true,
        }
    }

    /// Returns the number of these runs in the paper.
    fn of_paper(self, shares: &Distribution) -> u32 {
        match self {
            Self::LineRuns => {
                let lines = shares.percent(Structure::Line.name()) / 100.0;
                (lines * f64::from(shares.runs)).round() as u32
            }
            Self::AllRuns => shares.runs,
        }
    }
}

/// Creates the table of numbers from the paper's text, with the median best fitness of every
/// setting.
fn numbers(experiment: &str, groups: &[&Group], paper: &PaperValues) -> Option<Table> {
    type Values = fn(&Group) -> Vec<f64>;
    let medians: [(&str, usize, Values); 3] = [
        (MEDIAN_BEST_FITNESS, 3, |g| g.values(GatheredRun::fitness)),
        ("median share in the structure, %", 1, |g| {
            g.values(|run| 100.0 * run.named_share())
        }),
        ("median temperature in the last step", 3, |g| {
            g.values(|run| run.finished.temperature.last().copied().unwrap_or(0.0))
        }),
    ];
    let shares = [
        ("line runs with lines around the torus, %", Among::LineRuns),
        ("runs with lines around the torus, %", Among::AllRuns),
    ];
    let wanted = |measure: &str| {
        measure == MEDIAN_BEST_FITNESS
            || groups
                .iter()
                .any(|g| paper.number(experiment, &g.label, measure).is_some())
    };
    let mut columns = Vec::new();
    let mut rows: Vec<Row> = groups
        .iter()
        .map(|group| Row {
            name: group.label.clone(),
            counted: group.counted(),
            values: Vec::new(),
        })
        .collect();
    for (measure, digits, values) in medians.into_iter().filter(|(m, ..)| wanted(m)) {
        columns.push(measure.to_owned());
        for (row, group) in rows.iter_mut().zip(groups) {
            let values = values(group);
            let setting = format!("{experiment}: {}", group.label);
            let mut value = median_value(&setting, measure, &values, digits);
            if let Some(number) = paper.number(experiment, &group.label, measure) {
                value.paper = Some(number.value);
                if !values.is_empty() {
                    let rounding = number.last_digit / 2.0;
                    value = value.tested(median_is(&values, number.value, rounding));
                }
            }
            row.values.push(Some(value));
        }
    }
    for (measure, among) in shares.into_iter().filter(|(m, _)| wanted(m)) {
        columns.push(measure.to_owned());
        for (row, group) in rows.iter_mut().zip(groups) {
            let runs: Vec<&GatheredRun> = group.runs.iter().filter(|run| among.has(run)).collect();
            let spanning = runs.iter().filter(|run| run.lines.spanning > 0).count();
            let of = runs.len();
            let mut value = Value {
                of,
                ours: (of > 0).then(|| 100.0 * spanning as f64 / of as f64),
                digits: 1,
                ..Value::new(&format!("{experiment}: {}", group.label), measure)
            }
            .within(wilson(spanning as f64, of as f64), 100.0);
            if let Some(number) = paper.number(experiment, &group.label, measure) {
                value.paper = Some(number.value);
                let of_paper = |of| paper.distribution(of, experiment, &group.label);
                let shares = of_paper(Of::Structures).or_else(|| of_paper(Of::Orientation));
                if let Some(shares) = shares
                    && of > 0
                {
                    let of_theirs = among.of_paper(shares);
                    let theirs = (number.value / 100.0 * f64::from(of_theirs)).round() as u32;
                    value = value.tested(fisher(
                        &[spanning as u32, (of - spanning) as u32],
                        &[theirs, of_theirs - theirs],
                    ));
                }
            }
            row.values.push(Some(value));
        }
    }
    let counts: [(&str, bool); 2] = [
        ("fewest sensors predicted above 0.5 in a grouping run", true),
        ("most sensors predicted above 0.5 in a line run", false),
    ];
    for (measure, grouping) in counts.into_iter().filter(|(m, _)| wanted(m)) {
        columns.push(measure.to_owned());
        for (row, group) in rows.iter_mut().zip(groups) {
            let wanted = |run: &&GatheredRun| {
                run.name().is_some_and(|name| {
                    if grouping {
                        is_grouping(name)
                    } else {
                        name == Structure::Line
                    }
                })
            };
            let runs = group.runs.iter().filter(wanted);
            let numbers: Vec<usize> = runs.map(sensors_predicted_often).collect();
            let extreme = if grouping {
                numbers.iter().min()
            } else {
                numbers.iter().max()
            };
            row.values.push(Some(Value {
                of: numbers.len(),
                ours: extreme.map(|&number| number as f64),
                paper: paper
                    .number(experiment, &group.label, measure)
                    .map(|n| n.value),
                ..Value::new(&format!("{experiment}: {}", group.label), measure)
            }));
        }
    }
    if groups.is_empty() {
        return None;
    }
    let mut sources: Vec<String> = groups
        .iter()
        .flat_map(|g| {
            paper
                .numbers
                .iter()
                .filter(move |n| n.experiment == experiment && n.setting == g.label)
        })
        .map(|number| number.source.to_string())
        .collect();
    sources.dedup();
    let note = if sources.is_empty() {
        "Medians with bootstrap 95 % interval."
    } else {
        "Medians with bootstrap 95 % interval and sign test against the paper's median, where the \
         printed number counts as exact to half its last digit; percentages with Wilson's \
         interval and Fisher's test."
    };
    Some(Table {
        id: format!("numbers-{experiment}"),
        source: sources.join(", "),
        title: format!("{experiment}: fitness and other numbers"),
        notes: vec![note.to_owned()],
        columns,
        rows,
    })
}

/// Returns the number of sensors whose average prediction in a run is above 0.5.
fn sensors_predicted_often(run: &GatheredRun) -> usize {
    let predicted = run.finished.settings.topology().predicted();
    let averages = run.finished.average_prediction.iter().enumerate();
    averages
        .filter(|&(sensor, &average)| predicted.get(sensor) && average > 0.5)
        .count()
}

/// Creates Table 6: line orientations, in the runs and from new starts.
fn orientations(gathered: &Gathered, paper: &PaperValues) -> Option<Table> {
    let is_line = |group: &&Group| {
        group.settings.topology().prediction() == Prediction::Predefined(Template::Line)
    };
    let mut shared = Vec::new();
    for group in gathered.groups.iter().filter(is_line) {
        let key = (group.experiment.as_str(), group.label.as_str());
        let of_run = |run: &GatheredRun| {
            let name = run.lines.orientation().map_or(NONE, LineOrientation::name);
            vec![name.to_owned()]
        };
        shared.push(Shared {
            name: format!("{}: as evolved", group.label),
            setting: format!("{}: {}, as evolved", key.0, key.1),
            counted: group.counted(),
            runs: group.runs.iter().map(of_run).collect(),
            of: Of::Orientation,
            paper: paper.distribution(Of::Orientation, key.0, key.1),
        });
        let again = |r: &&Reevaluated| r.experiment == key.0 && r.label == key.1;
        for reevaluated in gathered.reevaluations.iter().filter(again) {
            let of_genome = |orientation: Option<LineOrientation>| {
                let name = orientation.map_or(DIVERSE, LineOrientation::name);
                vec![name.to_owned()]
            };
            let orientations = reevaluated.orientations();
            shared.push(Shared {
                name: format!("{}: {} new starts", group.label, reevaluated.starts),
                setting: format!("{}: {}, new starts", key.0, key.1),
                counted: group.counted(),
                runs: orientations.into_iter().map(of_genome).collect(),
                of: Of::NewStarts,
                paper: paper.distribution(Of::NewStarts, key.0, key.1),
            });
        }
    }
    if shared.is_empty() {
        return None;
    }
    let source = shared.iter().find_map(|s| s.paper).map(|d| &d.source);
    let mut categories: Vec<String> = [
        "mostly vertical",
        "mostly horizontal",
        "maze-like",
        DIVERSE,
        NONE,
    ]
    .map(str::to_owned)
    .to_vec();
    categories.retain(|c| {
        c != NONE
            || shared
                .iter()
                .any(|s| s.runs.iter().flatten().any(|r| r == c))
    });
    let id = source.map_or("orientations".to_owned(), Source::file_name);
    let title = "Runs, and genomes from new starts, by line orientation, %".to_owned();
    let counted = Counted::RunsAndGenomes;
    let mut table = share_table(id, in_words(source), title, counted, &shared, &categories);
    let done = |reevaluated: &&Reevaluated| !reevaluated.genomes.is_empty();
    for reevaluated in gathered.reevaluations.iter().filter(done) {
        let all: Vec<&[Structure]> = reevaluated
            .genomes
            .iter()
            .flatten()
            .map(|start| start.names.as_slice())
            .collect();
        let other = all
            .iter()
            .filter(|names| names.first() != Some(&Structure::Line));
        table.notes.push(format!(
            "{}: {} of {} new starts did not end in lines.",
            reevaluated.label,
            other.count(),
            all.len()
        ));
    }
    Some(table)
}

/// Creates the table of structures that the genomes of every setting formed from new starts.
fn new_starts(gathered: &Gathered) -> Option<Table> {
    let done = gathered
        .reevaluations
        .iter()
        .filter(|reevaluated| !reevaluated.genomes.is_empty());
    let done: Vec<&Reevaluated> = done.collect();
    let shared: Vec<Shared<'_>> = done
        .iter()
        .map(|reevaluated| {
            let name = |names: &[Structure]| match names {
                [] => vec![NONE.to_owned()],
                names => names.iter().map(|s| s.name().to_owned()).collect(),
            };
            let setting = format!("{}: {}", reevaluated.experiment, reevaluated.label);
            let genomes = reevaluated.genomes.len();
            Shared {
                name: setting.clone(),
                setting: format!("{}, {setting}", reevaluated.name),
                counted: format!(
                    "{}, {} each",
                    plural(genomes, "genome"),
                    plural(reevaluated.starts as usize, "start")
                ),
                runs: reevaluated
                    .genomes
                    .iter()
                    .flatten()
                    .map(|start| name(&start.names))
                    .collect(),
                of: Of::Structures,
                paper: None,
            }
        })
        .collect();
    let categories = structure_order(&shared);
    let id = "new-starts".to_owned();
    let title = "New starts by final structure, %".to_owned();
    let counted = Counted::TiedStarts;
    let mut table = share_table(id, String::new(), title, counted, &shared, &categories);
    table.columns.insert(0, "median fitness".to_owned());
    for ((row, shared), reevaluated) in table.rows.iter_mut().zip(&shared).zip(&done) {
        for value in row.values.iter_mut().flatten() {
            (value.low, value.high) = (None, None);
        }
        let of_genome = |starts: &Vec<NewStart>| {
            mean(&starts.iter().map(|start| start.fitness).collect::<Vec<_>>())
        };
        let fitness: Vec<f64> = reevaluated.genomes.iter().map(of_genome).collect();
        let value = median_value(&shared.setting, "median fitness", &fitness, 3);
        row.values.insert(0, Some(value));
    }
    (!table.rows.is_empty()).then_some(table)
}

/// Creates Tables 7 and 8.
fn resilience(resilient: &Resilient, paper: &PaperValues) -> Table {
    let name = &resilient.asked.name;
    let of_paper: Vec<_> = paper
        .damages
        .iter()
        .filter(|d| d.resilience == *name)
        .collect();
    let source = of_paper.first().map(|d| &d.source);
    let columns = [
        "fitness",
        "in the structure at the start, %",
        "in the structure at the end, %",
        "similarity",
    ];
    let mut notes = vec![format!(
        "Dominated by the structure ({}): {} of {} of {}.",
        resilient.structure,
        resilient.named,
        plural(resilient.looked_through, "run"),
        resilient.asked.of
    )];
    let mut rows = Vec::new();
    if let Some(damaged) = &resilient.damaged {
        let chosen = match resilient.further {
            0 => "The run with the largest share was damaged".to_owned(),
            further => format!(
                "Therefore further seeds were evolved, of all settings in turn, and the first run with \
                 the structure, run {further} beyond the plan, was damaged"
            ),
        };
        let grid = damaged.run.finished.settings.scenario().grid();
        notes.push(format!(
            "{chosen}: {}, seed {}. Means; in brackets, medians with bootstrap 95 % intervals.",
            damaged.label,
            damaged.run.finished.settings.seed()
        ));
        if !of_paper.is_empty() {
            let grids = if grid.to_string() == DAMAGED_GRID {
                String::new()
            } else {
                format!(" and evolved on a different grid, {grid} instead of {DAMAGED_GRID}")
            };
            notes.push(format!(
                "The genome is not the paper's{grids}, so the numbers may differ and are not \
                 tested."
            ));
        }
        notes.extend(resilient.all_damaged().map(|words| words + "."));
        for area in &damaged.areas {
            let r = area.rectangle;
            notes.push(format!(
                "Area {}: cells {} to {} from the west, {} to {} from the south.",
                area.name, r.x0, r.x1, r.y0, r.y1
            ));
        }
        for (row_name, row) in damaged.rows() {
            let theirs = of_paper.iter().find(|values| values.row == row_name);
            let percent = |values: &[f64]| values.iter().map(|v| 100.0 * v).collect::<Vec<_>>();
            let columns_values = [
                (row.fitness.clone(), theirs.map(|v| v.fitness), 3),
                (
                    percent(&row.share_start),
                    theirs.map(|v| v.start_percent),
                    1,
                ),
                (percent(&row.share_end), theirs.map(|v| v.end_percent), 1),
                (row.similarity.clone(), theirs.map(|v| v.similarity), 3),
            ];
            let values =
                columns
                    .iter()
                    .zip(columns_values)
                    .map(|(what, (values, theirs, digits))| {
                        Some(
                            Value {
                                of: values.len(),
                                ours: Some(mean(&values)),
                                ours_median: (values.len() > 1).then(|| median(&values)),
                                paper: theirs.map(|t| t.mean),
                                paper_median: theirs.and_then(|t| t.median),
                                digits,
                                ..Value::new(&row_name, what)
                            }
                            .within(median_interval(&values).filter(|_| values.len() > 1), 1.0),
                        )
                    });
            rows.push(Row {
                values: values.collect(),
                counted: plural(row.fitness.len(), "run"),
                name: row_name,
            });
        }
    } else {
        notes.push(format!(
            "No run with the structure was found in {}; more runs are needed.",
            resilient.counted()
        ));
    }
    Table {
        // The figure already uses `name` as its ID.
        id: source.map_or_else(|| format!("numbers-{name}"), Source::file_name),
        source: in_words(source),
        title: format!("{name}: effect of damage on a {}", resilient.structure),
        notes,
        columns: columns.map(str::to_owned).to_vec(),
        rows,
    }
}

impl Value {
    /// Formats our number, with the median in brackets if it is a mean.
    pub(super) fn ours_in_words(&self) -> Option<String> {
        let mean = number(self.ours?, self.digits);
        Some(match self.ours_median {
            Some(median) => format!("{mean} ({})", number(median, self.digits)),
            None => mean,
        })
    }

    /// Formats the paper's number in the same way, with the digits printed there.
    pub(super) fn theirs_in_words(&self) -> Option<String> {
        let paper = self.paper?;
        Some(match self.paper_median {
            Some(median) => format!("{paper} ({median})"),
            None => paper.to_string(),
        })
    }

    /// Formats the 95 % interval.
    pub(super) fn interval_in_words(&self) -> Option<String> {
        let (low, high) = (self.low?, self.high?);
        Some(format!(
            "{}–{}",
            number(low, self.digits),
            number(high, self.digits)
        ))
    }

    /// Describes the result of the test.
    pub(super) fn verdict_in_words(&self) -> Option<String> {
        let compatible = if self.compatible? {
            "compatible"
        } else {
            "differs"
        };
        Some(format!(
            "{compatible}, {} ({})",
            p_value(self.p?),
            self.test?
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_compared_with_the_papers_share_of_the_same_runs() {
        let shares = Distribution {
            source: Source::Table(5),
            also: None,
            experiment: "densities".to_owned(),
            setting: "C, 20x20".to_owned(),
            of: Of::Structures,
            runs: 50,
            note: None,
            percent: [("line".to_owned(), 24.0)].into(),
        };
        assert_eq!(Among::LineRuns.of_paper(&shares), 12);
        assert_eq!(Among::AllRuns.of_paper(&shares), 50);
    }

    #[test]
    fn a_table_says_of_what_its_percentages_are() {
        let shared = [Shared {
            name: "a setting".to_owned(),
            setting: "a setting".to_owned(),
            counted: String::new(),
            runs: vec![vec!["line".to_owned()]],
            of: Of::Structures,
            paper: None,
        }];
        let categories = ["line".to_owned()];
        let all = [
            Counted::TiedRuns,
            Counted::RunsAndGenomes,
            Counted::TiedStarts,
        ];
        for counted in all {
            let (id, source, title) = Default::default();
            let table = share_table(id, source, title, counted, &shared, &categories);
            assert_eq!(table.notes, [counted.note()]);
        }
    }
}
