//! The fast engine: the same results as [`evaluation::evaluate`](crate::evaluation::evaluate), bit
//! for bit, in a fraction of the time. Every trick is here and nowhere else.
//!
//! | trick | where |
//! |---|---|
//! | a robot's surroundings cut out of rows of bits | `board`, `window` |
//! | a robot in one word, states compared as words | `robot_word`, `swarm` |
//! | actions by table, filled as asked or all at once | `actions` |
//! | the world first, predictions from what it wrote down | `recording` |
//! | a world that repeats itself stops | `repeats` |
//! | a robot that sees and foresees the same goes on by counting | `skipping` |
//! | predictions of 32 robots side by side | `lanes`, `network`, `portable`, `x86` |
//! | noise drawn once a generation | `flips` |
//! | predictions that are fixed are compared four steps at a time | `fixed_predictions` |
//! | large or noisy swarms in parts that stay in the cache | `every_step` |
//!
//! `evaluator` puts them together, and `path` chooses the instructions.
#![cfg_attr(
    not(target_arch = "x86_64"),
    allow(
        dead_code,
        unused_variables,
        reason = "some is for the vector paths only"
    )
)]

mod actions;
mod board;
mod evaluator;
mod every_step;
mod fixed_predictions;
mod flips;
mod lanes;
mod network;
mod path;
mod portable;
mod recording;
mod repeats;
mod robot_word;
mod skipping;
mod swarm;
mod window;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use evaluator::{Engine, Evaluator, TrialSet};
pub use path::{PATH_VARIABLE, Path, PathError};
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};
