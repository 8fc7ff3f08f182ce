//! Tables 7 and 8: the effect of damage.

use super::table::{Row, Table, Value};
use crate::suite::report::gather::Resilient;
use crate::suite::report::numbers::plural;
use crate::suite::report::paper::{DAMAGED_GRID, PaperValues, Source};
use crate::suite::report::statistics::median_interval;
use minimal_surprise_evolution::statistics::{mean, median};

/// Creates Tables 7 and 8.
pub(super) fn resilience(resilient: &Resilient, paper: &PaperValues) -> Table {
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
        source: Source::in_words(source),
        title: format!("{name}: effect of damage on a {}", resilient.structure),
        notes,
        columns: columns.map(str::to_owned).to_vec(),
        rows,
    }
}
