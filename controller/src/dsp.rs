//! The sums of both layers with SMLAD, two products per instruction, for chips with Arm's DSP
//! extension, such as Cortex-M4 and Cortex-M7.
//!
//! This is the only module of the crate that uses `unsafe`. The intrinsic for SMLAD is not stable,
//! and without it the compiler neither emits the instruction nor combines the loads of the terms: a
//! control step would exceed the instruction budget of a robot (`budget` test). Sums are exact in
//! any order, so the results equal those of the portable code bit for bit (`parity` test).
#![allow(unsafe_code)]

use crate::activation::{ROWS, SEGMENT_SCALE};
use crate::fixed::{Aligned, FRACTION_BITS, MAX_TERMS, ROUNDING_Q24};
use core::arch::asm;

/// Replaces the first `count` values with their activations, with the same order of operations as
/// [`activate`](crate::activate).
#[inline]
pub(crate) fn activate_all<const N: usize>(values: &mut [i16; N], count: usize) {
    const { assert!(SEGMENT_SCALE == 15 << 1) };
    let count = count.min(N);
    if count == 0 {
        return;
    }
    // SAFETY: reads and writes `count` values, all of which exist, and reads one of the 32 rows of
    // `ROWS` for each; an `i32` is word-aligned, as `ldm` requires. The flags and registers used
    // are declared.
    unsafe {
        asm!(
            "2:",
            "ldrsh {x}, [{value}]",
            "rsb {x}, {x}, {x}, lsl #4",
            "lsls {x}, {x}, #1",
            "ubfx r0, {x}, #16, #5",
            "add r0, {rows}, r0, lsl #4",
            "ldm r0, {{r0, r1, r2, r3}}",
            "eor {x}, {x}, #0x8000",
            "sxth {x}, {x}",
            "mla r0, r0, {x}, r1",
            "smultb r0, r0, {x}",
            "add r0, r2, r0, asr #16",
            "mla r0, r0, {x}, r3",
            "asrs r0, r0, #19",
            "strh r0, [{value}], #2",
            "subs {count}, #1",
            "bne 2b",
            x = out(reg) _,
            rows = in(reg) ROWS.as_ptr(),
            value = inout(reg) values.as_mut_ptr() => _,
            count = inout(reg) count => _,
            out("r0") _,
            out("r1") _,
            out("r2") _,
            out("r3") _,
            options(nostack),
        );
    }
}

/// Number of terms in each sum of [`output_signs`].
pub(crate) const OUTPUT_TERMS: usize = 14;

/// Computes the hidden layer before activation. For each of the first `count` rows, the Q3.12 sum
/// of the row's products with `terms` replaces the row's entry in `values`, which is also the last
/// term of the sum.
#[inline]
pub(crate) fn hidden_sums<const N: usize>(
    rows: &Aligned<[[i16; MAX_TERMS]; N]>,
    terms: &mut Aligned<[i16; MAX_TERMS]>,
    values: &mut [i16; N],
    count: usize,
) {
    let count = count.min(N);
    if count == 0 {
        return;
    }
    // SAFETY: reads `count` rows of eight words, `count` times the eight words of `terms`, and
    // reads and writes `count` values; all of them exist and are word-aligned, as `ldm` requires.
    // The flags and registers used are declared.
    unsafe {
        asm!(
            "2:",
            "mov {sum}, #{rounding}",
            "ldm {terms}!, {{r0, r1, r2, r3}}",
            "ldm {row}!, {{r4, r5, r8}}",
            "smlad {sum}, r0, r4, {sum}",
            "smlad {sum}, r1, r5, {sum}",
            "smlad {sum}, r2, r8, {sum}",
            "ldm {row}!, {{r4, r5, r8}}",
            "smlad {sum}, r3, r4, {sum}",
            "ldm {terms}, {{r0, r1, r2, r3}}",
            "smlad {sum}, r0, r5, {sum}",
            "smlad {sum}, r1, r8, {sum}",
            "ldrh r4, [{value}]",
            "pkhbt r3, r3, r4, lsl #16",
            "ldm {row}!, {{r4, r5}}",
            "smlad {sum}, r2, r4, {sum}",
            "smlad {sum}, r3, r5, {sum}",
            "subs {terms}, #16",
            "ssat {sum}, #16, {sum}, asr #{fraction}",
            "strh {sum}, [{value}], #2",
            "subs {count}, #1",
            "bne 2b",
            rounding = const ROUNDING_Q24,
            fraction = const FRACTION_BITS,
            sum = out(reg) _,
            terms = inout(reg) terms.0.as_ptr() => _,
            row = inout(reg) rows.0.as_ptr() => _,
            value = inout(reg) values.as_mut_ptr() => _,
            count = inout(reg) count => _,
            out("r0") _,
            out("r1") _,
            out("r2") _,
            out("r3") _,
            out("r4") _,
            out("r5") _,
            out("r8") _,
            options(nostack),
        );
    }
}

/// Computes the signs of an output layer: bit k is set if the sum of row k's products with `terms`
/// is not negative, for the first `count` rows.
///
/// # Panics
/// If a row does not have [`OUTPUT_TERMS`] terms; checked at compile time.
#[inline]
pub(crate) fn output_signs<const N: usize, const O: usize>(
    rows: &Aligned<[[i16; N]; O]>,
    terms: &Aligned<[i16; N]>,
    count: usize,
) -> u16 {
    assert!(N == OUTPUT_TERMS);
    let count = count.min(O).min(16);
    if count == 0 {
        return 0;
    }
    let negative: u32;
    // SAFETY: reads `count` rows of seven words and `count` times the seven words of `terms`; all
    // of them exist and are word-aligned, as `ldm` requires. The flags and registers used are
    // declared.
    unsafe {
        asm!(
            "2:",
            "ldm {terms}!, {{r0, r1, r2, r3}}",
            "ldm {row}!, {{r4, r5, r8}}",
            "smuad {sum}, r0, r4",
            "smlad {sum}, r1, r5, {sum}",
            "smlad {sum}, r2, r8, {sum}",
            "ldm {row}!, {{r4, r5, r8}}",
            "smlad {sum}, r3, r4, {sum}",
            "ldm {terms}, {{r0, r1, r2}}",
            "smlad {sum}, r0, r5, {sum}",
            "smlad {sum}, r1, r8, {sum}",
            "ldr r4, [{row}], #4",
            "smlad {sum}, r2, r4, {sum}",
            "subs {terms}, #16",
            // The sign is shifted through the carry into the lowest bit; the first row's sign
            // becomes the highest bit.
            "lsls {sum}, {sum}, #1",
            "adcs {negative}, {negative}, {negative}",
            "subs {count}, #1",
            "bne 2b",
            sum = out(reg) _,
            terms = inout(reg) terms.0.as_ptr() => _,
            row = inout(reg) rows.0.as_ptr() => _,
            negative = inout(reg) 0 => negative,
            count = inout(reg) count => _,
            out("r0") _,
            out("r1") _,
            out("r2") _,
            out("r3") _,
            out("r4") _,
            out("r5") _,
            out("r8") _,
            options(nostack, pure, readonly),
        );
    }
    ((!negative).reverse_bits() >> (32 - count as u32)) as u16
}

/// Number of terms in each sum of [`action_signs`].
pub(crate) const ACTION_TERMS: usize = 8;

/// Like [`output_signs`], for rows of [`ACTION_TERMS`] terms, which stay in registers.
///
/// # Panics
/// If a row does not have [`ACTION_TERMS`] terms; checked at compile time.
#[inline]
pub(crate) fn action_signs<const N: usize, const O: usize>(
    rows: &Aligned<[[i16; N]; O]>,
    terms: &Aligned<[i16; N]>,
    count: usize,
) -> u16 {
    assert!(N == ACTION_TERMS);
    let count = count.min(O).min(16);
    if count == 0 {
        return 0;
    }
    let negative: u32;
    // SAFETY: reads `count` rows of four words and the four words of `terms`; all of them exist and
    // are word-aligned, as `ldm` requires. The flags and registers used are declared.
    unsafe {
        asm!(
            "ldm r0, {{r0, r1, r2, r3}}",
            "2:",
            "ldm {row}!, {{r4, r5, r8, r9}}",
            "smuad {sum}, r0, r4",
            "smlad {sum}, r1, r5, {sum}",
            "smlad {sum}, r2, r8, {sum}",
            "smlad {sum}, r3, r9, {sum}",
            "lsls {sum}, {sum}, #1",
            "adcs {negative}, {negative}, {negative}",
            "subs {count}, #1",
            "bne 2b",
            sum = out(reg) _,
            row = inout(reg) rows.0.as_ptr() => _,
            negative = inout(reg) 0 => negative,
            count = inout(reg) count => _,
            inout("r0") terms.0.as_ptr() => _,
            out("r1") _,
            out("r2") _,
            out("r3") _,
            out("r4") _,
            out("r5") _,
            out("r8") _,
            out("r9") _,
            options(nostack, pure, readonly),
        );
    }
    ((!negative).reverse_bits() >> (32 - count as u32)) as u16
}

/// Selects each pair of terms by the pair's two bits in `inputs`.
#[inline]
pub(crate) fn select_terms(
    pairs: &Aligned<[[[i16; 2]; 4]; MAX_TERMS / 2]>,
    inputs: u32,
    terms: &mut Aligned<[i16; MAX_TERMS]>,
) {
    // SAFETY: reads one of the four words of each of the eight tables, and writes the eight words
    // of `terms`. The flags and registers used are declared.
    unsafe {
        asm!(
            ".rept {words}",
            "and {word}, {bits}, #3",
            "ldr {word}, [{table}, {word}, lsl #2]",
            "adds {table}, #16",
            "lsrs {bits}, {bits}, #2",
            "str {word}, [{terms}], #4",
            ".endr",
            words = const MAX_TERMS / 2,
            word = out(reg) _,
            bits = inout(reg) inputs => _,
            table = inout(reg) pairs.0.as_ptr() => _,
            terms = inout(reg) terms.0.as_mut_ptr() => _,
            options(nostack),
        );
    }
}
