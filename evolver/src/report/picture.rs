//! Picture of a swarm, in characters.

use crate::output::stdout_is_ascii;
use console::{Style, Term};
use minimal_surprise_sim::drawing::draw_members;
use minimal_surprise_sim::{Grid, Pose};

/// Maximum number of rows and columns of the picture if the output is not a terminal.
const WITHOUT_TERMINAL: (u16, u16) = (60, 120);

/// Draws the swarm, two columns per cell: members as filled arrows (coloured on a terminal), the
/// others hollow. In ASCII, members are marked with a star, since all arrows look the same. If the
/// picture does not fit, returns a note instead.
#[must_use]
pub fn picture(grid: Grid, poses: &[Pose], is_member: impl Fn(u32) -> bool) -> String {
    let (rows, columns) = Term::stdout().size_checked().unwrap_or(WITHOUT_TERMINAL);
    if 2 * u32::from(grid.width()) + 1 > u32::from(columns) || grid.height() > 4 * rows {
        return format!("(a {grid} grid is too large to draw in this terminal)");
    }
    let member = Style::new().cyan().bold();
    let star = if stdout_is_ascii() { '*' } else { ' ' };
    let cell = |cell: char| {
        if "▶▲◀▼".contains(cell) {
            format!("{star}{}", member.apply_to(cell))
        } else {
            format!(" {cell}")
        }
    };
    let lines: Vec<String> = draw_members(grid, poses, is_member)
        .lines()
        .map(|row| format!(" {}", row.chars().map(cell).collect::<String>()))
        .collect();
    lines.join("\n")
}
