//! Clusters: robots packed so closely that they block each other.
//!
//! A core is a robot with at least [`MOORE_MIN`] robots in its Moore neighbourhood, at least
//! [`VON_NEUMANN_MIN`] of them orthogonally adjacent. A cluster is a Moore-connected set of cores
//! with all their neighbours. Two clusters are connected if a robot of one is orthogonally adjacent
//! to a robot of the other, or belongs to both; clusters connected to the same third cluster are
//! connected too (paper, Sec. 2.2).

use super::field::{Field, MOORE, VON_NEUMANN};

/// Minimum number of neighbours of a core.
pub const MOORE_MIN: usize = 6;
/// Minimum number of orthogonal neighbours of a core.
pub const VON_NEUMANN_MIN: usize = 3;

/// The grouping behaviour that a swarm's clusters form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Grouping {
    /// One cluster.
    Aggregation,
    /// Several clusters, all connected.
    LooseGrouping,
    /// Several clusters, not all connected.
    Clustering,
}

/// The clusters of a swarm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clusters {
    clusters: Vec<Vec<u32>>,
    groups: Vec<u32>,
    robots: Vec<u32>,
}

impl Clusters {
    /// Returns the robots of each cluster, in ascending order. A robot may be in several clusters.
    #[must_use]
    pub fn clusters(&self) -> &[Vec<u32>] {
        &self.clusters
    }

    /// Returns the group number of each cluster, which is the index of the group's first cluster.
    /// Connected clusters are in the same group.
    #[must_use]
    pub fn groups(&self) -> &[u32] {
        &self.groups
    }

    /// Returns the robots that belong to at least one cluster, in ascending order.
    #[must_use]
    pub fn robots(&self) -> &[u32] {
        &self.robots
    }

    /// Returns the number of pairs of clusters that are connected directly or through other
    /// clusters.
    #[must_use]
    pub fn connections(&self) -> u64 {
        let mut sizes = vec![0_u64; self.clusters.len()];
        let mut connections = 0;
        for &group in &self.groups {
            connections += sizes[group as usize];
            sizes[group as usize] += 1;
        }
        connections
    }

    /// Returns the grouping that the clusters form; `None` without clusters.
    #[must_use]
    pub fn grouping(&self) -> Option<Grouping> {
        let first = self.groups.first()?;
        Some(if self.clusters.len() == 1 {
            Grouping::Aggregation
        } else if self.groups.iter().all(|group| group == first) {
            Grouping::LooseGrouping
        } else {
            Grouping::Clustering
        })
    }
}

/// Mark of a robot in no cluster.
const NONE: u32 = u32::MAX;

/// Finds all clusters, ordered by their southernmost, then westernmost, core.
pub(super) fn find(field: &Field) -> Clusters {
    let core = cores(field);
    let mut clusters: Vec<Vec<u32>> = Vec::new();
    let mut reached = vec![false; field.robots()];
    // The first and the last cluster in which each robot was found.
    let mut first_cluster = vec![NONE; field.robots()];
    let mut last_cluster = vec![NONE; field.robots()];
    let mut groups = Groups::default();
    let mut stack = Vec::new();
    for start in field.row_by_row().filter(|&robot| core[robot as usize]) {
        if core::mem::replace(&mut reached[start as usize], true) {
            continue;
        }
        let number = groups.add();
        let mut robots = Vec::new();
        stack.push(start);
        while let Some(centre) = stack.pop() {
            let around = MOORE
                .iter()
                .filter_map(|&offset| field.near(centre, offset));
            for robot in around.chain([centre]) {
                let place = robot as usize;
                if last_cluster[place] != number {
                    last_cluster[place] = number;
                    robots.push(robot);
                    if first_cluster[place] == NONE {
                        first_cluster[place] = number;
                    } else {
                        groups.join(first_cluster[place], number);
                    }
                }
                if core[place] && !core::mem::replace(&mut reached[place], true) {
                    stack.push(robot);
                }
            }
        }
        robots.sort_unstable();
        clusters.push(robots);
    }
    let cluster_of = |robot: u32| Some(first_cluster[robot as usize]).filter(|&c| c != NONE);
    let robots: Vec<u32> = (0..field.robots() as u32)
        .filter(|&robot| cluster_of(robot).is_some())
        .collect();
    for robot in field.row_by_row() {
        for offset in [(1, 0), (0, 1)] {
            let next = field.near(robot, offset).and_then(cluster_of);
            if let (Some(one), Some(other)) = (cluster_of(robot), next) {
                groups.join(one, other);
            }
        }
    }
    Clusters {
        groups: (0..clusters.len() as u32).map(|c| groups.of(c)).collect(),
        clusters,
        robots,
    }
}

/// Returns whether each robot is a core.
fn cores(field: &Field) -> Vec<bool> {
    let mut core = vec![false; field.robots()];
    for robot in field.row_by_row() {
        let count = |offsets: &[(i32, i32)]| {
            let occupied = offsets.iter().filter(|&&o| field.occupied(robot, o));
            occupied.count()
        };
        core[robot as usize] = count(&VON_NEUMANN) >= VON_NEUMANN_MIN && count(&MOORE) >= MOORE_MIN;
    }
    core
}

/// Groups of connected clusters (union-find), each represented by its first cluster.
#[derive(Default)]
struct Groups {
    parent: Vec<u32>,
}

impl Groups {
    /// Adds a cluster that is not connected to any other.
    fn add(&mut self) -> u32 {
        let number = self.parent.len() as u32;
        self.parent.push(number);
        number
    }

    /// Returns the first cluster of a cluster's group.
    fn of(&mut self, mut cluster: u32) -> u32 {
        while self.parent[cluster as usize] != cluster {
            let above = self.parent[cluster as usize];
            self.parent[cluster as usize] = self.parent[above as usize];
            cluster = above;
        }
        cluster
    }

    fn join(&mut self, one: u32, other: u32) {
        let (one, other) = (self.of(one), self.of(other));
        self.parent[one.max(other) as usize] = one.min(other);
    }
}
