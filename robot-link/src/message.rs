//! Messages: requests, replies, and the envelope around them.

use minimal_surprise_controller::{Decision, KernelId, SensorBits, Surprise};
use serde::{Deserialize, Serialize};

/// Version of the protocol, the first byte of every message.
pub const PROTOCOL_VERSION: u8 = 1;
/// Maximum number of genome bytes in one request.
pub const CHUNK_BYTES_MAX: usize = 128;
/// Maximum length of a firmware's name, in bytes; longer names are truncated.
pub const FIRMWARE_BYTES_MAX: usize = 32;
/// Maximum length of a firmware's version, in bytes; longer versions are truncated.
pub const VERSION_BYTES_MAX: usize = 16;

/// Direction of a message, so that an echo is not taken for a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// From the host to the robot. 0.
    Request,
    /// From the robot to the host. 1.
    Reply,
}

/// A message with its session and its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Envelope<B> {
    /// [`PROTOCOL_VERSION`].
    pub version: u8,
    /// Direction of the message.
    pub direction: Direction,
    /// The session that the message belongs to; the host chooses a number that it has not used
    /// before.
    pub session: u32,
    /// Number of the request in the session, counted from 0; a reply has the number of its request.
    pub sequence: u32,
    /// [`Request`] or [`Reply`].
    pub body: B,
}

/// A request from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Who are you? Request 0 of every session. Answer: [`Reply::Identity`].
    Identify,
    /// A genome container follows; erases the slot that is not in use. Answer: [`Reply::Done`].
    Begin {
        /// Bytes of the container.
        length: u16,
        /// Its last four bytes, little-endian.
        crc: u32,
    },
    /// The next bytes of the container. Answer: [`Reply::Done`].
    Chunk {
        /// Number of bytes before these.
        offset: u16,
        /// At most [`CHUNK_BYTES_MAX`] bytes.
        data: &'a [u8],
    },
    /// The container is complete: check it and switch to it. Reply: [`Reply::Committed`].
    Commit,
    /// One control step with these readings instead of the robot's own, without moving. Answer:
    /// [`Reply::Stepped`].
    Step {
        /// The readings, bit k for sensor k.
        sensors: SensorBits,
    },
    /// Reset the controller's state to that at the start. Answer: [`Reply::Done`].
    Reset,
    /// Run the control loop. Answer: [`Reply::Done`].
    Start,
    /// Stop motors and control loop. Answer: [`Reply::Done`].
    Stop,
    /// Report the status. Answer: [`Reply::Telemetry`].
    Telemetry,
}

impl Request<'_> {
    /// How long to wait for the answer before repeating the request, in milliseconds: 500, and
    /// 10,000 for [`Request::Begin`], which may erase 128 KiB and more.
    #[must_use]
    pub const fn timeout_ms(&self) -> u32 {
        match self {
            Self::Begin { .. } => 10_000,
            _ => 500,
        }
    }
}

/// An answer from the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply<'a> {
    /// To [`Request::Identify`].
    #[serde(borrow)]
    Identity(Identity<'a>),
    /// The request was carried out; there is nothing to report.
    Done,
    /// The genome is in use, also after a restart.
    Committed {
        /// Number of the genome among all written to this robot.
        write_count: u32,
    },
    /// To [`Request::Step`].
    Stepped(Stepped),
    /// To [`Request::Telemetry`].
    Telemetry {
        /// The robot's report.
        report: Report,
        /// The counters of its end of the line.
        line: LineCounters,
    },
    /// The request was refused.
    Refused(Refusal),
}

/// Who the robot is and what it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity<'a> {
    /// Name of the firmware, at most [`FIRMWARE_BYTES_MAX`] bytes.
    pub firmware: &'a str,
    /// Its version, at most [`VERSION_BYTES_MAX`] bytes.
    pub version: &'a str,
    /// The arithmetic that it uses.
    pub kernel: KernelId,
    /// The genome in use.
    pub genome: GenomeInUse,
    /// Whether the control loop runs.
    pub running: bool,
    /// Current faults.
    pub faults: Faults,
}

/// Where the genome in use comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GenomeInUse {
    /// The built-in genome, because there is no other: the robot only turns.
    BuiltIn,
    /// A genome that was written.
    Slot {
        /// Which slot, 0 or 1.
        slot: u8,
        /// Its number among all genomes written to this robot, counted from 1.
        write_count: u32,
        /// Bytes of the container.
        length: u16,
        /// The container's last four bytes, little-endian.
        crc: u32,
    },
}

/// The faults of a robot, one bit per fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults(pub u16);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);
    /// No slot holds a genome to run; the built-in one is in use.
    pub const NO_GENOME: Self = Self(1);
    /// A genome that was written can no longer be run.
    pub const SLOT_DAMAGED: Self = Self(1 << 1);
    /// The flash has reported an error.
    pub const FLASH: Self = Self(1 << 2);
    /// The latest neighbour data is too old; the robot stands.
    pub const NEIGHBOURS_STALE: Self = Self(1 << 3);
    /// The watchdog caused the last restart.
    pub const WATCHDOG: Self = Self(1 << 4);

    /// All faults of both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns whether these include all of `other`.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// What one step decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Stepped {
    /// Action, turn, and the prediction for the next reading.
    pub decision: Decision,
    /// Surprise since the start or the last reset.
    pub surprise: Surprise,
}

/// What a robot has done since its start or the last reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// Whether the control loop runs.
    pub running: bool,
    /// Bits mispredicted, of all seen.
    pub surprise: Surprise,
    /// Steps that decided to go straight.
    pub straight: u32,
    /// Of these, steps that the guard held back because the cell ahead was occupied.
    pub held_back: u32,
    /// Steps that decided to turn left.
    pub turned_left: u32,
    /// Steps that decided to turn right.
    pub turned_right: u32,
    /// Current faults.
    pub faults: Faults,
}

/// What has arrived at the robot since its start. Counters saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineCounters {
    /// Requests carried out or refused.
    pub accepted: u32,
    /// Repeated requests: answered again, but not carried out again.
    pub repeated: u32,
    /// Requests that arrived too late or belong to no open session; not carried out.
    pub stale: u32,
    /// Frames with a correct CRC that are not a request of this protocol.
    pub malformed: u32,
    /// Frames with a wrong CRC.
    pub bad_crc: u32,
    /// Number of byte sequences between two zeros that are not a frame: damaged, truncated or too
    /// long.
    pub no_frame: u32,
}

/// Why a request was not carried out. Nothing has changed, unless the variant says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// The robot does not know this session: it was restarted, or another host talks to it.
    #[error("the robot has lost the session: it was restarted, or another program talks to it")]
    NoSession,
    /// Stop the robot first.
    #[error("the robot is running; stop it first")]
    Running,
    /// No update has begun.
    #[error("no genome is being written")]
    NotBegun,
    /// Chunks must arrive in order.
    #[error("the robot expects the bytes from {expected} on")]
    WrongOffset {
        /// Bytes that it has.
        expected: u16,
    },
    /// No container has this length.
    #[error("the robot has no room for a genome of that length")]
    ImpossibleLength,
    /// More or fewer bytes than the length announced.
    #[error("the genome's length is not the one announced")]
    OtherLength,
    /// The container is not the one announced, or this robot cannot run it. The update is over.
    #[error("the robot has received a genome that it cannot run")]
    BadGenome,
    /// The flash reports an error, or does not hold what was written. The update is over.
    #[error("the robot's flash has failed")]
    Flash,
    /// This robot cannot do that.
    #[error("the robot cannot do that")]
    Unsupported,
    /// The slots' write count has reached its maximum. Firmware older than this variant answers
    /// [`Refusal::Flash`].
    #[error(
        "the robot's write count has reached its maximum, so it accepts no more genomes over \
         the line; erase both of its genome slots with a debug probe to restart the count at 1"
    )]
    CountExhausted,
}

/// A frame with a correct CRC that is not a message of this protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MalformedMessage {
    /// Another version of the protocol.
    #[error("protocol version {found}; this program speaks version {PROTOCOL_VERSION}")]
    OtherVersion {
        /// The first byte of the message.
        found: u8,
    },
    /// A request where a reply is expected, or a reply where a request is.
    #[error("a message in the wrong direction")]
    WrongWay,
    /// Not a message, or one with bytes left over or a chunk that is too long.
    #[error("not a message of this protocol")]
    NotAMessage,
}

/// Reads a request.
///
/// # Errors
/// [`MalformedMessage`].
pub fn decode_request(payload: &[u8]) -> Result<Envelope<Request<'_>>, MalformedMessage> {
    let envelope: Envelope<Request<'_>> = decode(payload, Direction::Request)?;
    match envelope.body {
        Request::Chunk { data, .. } if data.len() > CHUNK_BYTES_MAX => {
            Err(MalformedMessage::NotAMessage)
        }
        Request::Identify => Ok(envelope),
        _ if envelope.sequence == 0 => Err(MalformedMessage::NotAMessage),
        _ => Ok(envelope),
    }
}

/// Reads a reply.
///
/// # Errors
/// [`MalformedMessage`].
pub fn decode_reply(payload: &[u8]) -> Result<Envelope<Reply<'_>>, MalformedMessage> {
    decode(payload, Direction::Reply)
}

fn decode<'a, B: Deserialize<'a>>(
    payload: &'a [u8],
    direction: Direction,
) -> Result<Envelope<B>, MalformedMessage> {
    match payload {
        [PROTOCOL_VERSION, way, ..] if *way == direction as u8 => {}
        [PROTOCOL_VERSION, ..] => return Err(MalformedMessage::WrongWay),
        [found, ..] => return Err(MalformedMessage::OtherVersion { found: *found }),
        [] => return Err(MalformedMessage::NotAMessage),
    }
    match postcard::take_from_bytes(payload) {
        Ok((envelope, [])) => Ok(envelope),
        _ => Err(MalformedMessage::NotAMessage),
    }
}
