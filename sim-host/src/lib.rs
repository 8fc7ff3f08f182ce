#![doc = include_str!("../README.md")]
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
pub use engine::{Engine, EnginePath, Evaluator, TrialSet};
pub use evaluation::{Evaluation, Outcome, evaluate, run};
pub use metrics::{Match, Measures, Motion, similarity};
pub use noise::{NoiseRate, NoiseStream};
pub use scenario::{Scenario, ScenarioError, Trial};
pub use seed::{Purpose, SeedTree};
pub use structures::{Structure, Structures, classify};
pub use torus::{Grid, GridError, Heading, Pose};
pub use trace::{Trace, TraceStep};
pub use world::{World, WorldError};
