//! Tables, with our values beside the paper's values.

use crate::suite::report::numbers::{number, p_value};
use crate::suite::report::statistics::{Interval, RUNS_MIN, SIGN_TEST, Test, median_interval};
use minimal_surprise_evolution::statistics::median;
use serde::Serialize;

/// One of our numbers, with the paper's number.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Value {
    /// Name of the row, with the row's experiment.
    pub setting: String,
    /// Name of the column.
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
    /// Name of the test for a difference between the two numbers.
    pub test: Option<&'static str>,
    /// The test's p-value.
    pub p: Option<f64>,
    /// True if the test finds no significant difference.
    pub compatible: Option<bool>,
    /// Number of decimals to print.
    #[serde(skip)]
    pub digits: usize,
}

impl Value {
    pub(super) fn new(setting: &str, what: &str) -> Self {
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

    /// Returns whether a value in a different table is the same value.
    pub fn repeats(&self, other: &Self) -> bool {
        (&self.setting, &self.what) == (&other.setting, &other.what)
            && (self.of, self.ours, self.paper, self.p)
                == (other.of, other.ours, other.paper, other.p)
    }

    pub(super) fn within(mut self, interval: Option<Interval>, scale: f64) -> Self {
        self.low = interval.map(|interval| scale * interval.low);
        self.high = interval.map(|interval| scale * interval.high);
        self
    }

    pub(super) fn tested(mut self, test: Test) -> Self {
        self.test = Some(test.name);
        self.p = Some(test.p);
        self.compatible = Some(test.compatible());
        self
    }

    /// Computes a median with its interval.
    pub(super) fn median(setting: &str, what: &str, values: &[f64], digits: usize) -> Self {
        Self {
            of: values.len(),
            ours: (!values.is_empty()).then(|| median(values)),
            digits,
            ..Self::new(setting, what)
        }
        .within(median_interval(values), 1.0)
    }

    /// Formats our number, with the median in brackets if it is a mean.
    pub fn ours_in_words(&self) -> Option<String> {
        let mean = number(self.ours?, self.digits);
        Some(match self.ours_median {
            Some(median) => format!("{mean} ({})", number(median, self.digits)),
            None => mean,
        })
    }

    /// Formats the paper's number in the same way, with the digits printed in the paper.
    pub fn theirs_in_words(&self) -> Option<String> {
        let paper = self.paper?;
        Some(match self.paper_median {
            Some(median) => format!("{paper} ({median})"),
            None => paper.to_string(),
        })
    }

    /// Formats the 95 % interval.
    pub fn interval_in_words(&self) -> Option<String> {
        let (low, high) = (self.low?, self.high?);
        Some(format!(
            "{}–{}",
            number(low, self.digits),
            number(high, self.digits)
        ))
    }

    /// Describes the result of the test.
    pub fn verdict_in_words(&self) -> Option<String> {
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
