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

/// Direction of a message, so that an echo is not mistaken for a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// From the host to the robot; encoded as 0.
    Request,
    /// From the robot to the host; encoded as 1.
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
    /// The session that the message belongs to: a number that the host has not used before.
    pub session: u32,
    /// Number of the request in its session, counted from 0; a reply has the number of its request.
    pub sequence: u32,
    /// The [`Request`] or [`Reply`].
    pub body: B,
}

/// A request from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Identify the robot. Request 0 of every session. Reply: [`Reply::Identity`].
    Identify,
    /// Start an update: erase the slot that is not in use, then expect a genome container. Reply:
    /// [`Reply::Done`].
    Begin {
        /// Length of the container, in bytes.
        length: u16,
        /// The container's last four bytes, little-endian.
        crc: u32,
    },
    /// Write the next bytes of the container. Reply: [`Reply::Done`].
    Chunk {
        /// Number of container bytes before this chunk.
        offset: u16,
        /// The chunk, at most [`CHUNK_BYTES_MAX`] bytes.
        data: &'a [u8],
    },
    /// Check the complete container and switch to it. Reply: [`Reply::Committed`].
    Commit,
    /// Run one control step with these readings instead of the robot's own, without moving. Reply:
    /// [`Reply::Stepped`].
    Step {
        /// The readings, bit k for sensor k.
        sensors: SensorBits,
    },
    /// Reset the controller's state to its initial value. Reply: [`Reply::Done`].
    Reset,
    /// Run the control loop. Reply: [`Reply::Done`].
    Start,
    /// Stop motors and control loop. Reply: [`Reply::Done`].
    Stop,
    /// Report the status. Reply: [`Reply::Telemetry`].
    Telemetry,
}

impl Request<'_> {
    /// Returns the time to wait for the reply before repeating the request, in milliseconds: 500,
    /// or 10,000 for [`Request::Begin`], which may erase 128 KiB and more.
    #[must_use]
    pub const fn timeout_ms(&self) -> u32 {
        match self {
            Self::Begin { .. } => 10_000,
            _ => 500,
        }
    }
}

/// A reply from the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply<'a> {
    /// Reply to [`Request::Identify`].
    #[serde(borrow)]
    Identity(Identity<'a>),
    /// The request was executed; there is no result to report.
    Done,
    /// The genome is in use, even after a restart.
    Committed {
        /// Number of the genome among all written to this robot.
        write_count: u32,
    },
    /// Reply to [`Request::Step`].
    Stepped(Stepped),
    /// Reply to [`Request::Telemetry`].
    Telemetry {
        /// The robot's report.
        report: Report,
        /// Counters of the robot's end of the line.
        line: LineCounters,
    },
    /// The request was refused.
    Refused(Refusal),
}

/// Firmware, genome and status of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity<'a> {
    /// Name of the firmware, at most [`FIRMWARE_BYTES_MAX`] bytes.
    pub firmware: &'a str,
    /// Version of the firmware, at most [`VERSION_BYTES_MAX`] bytes.
    pub version: &'a str,
    /// The arithmetic that the firmware uses.
    pub kernel: KernelId,
    /// The genome in use.
    pub genome: GenomeInUse,
    /// True if the control loop runs.
    pub running: bool,
    /// Current faults.
    pub faults: Faults,
}

/// Origin of the genome in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GenomeInUse {
    /// The built-in genome, because no slot holds a genome to run: the robot only turns.
    BuiltIn,
    /// A genome that was written to a slot.
    Slot {
        /// Index of the slot, 0 or 1.
        slot: u8,
        /// Number of the genome among all genomes written to this robot, counted from 1.
        write_count: u32,
        /// Length of the container, in bytes.
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
    /// No slot holds a genome to run; the built-in genome is in use.
    pub const NO_GENOME: Self = Self(1);
    /// A stored genome can no longer be run.
    pub const SLOT_DAMAGED: Self = Self(1 << 1);
    /// The flash has reported an error.
    pub const FLASH: Self = Self(1 << 2);
    /// The latest neighbour data is too old; the robot has stopped.
    pub const NEIGHBOURS_STALE: Self = Self(1 << 3);
    /// The watchdog caused the last restart.
    pub const WATCHDOG: Self = Self(1 << 4);

    /// Returns the union of both sets of faults.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns true if these faults include all of `other`.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// Result of one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Stepped {
    /// Action, turn, and the prediction for the next reading.
    pub decision: Decision,
    /// Surprise since the start or the last reset.
    pub surprise: Surprise,
}

/// Status of a robot and its activity since its start or the last reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// True if the control loop runs.
    pub running: bool,
    /// Counts of mispredicted and sensed bits.
    pub surprise: Surprise,
    /// Number of steps that decided to go straight.
    pub straight: u32,
    /// Number of straight steps that the guard suppressed because the cell ahead was occupied.
    pub held_back: u32,
    /// Number of steps that decided to turn left.
    pub turned_left: u32,
    /// Number of steps that decided to turn right.
    pub turned_right: u32,
    /// Current faults.
    pub faults: Faults,
}

/// Counts of the data that has arrived at the robot since its start. Counters saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineCounters {
    /// Number of requests executed or refused.
    pub accepted: u32,
    /// Number of repeated requests: the reply was sent again, but the request not executed again.
    pub repeated: u32,
    /// Number of requests that arrived too late or do not belong to the open session; they are not
    /// executed.
    pub stale: u32,
    /// Number of frames with a correct CRC that are not a request of this protocol.
    pub malformed: u32,
    /// Number of frames with a wrong CRC.
    pub bad_crc: u32,
    /// Number of byte sequences between zeros that are not valid frames: damaged, truncated or too
    /// long.
    pub no_frame: u32,
}

/// Reason why a request was not executed. Unless stated otherwise for a variant, nothing has
/// changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// The session is unknown: the robot was restarted, or a different host is using the line.
    #[error(
        "the robot has lost the session: it was restarted, or another program is using the line"
    )]
    NoSession,
    /// The robot must be stopped first.
    #[error("the robot is running; stop it first")]
    Running,
    /// No update has begun.
    #[error("no genome is being written")]
    NotBegun,
    /// The chunk is out of order.
    #[error("the robot expects the bytes from offset {expected} onwards")]
    WrongOffset {
        /// Number of bytes received so far.
        expected: u16,
    },
    /// The length is not valid for a container.
    #[error("the robot has no room for a genome of that length")]
    ImpossibleLength,
    /// The container is longer or shorter than the stated length.
    #[error("the genome's length differs from the stated length")]
    OtherLength,
    /// The container does not match the stated CRC, or this robot cannot run it. The update is
    /// aborted.
    #[error("the robot has received a genome that it cannot run")]
    BadGenome,
    /// The flash reports an error, or does not hold the bytes written. The update is aborted.
    #[error("the robot's flash has failed")]
    Flash,
    /// This robot does not support the request.
    #[error("the robot does not support the request")]
    Unsupported,
    /// The slots' write count has reached its maximum. Firmware older than this variant replies
    /// with [`Refusal::Flash`].
    #[error(
        "the robot's write count has reached its maximum, so it accepts no more genomes over \
         the line; erase both of its genome slots with a debug probe to restart the count at 1"
    )]
    CountExhausted,
}

/// Reason why a frame with a correct CRC is not a message of this protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MalformedMessage {
    /// The message has a different protocol version.
    #[error("protocol version {found}; this program uses version {PROTOCOL_VERSION}")]
    OtherVersion {
        /// The first byte of the message.
        found: u8,
    },
    /// A request arrived instead of a reply, or a reply instead of a request.
    #[error("a message in the wrong direction")]
    WrongWay,
    /// The bytes are not a message, surplus bytes follow the message, or the message's chunk is too
    /// long.
    #[error("not a message of this protocol")]
    NotAMessage,
}

/// Decodes a request.
///
/// # Errors
/// [`MalformedMessage`] if the payload is not a request of this protocol.
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

/// Decodes a reply.
///
/// # Errors
/// [`MalformedMessage`] if the payload is not a reply of this protocol.
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
