//! The host's end of the line.

use crate::frame::{Decoder, LineErrors, WIRE_BYTES_MAX, count, encode};
use crate::message::{
    CHUNK_BYTES_MAX, Direction, Envelope, MalformedMessage, PROTOCOL_VERSION, Reply, Request,
    decode_reply,
};

/// The host's end of the line: one request at a time, and its reply.
///
/// A client has no clock: the caller waits, and calls [`Client::timed_out`].
///
/// ```
/// use minimal_surprise_link::{Client, Reply, Request, Server};
/// # use robot_support::link_robot::{Flash, LinkRobot};
///
/// # let mut robot = LinkRobot::start(Flash::new());
/// let mut client = Client::new(0x1234_5678, Client::ATTEMPTS_MAX);
/// let mut server = Server::new();
/// let mut identified = false;
/// // Stands for the serial line to the robot.
/// for byte in client.request(&Request::Identify)?.to_vec() {
///     for &byte in server.feed(byte, &mut robot).unwrap_or_default() {
///         if let Some(Reply::Identity(identity)) = client.feed(byte) {
///             println!("{} {}", identity.firmware, identity.version);
///             identified = true;
///         }
///     }
/// }
/// assert!(identified);
/// # Ok::<(), minimal_surprise_link::RequestError>(())
/// ```
#[derive(Debug)]
pub struct Client {
    decoder: Decoder,
    session: u32,
    /// Number of the next request; `None` after 2³² requests.
    next: Option<u32>,
    /// Number of the request whose reply is pending, and the number of times it was sent.
    pending: Option<(u32, u32)>,
    attempts_max: u32,
    wire: [u8; WIRE_BYTES_MAX],
    length: usize,
    strays: u32,
    last_malformed: Option<MalformedMessage>,
}

/// Reason why a request cannot be sent now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RequestError {
    /// The reply to the last request is still pending.
    #[error("the robot has not replied to the last request yet")]
    Pending,
    /// The session does not begin with [`Request::Identify`].
    #[error("the first request of a session must be to identify")]
    IdentifyFirst,
    /// The chunk has more than [`CHUNK_BYTES_MAX`] bytes.
    #[error("a chunk of {found} bytes; at most {CHUNK_BYTES_MAX} fit in a request")]
    ChunkTooLong {
        /// Size of the chunk, in bytes.
        found: usize,
    },
    /// All 2³² numbers have been used; open a new session.
    #[error("all request numbers have been used; open a new session")]
    SessionExhausted,
}

/// Error: the robot has not replied. The robot may or may not have executed the request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no reply to a request sent {attempts} times")]
pub struct GaveUp {
    /// Number of times that the request was sent.
    pub attempts: u32,
}

impl Client {
    /// Default for the maximum number of times that a request is sent.
    pub const ATTEMPTS_MAX: u32 = 5;

    /// Creates a new session. The session number must not have been used on this line before: use a
    /// random number. A request is sent at most `attempts_max` times, and at least once.
    #[must_use]
    pub const fn new(session: u32, attempts_max: u32) -> Self {
        Self {
            decoder: Decoder::new(),
            session,
            next: Some(0),
            pending: None,
            attempts_max,
            wire: [0; WIRE_BYTES_MAX],
            length: 0,
            strays: 0,
            last_malformed: None,
        }
    }

    /// Changes the maximum number of times that a request is sent, starting with the next attempt.
    /// A request is sent at least once.
    pub const fn set_attempts_max(&mut self, attempts_max: u32) {
        self.attempts_max = attempts_max;
    }

    /// Returns the bytes to send for a request. After sending them, wait [`Request::timeout_ms`]
    /// for the reply.
    ///
    /// # Errors
    /// [`RequestError`] if the request cannot be sent; send nothing in that case.
    pub fn request(&mut self, request: &Request<'_>) -> Result<&[u8], RequestError> {
        if self.pending.is_some() {
            return Err(RequestError::Pending);
        }
        let sequence = self.next.ok_or(RequestError::SessionExhausted)?;
        if sequence == 0 && *request != Request::Identify {
            return Err(RequestError::IdentifyFirst);
        }
        let found = match request {
            Request::Chunk { data, .. } => data.len(),
            _ => 0,
        };
        let too_long = RequestError::ChunkTooLong { found };
        if found > CHUNK_BYTES_MAX {
            return Err(too_long);
        }
        let envelope = Envelope {
            version: PROTOCOL_VERSION,
            direction: Direction::Request,
            session: self.session,
            sequence,
            body: *request,
        };
        self.length = encode(&envelope, &mut self.wire).map_err(|_| too_long)?;
        self.next = sequence.checked_add(1);
        self.pending = Some((sequence, 1));
        Ok(self.frame())
    }

    /// Processes one byte from the line. If the byte completes the reply to the pending request,
    /// returns the reply. Everything else that arrives is counted and discarded.
    pub fn feed(&mut self, byte: u8) -> Option<Reply<'_>> {
        if !self.decoder.feed(byte) {
            return None;
        }
        let pending = self.pending.map(|(sequence, _)| sequence);
        match decode_reply(self.decoder.payload()) {
            Ok(reply) if reply.session == self.session && Some(reply.sequence) == pending => {
                self.pending = None;
                Some(reply.body)
            }
            Ok(_) => {
                count(&mut self.strays);
                None
            }
            Err(malformed) => {
                count(&mut self.strays);
                self.last_malformed = Some(malformed);
                None
            }
        }
    }

    /// Returns the bytes to send again. Call this if the reply has not arrived in time.
    ///
    /// # Errors
    /// [`GaveUp`] if the last attempt has timed out, or no request is pending. A new request may
    /// then be sent.
    pub fn timed_out(&mut self) -> Result<&[u8], GaveUp> {
        match self.pending {
            Some((sequence, attempts)) if attempts < self.attempts_max => {
                self.pending = Some((sequence, attempts + 1));
                Ok(self.frame())
            }
            pending => {
                self.pending = None;
                let attempts = pending.map_or(0, |(_, attempts)| attempts);
                Err(GaveUp { attempts })
            }
        }
    }

    /// Returns the number of frames received that were not the reply to the pending request.
    #[must_use]
    pub fn strays(&self) -> u32 {
        self.strays
    }

    /// Returns the reason why the last malformed frame was not a message of this protocol. This
    /// distinguishes a different device or protocol version from silence.
    #[must_use]
    pub fn last_malformed(&self) -> Option<MalformedMessage> {
        self.last_malformed
    }

    /// Returns the counts of received data that was not a valid frame.
    #[must_use]
    pub fn errors(&self) -> LineErrors {
        self.decoder.errors()
    }

    fn frame(&self) -> &[u8] {
        self.wire.get(..self.length).unwrap_or(&[])
    }
}
