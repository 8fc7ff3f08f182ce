//! Tests on swarms given as text drawings. North is at the top; opposite edges are joined.

use super::*;
use crate::drawing::{EMPTY, draw, parse};
use crate::scenario::random_poses;
use crate::seed::{Purpose, SeedTree};
use crate::torus::Heading;

fn classified(drawing: &str) -> Structures {
    let (grid, poses) = parse(drawing).unwrap();
    classify(grid, &poses).unwrap()
}

/// Returns the drawing with only the members of a structure.
fn members(structure: Structure, drawing: &str) -> String {
    let (grid, poses) = parse(drawing).unwrap();
    let structures = classify(grid, &poses).unwrap();
    let members: Vec<Pose> = structures
        .robots_in(structure)
        .map(|robot| poses[robot as usize])
        .collect();
    assert_eq!(members.len(), structures.count(structure) as usize);
    draw(grid, &members)
}

/// Returns the rows without the white space around them.
fn rows(drawing: &str) -> String {
    let rows: Vec<&str> = drawing.split_whitespace().collect();
    rows.join("\n")
}

fn assert_members(structure: Structure, drawing: &str, expected: &str) {
    let found = members(structure, drawing);
    assert_eq!(found, rows(expected), "{structure} in\n{}", rows(drawing));
}

fn assert_all_are_members(structure: Structure, drawing: &str) {
    assert_members(structure, drawing, drawing);
}

fn assert_no_members(structure: Structure, drawing: &str) {
    let nobody: String = drawing
        .chars()
        .map(|c| if "▶▲◀▼".contains(c) { EMPTY } else { c })
        .collect();
    assert_members(structure, drawing, &nobody);
}

#[test]
fn three_robots_in_a_row_with_inward_ends_are_a_line() {
    let drawing = "
        ······
        ·▶◀◀··
        ······";
    assert_all_are_members(Structure::Line, drawing);
    let structures = classified(drawing);
    let counts = LineCounts {
        horizontal: 1,
        vertical: 0,
        spanning: 0,
    };
    assert_eq!(structures.line_counts(), counts);
    assert_eq!(structures.lines()[0].robots, [0, 1, 2]);
    assert_no_members(Structure::Pair, drawing);
    assert_no_members(Structure::RandomDispersion, drawing);
}

#[test]
fn outward_robots_are_dropped_from_both_ends_of_a_line() {
    assert_members(
        Structure::Line,
        "·········
         ·◀▶▶◀▶▶··
         ·········",
        "·········
         ··▶▶◀····
         ·········",
    );
}

#[test]
fn fewer_than_three_robots_after_dropping_are_not_a_line() {
    let drawing = "
        ·······
        ·◀▶◀▶··
        ·······";
    assert_no_members(Structure::Line, drawing);
    assert_members(
        Structure::Pair,
        drawing,
        "·······
         ··▶◀···
         ·······",
    );
    assert_no_members(
        Structure::Line,
        "·······
         ·◀◀▶▶··
         ·······",
    );
}

#[test]
fn a_robot_across_the_axis_ends_a_run() {
    assert_members(
        Structure::Line,
        "·········
         ·▶▶◀▲▶▶◀·
         ·········
         ·········",
        "·········
         ·▶▶◀·▶▶◀·
         ·········
         ·········",
    );
}

#[test]
fn a_line_across_the_edge_is_one_line() {
    let drawing = "
        ······
        ▶◀···▶
        ······";
    assert_all_are_members(Structure::Line, drawing);
    assert!(!classified(drawing).lines()[0].spanning);
    assert_all_are_members(
        Structure::Line,
        "▲··
         ▲··
         ···
         ···
         ▼··",
    );
}

#[test]
fn a_line_across_the_edge_stays_one_line_when_outward_robots_are_dropped() {
    assert_members(
        Structure::Line,
        "·······
         ▶◀▶·◀▶▶
         ·······",
        "·······
         ▶◀···▶▶
         ·······",
    );
}

#[test]
fn a_ring_around_the_torus_is_a_line_whatever_its_headings() {
    for ring in ["▶▶▶▶▶", "◀◀▶▶◀", "◀▶◀▶▶"] {
        let drawing = format!("·····\n{ring}\n·····");
        assert_all_are_members(Structure::Line, &drawing);
        let counts = classified(&drawing).line_counts();
        assert_eq!((counts.horizontal, counts.spanning), (1, 1));
    }
    let vertical = "·▲·\n·▲·\n·▼·\n·▲·";
    assert_all_are_members(Structure::Line, vertical);
    let counts = classified(vertical).line_counts();
    assert_eq!((counts.vertical, counts.spanning), (1, 1));
}

#[test]
fn a_row_that_is_almost_a_ring_needs_ends() {
    assert_no_members(
        Structure::Line,
        "·····
         ▶▶▲▶▶
         ·····",
    );
    let closed = classified("·····\n▶◀▲▶▶\n·····");
    assert_eq!(closed.count(Structure::Line), 4);
    assert_eq!(closed.line_counts().spanning, 0);
}

#[test]
fn on_a_side_of_three_cells_three_robots_are_a_ring() {
    let structures = classified("···\n▶▶▶\n···");
    assert_eq!(structures.count(Structure::Line), 3);
    assert!(structures.lines()[0].spanning);
    assert_no_members(Structure::Line, "▶▶▶\n▶▶▶\n▶▶▶");
}

#[test]
fn lines_that_touch_end_to_end_are_one_line() {
    let structures = classified("········\n·▶▶◀▶◀◀·\n········");
    assert_eq!(structures.line_counts().total(), 1);
    assert_eq!(structures.count(Structure::Line), 6);
}

#[test]
fn lines_that_touch_side_by_side_are_not_lines() {
    assert_no_members(
        Structure::Line,
        "·····
         ·▶▶◀·
         ·▶◀◀·
         ·····
         ·····",
    );
}

#[test]
fn lines_that_overlap_by_one_cell_are_two_lines() {
    let structures = classified(
        "·······
         ·▶▶◀···
         ···▶▶◀·
         ·······
         ·······",
    );
    assert_eq!(structures.line_counts().horizontal, 2);
}

#[test]
fn lines_that_meet_at_a_right_angle_are_two_lines() {
    let structures = classified(
        "·······
         ·▶▶▶◀··
         ··▼····
         ··▼····
         ··▲····
         ·······",
    );
    let counts = structures.line_counts();
    assert_eq!((counts.horizontal, counts.vertical), (1, 1));
    assert_eq!(structures.count(Structure::Line), 7);
}

#[test]
fn neighbours_beside_a_line_may_not_be_adjacent() {
    let line = "
        ·······
        ·▶▶▶◀··
        ·······";
    assert_all_are_members(Structure::Line, line);
    assert_members(
        Structure::Line,
        "··▲·▲··
         ·▶▶▶◀··
         ·▲·▲···
         ·······",
        "·······
         ·▶▶▶◀··
         ·······
         ·······",
    );
    assert_no_members(
        Structure::Line,
        "··▲▲···
         ·▶▶▶◀··
         ·······
         ·······",
    );
}

#[test]
fn neighbours_beside_a_dropped_robot_do_not_count() {
    assert_members(
        Structure::Line,
        "▲▲·····
         ◀▶▶◀···
         ·······
         ·······",
        "·······
         ·▶▶◀···
         ·······
         ·······",
    );
}

#[test]
fn neighbours_beside_a_line_are_adjacent_across_the_edge() {
    assert_members(
        Structure::Line,
        "▲····▲
         ▶◀··▶▶
         ······
         ······",
        "······
         ······
         ······
         ······",
    );
    assert_members(
        Structure::Line,
        "▲···▲·
         ▶◀··▶▶
         ······
         ······",
        "······
         ▶◀··▶▶
         ······
         ······",
    );
}

#[test]
fn the_first_and_last_neighbours_beside_a_ring_are_adjacent() {
    assert_no_members(
        Structure::Line,
        "▲····▲
         ▶▶▶▶▶▶
         ······
         ······",
    );
    assert_eq!(
        classified("▲···▲·\n▶▶▶▶▶▶\n······\n······").count(Structure::Line),
        6
    );
}

#[test]
fn two_robots_facing_each_other_are_a_pair() {
    for drawing in ["····\n·▶◀·\n····", "◀··▶\n····\n····", "▼··\n▲··\n···\n···"]
    {
        assert_all_are_members(Structure::Pair, drawing);
        assert_no_members(Structure::RandomDispersion, drawing);
    }
    for drawing in ["····\n·◀▶·\n····", "····\n·▶▲·\n····"] {
        assert_no_members(Structure::Pair, drawing);
    }
}

#[test]
fn on_a_side_of_three_cells_robots_facing_across_the_edge_are_a_pair() {
    assert_all_are_members(Structure::Pair, "···\n◀·▶\n···");
}

#[test]
fn pairs_that_touch_side_by_side_are_not_pairs() {
    assert_no_members(
        Structure::Pair,
        "·▶◀·
         ·▶◀·
         ····
         ····",
    );
}

#[test]
fn pairs_that_touch_with_one_robot_or_at_a_corner_are_pairs() {
    assert_all_are_members(
        Structure::Pair,
        "·▶◀··
         ··▶◀·
         ·····
         ·····",
    );
    assert_all_are_members(
        Structure::Pair,
        "·▶◀···
         ···▶◀·
         ······
         ······",
    );
}

#[test]
fn pairs_that_touch_end_to_end_are_a_line() {
    let drawing = "
        ······
        ·▶◀▶◀·
        ······";
    assert_all_are_members(Structure::Line, drawing);
    assert_no_members(Structure::Pair, drawing);
}

#[test]
fn a_pair_may_have_one_neighbour_on_each_side() {
    assert_members(
        Structure::Pair,
        "·▲··
         ·▶◀·
         ··▲·
         ····",
        "····
         ·▶◀·
         ····
         ····",
    );
}

#[test]
fn neighbours_beside_a_pair_are_adjacent_across_the_edge() {
    assert_no_members(
        Structure::Pair,
        "▲··▲
         ◀··▶
         ····
         ····",
    );
}

#[test]
fn a_pair_may_be_part_of_a_run_that_is_not_a_line() {
    assert_members(
        Structure::Pair,
        "·▲▲···
         ·▶▶◀··
         ······
         ······",
        "······
         ··▶◀··
         ······
         ······",
    );
}

#[test]
fn a_full_block_of_nine_is_one_cluster() {
    let drawing = "
        ·····
        ·▲▲▲·
        ·▲▲▲·
        ·▲▲▲·
        ·····";
    assert_all_are_members(Structure::Aggregation, drawing);
    assert_no_members(Structure::Clustering, drawing);
    assert_eq!(classified(drawing).clusters().clusters().len(), 1);
}

#[test]
fn a_cluster_across_the_corner_of_the_torus_is_one_cluster() {
    assert_all_are_members(
        Structure::Aggregation,
        "▲▲··▲
         ▲▲··▲
         ·····
         ·····
         ▲▲··▲",
    );
}

#[test]
fn a_core_has_six_neighbours_three_of_them_orthogonal() {
    assert_all_are_members(
        Structure::Aggregation,
        "·····
         ·▲▲··
         ·▲▲··
         ·▲▲▲·
         ·····",
    );
    assert_no_members(
        Structure::Aggregation,
        "·····
         ·▲▲▲·
         ··▲··
         ·▲▲▲·
         ·····",
    );
    assert_no_members(
        Structure::Aggregation,
        "·····
         ··▲··
         ·▲▲▲·
         ··▲▲·
         ·····",
    );
}

#[test]
fn two_clusters_that_share_a_robot_are_loosely_grouped() {
    let drawing = "
        ·······
        ···▲▲▲·
        ····▲▲·
        ·▲▲▲▲▲·
        ·▲▲····
        ·▲▲▲···
        ·······";
    assert_all_are_members(Structure::LooseGrouping, drawing);
    let structures = classified(drawing);
    let clusters = structures.clusters();
    let sizes: Vec<usize> = clusters.clusters().iter().map(Vec::len).collect();
    assert_eq!((sizes, clusters.connections()), (vec![8, 8], 1));
    assert_eq!(structures.count(Structure::LooseGrouping), 15);
}

#[test]
fn two_clusters_with_orthogonally_adjacent_robots_are_loosely_grouped() {
    let drawing = "
        ········
        ·····▲▲·
        ····▲▲▲·
        ·▲▲▲▲▲▲·
        ·▲▲▲····
        ·▲▲·····
        ········";
    assert_all_are_members(Structure::LooseGrouping, drawing);
    let structures = classified(drawing);
    assert_eq!(structures.clusters().groups(), [0, 0]);
    assert_eq!(structures.clusters().robots().len(), 16);
}

#[test]
fn two_clusters_that_touch_at_a_corner_are_not_connected() {
    let drawing = "
        ········
        ····▲▲▲·
        ····▲▲▲·
        ····▲▲▲·
        ·▲▲▲····
        ·▲▲▲····
        ·▲▲▲····
        ········";
    assert_all_are_members(Structure::Clustering, drawing);
    assert_eq!(classified(drawing).clusters().connections(), 0);
}

#[test]
fn clusters_connected_to_a_third_are_connected() {
    let structures = classified(
        "···········
         ········▲▲·
         ·······▲▲▲·
         ·····▲▲▲▲▲·
         ····▲▲▲····
         ·▲▲▲▲▲·····
         ·▲▲▲·······
         ·▲▲········
         ···········",
    );
    assert_eq!(structures.clusters().clusters().len(), 3);
    assert_eq!(structures.clusters().connections(), 3);
    assert_eq!(structures.names(), [Structure::LooseGrouping]);
}

#[test]
fn of_three_clusters_two_connected_ones_are_not_enough_for_a_loose_grouping() {
    let structures = classified(
        "············
         ·····▲▲·▲▲▲·
         ····▲▲▲·▲▲▲·
         ·▲▲▲▲▲▲·▲▲▲·
         ·▲▲▲········
         ·▲▲·········
         ············",
    );
    assert_eq!(structures.clusters().clusters().len(), 3);
    assert_eq!(structures.clusters().connections(), 1);
    assert_eq!(structures.names(), [Structure::Clustering]);
}

#[test]
fn a_grid_without_a_free_cell_is_one_cluster() {
    assert_all_are_members(Structure::Aggregation, "▲▲▲\n▲▲▲\n▲▲▲");
}

#[test]
fn robots_with_at_most_one_neighbour_are_dispersed() {
    assert_members(
        Structure::RandomDispersion,
        "▲······
         ······▲
         ··▲····
         ·▲·▲···
         ·······
         ·····▲·
         ·······",
        "▲······
         ······▲
         ·······
         ·▲·▲···
         ·······
         ·····▲·
         ·······",
    );
}

#[test]
fn members_of_lines_pairs_and_squares_are_not_dispersed() {
    assert_no_members(Structure::RandomDispersion, "····\n·▶◀·\n····\n····");
    assert_no_members(Structure::RandomDispersion, "·····\n·▶▶◀·\n·····\n·····");
    assert_no_members(
        Structure::RandomDispersion,
        "·····
         ·▲·▲·
         ·····
         ·▲·▲·
         ·····",
    );
}

#[test]
fn four_corners_in_an_empty_block_are_a_square() {
    assert_all_are_members(
        Structure::Square,
        "▲···▼·
         ······
         ······
         ······
         ▶···▲·
         ······",
    );
    assert_no_members(
        Structure::Square,
        "·······
         ··▲·▲··
         ·······
         ··▲·▲··
         ·····▼·
         ·······",
    );
    assert_no_members(
        Structure::Square,
        "·····
         ·▲·▲·
         ··▶··
         ·▲·▲·
         ·····",
    );
}

#[test]
fn nine_alternating_robots_are_a_triangular_lattice() {
    assert_members(
        Structure::TriangularLattice,
        "·······
         ···▲···
         ··▲·▶··
         ·◀·▲·▲·
         ··▼·▲··
         ···▲·▲·
         ·······",
        "·······
         ···▲···
         ··▲·▶··
         ·◀·▲·▲·
         ··▼·▲··
         ···▲···
         ·······",
    );
    assert_no_members(
        Structure::TriangularLattice,
        "·······
         ···▲▲··
         ··▲·▶··
         ·◀·▲·▲·
         ··▼·▲··
         ···▲···
         ·······",
    );
}

#[test]
fn a_triangular_lattice_may_leave_the_second_cells_diagonally_empty_or_not() {
    let drawing = "
        ·······
        ·▲·▲·▲·
        ··▲·▲··
        ·▲·▲·▲·
        ··▲·▲··
        ···▲···
        ·······";
    let structures = classified(drawing);
    assert_eq!(structures.count(Structure::TriangularLattice), 9);
    assert_eq!(structures.count(Structure::RandomDispersion), 2);
}

#[test]
fn on_a_side_of_four_cells_patterns_close_around_the_torus() {
    assert_all_are_members(
        Structure::Square,
        "····
         ▲·▲·
         ····
         ▲·▲·",
    );
    assert_all_are_members(
        Structure::TriangularLattice,
        "▲···
         ·▲·▲
         ▲·▲·
         ·▲·▲",
    );
}

#[test]
fn on_a_side_of_three_cells_there_is_no_square_and_no_triangular_lattice() {
    for drawing in [
        "···\n▲·▲\n···\n▲·▲\n···",
        "▲·▲\n···\n▲·▲",
        "·▲·\n▲·▲\n·▲·",
        "·▲·\n▲·▲\n·▲·\n▲·▲\n·▲·\n···",
        "▲▲▲\n▲▲▲\n▲▲▲",
    ] {
        assert_no_members(Structure::Square, drawing);
        assert_no_members(Structure::TriangularLattice, drawing);
    }
}

#[test]
fn a_run_is_named_after_the_structure_with_the_most_robots() {
    let structures = classified(
        "·········
         ·▶▶◀·····
         ·······▼·
         ·▶◀····▲·
         ·········
         ·····▲···
         ·········",
    );
    assert_eq!(structures.count(Structure::Line), 3);
    assert_eq!(structures.count(Structure::Pair), 4);
    assert_eq!(structures.count(Structure::RandomDispersion), 1);
    assert_eq!(structures.names(), [Structure::Pair]);
    assert_eq!(structures.share(Structure::Line), 3.0 / 8.0);
}

#[test]
fn structures_with_equally_many_robots_share_the_name() {
    let structures = classified("······\n·▶◀···\n······\n▲··▲··\n······");
    let shared = [Structure::Pair, Structure::RandomDispersion];
    assert_eq!(structures.names(), shared);
}

#[test]
fn a_swarm_in_no_structure_has_no_name() {
    let structures = classified("·····\n·▲▲··\n·▲▲··\n·····");
    assert_eq!(structures.names(), []);
    assert_eq!(structures.line_counts().orientation(), None);
}

#[test]
fn mostly_is_more_than_two_thirds_of_the_lines() {
    let orientation = |horizontal, vertical| {
        let spanning = 0;
        LineCounts {
            horizontal,
            vertical,
            spanning,
        }
        .orientation()
    };
    assert_eq!(orientation(0, 0), None);
    assert_eq!(orientation(2, 1), Some(LineOrientation::MazeLike));
    assert_eq!(orientation(7, 3), Some(LineOrientation::MostlyHorizontal));
    assert_eq!(orientation(1, 3), Some(LineOrientation::MostlyVertical));
    assert_eq!(orientation(1, 2), Some(LineOrientation::MazeLike));
}

#[test]
fn a_genome_forms_the_orientation_of_more_than_half_of_its_runs() {
    use LineOrientation::{MazeLike, MostlyVertical};
    let runs = |vertical: usize| {
        let mut runs = vec![Some(MostlyVertical); vertical];
        runs.resize(19, Some(MazeLike));
        runs.push(None);
        LineOrientation::of_most(&runs)
    };
    assert_eq!(runs(11), Some(MostlyVertical));
    assert_eq!(runs(10), None);
    assert_eq!(runs(9), None);
    assert_eq!(runs(8), Some(MazeLike));
    assert_eq!(LineOrientation::of_most(&[]), None);
}

#[test]
fn impossible_poses_are_refused() {
    let grid = Grid::new(4, 4).unwrap();
    let pose = |x, y| Pose {
        x,
        y,
        heading: Heading::East,
    };
    assert!(matches!(
        classify(grid, &[pose(4, 0)]),
        Err(WorldError::OutsideGrid { robot: 0, .. })
    ));
    assert!(matches!(
        classify(grid, &[pose(1, 0), pose(1, 0)]),
        Err(WorldError::Overlap { robot: 1, .. })
    ));
}

/// Returns the properties of a swarm that do not depend on its position on the torus, its rotation
/// or its numbering.
fn summary(structures: &Structures) -> Vec<u64> {
    let lines = structures.line_counts();
    let clusters = structures.clusters();
    let mut summary = vec![
        lines.total().into(),
        lines.spanning.into(),
        lines.horizontal.abs_diff(lines.vertical).into(),
        clusters.clusters().len() as u64,
        clusters.connections(),
    ];
    let counts = Structure::ALL.map(|structure| u64::from(structures.count(structure)));
    summary.extend(counts);
    summary
}

#[test]
fn structures_stay_the_same_when_the_swarm_is_shifted_rotated_or_renumbered() {
    let mut seen = [0; 8];
    for (index, (width, height, robots)) in [
        (3, 3, 4),
        (3, 5, 6),
        (4, 4, 5),
        (5, 4, 8),
        (6, 6, 18),
        (8, 5, 12),
        (7, 9, 30),
        (11, 18, 100),
        (15, 15, 100),
    ]
    .into_iter()
    .cycle()
    .take(900)
    .enumerate()
    {
        let grid = Grid::new(width, height).unwrap();
        let mut stream = SeedTree::new(9).stream(Purpose::Starts, 0, index as u32);
        let poses = random_poses(grid, robots, &mut stream);
        let structures = classify(grid, &poses).unwrap();
        for (count, structure) in seen.iter_mut().zip(Structure::ALL) {
            *count += structures.count(structure);
        }
        let expected = summary(&structures);
        let check = |grid, poses: &[Pose]| {
            let found = summary(&classify(grid, poses).unwrap());
            assert_eq!(found, expected, "\n{}", draw(grid, poses));
        };
        for by in [1, 2, 5] {
            let shifted = poses.iter().map(|pose| {
                let (x, y) = grid.moved(pose.x, pose.y, by, 2 * by - 3);
                Pose { x, y, ..*pose }
            });
            check(grid, &shifted.collect::<Vec<_>>());
        }
        let turned = poses.iter().map(|pose| Pose {
            x: grid.height() - 1 - pose.y,
            y: pose.x,
            heading: Heading::from_low_bits(pose.heading as u32 + 1),
        });
        let turned_grid = Grid::new(height, width).unwrap();
        check(turned_grid, &turned.collect::<Vec<_>>());
        let renumbered: Vec<Pose> = poses.iter().rev().copied().collect();
        check(grid, &renumbered);
    }
    // Lattices are too rare to occur in random swarms.
    println!("members found: {seen:?}");
    assert!(seen[..6].iter().all(|&count| count > 0));
}

#[test]
fn memberships_agree_with_the_members_of_every_structure() {
    let grid = Grid::new(15, 15).unwrap();
    for start in 0..20 {
        let stream = &mut SeedTree::new(2).stream(Purpose::Starts, 0, start);
        let found = classify(grid, &random_poses(grid, 90, stream)).unwrap();
        for (robot, membership) in (0..).zip(found.memberships()) {
            for (bit, structure) in (0..).zip(Structure::ALL) {
                let member = found.contains(structure, robot);
                assert_eq!(membership.contains(structure), member);
                assert_eq!(membership.bits() >> bit & 1, u8::from(member));
            }
        }
    }
}
