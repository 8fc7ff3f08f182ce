//! The robot's end of the line.

use crate::frame::{Decoder, WIRE_BYTES_MAX, count, encode};
use crate::message::{
    Direction, Envelope, FIRMWARE_BYTES_MAX, Identity, LineCounters, PROTOCOL_VERSION, Refusal,
    Reply, Report, Request, Stepped, VERSION_BYTES_MAX, decode_request,
};
use minimal_surprise_controller::SensorBits;

/// Functions that execute the requests on the robot. Each is called once per request, even if the
/// request arrives several times. Unless stated otherwise for the [`Refusal`], a refused request
/// has changed nothing.
pub trait Handler {
    /// Returns the robot's firmware, genome and status.
    fn identify(&mut self) -> Identity<'_>;

    /// Prepares to receive a container of `length` bytes whose last four bytes are `crc`,
    /// little-endian.
    ///
    /// # Errors
    /// [`Refusal::Running`], [`Refusal::ImpossibleLength`] or [`Refusal::Flash`] if the update
    /// cannot begin.
    fn begin(&mut self, length: u16, crc: u32) -> Result<(), Refusal>;

    /// Writes the next bytes of the container.
    ///
    /// # Errors
    /// [`Refusal::NotBegun`], [`Refusal::WrongOffset`], [`Refusal::OtherLength`] or
    /// [`Refusal::Flash`] if the bytes cannot be written.
    fn chunk(&mut self, offset: u16, data: &[u8]) -> Result<(), Refusal>;

    /// Checks the genome and switches to it; returns the write count.
    ///
    /// # Errors
    /// [`Refusal::NotBegun`], [`Refusal::OtherLength`], [`Refusal::BadGenome`] or
    /// [`Refusal::Flash`] if the genome cannot be committed.
    fn commit(&mut self) -> Result<u32, Refusal>;

    /// Runs one control step with these readings, without moving.
    ///
    /// # Errors
    /// [`Refusal::Running`] if the robot is running.
    fn step(&mut self, sensors: SensorBits) -> Result<Stepped, Refusal>;

    /// Resets the controller's state to its initial value.
    ///
    /// # Errors
    /// [`Refusal::Running`] if the robot is running.
    fn reset(&mut self) -> Result<(), Refusal>;

    /// Starts the control loop; has no effect on a running robot.
    ///
    /// # Errors
    /// [`Refusal::Unsupported`] if the robot does not support the request.
    fn start(&mut self) -> Result<(), Refusal>;

    /// Stops the motors and the control loop; has no effect on a stopped robot.
    ///
    /// # Errors
    /// [`Refusal::Unsupported`] if the robot does not support the request.
    fn stop(&mut self) -> Result<(), Refusal>;

    /// Returns a status report.
    fn telemetry(&mut self) -> Report;
}

/// The robot's end of the line: processes received bytes, returns bytes to send, and ensures that
/// every request is executed once.
///
/// ```
/// use minimal_surprise_link::{Client, Request, Server};
/// # use robot_support::link_robot::{Flash, LinkRobot};
///
/// # let mut robot = LinkRobot::start(Flash::new());
/// let mut client = Client::new(1, Client::ATTEMPTS_MAX);
/// let received = client.request(&Request::Identify)?.to_vec();
///
/// let mut server = Server::new();
/// let mut replies = 0;
/// for byte in received {
///     if let Some(frame) = server.feed(byte, &mut robot) {
///         assert_eq!(frame.first(), Some(&0), "frames start and end with zero");
///         replies += 1;
///     }
/// }
/// assert_eq!(replies, 1);
/// assert_eq!(server.counters().accepted, 1);
/// # Ok::<(), minimal_surprise_link::RequestError>(())
/// ```
#[derive(Debug)]
pub struct Server {
    decoder: Decoder,
    conversation: Conversation,
}

/// The open session and its last exchange.
#[derive(Debug)]
struct Conversation {
    session: Option<u32>,
    /// The previous session, which cannot be reopened.
    session_before: Option<u32>,
    /// The last request executed: its number and the CRC of its frame.
    last: (u32, u32),
    /// The reply to the last request, as sent.
    reply: Wire<WIRE_BYTES_MAX>,
    /// The reply to a request that does not belong to the open session.
    no_session: Wire<24>,
    counters: LineCounters,
}

/// A frame to send.
#[derive(Debug)]
struct Wire<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

/// Selection of the reply to send.
enum Answer {
    Reply,
    NoSession,
}

impl Server {
    /// Creates a server without a session.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            conversation: Conversation {
                session: None,
                session_before: None,
                last: (0, 0),
                reply: Wire::new(),
                no_session: Wire::new(),
                counters: LineCounters {
                    accepted: 0,
                    repeated: 0,
                    stale: 0,
                    malformed: 0,
                    bad_crc: 0,
                    no_frame: 0,
                },
            },
        }
    }

    /// Processes one byte from the line. If the byte completes a request, executes it and returns
    /// the bytes to send.
    pub fn feed(&mut self, byte: u8, handler: &mut impl Handler) -> Option<&[u8]> {
        if !self.decoder.feed(byte) {
            return None;
        }
        let line = self.counters();
        let conversation = &mut self.conversation;
        let Ok(request) = decode_request(self.decoder.payload()) else {
            count(&mut conversation.counters.malformed);
            return None;
        };
        match conversation.answer(&request, self.decoder.crc(), line, handler)? {
            Answer::Reply => conversation.reply.get(),
            Answer::NoSession => conversation.no_session.get(),
        }
    }

    /// Returns the counts of received data.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        let errors = self.decoder.errors();
        LineCounters {
            bad_crc: errors.bad_crc,
            no_frame: errors.no_frame,
            ..self.conversation.counters
        }
    }
}

impl Default for Server {
    fn default() -> Self {
        Self::new()
    }
}

impl Conversation {
    fn answer(
        &mut self,
        request: &Envelope<Request<'_>>,
        crc: u32,
        line: LineCounters,
        handler: &mut impl Handler,
    ) -> Option<Answer> {
        let Envelope {
            session, sequence, ..
        } = *request;
        if self.session != Some(session) {
            // Request 0 always identifies the robot.
            if sequence > 0 || self.session_before == Some(session) {
                count(&mut self.counters.stale);
                let refused = Reply::Refused(Refusal::NoSession);
                self.no_session.put(session, sequence, refused);
                return Some(Answer::NoSession);
            }
            self.session_before = self.session;
            self.session = Some(session);
        } else if sequence == self.last.0 && crc == self.last.1 {
            count(&mut self.counters.repeated);
            return Some(Answer::Reply);
        } else if sequence <= self.last.0 {
            count(&mut self.counters.stale);
            return None;
        }
        self.last = (sequence, crc);
        count(&mut self.counters.accepted);
        let line = LineCounters {
            accepted: self.counters.accepted,
            ..line
        };
        let reply = carry_out(&request.body, line, handler);
        self.reply.put(session, sequence, reply);
        Some(Answer::Reply)
    }
}

fn carry_out<'h>(
    request: &Request<'_>,
    line: LineCounters,
    handler: &'h mut impl Handler,
) -> Reply<'h> {
    let done = |()| Reply::Done;
    let reply = match *request {
        Request::Identify => {
            let identity = handler.identify();
            return Reply::Identity(Identity {
                firmware: front(identity.firmware, FIRMWARE_BYTES_MAX),
                version: front(identity.version, VERSION_BYTES_MAX),
                ..identity
            });
        }
        Request::Begin { length, crc } => handler.begin(length, crc).map(done),
        Request::Chunk { offset, data } => handler.chunk(offset, data).map(done),
        Request::Commit => handler
            .commit()
            .map(|write_count| Reply::Committed { write_count }),
        Request::Step { sensors } => handler.step(sensors).map(Reply::Stepped),
        Request::Reset => handler.reset().map(done),
        Request::Start => handler.start().map(done),
        Request::Stop => handler.stop().map(done),
        Request::Telemetry => {
            let report = handler.telemetry();
            Ok(Reply::Telemetry { report, line })
        }
    };
    reply.unwrap_or_else(Reply::Refused)
}

/// Returns the longest prefix of a text that has at most `max` bytes and only whole characters.
fn front(text: &str, max: usize) -> &str {
    text.get(..text.floor_char_boundary(max)).unwrap_or("")
}

impl<const N: usize> Wire<N> {
    const fn new() -> Self {
        Self {
            bytes: [0; N],
            length: 0,
        }
    }

    fn put(&mut self, session: u32, sequence: u32, body: Reply<'_>) {
        let envelope = Envelope {
            version: PROTOCOL_VERSION,
            direction: Direction::Reply,
            session,
            sequence,
            body,
        };
        // Every reply fits: texts are truncated; all other fields have a maximum size.
        self.length = encode(&envelope, &mut self.bytes).unwrap_or(0);
    }

    fn get(&self) -> Option<&[u8]> {
        self.bytes.get(..self.length)
    }
}
