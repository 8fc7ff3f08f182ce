//! Tables of shares: runs by dominant structure, by line orientation, and from new starts.

use super::table::{Row, Table, Value};
use crate::suite::report::gather::{
    Gathered, GatheredRun, Group, GroupChance, NewStart, Reevaluated, structure_named,
};
use crate::suite::report::numbers::plural;
use crate::suite::report::paper::{
    Distribution, GROUPING, NONE, Of, PaperValues, Source, is_grouping,
};
use crate::suite::report::statistics::{fisher, wilson};
use minimal_surprise_controller::{Prediction, Template};
use minimal_surprise_evolution::baseline::Chance;
use minimal_surprise_evolution::statistics::mean;
use minimal_surprise_sim::structures::{LineOrientation, Structure};

/// Category of genomes that do not form the same line orientation in most of their new starts.
const DIVERSE: &str = "diverse";

/// Data of a row of shares: each run's categories, several if tied.
struct Shared<'a> {
    name: String,
    setting: String,
    counted: String,
    runs: Vec<Vec<String>>,
    of: Of,
    /// True if the groupings are one category, as in the paper's distribution.
    together: bool,
    paper: Option<&'a Distribution>,
}

/// Returns whether the paper combines the groupings.
fn combines(paper: Option<&Distribution>) -> bool {
    paper.is_some_and(|d| d.percent.contains_key(GROUPING))
}

impl Shared<'_> {
    /// Returns whether the row has a category; a row has either separate groupings or a combined
    /// one.
    fn has(&self, category: &str) -> bool {
        if category == GROUPING {
            self.together
        } else if category == DIVERSE {
            self.of == Of::NewStarts
        } else {
            !(self.together && structure_named(category).is_some_and(is_grouping))
        }
    }
}

/// Creates the tables of dominant structures: one for each table of the paper, and one for the
/// settings that are not in the paper.
pub(super) fn structure_tables(
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
    sources.sort_by_key(|source| (source.is_none(), Source::in_words(*source)));
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
            .flat_map(|group| {
                let names = group.runs.iter().map(|run| run.names.as_slice());
                let evolved = Shared {
                    name: group.label.clone(),
                    setting: format!("{}: {}", group.experiment, group.label),
                    counted: group.counted(),
                    runs: structure_categories(names, of_paper(group)),
                    of: Of::Structures,
                    together: combines(of_paper(group)),
                    paper: of_paper(group),
                };
                [evolved]
                    .into_iter()
                    .chain(by_chance(group, of_paper(group)))
            })
            .collect();
        let id = match source {
            None => format!("structures-{experiment}"),
            Some(table @ Source::Table(_)) => table.file_name(),
            // One section of the paper may describe several experiments.
            Some(section) => format!("{}-{experiment}", section.file_name()),
        };
        let title = format!("{experiment}: runs by dominant structure, %");
        let categories = structure_order(&shared);
        let table = share_table(
            id,
            Source::in_words(source),
            title,
            Counted::TiedRuns,
            &shared,
            &categories,
        );
        (!categories.is_empty()).then_some(table)
    });
    tables.collect()
}

/// Returns the rows of what chance gives under a group's settings.
fn by_chance(group: &Group, paper: Option<&Distribution>) -> Vec<Shared<'static>> {
    let kinds = group.chance.iter().flat_map(GroupChance::kinds);
    let row = |(kind, chance): (&str, &Chance)| {
        let names = chance.states.iter().map(|state| state.names.as_slice());
        Shared {
            name: format!("{}: {kind}", group.label),
            setting: format!("{}: {}, {kind}", group.experiment, group.label),
            counted: plural(chance.draws(), "draw"),
            runs: structure_categories(names, paper),
            of: Of::Structures,
            together: combines(paper),
            paper: None,
        }
    };
    kinds.map(row).collect()
}

/// Returns the categories of every run or draw; combines the groupings if the paper does.
fn structure_categories<'a>(
    runs: impl Iterator<Item = &'a [Structure]>,
    paper: Option<&Distribution>,
) -> Vec<Vec<String>> {
    let together = combines(paper);
    let name = |structure: &Structure| {
        if together && is_grouping(*structure) {
            GROUPING.to_owned()
        } else {
            structure.name().to_owned()
        }
    };
    runs.map(|names| match names {
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
    /// Runs, and genomes by the majority of their new starts.
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

/// Describes the share of runs that form any of the groupings, if the paper reports the groupings
/// separately.
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

/// Creates Table 6: line orientations in the runs and from new starts.
pub(super) fn orientations(gathered: &Gathered, paper: &PaperValues) -> Option<Table> {
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
            together: false,
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
                together: false,
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
    let mut table = share_table(
        id,
        Source::in_words(source),
        title,
        counted,
        &shared,
        &categories,
    );
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
pub(super) fn new_starts(gathered: &Gathered) -> Option<Table> {
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
                together: false,
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
        let value = Value::median(&shared.setting, "median fitness", &fitness, 3);
        row.values.insert(0, Some(value));
    }
    (!table.rows.is_empty()).then_some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_says_of_what_its_percentages_are() {
        let shared = [Shared {
            name: "a setting".to_owned(),
            setting: "a setting".to_owned(),
            counted: String::new(),
            runs: vec![vec!["line".to_owned()]],
            of: Of::Structures,
            together: false,
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
