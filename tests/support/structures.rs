//! Reads recorded structure counts.

use minimal_surprise_sim::structures::{Structure, Structures};
use minimal_surprise_sim::{Grid, Pose};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// One line of the file.
#[derive(Deserialize)]
struct StateLine {
    grid: (u32, u32),
    robots: Vec<Pose>,
    source: String,
    structures: StructuresLine,
}

#[derive(Deserialize)]
struct StructuresLine {
    line: LineLine,
    pair: u64,
    square: u64,
    triangular_lattice: u64,
    random_dispersion: u64,
    cluster: ClusterLine,
}

#[derive(Deserialize)]
struct LineLine {
    robots: u64,
    horizontal: u64,
    vertical: u64,
    spanning: u64,
}

#[derive(Deserialize)]
struct ClusterLine {
    robots: u64,
    clusters: u64,
    connections: u64,
    verdict: String,
}

/// All counts of a state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Number of robots in lines.
    pub line_robots: u64,
    /// Number of lines from west to east.
    pub horizontal: u64,
    /// Number of lines from south to north.
    pub vertical: u64,
    /// Number of lines around the torus.
    pub spanning: u64,
    /// Number of robots in pairs.
    pub pair: u64,
    /// Number of robots in squares.
    pub square: u64,
    /// Number of robots in triangular lattices.
    pub triangular_lattice: u64,
    /// Number of robots in random dispersion.
    pub random_dispersion: u64,
    /// Number of robots in clusters.
    pub cluster_robots: u64,
    /// Number of clusters.
    pub clusters: u64,
    /// Number of connected pairs of clusters.
    pub connections: u64,
    /// The grouping that the clusters form; clustering if no clusters exist.
    pub verdict: Structure,
}

impl Counts {
    /// Returns the library's counts.
    #[must_use]
    pub fn of(structures: &Structures) -> Self {
        let count = |structure| u64::from(structures.count(structure));
        let (lines, clusters) = (structures.line_counts(), structures.clusters());
        Self {
            line_robots: count(Structure::Line),
            horizontal: lines.horizontal.into(),
            vertical: lines.vertical.into(),
            spanning: lines.spanning.into(),
            pair: count(Structure::Pair),
            square: count(Structure::Square),
            triangular_lattice: count(Structure::TriangularLattice),
            random_dispersion: count(Structure::RandomDispersion),
            cluster_robots: clusters.robots().len() as u64,
            clusters: clusters.clusters().len() as u64,
            connections: clusters.connections(),
            verdict: clusters
                .grouping()
                .map_or(Structure::Clustering, Structure::from),
        }
    }

    /// Returns the names and values of all counts and of the verdict, in a fixed order.
    #[must_use]
    pub fn named(&self) -> [(&'static str, u64); 12] {
        [
            ("robots in lines", self.line_robots),
            ("horizontal lines", self.horizontal),
            ("vertical lines", self.vertical),
            ("spanning lines", self.spanning),
            ("pair", self.pair),
            ("square", self.square),
            ("triangular lattice", self.triangular_lattice),
            ("random dispersion", self.random_dispersion),
            ("robots in clusters", self.cluster_robots),
            ("clusters", self.clusters),
            ("connections", self.connections),
            ("verdict", self.verdict as u64),
        ]
    }
}

/// A recorded state.
pub struct State {
    /// Line number in the file, counted from 1.
    pub line: usize,
    /// Source of the state.
    pub source: String,
    /// The grid.
    pub grid: Grid,
    /// The swarm.
    pub poses: Vec<Pose>,
    /// Counts computed by the authors' scripts.
    pub recorded: Counts,
}

/// Returns the path of the states: `STRUCTURES_FILE` if set, otherwise the project's own copy.
#[must_use]
pub fn file() -> PathBuf {
    std::env::var_os("STRUCTURES_FILE").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/structures/states.jsonl"),
        PathBuf::from,
    )
}

/// Reads all states, in the order of the file.
///
/// # Panics
/// If the file cannot be read.
#[must_use]
pub fn states() -> Vec<State> {
    let path = file();
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let states: Vec<State> = (1..)
        .zip(text.lines())
        .filter(|(_, text)| !text.trim().is_empty())
        .map(|(line, text)| {
            read(line, text).unwrap_or_else(|error| panic!("{}:{line}: {error}", path.display()))
        })
        .collect();
    assert!(!states.is_empty(), "no state in {}", path.display());
    states
}

fn read(line: usize, text: &str) -> Result<State, String> {
    let state: StateLine = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let StructuresLine {
        line: lines,
        cluster,
        ..
    } = &state.structures;
    let verdict = match cluster.verdict.as_str() {
        "Aggregation" => Structure::Aggregation,
        "Loosely Grouped" => Structure::LooseGrouping,
        "Clusters" => Structure::Clustering,
        other => return Err(format!("verdict {other:?}")),
    };
    Ok(State {
        line,
        grid: Grid::new(state.grid.0, state.grid.1).map_err(|error| error.to_string())?,
        recorded: Counts {
            line_robots: lines.robots,
            horizontal: lines.horizontal,
            vertical: lines.vertical,
            spanning: lines.spanning,
            pair: state.structures.pair,
            square: state.structures.square,
            triangular_lattice: state.structures.triangular_lattice,
            random_dispersion: state.structures.random_dispersion,
            cluster_robots: cluster.robots,
            clusters: cluster.clusters,
            connections: cluster.connections,
            verdict,
        },
        poses: state.robots,
        source: state.source,
    })
}
