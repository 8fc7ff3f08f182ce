//! AVX-512: 32 activations or 16 robots per register.

pub(in super::super) mod actions;
mod activation;
mod prediction;
pub(in super::super) mod sensing;

pub(in super::super) use prediction::Network;
