#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic
    )
)]

mod client;
mod frame;
mod message;
mod server;

pub use client::{Client, GaveUp, RequestError};
pub use frame::{
    Decoder, EncodeError, FRAME_BYTES_MAX, LineErrors, PAYLOAD_BYTES_MAX, WIRE_BYTES_MAX, encode,
};
pub use message::{
    CHUNK_BYTES_MAX, Direction, Envelope, FIRMWARE_BYTES_MAX, Faults, GenomeInUse, Identity,
    LineCounters, MalformedMessage, PROTOCOL_VERSION, Refusal, Reply, Report, Request, Stepped,
    VERSION_BYTES_MAX, decode_reply, decode_request,
};
pub use server::{Handler, Server};
