//! The paper's numbers, from `paper-values.toml`.

use crate::suite::Reference;
use minimal_surprise_sim::structures::Structure;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt;

/// All numbers from the paper that the report compares our results with.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperValues {
    /// Distributions of runs over categories.
    #[serde(rename = "distribution")]
    pub distributions: Vec<Distribution>,
    /// Single numbers.
    #[serde(rename = "number")]
    pub numbers: Vec<Number>,
    /// Measures of the runs of each structure.
    #[serde(rename = "structure")]
    pub structures: Vec<StructureValues>,
    /// Results of damage to structures.
    #[serde(rename = "damage")]
    pub damages: Vec<DamageValues>,
    /// Increases in the share of line runs due to partly predefining a line.
    pub raised: Vec<Raised>,
}

/// Place of a number in the paper.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub enum Source {
    /// Text of a section.
    Section(String),
    /// Table.
    Table(u32),
}

impl Source {
    /// Returns a file name for the numbers from this source.
    #[must_use]
    pub fn file_name(&self) -> String {
        match self {
            Self::Section(number) => format!("sec-{number}"),
            Self::Table(number) => format!("table-{number}"),
        }
    }

    /// Formats the source of a table; returns an empty text if the paper has no such numbers.
    #[must_use]
    pub fn in_words(source: Option<&Self>) -> String {
        source.map(Self::to_string).unwrap_or_default()
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Section(number) => write!(f, "Sec. {number}"),
            Self::Table(number) => write!(f, "Table {number}"),
        }
    }
}

impl TryFrom<String> for Source {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let table = text.strip_prefix("Table ").and_then(|n| n.parse().ok());
        let section = text.strip_prefix("Sec. ").map(str::to_owned);
        table
            .map(Self::Table)
            .or(section.map(Self::Section))
            .ok_or_else(|| format!("source = {text}: expected Table n or Sec. n"))
    }
}

/// Items counted by a distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Of {
    /// Runs, by dominant structure.
    #[default]
    Structures,
    /// Runs, by line orientation.
    Orientation,
    /// Genomes, by line orientation in most of their new starts.
    #[serde(rename = "new starts")]
    NewStarts,
}

/// Percentages of runs by category.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distribution {
    /// Table or section of the paper.
    pub source: Source,
    /// A second table that repeats the distribution.
    pub also: Option<Source>,
    /// The experiment.
    pub experiment: String,
    /// The label of the setting.
    pub setting: String,
    /// Items counted.
    #[serde(default)]
    pub of: Of,
    /// Number of runs.
    pub runs: u32,
    /// Note on the distribution.
    pub note: Option<String>,
    /// The shares in percent, as printed.
    pub percent: BTreeMap<String, f64>,
}

impl Distribution {
    /// Returns the paper's share of a category, in percent; 0 if it is not printed.
    #[must_use]
    pub fn percent(&self, category: &str) -> f64 {
        self.percent.get(category).copied().unwrap_or(0.0)
    }

    /// Converts the shares to numbers of whole runs per category; a tied run, printed as fractions,
    /// counts towards the first of its categories.
    #[must_use]
    pub fn runs(&self, categories: &[String]) -> Vec<u32> {
        let exact = |category: &String| self.percent(category) / 100.0 * f64::from(self.runs);
        // Shares are printed to half a percent, so a remainder below a fifth of a run is rounding.
        let mut counts: Vec<u32> = categories
            .iter()
            .map(|category| (exact(category) + 0.2).floor() as u32)
            .collect();
        let printed: f64 = categories.iter().map(exact).sum();
        let mut left = (printed.round() as u32).saturating_sub(counts.iter().sum());
        for (count, category) in counts.iter_mut().zip(categories) {
            if left > 0 && exact(category) - f64::from(*count) > 0.2 {
                *count += 1;
                left -= 1;
            }
        }
        counts
    }
}

/// A single number.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Number {
    /// Table or section of the paper.
    pub source: Source,
    /// The experiment.
    pub experiment: String,
    /// The label of the setting.
    pub setting: String,
    /// Name of the measure.
    pub measure: String,
    /// The number.
    pub value: f64,
    /// Value of one unit in the last printed digit.
    pub last_digit: f64,
}

/// A mean and a median.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeanMedian {
    /// The mean.
    pub mean: f64,
    /// The median, if it is printed.
    pub median: Option<f64>,
}

/// Measures of the runs of a structure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct StructureValues {
    /// Table of the paper.
    pub source: Source,
    /// The experiment.
    pub experiment: String,
    /// The label of the setting.
    pub setting: String,
    /// The structure.
    pub structure: String,
    /// Robots in the structure, in percent.
    pub robots_percent: MeanMedian,
    /// Fitness.
    pub fitness: MeanMedian,
    /// Movement M.
    pub movement: MeanMedian,
    /// Intended movement I.
    pub intended_movement: MeanMedian,
}

/// The result of damage to a structure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct DamageValues {
    /// Table of the paper.
    pub source: Source,
    /// The resilience experiment.
    pub resilience: String,
    /// Name of the row; the name describes the damage.
    pub row: String,
    /// Fitness.
    pub fitness: MeanMedian,
    /// Robots in the structure at the start, in percent.
    pub start_percent: MeanMedian,
    /// Robots in the structure at the end, in percent.
    pub end_percent: MeanMedian,
    /// Similarity to the undamaged final state.
    pub similarity: MeanMedian,
}

/// Increase of a share.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Raised {
    /// Section of the paper.
    pub source: Source,
    /// The grid.
    pub grid: String,
    /// Increase in percentage points.
    pub points: f64,
}

impl PaperValues {
    /// Returns the paper's numbers that a report compares its results with: all for the paper's
    /// suite, none for other suites.
    #[must_use]
    pub fn for_suite(reference: Option<Reference>) -> Self {
        let all: Self = toml::from_str(include_str!("../paper-values.toml"))
            .expect("a test parses the built-in file");
        match reference {
            Some(Reference::Paper) => all,
            None => Self::none(),
        }
    }

    fn none() -> Self {
        Self {
            distributions: Vec::new(),
            numbers: Vec::new(),
            structures: Vec::new(),
            damages: Vec::new(),
            raised: Vec::new(),
        }
    }

    /// Looks up a distribution by items, experiment and setting.
    #[must_use]
    pub fn distribution(&self, of: Of, experiment: &str, setting: &str) -> Option<&Distribution> {
        self.distributions
            .iter()
            .find(|d| d.of == of && d.experiment == experiment && d.setting == setting)
    }

    /// Looks up one number by experiment, setting and measure.
    #[must_use]
    pub fn number(&self, experiment: &str, setting: &str, measure: &str) -> Option<&Number> {
        self.numbers
            .iter()
            .find(|n| n.experiment == experiment && n.setting == setting && n.measure == measure)
    }
}

/// The grid of the damaged structures in Tables 7 and 8.
pub const DAMAGED_GRID: &str = "15x15";

/// Category of all three groupings together.
pub const GROUPING: &str = "grouping";

/// Category of runs without a dominant structure.
pub const NONE: &str = "none";

/// Returns whether a structure is one of the three groupings.
#[must_use]
pub fn is_grouping(structure: Structure) -> bool {
    matches!(
        structure,
        Structure::Aggregation | Structure::Clustering | Structure::LooseGrouping
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::Suite;
    use crate::suite::plan::Plan;
    use minimal_surprise_sim::structures::LineOrientation;

    #[test]
    fn every_number_belongs_to_a_setting_of_the_papers_suite() {
        let suite = Suite::paper().unwrap();
        let plan = Plan::new(&suite, None, None, false).unwrap();
        let values = PaperValues::for_suite(Some(Reference::Paper));
        let exists = |experiment: &str, setting: &str| {
            let found = plan.experiments.iter().any(|planned| {
                planned.name == experiment && planned.settings().any(|s| s.label == setting)
            });
            assert!(found, "{experiment}: {setting}");
        };
        for distribution in &values.distributions {
            exists(&distribution.experiment, &distribution.setting);
            let sum: f64 = distribution.percent.values().sum();
            assert!((sum - 100.0).abs() < 1e-9, "{distribution:?}");
            for category in distribution.percent.keys() {
                let structure = Structure::ALL.iter().any(|s| s.name() == category);
                let orientation = LineOrientation::ALL.iter().any(|o| o.name() == category);
                let other = [GROUPING, "diverse"].contains(&category.as_str());
                assert!(structure || orientation || other, "{category}");
            }
        }
        for number in &values.numbers {
            exists(&number.experiment, &number.setting);
        }
        for structure in &values.structures {
            exists(&structure.experiment, &structure.setting);
        }
        for damage in &values.damages {
            assert!(
                suite
                    .resiliences
                    .iter()
                    .any(|r| r.name == damage.resilience)
            );
        }
    }

    #[test]
    fn tied_runs_of_the_paper_count_for_the_first_structure() {
        let values = PaperValues::for_suite(Some(Reference::Paper));
        let names = ["line", "pair", "clustering", "random dispersion"].map(str::to_owned);
        let runs = |experiment: &str| {
            let found = values.distribution(Of::Structures, experiment, "C, 20x20");
            found.unwrap().runs(&names)
        };
        assert_eq!(runs("sensor-models"), [5, 5, 2, 8]);
        assert_eq!(runs("densities"), [13, 13, 3, 21]);
    }
}
