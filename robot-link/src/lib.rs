//! The line between a robot and its host, both ends of it.
//!
//! The host asks, the robot answers; one request at a time. Every frame is a [`postcard`] message
//! with a CRC-32C, in COBS, between zero bytes. Requests are numbered, so that the host may repeat
//! one until an answer comes, and the robot carries it out once. `docs/link-protocol.md` describes
//! every byte.
//!
//! The robot feeds every byte that arrives to a [`Server`] and sends what that returns; a
//! [`Handler`] does the work. The host makes requests with a [`Client`] and tells it when it has
//! waited long enough. Neither knows a clock or a port.
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
