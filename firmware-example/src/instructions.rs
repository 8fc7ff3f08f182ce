//! Counter of instructions under QEMU.
//!
//! With `-icount`, QEMU's clock advances by a fixed time per instruction, and SysTick counts that
//! time. A block of `nop`s calibrates the number of ticks per instruction. The unit is instructions
//! executed, not cycles: QEMU does not model a pipeline, and on the chip some instructions take
//! more than one cycle.

use core::sync::atomic::{Ordering, compiler_fence};
use cortex_m::asm::nop;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// Value from which SysTick counts down.
pub const RELOAD: u32 = 0x00ff_ffff;

/// Number of `nop`s for the calibration.
const NOPS: u32 = 1000;

/// Counter of the instructions that a function executes.
pub struct Counter {
    /// Number of ticks that pass while the clock is read twice.
    empty_ticks: u32,
    /// Number of ticks that [`NOPS`] instructions take.
    nops_ticks: u32,
}

impl Counter {
    /// Starts and calibrates SysTick; returns `None` if SysTick does not count instructions, for
    /// example without `-icount`.
    #[must_use]
    pub fn new(mut systick: SYST) -> Option<Self> {
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(RELOAD);
        systick.clear_current();
        systick.enable_counter();
        let empty_ticks = ticks(|| ());
        let nops_ticks = ticks(|| {
            ten!(ten!(ten!(nop())));
        });
        let counter = Self {
            empty_ticks,
            nops_ticks: nops_ticks.checked_sub(empty_ticks)?,
        };
        let again = ticks(|| {
            ten!(ten!(ten!(nop())));
            ten!(ten!(ten!(nop())));
        });
        (counter.nops_ticks > NOPS && counter.instructions(again).abs_diff(2 * NOPS) <= 1)
            .then_some(counter)
    }

    /// Returns the number of instructions that `work` executes, and the result of `work`. The
    /// maximum is about 650,000 instructions; if more are executed, SysTick wraps around.
    pub fn count<T>(&self, work: impl FnOnce() -> T) -> (u32, T) {
        let mut result = None;
        let ticks = ticks(|| result = Some(work()));
        match result {
            Some(result) => (self.instructions(ticks), result),
            None => unreachable!("`work` was called"),
        }
    }

    /// Converts ticks to instructions, excluding the ticks of reading the clock twice.
    #[must_use]
    pub fn instructions(&self, ticks: u32) -> u32 {
        let scaled = u64::from(ticks.saturating_sub(self.empty_ticks)) * u64::from(NOPS);
        let nops_ticks = u64::from(self.nops_ticks);
        ((scaled + nops_ticks / 2) / nops_ticks) as u32
    }
}

/// Repeats an instruction ten times.
macro_rules! ten {
    ($work:expr) => {
        $work;
        $work;
        $work;
        $work;
        $work;
        $work;
        $work;
        $work;
        $work;
        $work;
    };
}
use ten;

/// Returns the number of ticks from just before `work` to just after it.
#[inline(always)]
fn ticks(work: impl FnOnce()) -> u32 {
    let start = SYST::get_current();
    compiler_fence(Ordering::SeqCst);
    work();
    compiler_fence(Ordering::SeqCst);
    let end = SYST::get_current();
    start.wrapping_sub(end) & RELOAD
}
