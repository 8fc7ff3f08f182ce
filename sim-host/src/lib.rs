//! The torus grid world in which swarms of minimal-surprise robots live.
//!
//! Robots sense, decide by calling the controller crate, and act in index order. An evaluation is
//! a pure function of genome, scenario and seed: no clock, no thread and no memory layout enters
//! a result.
//!
//! Data flows one way: [`torus`] → [`seed`] → [`noise`] → [`world`] → [`scenario`] → [`evaluation`] →
//! [`trace`] → [`metrics`] → [`structures`]. [`damage`] turns a final state into a new start;
//! [`exchange`] reads and writes the text files of the authors' program; [`drawing`] draws swarms
//! as text. [`engine`] computes the same evaluations faster, and is the only place with unsafe
//! code: its folder `x86`.
#![deny(unsafe_code)]

pub mod damage;
pub mod drawing;
pub mod engine;
pub mod evaluation;
pub mod exchange;
pub mod metrics;
pub mod noise;
pub mod scenario;
pub mod seed;
pub mod structures;
pub mod torus;
pub mod trace;
pub mod world;

pub use damage::{Area, Damage, DamageError};
pub use engine::{Engine, Evaluator, Path, TrialSet};
pub use evaluation::{Evaluation, Outcome, evaluate, run};
pub use metrics::{Match, Measures, similarity};
pub use noise::{NoiseRate, NoiseStream};
pub use scenario::{Scenario, ScenarioError, Trial};
pub use seed::{Purpose, SeedTree};
pub use structures::{Structure, Structures, classify};
pub use torus::{Grid, GridError, Heading, Pose};
pub use trace::{Trace, TraceStep};
pub use world::{World, WorldError};
