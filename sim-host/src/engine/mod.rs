//! The fast engine: the same results as [`evaluation::evaluate`](crate::evaluation::evaluate), bit
//! for bit, in a fraction of the time. All optimisations are in this module.
//!
//! | optimisation | where |
//! |---|---|
//! | the cells around a robot are extracted from rows of bits | `board`, `window` |
//! | a robot is one word, states are compared as words | `robot_word`, `swarm` |
//! | actions come from a table, filled on demand or all at once | `actions` |
//! | the world runs first, predictions are computed from its recording | `recording` |
//! | a world that repeats a state is not run further | `repeats` |
//! | steps in which a robot's inputs and predictions repeat are counted, not computed | `skipping` |
//! | predictions of 32 robots are computed side by side | `lanes`, `network`, `portable`, `x86` |
//! | noise is drawn once per generation | `flips` |
//! | fixed predictions are compared four steps at a time | `fixed_predictions` |
//! | large or noisy swarms are processed in parts that stay in the cache | `every_step` |
//!
//! `evaluator` combines them, and `path` chooses the instructions.
#![cfg_attr(
    not(target_arch = "x86_64"),
    allow(
        dead_code,
        unused_variables,
        reason = "some items are used by the vector paths only"
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
mod predictor;
mod recording;
mod repeats;
mod robot_word;
mod skipping;
mod swarm;
mod window;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use evaluator::{Engine, Evaluator, TrialSet};
pub use path::{EnginePath, PATH_VARIABLE, PathError};
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};
