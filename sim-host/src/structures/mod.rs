//! Structures that a swarm has formed (paper, Sec. 2.2), on any torus, for any number of robots, in
//! time linear in the numbers of cells and robots.
//!
//! A robot may belong to several structures. A run is named after the structure with the most
//! robots.

mod clusters;
mod dispersion;
mod field;
mod lines;
mod pairs;

/// Formats the names as text: `line`, `line and pair (tied)`, `nothing`.
#[must_use]
pub fn in_words(names: &[Structure]) -> String {
    let words: Vec<&str> = names.iter().map(|structure| structure.name()).collect();
    match words.as_slice() {
        [] => "nothing".to_owned(),
        [one] => (*one).to_owned(),
        several => format!("{} (tied)", several.join(" and ")),
    }
}

#[cfg(test)]
mod tests;

pub use clusters::{Clusters, Grouping, MOORE_MIN, VON_NEUMANN_MIN};
pub use lines::{Axis, LENGTH_MIN, Line, LineCounts, LineOrientation};

use crate::metrics::Match;
use crate::torus::{Grid, Pose};
use crate::world::WorldError;
use field::Field;

/// The paper's eight structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Structure {
    /// Robots in a row, pointing inwards at both ends, or around the torus.
    Line,
    /// Two robots that face each other.
    Pair,
    /// One cluster.
    Aggregation,
    /// Several clusters, not all connected.
    Clustering,
    /// Several clusters, all connected.
    LooseGrouping,
    /// Robots that have at most one neighbour and are not part of a line, pair or square.
    RandomDispersion,
    /// Robots on the corners of 3 × 3 blocks, with all other cells around them empty.
    Square,
    /// Robots on every second cell, alternate rows shifted by one.
    TriangularLattice,
}

impl Structure {
    /// Every structure, in order.
    pub const ALL: [Self; 8] = [
        Self::Line,
        Self::Pair,
        Self::Aggregation,
        Self::Clustering,
        Self::LooseGrouping,
        Self::RandomDispersion,
        Self::Square,
        Self::TriangularLattice,
    ];

    /// Returns the name used in files and tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Pair => "pair",
            Self::Aggregation => "aggregation",
            Self::Clustering => "clustering",
            Self::LooseGrouping => "loose grouping",
            Self::RandomDispersion => "random dispersion",
            Self::Square => "square",
            Self::TriangularLattice => "triangular lattice",
        }
    }
}

/// The structures that a robot belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Membership(u8);

// Every structure has a bit; its index in `Structure::ALL` is the number of the bit.
const _: () = {
    assert!(Structure::ALL.len() <= u8::BITS as usize);
    let mut bit = 0;
    while bit < Structure::ALL.len() {
        assert!(Structure::ALL[bit] as usize == bit);
        bit += 1;
    }
};

impl Membership {
    /// Returns true if the robot belongs to a structure.
    #[must_use]
    pub fn contains(self, structure: Structure) -> bool {
        self.0 >> structure as u8 & 1 == 1
    }

    /// Returns the bits; bit `i` stands for `Structure::ALL[i]`.
    #[must_use]
    pub fn bits(self) -> u8 {
        self.0
    }
}

impl Structure {
    /// Returns the condition used to measure the similarity to an earlier state. Triangular
    /// lattices are compared by cells, because their robots keep turning; all other structures are
    /// compared by poses (paper, Sec. 3.4).
    #[must_use]
    pub fn matching(self) -> Match {
        match self {
            Self::TriangularLattice => Match::Cell,
            _ => Match::Pose,
        }
    }
}

impl From<Grouping> for Structure {
    fn from(grouping: Grouping) -> Self {
        match grouping {
            Grouping::Aggregation => Self::Aggregation,
            Grouping::LooseGrouping => Self::LooseGrouping,
            Grouping::Clustering => Self::Clustering,
        }
    }
}

impl core::fmt::Display for Structure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

/// A pattern of robots: one of the paper's structures, or a user-defined one.
pub trait Pattern {
    /// Returns whether each robot belongs to the pattern, robot 0 first.
    ///
    /// # Errors
    /// [`WorldError`] if a robot is outside the grid or two share a cell.
    fn members(&self, grid: Grid, poses: &[Pose]) -> Result<Vec<bool>, WorldError>;

    /// Returns the share of the robots that belong to the pattern, 0 to 1; 0 without robots.
    ///
    /// # Errors
    /// [`WorldError`] if a robot is outside the grid or two share a cell.
    fn share(&self, grid: Grid, poses: &[Pose]) -> Result<f64, WorldError> {
        let members = self.members(grid, poses)?;
        let count = members.iter().filter(|&&member| member).count();
        Ok(count as f64 / members.len().max(1) as f64)
    }
}

impl Pattern for Structure {
    fn members(&self, grid: Grid, poses: &[Pose]) -> Result<Vec<bool>, WorldError> {
        let found = classify(grid, poses)?;
        let members = found.members(*self).map(<[bool]>::to_vec);
        Ok(members.unwrap_or_else(|| vec![false; poses.len()]))
    }
}

/// The structures of a swarm, and the robots that belong to each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structures {
    swarm_size: u32,
    lines: Vec<Line>,
    pairs: Vec<[u32; 2]>,
    clusters: Clusters,
    in_line: Vec<bool>,
    in_pair: Vec<bool>,
    in_cluster: Vec<bool>,
    dispersed: Vec<bool>,
    in_square: Vec<bool>,
    in_lattice: Vec<bool>,
}

/// Finds all structures of a swarm.
///
/// ```
/// use minimal_surprise_sim::{Structure, classify, drawing};
///
/// let (grid, poses) = drawing::parse(
///     "······
///      ·▶▶◀··
///      ······
///      ▼·····
///      ▲·····",
/// )?;
/// let structures = classify(grid, &poses)?;
/// assert_eq!(structures.count(Structure::Line), 3);
/// assert_eq!(structures.count(Structure::Pair), 2);
/// assert_eq!(structures.names(), [Structure::Line]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`WorldError`] if a robot is outside the grid or two share a cell.
pub fn classify(grid: Grid, poses: &[Pose]) -> Result<Structures, WorldError> {
    let field = Field::new(grid, poses)?;
    let members = |robots: &mut dyn Iterator<Item = u32>| {
        let mut members = vec![false; poses.len()];
        robots.for_each(|robot| members[robot as usize] = true);
        members
    };
    let lines = lines::find(&field);
    let in_line = members(&mut lines.iter().flat_map(|line| line.robots.iter().copied()));
    let pairs = pairs::find(&field, &in_line);
    let in_pair = members(&mut pairs.iter().flatten().copied());
    let clusters = clusters::find(&field);
    let in_cluster = members(&mut clusters.robots().iter().copied());
    let in_square = dispersion::in_squares(&field);
    let in_lattice = dispersion::in_triangular_lattices(&field);
    let dispersed = dispersion::randomly_dispersed(&field, |robot| {
        let robot = robot as usize;
        in_line[robot] || in_pair[robot] || in_square[robot]
    });
    Ok(Structures {
        swarm_size: poses.len() as u32,
        lines,
        pairs,
        clusters,
        in_line,
        in_pair,
        in_cluster,
        dispersed,
        in_square,
        in_lattice,
    })
}

impl Structures {
    /// Returns true if a robot belongs to a structure; false for an index beyond the swarm.
    #[must_use]
    pub fn contains(&self, structure: Structure, robot: u32) -> bool {
        self.members(structure)
            .is_some_and(|members| members.get(robot as usize) == Some(&true))
    }

    /// Returns the structures that each robot belongs to, robot 0 first.
    #[must_use]
    pub fn memberships(&self) -> Vec<Membership> {
        let mut memberships = vec![Membership::default(); self.swarm_size as usize];
        for structure in Structure::ALL {
            let members = self.members(structure).unwrap_or_default();
            for (membership, &member) in memberships.iter_mut().zip(members) {
                membership.0 |= u8::from(member) << structure as u8;
            }
        }
        memberships
    }

    /// Iterates over the indices of the robots that belong to a structure, in ascending order.
    pub fn robots_in(&self, structure: Structure) -> impl Iterator<Item = u32> {
        (0..self.swarm_size).filter(move |&robot| self.contains(structure, robot))
    }

    /// Returns the number of robots that belong to a structure.
    #[must_use]
    pub fn count(&self, structure: Structure) -> u32 {
        let members = self.members(structure).unwrap_or_default();
        members.iter().filter(|&&member| member).count() as u32
    }

    /// Returns the share of the robots present that belong to a structure, 0 to 1; 0 without
    /// robots.
    #[must_use]
    pub fn share(&self, structure: Structure) -> f64 {
        f64::from(self.count(structure)) / f64::from(self.swarm_size.max(1))
    }

    /// Returns the number of robots present.
    #[must_use]
    pub fn swarm_size(&self) -> u32 {
        self.swarm_size
    }

    /// Returns the lines: first the horizontal lines, then the vertical lines.
    #[must_use]
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Returns the numbers of lines by direction.
    #[must_use]
    pub fn line_counts(&self) -> LineCounts {
        LineCounts::of(&self.lines)
    }

    /// Returns the pairs.
    #[must_use]
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// Returns the clusters. Together they are an aggregation, a clustering or a loose grouping,
    /// and their robots count towards that structure.
    #[must_use]
    pub fn clusters(&self) -> &Clusters {
        &self.clusters
    }

    /// Returns the structures that the run is named after: those with the most robots, usually one.
    /// If k structures are tied, the run counts 1/k for each; the list is empty if no robot is in
    /// any structure.
    #[must_use]
    pub fn names(&self) -> Vec<Structure> {
        let counts = Structure::ALL.map(|structure| (structure, self.count(structure)));
        let most = counts.iter().map(|&(_, count)| count).max().unwrap_or(0);
        let named = counts
            .iter()
            .filter(|&&(_, count)| count == most && most > 0);
        named.map(|&(structure, _)| structure).collect()
    }

    fn members(&self, structure: Structure) -> Option<&[bool]> {
        match structure {
            Structure::Line => Some(&self.in_line),
            Structure::Pair => Some(&self.in_pair),
            Structure::Aggregation | Structure::Clustering | Structure::LooseGrouping => {
                (self.clusters.grouping().map(Structure::from) == Some(structure))
                    .then_some(&self.in_cluster)
            }
            Structure::RandomDispersion => Some(&self.dispersed),
            Structure::Square => Some(&self.in_square),
            Structure::TriangularLattice => Some(&self.in_lattice),
        }
    }
}
