//! Tables of measures: fitness, movement and other numbers from the paper's text.

use super::table::{Row, Table, Value};
use crate::suite::report::gather::{GatheredRun, Group};
use crate::suite::report::numbers::plural;
use crate::suite::report::paper::{
    Distribution, MeanMedian, Number, Of, PaperValues, StructureValues, is_grouping,
};
use crate::suite::report::statistics::{fisher, median_interval, median_is, wilson};
use minimal_surprise_evolution::statistics::{mean, median};
use minimal_surprise_sim::structures::Structure;

/// Name of the measure that the paper gives for most settings.
pub const MEDIAN_BEST_FITNESS: &str = "median best fitness";

/// Creates the rows of Tables 4 and 5 below the first row: measures of the runs of each structure.
pub(super) fn per_structure(group: &Group, paper: &PaperValues) -> Option<Table> {
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
        rows: rows.into_iter().chain(by_chance(group, &present)).collect(),
    })
}

/// Creates the row with each structure's share of robots in random placements.
fn by_chance(group: &Group, structures: &[Structure]) -> Option<Row> {
    const NAME: &str = "robots in the structure in random placements, %";
    let placements = &group.chance.as_ref()?.placements;
    let value = |&structure: &Structure| {
        let shares = placements.sorted_shares(structure);
        let percent: Vec<f64> = shares.iter().map(|share| 100.0 * share).collect();
        Some(Value {
            of: percent.len(),
            ours: Some(mean(&percent)),
            ours_median: Some(median(&percent)),
            digits: 1,
            ..Value::new(NAME, structure.name())
        })
    };
    Some(Row {
        name: NAME.to_owned(),
        counted: plural(placements.draws(), "draw"),
        values: structures.iter().map(value).collect(),
    })
}

/// Creates the table of numbers from the paper's text, with the median best fitness of every
/// setting.
pub(super) fn numbers(experiment: &str, groups: &[&Group], paper: &PaperValues) -> Option<Table> {
    if groups.is_empty() {
        return None;
    }
    let columns = Columns {
        experiment,
        groups,
        paper,
    };
    let columns: Vec<(&str, Vec<Value>)> = columns
        .medians()
        .into_iter()
        .chain([columns.skill()])
        .chain(columns.lines_around_the_torus())
        .chain(columns.sensors_predicted())
        .collect();
    let rows = groups.iter().enumerate().map(|(row, group)| Row {
        name: group.label.clone(),
        counted: group.counted(),
        values: columns
            .iter()
            .map(|(_, values)| values.get(row).cloned())
            .collect(),
    });
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
        "Medians; with six runs or more, their bootstrap 95 % interval."
    } else {
        "Medians, with six runs or more their bootstrap 95 % interval, and sign test against the paper's median, where the \
         printed number counts as exact to half its last digit; percentages with Wilson's \
         interval and Fisher's test."
    };
    Some(Table {
        id: format!("numbers-{experiment}"),
        source: sources.join(", "),
        title: format!("{experiment}: fitness and other numbers"),
        notes: vec![note.to_owned()],
        columns: columns.iter().map(|(name, _)| (*name).to_owned()).collect(),
        rows: rows.collect(),
    })
}

/// The columns of [`numbers`], each with a name and one value per group.
struct Columns<'a> {
    experiment: &'a str,
    groups: &'a [&'a Group],
    paper: &'a PaperValues,
}

impl<'a> Columns<'a> {
    /// Returns whether the table has a column for this measure; it has one only if the paper has a
    /// number for the measure.
    fn has(&self, measure: &str) -> bool {
        measure == MEDIAN_BEST_FITNESS
            || self
                .groups
                .iter()
                .any(|g| self.number(g, measure).is_some())
    }

    /// Returns the paper's number.
    fn number(&self, group: &Group, measure: &str) -> Option<&'a Number> {
        self.paper.number(self.experiment, &group.label, measure)
    }

    fn setting(&self, group: &Group) -> String {
        format!("{}: {}", self.experiment, group.label)
    }

    /// Computes a column for each measure that the table has.
    fn of<M>(
        &self,
        measures: impl IntoIterator<Item = (&'static str, M)>,
        value: impl Fn(&Group, &str, &M) -> Value,
    ) -> Vec<(&'static str, Vec<Value>)> {
        let measures = measures.into_iter().filter(|(name, _)| self.has(name));
        measures
            .map(|(name, measure)| {
                let values = self.groups.iter().map(|group| value(group, name, &measure));
                (name, values.collect())
            })
            .collect()
    }

    fn medians(&self) -> Vec<(&'static str, Vec<Value>)> {
        type Values = fn(&Group) -> Vec<f64>;
        let measures: [(&str, (usize, Values)); 3] = [
            (MEDIAN_BEST_FITNESS, (3, |g| g.values(GatheredRun::fitness))),
            (
                "median share in the structure, %",
                (1, |g| g.values(|run| 100.0 * run.named_share())),
            ),
            (
                "median temperature in the last step",
                (3, |g| {
                    g.values(|run| run.finished.temperature.last().copied().unwrap_or(0.0))
                }),
            ),
        ];
        self.of(measures, |group, measure, (digits, values)| {
            let values = values(group);
            let mut value = Value::median(&self.setting(group), measure, &values, *digits);
            if let Some(number) = self.number(group, measure) {
                value.paper = Some(number.value);
                if !values.is_empty() {
                    let rounding = number.last_digit / 2.0;
                    value = value.tested(median_is(&values, number.value, rounding));
                }
            }
            value
        })
    }

    /// Computes the median skill of runs; empty where it is undefined.
    fn skill(&self) -> (&'static str, Vec<Value>) {
        const MEASURE: &str = "median skill";
        let value = |group: &&Group| {
            let skills: Vec<f64> = group.runs.iter().filter_map(GatheredRun::skill).collect();
            Value::median(&self.setting(group), MEASURE, &skills, 3)
        };
        (MEASURE, self.groups.iter().map(value).collect())
    }

    fn lines_around_the_torus(&self) -> Vec<(&'static str, Vec<Value>)> {
        let measures = [
            ("line runs with lines around the torus, %", Among::LineRuns),
            ("runs with lines around the torus, %", Among::AllRuns),
        ];
        self.of(measures, |group, measure, among| {
            let runs: Vec<&GatheredRun> = group.runs.iter().filter(|run| among.has(run)).collect();
            let spanning = runs.iter().filter(|run| run.lines.spanning > 0).count();
            let of = runs.len();
            let mut value = Value {
                of,
                ours: (of > 0).then(|| 100.0 * spanning as f64 / of as f64),
                digits: 1,
                ..Value::new(&self.setting(group), measure)
            }
            .within(wilson(spanning as f64, of as f64), 100.0);
            if let Some(number) = self.number(group, measure) {
                value.paper = Some(number.value);
                let of_paper = |of| self.paper.distribution(of, self.experiment, &group.label);
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
            value
        })
    }

    fn sensors_predicted(&self) -> Vec<(&'static str, Vec<Value>)> {
        type Extreme = fn(&[usize]) -> Option<usize>;
        type Wanted = fn(Structure) -> bool;
        let measures: [(&str, (Wanted, Extreme)); 2] = [
            (
                "fewest sensors predicted above 0.5 in a grouping run",
                (is_grouping, |numbers| numbers.iter().min().copied()),
            ),
            (
                "most sensors predicted above 0.5 in a line run",
                (
                    |name| name == Structure::Line,
                    |numbers| numbers.iter().max().copied(),
                ),
            ),
        ];
        self.of(measures, |group, measure, (wanted, extreme)| {
            let runs = group.runs.iter();
            let runs = runs.filter(|run| run.name().is_some_and(wanted));
            let numbers: Vec<usize> = runs.map(sensors_predicted_often).collect();
            Value {
                of: numbers.len(),
                ours: extreme(&numbers).map(|number| number as f64),
                paper: self.number(group, measure).map(|n| n.value),
                ..Value::new(&self.setting(group), measure)
            }
        })
    }
}

/// Runs over which a share is computed.
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

    /// Returns the number of such runs in the paper.
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

/// Returns the number of sensors whose average prediction in a run is above 0.5.
fn sensors_predicted_often(run: &GatheredRun) -> usize {
    let predicted = run.finished.settings.topology().predicted();
    let averages = run.finished.average_prediction.iter().enumerate();
    averages
        .filter(|&(sensor, &average)| predicted.get(sensor) && average > 0.5)
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::report::paper::Source;

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
}
