//! Senses and decides for 16 robots at once.
//!
//! On boards whose lines are single words, all lines are kept in registers, and a permutation
//! fetches each robot's lines; on wider boards, gathers fetch them. Then the three lines are
//! rotated so that the robot's cells are at their window bits, and merged.

use super::super::super::board::{Board, Plane};
use super::super::super::robot_word::{
    ACTION, ENTRY_SHIFT, HEADING_SHIFT, POSITION, ROBOTS_AT_ONCE,
};
use super::super::super::window::{ACTION_BIT, AHEAD_BIT, ROW_BITS, WINDOWS};
use super::super::Sensing;
use core::arch::x86_64::*;

/// Number of bits of a coordinate in a robot word.
const Y_SHIFT: u32 = POSITION.trailing_ones() / 2;
const COORDINATE: i32 = (1 << Y_SHIFT) - 1;

/// Applies all turns and lists the robots that may move; returns the length of the list.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi2,gfni")]
pub(in super::super) fn sense_and_decide(sensing: Sensing<'_>) -> usize {
    let board = sensing.board;
    if board.is_narrow() {
        if board.rows.lines().max(board.columns.lines()) <= 16 {
            let lines = LinesInRegisters::<1>::of(board);
            all_robots(sensing, |x, y, upright| lines.fetch(x, y, upright))
        } else {
            let lines = LinesInRegisters::<2>::of(board);
            all_robots(sensing, |x, y, upright| lines.fetch(x, y, upright))
        }
    } else {
        let lines = LinesInMemory::of(board);
        all_robots(sensing, |x, y, upright| lines.fetch(x, y, upright))
    }
}

/// The cells around a robot, in the lowest 15 bits; other bits are undefined. In the functions that
/// fetch them, `upright` selects the robots facing north or south.
type Fetched = __m512i;

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi2,gfni")]
#[inline]
fn all_robots(
    sensing: Sensing<'_>,
    fetch: impl Fn(__m512i, __m512i, __mmask16) -> Fetched,
) -> usize {
    let Sensing {
        robots,
        words,
        entries,
        sensors,
        flips,
        inputs,
        movers,
        ..
    } = sensing;
    assert!(entries.len() >= WINDOWS + 3);
    assert!(words.len() == robots.next_multiple_of(ROBOTS_AT_ONCE));
    assert!(movers.len() >= words.len());
    let sensors = _mm512_set1_epi32(sensors.into());
    let action_bit = _mm512_set1_epi32(ACTION_BIT.into());
    let ahead_bit = _mm512_set1_epi32(AHEAD_BIT.into());
    let action = _mm512_set1_epi32(ACTION as i32);
    let coordinate = _mm512_set1_epi32(COORDINATE);
    let upright_bit = _mm512_set1_epi32(1 << HEADING_SHIFT);
    let reversed_bit = _mm512_set1_epi32(2 << HEADING_SHIFT);
    let mut robot = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    let mut listed = 0;
    for (place, (words, inputs)) in words
        .chunks_exact_mut(ROBOTS_AT_ONCE)
        .zip(inputs.chunks_exact_mut(ROBOTS_AT_ONCE))
        .enumerate()
    {
        let first = place * ROBOTS_AT_ONCE;
        let present = robots_present(robots - first);
        // SAFETY: a chunk of 16 32-bit words fills a register.
        let word = unsafe { _mm512_loadu_si512(words.as_ptr().cast()) };
        let x = _mm512_and_si512(word, coordinate);
        let y = _mm512_and_si512(_mm512_srli_epi32::<Y_SHIFT>(word), coordinate);
        let upright = _mm512_test_epi32_mask(word, upright_bit);
        let seen = fetch(x, y, upright);
        let seen = _mm512_mask_mov_epi32(
            seen,
            _mm512_test_epi32_mask(word, reversed_bit),
            half_a_turn_on(seen),
        );
        let may_move = _mm512_testn_epi32_mask(seen, ahead_bit);
        let reading = match flips {
            None => seen,
            Some(flips) => {
                // SAFETY: 16 bits are read per robot present, and the number of flips equals the
                // number of robots.
                let flips =
                    unsafe { _mm256_maskz_loadu_epi16(present, flips[first..].as_ptr().cast()) };
                _mm512_xor_si512(seen, _mm512_cvtepu16_epi32(flips))
            }
        };
        let reading = _mm512_and_si512(reading, sensors);
        let last_action = _mm512_and_si512(
            _mm512_srli_epi32::<{ ACTION.trailing_zeros() - ACTION_BIT.trailing_zeros() }>(word),
            action_bit,
        );
        let window = _mm512_or_si512(reading, last_action);
        // SAFETY: a window is below 2¹⁵, and the size of the table is 2¹⁵ bytes plus three.
        let entry = unsafe { _mm512_i32gather_epi32::<1>(window, entries.as_ptr().cast()) };
        let entry = _mm512_slli_epi32::<ENTRY_SHIFT>(entry);
        let turned = _mm512_add_epi32(word, entry);
        // Bitwise: the entry where the mask is one, otherwise the word.
        let word = _mm512_ternarylogic_epi32::<0xca>(action, entry, turned);
        // SAFETY: as above.
        unsafe { _mm512_storeu_si512(words.as_mut_ptr().cast(), word) };
        let new_action =
            _mm512_srli_epi32::<{ ACTION.trailing_zeros() - ACTION_BIT.trailing_zeros() }>(entry);
        let input = _mm512_ternarylogic_epi32::<0xca>(action_bit, new_action, reading);
        // SAFETY: a chunk of 16 16-bit words fills half a register.
        unsafe {
            _mm256_storeu_si256(inputs.as_mut_ptr().cast(), _mm512_cvtepi32_epi16(input));
        }
        let moving = _mm512_mask_testn_epi32_mask(may_move & present, entry, action);
        // SAFETY: at most `first` robots are listed, and the list has space for `first + 16`.
        unsafe {
            let end = movers.as_mut_ptr().add(listed);
            _mm512_storeu_si512(end.cast(), _mm512_maskz_compress_epi32(moving, robot));
        }
        listed += moving.count_ones() as usize;
        robot = _mm512_add_epi32(robot, _mm512_set1_epi32(ROBOTS_AT_ONCE as i32));
    }
    listed
}

fn robots_present(left: usize) -> __mmask16 {
    if left >= ROBOTS_AT_ONCE {
        __mmask16::MAX
    } else {
        (1 << left) - 1
    }
}

/// Returns the window of a robot facing the opposite direction: its 15 bits in reverse order.
#[target_feature(enable = "avx512f,avx512bw,gfni")]
#[inline]
fn half_a_turn_on(window: __m512i) -> __m512i {
    // Matrix that reverses the bits of a byte.
    let reversal = _mm512_set1_epi64(0x8040_2010_0804_0201_u64 as i64);
    // Indices that exchange the lower two bytes of 32 bits and clear the others.
    let exchange = _mm512_set4_epi32(
        0x8080_0c0d_u32 as i32,
        0x8080_0809_u32 as i32,
        0x8080_0405_u32 as i32,
        0x8080_0001_u32 as i32,
    );
    let bytes = _mm512_shuffle_epi8(window, exchange);
    _mm512_srli_epi32::<1>(_mm512_gf2p8affine_epi64_epi8::<0>(bytes, reversal))
}

/// Merges three lines, each rotated into its place, into a window.
#[target_feature(enable = "avx512f")]
#[inline]
fn merge(right: __m512i, middle: __m512i, left: __m512i) -> Fetched {
    let first = _mm512_set1_epi32((1 << ROW_BITS) - 1);
    let first_two = _mm512_set1_epi32((1 << (2 * ROW_BITS)) - 1);
    let two = _mm512_ternarylogic_epi32::<0xca>(first, right, middle);
    _mm512_ternarylogic_epi32::<0xca>(first_two, two, left)
}

/// Rows and columns of a board with at most 16 · `N` of each. The borders at the ends of lines are
/// filled, and each line is rotated to the position of its cells in a window.
struct LinesInRegisters<const N: usize> {
    /// Rows, indexed by the robot's line: the line before it, the line, the line after it.
    rows: [[__m512i; N]; 3],
    columns: [[__m512i; N]; 3],
    width: __m512i,
}

impl<const N: usize> LinesInRegisters<N> {
    #[target_feature(enable = "avx512f")]
    #[inline]
    fn of(board: &Board) -> Self {
        Self {
            rows: Self::of_plane(&board.rows),
            columns: Self::of_plane(&board.columns),
            width: _mm512_set1_epi32(board.rows.side() as i32 - 1),
        }
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    fn of_plane(plane: &Plane) -> [[__m512i; N]; 3] {
        let lines = plane.lines() as usize;
        let mut padded = [0_u32; 48];
        padded[1..=lines].copy_from_slice(&plane.words()[1..=lines]);
        padded[0] = padded[lines];
        padded[lines + 1] = padded[1];
        let side = _mm_cvtsi32_si128(plane.side() as i32);
        core::array::from_fn(|row| {
            core::array::from_fn(|n| {
                // SAFETY: 16 words are read, starting no later than at index 2 + 16.
                let own = unsafe { _mm512_loadu_si512(padded.as_ptr().add(row + 16 * n).cast()) };
                let line = _mm512_or_si512(
                    own,
                    _mm512_or_si512(_mm512_sll_epi32(own, side), _mm512_srl_epi32(own, side)),
                );
                _mm512_rolv_epi32(line, _mm512_set1_epi32((ROW_BITS * row) as i32))
            })
        })
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    fn fetch(&self, x: __m512i, y: __m512i, upright: __mmask16) -> Fetched {
        let column = _mm512_sub_epi32(self.width, x);
        let along = _mm512_mask_mov_epi32(x, upright, y);
        let line = _mm512_mask_mov_epi32(y, upright, column);
        let [right, middle, left] = core::array::from_fn(|row| {
            let (rows, columns) = (&self.rows[row], &self.columns[row]);
            let words = if N == 1 {
                let line = _mm512_mask_add_epi32(line, upright, line, _mm512_set1_epi32(16));
                _mm512_permutex2var_epi32(rows[0], line, columns[0])
            } else {
                _mm512_mask_mov_epi32(
                    _mm512_permutex2var_epi32(rows[0], line, rows[N - 1]),
                    upright,
                    _mm512_permutex2var_epi32(columns[0], line, columns[N - 1]),
                )
            };
            _mm512_rorv_epi32(words, along)
        });
        merge(right, middle, left)
    }
}

/// Rows and columns of a board of any size, with up-to-date borders.
struct LinesInMemory<'a> {
    rows: &'a Plane,
    columns: &'a Plane,
}

impl<'a> LinesInMemory<'a> {
    fn of(board: &'a Board) -> Self {
        let (rows, columns) = (&board.rows, &board.columns);
        for plane in [rows, columns] {
            let words = (plane.lines() as usize + 2) * plane.words_per_line();
            assert!(plane.words().len() > words && words < i32::MAX as usize / 4);
        }
        Self { rows, columns }
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    fn fetch(&self, x: __m512i, y: __m512i, upright: __mmask16) -> Fetched {
        let column = _mm512_sub_epi32(_mm512_set1_epi32(self.rows.side() as i32 - 1), x);
        let (from_rows, from_columns) = (
            Self::fetch_from(self.rows, y, x, !upright),
            Self::fetch_from(self.columns, column, y, upright),
        );
        _mm512_mask_mov_epi32(from_rows, upright, from_columns)
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    fn fetch_from(plane: &Plane, line: __m512i, along: __m512i, robots: __mmask16) -> Fetched {
        let line_bytes = 4 * plane.words_per_line();
        let zero = _mm512_setzero_si512();
        let place = _mm512_add_epi32(
            _mm512_mullo_epi32(line, _mm512_set1_epi32(line_bytes as i32)),
            _mm512_srli_epi32::<3>(along),
        );
        let shift = _mm512_and_si512(along, _mm512_set1_epi32(7));
        let [right, middle, left] = core::array::from_fn(|row| {
            // SAFETY: `line` and `along` belong to a robot on the board. So `place` is in the line
            // before it, and each of the three reads of four bytes ends at most one word after the
            // last line; planes have that word.
            let words = unsafe {
                let lines = plane.words().as_ptr().cast::<u8>().add(row * line_bytes);
                _mm512_mask_i32gather_epi32::<1>(zero, robots, place, lines.cast())
            };
            let back = _mm512_sub_epi32(shift, _mm512_set1_epi32((ROW_BITS * row) as i32));
            _mm512_rorv_epi32(words, back)
        });
        merge(right, middle, left)
    }
}
