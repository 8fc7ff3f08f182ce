//! The paper's tables with our numbers, the paper's numbers, intervals and tests.

mod measures;
mod resilience;
mod shares;
mod table;

pub use measures::MEDIAN_BEST_FITNESS;
pub use table::{Row, Table, Value};

use super::gather::{Gathered, Group};
use super::paper::PaperValues;

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
        tables.extend(shares::structure_tables(
            experiment, &groups, gathered, paper,
        ));
        for group in &groups {
            tables.extend(measures::per_structure(group, paper));
        }
        tables.extend(measures::numbers(experiment, &groups, paper));
    }
    tables.extend(shares::orientations(gathered, paper));
    tables.extend(shares::new_starts(gathered));
    tables.extend(
        gathered
            .resiliences
            .iter()
            .map(|r| resilience::resilience(r, paper)),
    );
    tables
}
