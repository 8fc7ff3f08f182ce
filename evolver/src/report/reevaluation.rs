//! Tables and JSON of re-evaluations and of resilience to damage.

use minimal_surprise_evolution::baseline::{ceiling, constant_fitness, skill};
use minimal_surprise_evolution::reevaluation::{Rerun, ResilienceRow};
use minimal_surprise_evolution::run_files::{self, SCHEMA_VERSION};
use minimal_surprise_evolution::settings::add_seed;
use minimal_surprise_evolution::statistics::{mean, median};
use minimal_surprise_sim::Scenario;
use minimal_surprise_sim::structures::{LineOrientation, Structure, in_words};
use serde_json::{Map, Value, json};

/// A combination of conditions, with its runs.
#[derive(Clone, Debug)]
pub struct Condition {
    /// The conditions.
    pub scenario: Scenario,
    /// Noise, as given by the user.
    pub noise: f64,
    /// The runs, one per start.
    pub reruns: Vec<Rerun>,
}

impl Condition {
    /// Returns the skill of the mean fitness.
    fn skill(&self) -> Option<f64> {
        skill(mean(&fitnesses(&self.reruns)), &self.scenario)
    }
}

/// Returns the number of runs that each structure dominates; in a tie of k structures, each counts
/// 1/k.
#[must_use]
pub fn name_counts(reruns: &[Rerun]) -> Vec<(Structure, f64)> {
    let count = |structure| {
        let named = reruns
            .iter()
            .filter(|rerun| rerun.names.contains(&structure));
        named
            .map(|rerun| 1.0 / rerun.names.len() as f64)
            .sum::<f64>()
    };
    let counts = Structure::ALL.map(|structure| (structure, count(structure)));
    counts.into_iter().filter(|&(_, n)| n > 0.0).collect()
}

fn fitnesses(reruns: &[Rerun]) -> Vec<f64> {
    reruns.iter().map(|rerun| rerun.fitness).collect()
}

/// Returns the most frequent orientation of lines; an empty text if no run has lines.
fn orientation(reruns: &[Rerun]) -> String {
    if !reruns.iter().any(|r| r.names.contains(&Structure::Line)) {
        return String::new();
    }
    let runs: Vec<Option<LineOrientation>> = reruns.iter().map(|r| r.orientation).collect();
    LineOrientation::of_most(&runs).map_or("diverse".to_owned(), |most| most.name().to_owned())
}

/// Formats the conditions as a table.
#[must_use]
pub fn conditions_text(conditions: &[Condition]) -> String {
    let mut table = super::table(&[
        "grid",
        "robots",
        "noise",
        "mean fitness",
        "median",
        "constant",
        "skill",
        "structures",
        "lines",
    ]);
    for condition in conditions {
        let values = fitnesses(&condition.reruns);
        let mut structures: Vec<String> = name_counts(&condition.reruns)
            .into_iter()
            .map(|(structure, count)| format!("{} {}", plain(count), structure.name()))
            .collect();
        let nothing = condition.reruns.iter().filter(|r| r.names.is_empty());
        match nothing.count() {
            0 => {}
            n => structures.push(format!("{n} nothing")),
        }
        table.add_row([
            condition.scenario.grid().to_string(),
            condition.scenario.robots().to_string(),
            condition.noise.to_string(),
            format!("{:.4}", mean(&values)),
            format!("{:.4}", median(&values)),
            format!("{:.4}", constant_fitness(&condition.scenario)),
            condition
                .skill()
                .map_or("undefined".to_owned(), |skill| format!("{skill:.4}")),
            structures.join(", "),
            orientation(&condition.reruns),
        ]);
    }
    super::right_aligned(table, &[1, 2, 3, 4, 5, 6])
}

/// Formats a count without unnecessary decimals.
fn plain(count: f64) -> String {
    let text = format!("{count:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Converts the conditions to JSON.
#[must_use]
pub fn conditions_json(conditions: &[Condition], seed: u64) -> Value {
    let rows: Vec<Value> = conditions
        .iter()
        .map(|condition| {
            let values = fitnesses(&condition.reruns);
            let mut names = Map::new();
            for (structure, count) in name_counts(&condition.reruns) {
                names.insert(structure.name().to_owned(), count.into());
            }
            let starts: Vec<Value> = condition
                .reruns
                .iter()
                .map(|rerun| {
                    json!({
                        "fitness": rerun.fitness,
                        "names": run_files::names(&rerun.names),
                        "orientation": rerun.orientation.map(|o| o.name()),
                    })
                })
                .collect();
            json!({
                "grid": condition.scenario.grid().to_string(),
                "robots": condition.scenario.robots(),
                "noise": condition.noise,
                "steps": condition.scenario.steps(),
                "mean_fitness": mean(&values),
                "constant_fitness": constant_fitness(&condition.scenario),
                "ceiling": ceiling(&condition.scenario),
                "skill": condition.skill(),
                "median_fitness": median(&values),
                "structures": names,
                "starts": starts,
            })
        })
        .collect();
    let mut object = json!({
        "schema_version": SCHEMA_VERSION,
        "conditions": rows,
    });
    add_seed(&mut object, seed);
    object
}

/// Formats rows of Tables 7 and 8: the mean and, if there are several runs, the median in brackets.
#[must_use]
pub fn resilience_text(structure: Structure, rows: &[ResilienceRow]) -> String {
    let mut table = super::table(&[
        "",
        "runs",
        "robots",
        "fitness",
        "in structure, start",
        "end",
        "similarity",
    ]);
    for row in rows {
        let value = |values: &[f64], scale: f64, decimals: usize| {
            let mean = format!("{:.decimals$}", scale * mean(values));
            if values.len() == 1 {
                mean
            } else {
                format!("{mean} ({:.decimals$})", scale * median(values))
            }
        };
        table.add_row([
            row.name.clone(),
            row.fitness.len().to_string(),
            plain(mean(&row.robots)),
            value(&row.fitness, 1.0, 3),
            value(&row.share_start, 100.0, 1) + " %",
            value(&row.share_end, 100.0, 1) + " %",
            value(&row.similarity, 1.0, 3),
        ]);
    }
    format!(
        "structure: {}; mean (median)\n\n{}",
        in_words(&[structure]),
        super::right_aligned(table, &[1, 2, 3, 4, 5, 6])
    )
}

/// Converts rows of Tables 7 and 8 to JSON, with the values of every run.
#[must_use]
pub fn resilience_json(structure: Structure, rows: &[ResilienceRow]) -> Value {
    let rows: Vec<Value> = rows
        .iter()
        .map(|row| {
            let column = |values: &[f64]| {
                json!({ "mean": mean(values), "median": median(values), "values": values })
            };
            json!({
                "name": row.name,
                "runs": row.fitness.len(),
                "robots": column(&row.robots),
                "fitness": column(&row.fitness),
                "share_start": column(&row.share_start),
                "share_end": column(&row.share_end),
                "similarity": column(&row.similarity),
            })
        })
        .collect();
    json!({
        "schema_version": SCHEMA_VERSION,
        "structure": structure.name(),
        "rows": rows,
    })
}
