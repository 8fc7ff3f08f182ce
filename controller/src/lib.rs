//! Robot controller of the minimal-surprise approach, in integers only.
//!
//! Each robot of a swarm carries an *action network* and a recurrent *prediction network*. Both
//! come from one [`Genome`]; fitness is how well a robot predicts its own next sensor readings.
//! This crate is what evolution runs on a PC and what the robot runs: the same code, the same
//! bits. It needs neither `std` nor an allocator, and its core uses no floating point.
//!
//! ```
//! use minimal_surprise_controller::{Controller, Genome, SensorBits, State, Topology};
//!
//! let genome = Genome::zeroed(Topology::default());
//! let controller = Controller::new(&genome);
//! let mut state = State::new(&controller);
//! let decision = controller.step(&mut state, SensorBits::new(0b1001));
//! assert_eq!(decision.prediction, state.prediction());
//! ```
//!
//! Data flows one way: [`sensor`] bits enter [`network`]s built from a [`genome`], and a
//! [`controller`] turns them into a decision. [`codec`] carries genomes between machines.
//!
//! # Features
//!
//! | feature | adds |
//! |---|---|
//! | `neighbours` | [`neighbours`]: detected neighbours (range and bearing) become sensor bits |
//! | `defmt` | every public type can be logged with `defmt` |
#![no_std]
#![deny(unsafe_code)]

pub mod activation;
pub mod codec;
pub mod controller;
#[cfg(has_smlad)]
mod dsp;
pub mod fixed;
pub mod genome;
#[cfg(feature = "neighbours")]
pub mod neighbours;
pub mod network;
pub mod sensor;
pub mod topology;

pub use activation::{KERNEL_ID, KernelId, activate};
pub use codec::{DecodeError, EncodedGenome, Provenance};
pub use controller::{Action, Controller, Decision, State, Surprise, Turn};
pub use genome::{Genome, GenomeError, MutationRate};
pub use sensor::{SensorBits, SensorModel};
pub use topology::{Prediction, Template, Topology, TopologyError};
