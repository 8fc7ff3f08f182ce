#![doc = include_str!("../README.md")]
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
