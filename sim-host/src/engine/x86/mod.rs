//! x86-64 vector paths. The only unsafe code of the crate is in this folder: intrinsics that use
//! pointers, and calls to functions compiled for instructions that some processors lack. These
//! calls are in methods of [`Avx2`] and [`Avx512`], which can be constructed only after the
//! instructions have been detected at run time.
#![allow(unsafe_code)]

pub(super) mod avx2;
pub(super) mod avx512;

use super::board::Board;
use super::lanes::{Blocks, Lanes, Matches};
use super::window::WindowOrder;
use minimal_surprise_controller::Controller;

/// Proof that the processor has AVX2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx2(());

/// Proof that the processor has AVX-512 F, BW, VL, VBMI2, VNNI and BITALG, and GFNI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx512(());

/// The inputs and outputs of sensing and deciding.
pub(super) struct Sensing<'a> {
    pub(super) board: &'a Board,
    pub(super) robots: usize,
    pub(super) words: &'a mut [u32],
    /// The whole action table, plus three bytes.
    pub(super) entries: &'a [u8],
    /// Window bits that are sensors.
    pub(super) sensors: u16,
    pub(super) flips: Option<&'a [u16]>,
    pub(super) inputs: &'a mut [u16],
    pub(super) movers: &'a mut [u32],
}

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        std::arch::is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    pub(super) fn run_block(
        self,
        network: &avx2::Network,
        lanes: &mut Lanes,
        blocks: &Blocks,
        matches: &mut Matches,
    ) -> u32 {
        // SAFETY: `self` exists only if the processor has AVX2.
        unsafe { avx2::run_block(network, lanes, blocks, matches) }
    }
}

impl Avx512 {
    pub(super) fn detect() -> Option<Self> {
        (std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512bw")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512vbmi2")
            && std::arch::is_x86_feature_detected!("avx512vnni")
            && std::arch::is_x86_feature_detected!("avx512bitalg")
            && std::arch::is_x86_feature_detected!("gfni"))
        .then_some(Self(()))
    }

    pub(super) fn run_block(
        self,
        network: &avx512::Network,
        lanes: &mut Lanes,
        blocks: &Blocks,
        matches: &mut Matches,
    ) -> u32 {
        // SAFETY: `self` exists only if the processor has the instructions.
        unsafe { network.run_block(lanes, blocks, matches) }
    }

    /// Computes the entries of all windows.
    pub(super) fn fill_action_table(
        self,
        controller: &Controller,
        order: &WindowOrder,
        entries: &mut [u8],
    ) {
        // SAFETY: `self` exists only if the processor has the instructions.
        unsafe { avx512::actions::fill_table(controller, order, entries) }
    }

    /// Applies all turns and lists the robots that may move; returns the length of the list.
    pub(super) fn sense_and_decide(self, sensing: Sensing<'_>) -> usize {
        // SAFETY: `self` exists only if the processor has the instructions.
        unsafe { avx512::sensing::sense_and_decide(sensing) }
    }
}
