//! Occupancy as rows of bits, once along x and once along y, so that the window of a robot with any
//! heading spans three adjacent lines.
//!
//! If the robot faces east or north, its window is read directly: `rows` has the lines y = 0, 1, …
//! with x increasing along them; `columns` has the lines x = W − 1, W − 2, … with y increasing
//! along them. So in both, the preceding line is on the robot's right. If the robot faces west or
//! south, the window is rotated by half a turn: its 15 bits are in reverse order.

use super::robot_word;
use crate::torus::Grid;

/// Lines of bits with a border that repeats the cells across the edges: two bits at both ends of a
/// line, one line before the first and one after the last.
#[derive(Clone, Debug, Default)]
pub(super) struct Plane {
    /// Number of cells along a line.
    side: u32,
    lines: u32,
    words_per_line: usize,
    /// Lines of bits, plus one word, because any five bits may be read from two words.
    bits: Vec<u32>,
}

/// Width of the border at both ends of a line.
const BORDER: u32 = 2;

impl Plane {
    /// Maximum length of lines that fit into one word.
    pub(super) const SIDE_MAX_ONE_WORD: u32 = 32 - 2 * BORDER;

    fn reset(&mut self, side: u32, lines: u32) {
        self.side = side;
        self.lines = lines;
        self.words_per_line = (side + 2 * BORDER).div_ceil(32) as usize;
        self.bits.clear();
        self.bits
            .resize((lines as usize + 2) * self.words_per_line + 1, 0);
    }

    /// Returns the lines, starting at −1, each of [`Plane::words_per_line`] words, plus one word.
    pub(super) fn words(&self) -> &[u32] {
        &self.bits
    }

    pub(super) fn words_per_line(&self) -> usize {
        self.words_per_line
    }

    pub(super) fn side(&self) -> u32 {
        self.side
    }

    pub(super) fn lines(&self) -> u32 {
        self.lines
    }

    /// Returns the word and the bit of a cell. `ONE_WORD`: all lines are single words.
    #[inline]
    fn place<const ONE_WORD: bool>(&self, line: u32, along: u32) -> (usize, u32) {
        let bit = along + BORDER;
        let line = line as usize + 1;
        let word = if ONE_WORD {
            line
        } else {
            line * self.words_per_line + (bit / 32) as usize
        };
        (word, 1 << (bit % 32))
    }

    #[inline]
    fn flip<const ONE_WORD: bool>(&mut self, line: u32, along: u32) {
        let (word, mask) = self.place::<ONE_WORD>(line, along);
        self.bits[word] ^= mask;
    }

    #[inline]
    fn occupied<const ONE_WORD: bool>(&self, line: u32, along: u32) -> bool {
        let (word, mask) = self.place::<ONE_WORD>(line, along);
        self.bits[word] & mask != 0
    }

    /// Returns the cells `along` − 2 to `along` + 2 of `line` and of the lines before and after it,
    /// five bits per line.
    #[inline]
    fn window(&self, line: u32, along: u32) -> u16 {
        let mut window = 0;
        let first = line as usize * self.words_per_line + (along / 32) as usize;
        for row in 0..3 {
            let word = first + row * self.words_per_line;
            let pair = u64::from(self.bits[word]) | u64::from(self.bits[word + 1]) << 32;
            window |= ((pair >> (along % 32)) as u16 & 31) << (5 * row);
        }
        window
    }

    /// Fills the border with the cells on the other side of each edge.
    fn close_edges(&mut self) {
        let words_per_line = self.words_per_line;
        let lines = self.lines as usize;
        let (end_word, end_bit) = ((self.side / 32) as usize, self.side % 32);
        for line in self.bits[words_per_line..]
            .chunks_exact_mut(words_per_line)
            .take(lines)
        {
            // Bits `side` and `side + 1` are the last two cells, bits 2 and 3 the first two.
            let pair = u64::from(line[end_word])
                | u64::from(line.get(end_word + 1).copied().unwrap_or(0)) << 32;
            line[0] = line[0] & !3 | (pair >> end_bit) as u32 & 3;
            let first = line[0] >> BORDER & 3;
            for cell in 0..2 {
                let bit = self.side + BORDER + cell;
                let word = &mut line[(bit / 32) as usize];
                *word = *word & !(1 << (bit % 32)) | (first >> cell & 1) << (bit % 32);
            }
        }
        self.bits
            .copy_within(lines * words_per_line..(lines + 1) * words_per_line, 0);
        self.bits.copy_within(
            words_per_line..2 * words_per_line,
            (lines + 1) * words_per_line,
        );
    }
}

/// The rows and the columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Board {
    width: u32,
    height: u32,
    pub(super) rows: Plane,
    pub(super) columns: Plane,
}

impl Board {
    /// Empties the board.
    pub(super) fn reset(&mut self, grid: Grid) {
        (self.width, self.height) = (grid.width().into(), grid.height().into());
        self.rows.reset(self.width, self.height);
        self.columns.reset(self.height, self.width);
    }

    /// Returns true if a line of either plane is a single word.
    pub(super) fn is_narrow(&self) -> bool {
        self.width.max(self.height) <= Plane::SIDE_MAX_ONE_WORD
    }

    /// Places a robot on an empty board. Does not update borders.
    pub(super) fn place(&mut self, robot: u32) {
        self.flip::<false>(robot_word::x(robot), robot_word::y(robot));
    }

    /// Places a robot on a cell or removes it.
    #[inline]
    fn flip<const ONE_WORD: bool>(&mut self, x: u32, y: u32) {
        self.rows.flip::<ONE_WORD>(y, x);
        self.columns.flip::<ONE_WORD>(self.width - 1 - x, y);
    }

    pub(super) fn close_edges(&mut self) {
        self.rows.close_edges();
        self.columns.close_edges();
    }

    /// Returns the window of a robot, with the bit of its own cell set. Borders must be up to date.
    #[inline]
    pub(super) fn window(&self, robot: u32) -> u16 {
        let (x, y) = (robot_word::x(robot), robot_word::y(robot));
        let heading = robot_word::heading(robot);
        let window = if heading & 1 == 0 {
            self.rows.window(y, x)
        } else {
            self.columns.window(self.width - 1 - x, y)
        };
        if heading & 2 == 0 {
            window
        } else {
            window.reverse_bits() >> 1
        }
    }

    /// Moves each of the listed robots one cell ahead, one after the other, unless the cell is
    /// occupied. Does not update borders.
    pub(super) fn advance(&mut self, movers: &[u32], robots: &mut [u32]) {
        if self.is_narrow() {
            self.advance_each::<true>(movers, robots);
        } else {
            self.advance_each::<false>(movers, robots);
        }
    }

    fn advance_each<const ONE_WORD: bool>(&mut self, movers: &[u32], robots: &mut [u32]) {
        // Headings are too mixed for branch prediction, so the code does not branch on them.
        static AHEAD: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
        let (width, height) = (self.width, self.height);
        let across_the_edge = |to: u32, side: u32| {
            let to = if to == side { 0 } else { to };
            if to == u32::MAX { side - 1 } else { to }
        };
        for &mover in movers {
            let robot = &mut robots[mover as usize];
            let (x, y) = (robot_word::x(*robot), robot_word::y(*robot));
            let (ahead_x, ahead_y) = AHEAD[robot_word::heading(*robot) as usize];
            let to_x = across_the_edge(x.wrapping_add_signed(ahead_x), width);
            let to_y = across_the_edge(y.wrapping_add_signed(ahead_y), height);
            if !self.rows.occupied::<ONE_WORD>(to_y, to_x) {
                self.flip::<ONE_WORD>(x, y);
                self.flip::<ONE_WORD>(to_x, to_y);
                *robot = *robot & !robot_word::POSITION | robot_word::position(to_x, to_y);
            }
        }
    }
}
