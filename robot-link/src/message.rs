//! What is said: requests, replies, and the envelope around them.

use minimal_surprise_controller::{Decision, KernelId, SensorBits, Surprise};
use serde::{Deserialize, Serialize};

/// Version of the protocol, the first byte of every message.
pub const PROTOCOL_VERSION: u8 = 1;
/// Most bytes of a genome in one request.
pub const CHUNK_BYTES_MAX: usize = 128;
/// Most bytes of a firmware's name; what is beyond is cut off.
pub const FIRMWARE_BYTES_MAX: usize = 32;
/// Most bytes of a firmware's version; what is beyond is cut off.
pub const VERSION_BYTES_MAX: usize = 16;

/// Which way a message goes; an echo is not an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// From the host to the robot. 0.
    Request,
    /// From the robot to the host. 1.
    Reply,
}

/// A message and what it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Envelope<B> {
    /// [`PROTOCOL_VERSION`].
    pub version: u8,
    /// Which way it goes.
    pub direction: Direction,
    /// The conversation that it belongs to; the host chooses a number that it has not used before.
    pub session: u32,
    /// Number of the request in the session, from 0 on; a reply has that of its request.
    pub sequence: u32,
    /// [`Request`] or [`Reply`].
    pub body: B,
}

/// What the host may ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Who are you? Number 0 of every session is this. Answer: [`Reply::Identity`].
    Identify,
    /// A genome container will come; erases the slot that is not in use. Answer: [`Reply::Done`].
    Begin {
        /// Bytes of the container.
        length: u16,
        /// Its last four bytes, little-endian.
        crc: u32,
    },
    /// The next bytes of the container. Answer: [`Reply::Done`].
    Chunk {
        /// Bytes that came before.
        offset: u16,
        /// At most [`CHUNK_BYTES_MAX`] bytes.
        data: &'a [u8],
    },
    /// All has been sent: check it, and run it from now on. Answer: [`Reply::Committed`].
    Commit,
    /// One control step with these readings instead of the robot's own, without moving. Answer:
    /// [`Reply::Stepped`].
    Step {
        /// The readings, bit k for sensor k.
        sensors: SensorBits,
    },
    /// Forget the past: the controller's state as at the start. Answer: [`Reply::Done`].
    Reset,
    /// Run the control loop. Answer: [`Reply::Done`].
    Start,
    /// Stop motors and control loop. Answer: [`Reply::Done`].
    Stop,
    /// How is it going? Answer: [`Reply::Telemetry`].
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

/// What the robot answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply<'a> {
    /// To [`Request::Identify`].
    #[serde(borrow)]
    Identity(Identity<'a>),
    /// It is done, and there is nothing to say about it.
    Done,
    /// The genome is in use, also after a restart.
    Committed {
        /// Place of the genome among all that were written to this robot.
        write_count: u32,
    },
    /// To [`Request::Step`].
    Stepped(Stepped),
    /// To [`Request::Telemetry`].
    Telemetry {
        /// What the robot says.
        report: Report,
        /// What its end of the line says.
        line: LineCounters,
    },
    /// It was not done.
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
    /// The arithmetic that it computes with.
    pub kernel: KernelId,
    /// The genome in use.
    pub genome: GenomeInUse,
    /// Whether the control loop runs.
    pub running: bool,
    /// What is wrong.
    pub faults: Faults,
}

/// Where the genome in use comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GenomeInUse {
    /// The built-in one, for want of any other: the robot only turns.
    BuiltIn,
    /// One that was written.
    Slot {
        /// Which slot, 0 or 1.
        slot: u8,
        /// Its place among all genomes written to this robot, from 1 on.
        write_count: u32,
        /// Bytes of the container.
        length: u16,
        /// The container's last four bytes, little-endian.
        crc: u32,
    },
}

/// What is wrong with a robot, one bit a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults(pub u16);

impl Faults {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// No slot holds a genome to run; the built-in one is in use.
    pub const NO_GENOME: Self = Self(1);
    /// A genome that was written can no longer be run.
    pub const SLOT_DAMAGED: Self = Self(1 << 1);
    /// The flash has reported an error.
    pub const FLASH: Self = Self(1 << 2);
    /// The last neighbour data is too old; the robot stands.
    pub const NEIGHBOURS_STALE: Self = Self(1 << 3);
    /// The last restart was the watchdog's.
    pub const WATCHDOG: Self = Self(1 << 4);

    /// These and those.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether all of `other` are among these.
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
    /// Of these, those that the guard held back, for the cell ahead was occupied.
    pub held_back: u32,
    /// Steps that decided to turn left.
    pub turned_left: u32,
    /// Steps that decided to turn right.
    pub turned_right: u32,
    /// What is wrong.
    pub faults: Faults,
}

/// What has arrived at the robot since its start. Counters stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LineCounters {
    /// Requests carried out or refused.
    pub accepted: u32,
    /// Requests that were answered again, not done again.
    pub repeated: u32,
    /// Requests that came too late or of no open session; not done.
    pub stale: u32,
    /// Frames whose CRC was right but that are no request of this protocol.
    pub malformed: u32,
    /// Frames with a wrong CRC.
    pub bad_crc: u32,
    /// Bytes between two zero bytes that are no frame: broken, cut off or too long.
    pub no_frame: u32,
}

/// Why a request was not carried out. Nothing has changed, unless it says so.
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
    /// Chunks come in order.
    #[error("the robot expects the bytes from {expected} on")]
    WrongOffset {
        /// Bytes that it has.
        expected: u16,
    },
    /// No container is that long.
    #[error("the robot has no room for a genome of that length")]
    ImpossibleLength,
    /// Bytes beyond the length announced, or fewer than that.
    #[error("the genome's length is not the one announced")]
    OtherLength,
    /// The container is not the one announced, or none that this robot runs. The update is over.
    #[error("the robot has received a genome that it cannot run")]
    BadGenome,
    /// The flash reports an error, or does not hold what was written. The update is over.
    #[error("the robot's flash has failed")]
    Flash,
    /// This robot cannot do that.
    #[error("the robot cannot do that")]
    Unsupported,
    /// The slots' write count has reached its end. Robots of firmware before this variant answer
    /// [`Refusal::Flash`].
    #[error(
        "the robot's count of genomes written has reached its end, so that it takes no more over \
         the line; erase both of its genome slots with a debug probe, and it counts from 1 again"
    )]
    CountExhausted,
}

/// A frame whose CRC is right, but not of this protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MalformedMessage {
    /// Another version of the protocol.
    #[error("protocol version {found}; this program speaks version {PROTOCOL_VERSION}")]
    OtherVersion {
        /// The first byte of the message.
        found: u8,
    },
    /// A request where a reply is due, or the other way round.
    #[error("a message that goes the other way")]
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
