//! Structures of a swarm, as a picture and a table, or as JSON.

use super::baseline;
use super::picture::picture;
use minimal_surprise_evolution::baseline::{Chance, FitnessBaselines, ROBOTS_MAX};
use minimal_surprise_evolution::run_files::{MeasuresOfRun, SCHEMA_VERSION, names};
use minimal_surprise_evolution::statistics::mean;
use minimal_surprise_sim::metrics::Measures;
use minimal_surprise_sim::structures::{LineCounts, Structure, Structures, in_words};
use minimal_surprise_sim::{Grid, Pose};
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// A state, its structures and, if the run is known, the run's measures.
#[derive(Clone, Copy, Debug)]
pub struct Classified<'a> {
    /// The grid.
    pub grid: Grid,
    /// The state.
    pub poses: &'a [Pose],
    /// The structures in this state.
    pub found: &'a Structures,
    /// Measures of the run that ended in this state.
    pub measures: Option<&'a Measures>,
    /// Baselines of the run's fitness.
    pub baselines: Option<&'a FitnessBaselines>,
    /// Structures of random placements; `None` if the swarm is too large.
    pub chance: Option<&'a Chance>,
}

/// Returns the dominant structure in words: `lines`, `lines and pairs (tied)`, `nothing`.
#[must_use]
pub fn name(found: &Structures) -> String {
    in_words(&found.names())
}

/// Draws the swarm, with the robots of the dominant structure highlighted.
#[must_use]
pub fn highlighted(classified: &Classified<'_>) -> String {
    let Classified {
        grid, poses, found, ..
    } = *classified;
    let names = found.names();
    picture(grid, poses, |robot| {
        names
            .iter()
            .any(|&structure| found.contains(structure, robot))
    })
}

/// Formats the picture, a table of structures, and the measures.
#[must_use]
pub fn text(classified: &Classified<'_>) -> String {
    let Classified {
        grid,
        poses,
        found,
        measures,
        baselines,
        chance,
    } = classified;
    let mut text = highlighted(classified);
    let _ = write!(
        text,
        "\n\n{} robots on {grid}: {}\n\n",
        poses.len(),
        name(found)
    );
    let mut table = super::table(&["structure", "robots", "share", "by chance", "p", ""]);
    for structure in Structure::ALL {
        let share = found.share(structure);
        let (by_chance, p) = match chance {
            None => (String::new(), String::new()),
            Some(chance) => (
                format!("{:.1} %", 100.0 * mean(&chance.sorted_shares(structure))),
                format!("{:.3}", chance.p_of_share(structure, share)),
            ),
        };
        table.add_row([
            structure.name().to_owned(),
            found.count(structure).to_string(),
            format!("{:.1} %", 100.0 * share),
            by_chance,
            p,
            details(found, structure),
        ]);
    }
    let _ = writeln!(text, "{}", super::right_aligned(table, &[1, 2, 3, 4]));
    let _ = match chance {
        Some(chance) => writeln!(
            text,
            "\nby chance: mean share in {} random placements; p: probability that a random\n\
             placement has a share at least as large",
            chance.draws()
        ),
        None => writeln!(
            text,
            "\nby chance: not computed for more than {ROBOTS_MAX} robots; see evolver baseline"
        ),
    };
    if let Some(measures) = measures {
        let temperature = measures.temperature();
        let last = temperature.last().copied().unwrap_or(0.0);
        let _ = write!(
            text,
            "\nfitness            {:.4}\n\
             movement           {:.4}   (last {period} steps)\n\
             intended movement  {:.4}   (last {period} steps)\n\
             temperature        {last:.4}   (last step)\n",
            measures.fitness(),
            measures.movement(),
            measures.intended_movement(),
            period = measures.period(),
        );
    }
    if let Some(baselines) = baselines {
        let ratio = |skill: Option<f64>| match skill {
            Some(skill) => format!("{skill:.4}"),
            None => "undefined".to_owned(),
        };
        let _ = write!(
            text,
            "skill              {}   (0: constant prediction on random states, {:.4}; 1: {:.4})\n\
             model gain         {}   (0: constant prediction on this run's readings, {:.4})\n",
            ratio(baselines.skill),
            baselines.constant_fitness,
            baselines.ceiling,
            ratio(baselines.model_gain),
            baselines.constant_fitness_of_readings,
        );
    }
    text
}

fn details(found: &Structures, structure: Structure) -> String {
    match structure {
        Structure::Line if !found.lines().is_empty() => {
            let LineCounts {
                horizontal,
                vertical,
                spanning,
            } = found.line_counts();
            let orientation = found.line_counts().orientation();
            let orientation = orientation.map_or("", |orientation| orientation.name());
            format!(
                "{horizontal} horizontal, {vertical} vertical, {spanning} spanning: {orientation}"
            )
        }
        Structure::Pair if !found.pairs().is_empty() => format!("{} pairs", found.pairs().len()),
        Structure::Aggregation | Structure::Clustering | Structure::LooseGrouping
            if found.count(structure) > 0 =>
        {
            let clusters = found.clusters();
            format!(
                "{} clusters, {} connections",
                clusters.clusters().len(),
                clusters.connections()
            )
        }
        _ => String::new(),
    }
}

/// Converts the classified state to JSON.
#[must_use]
pub fn json(classified: &Classified<'_>) -> Value {
    let found = classified.found;
    let mut structures = Map::new();
    for structure in Structure::ALL {
        let members: Vec<u32> = found.robots_in(structure).collect();
        structures.insert(
            structure.name().to_owned(),
            json!({
                "robots": found.count(structure),
                "share": found.share(structure),
                "members": members,
                "p_by_chance": classified.chance.map(|chance| {
                    chance.p_of_share(structure, found.share(structure))
                }),
            }),
        );
    }
    let lines = found.line_counts();
    let clusters = found.clusters();
    json!({
        "schema_version": SCHEMA_VERSION,
        "grid": classified.grid.to_string(),
        "robots": classified.poses.len(),
        "names": names(&found.names()),
        "structures": structures,
        "lines": {
            "horizontal": lines.horizontal,
            "vertical": lines.vertical,
            "spanning": lines.spanning,
            "orientation": lines.orientation().map(|orientation| orientation.name()),
        },
        "clusters": {
            "clusters": clusters.clusters().len(),
            "connections": clusters.connections(),
        },
        "average_prediction": classified.measures.map(Measures::average_prediction),
        "measures": classified.measures.map(MeasuresOfRun::from),
        "baselines": classified.baselines,
        "chance": classified.chance.map(baseline::chance),
    })
}
