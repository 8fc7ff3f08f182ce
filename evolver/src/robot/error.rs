//! Errors in the communication with a robot.

use super::port_name::PortName;
use minimal_surprise_controller::{KERNEL_ID, KernelId};
use minimal_surprise_link::Refusal;

/// A problem with a port or its robot, with the robot's resulting state.
#[derive(Debug, thiserror::Error)]
#[error("--port = {port}: {problem}{}", left.as_ref().map_or(String::new(), |left| format!("; {left}")))]
pub struct RobotError {
    /// The port.
    pub port: PortName,
    /// The problem.
    pub problem: Problem,
    /// The robot's state and advice for the user; empty if the command has not changed the state.
    pub left: Option<String>,
}

/// A problem with a port or a robot.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The port does not exist.
    #[error("no such port; {}", present(ports))]
    NoSuchPort {
        /// The existing ports.
        ports: Vec<String>,
    },
    /// The name refers to a file, folder or other device.
    #[error(
        "not a serial port, but a file, folder or other device; {}",
        present(ports)
    )]
    NotAPort {
        /// The existing ports.
        ports: Vec<String>,
    },
    /// The name cannot be passed to the serial library.
    #[error(
        "its name is not UTF-8, and such ports cannot be opened; create a symbolic link to it with a \
         UTF-8 name, and use the link"
    )]
    NotUtf8,
    /// Another program uses the port.
    #[error("the port is in use by another program; close that program first")]
    InUse,
    /// The operating system cannot open the port.
    #[error("the port cannot be opened: {0}")]
    NotOpened(serialport::Error),
    /// Nothing was received.
    #[error(
        "nothing received for {seconds:.1} s; expected a robot that is switched on, at {baud} baud (--baud){reader}{RESTARTS}"
    )]
    Silent {
        /// Time waited, in seconds.
        seconds: f64,
        /// The baud rate.
        baud: u32,
        /// Possibility that another program has read the reply.
        reader: OtherReader,
    },
    /// Bytes were received, but no reply from a robot.
    #[error(
        "a different device is sending data: {heard}; expected a robot at {baud} baud (--baud){reader}{RESTARTS}"
    )]
    OtherDevice {
        /// The received data.
        heard: Heard,
        /// The baud rate.
        baud: u32,
        /// Possibility that another program has read the reply.
        reader: OtherReader,
    },
    /// The robot uses different arithmetic.
    #[error(
        "the robot has kernel {robot}, but this program has kernel {KERNEL_ID}; update one of them"
    )]
    OtherKernel {
        /// The robot's kernel.
        robot: KernelId,
    },
    /// The line failed, for example because it was unplugged.
    #[error("the line failed while the robot was {doing}: {error}{}", doing.consequence())]
    Broken {
        /// The robot's activity at that time.
        doing: Doing,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// The robot stopped replying.
    #[error("the robot stopped replying while it was {doing}{}{reader}", doing.consequence())]
    Unanswered {
        /// The robot's activity at that time.
        doing: Doing,
        /// Possibility that another program has read the reply.
        reader: OtherReader,
    },
    /// The user interrupted the command.
    #[error("interrupted while the robot was {doing}{}", doing.consequence())]
    Interrupted {
        /// The robot's activity at that time.
        doing: Doing,
    },
    /// The robot rejected the request.
    #[error("request rejected while the robot was {doing}: {refusal}{}", doing.consequence_of(*refusal))]
    Refused {
        /// The robot's activity at that time.
        doing: Doing,
        /// The robot's reason.
        refusal: Refusal,
    },
    /// The reply does not match the request.
    #[error("the reply does not match the request, while the robot was {doing}")]
    OtherAnswer {
        /// The robot's activity at that time.
        doing: Doing,
    },
    /// The robot reports values that are impossible.
    #[error("the robot reports impossible {what}")]
    Impossible {
        /// The values, and why they are impossible.
        what: String,
    },
    /// The robot confirmed the genome, but does not run it.
    #[error("the robot confirmed the genome, but runs {runs}; run the command again")]
    NotInUse {
        /// The genome that the robot runs.
        runs: String,
    },
}

/// End of a message about a robot that has never replied.
const RESTARTS: &str =
    "; a board that restarts when its port is opened may need a longer wait, such as --wait 10";

/// Possibility that another program reads the same port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherReader {
    /// Possibly.
    Possible,
    /// Certainly: bytes had arrived, but another program read them first.
    Certain,
}

impl std::fmt::Display for OtherReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Possible => "; another program may be reading the port",
            Self::Certain => "; another program is reading the port: close that program first",
        })
    }
}

/// The work that a robot is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// Identify itself.
    Identifying,
    /// Start, stop, or reset its controller.
    Switching,
    /// Receive a genome.
    Receiving,
    /// Put a genome into use.
    Committing,
    /// Make single steps.
    Stepping,
    /// Report its telemetry.
    Reporting,
}

impl Doing {
    /// Returns the consequence for the robot; an empty text if the consequence is obvious.
    fn consequence(self) -> &'static str {
        match self {
            Self::Receiving => "; it keeps its old genome",
            Self::Committing => {
                "; it has either its old genome or the new one: run the command again"
            }
            _ => "",
        }
    }

    /// Returns the consequence of a rejected request. A rejected genome is not in use. However, if
    /// the session was lost, the request may already have been executed; and if the flash could not
    /// be read, the robot may run the new genome after a restart.
    fn consequence_of(self, refusal: Refusal) -> &'static str {
        match (self, refusal) {
            (Self::Committing, Refusal::NoSession | Refusal::Flash) => self.consequence(),
            (Self::Committing, _) => Self::Receiving.consequence(),
            _ => self.consequence(),
        }
    }
}

impl std::fmt::Display for Doing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Identifying => "identifying itself",
            Self::Switching => "starting or stopping",
            Self::Receiving => "receiving a genome",
            Self::Committing => "committing a genome",
            Self::Stepping => "stepping",
            Self::Reporting => "reporting",
        })
    }
}

/// Received data that is not a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A copy of the bytes that were sent.
    Echo,
    /// A message in a different version of the protocol.
    OtherVersion {
        /// The version.
        found: u8,
    },
    /// Frames that are not replies.
    Frames,
    /// Bytes that are not frames.
    Bytes {
        /// Number of bytes.
        count: u64,
    },
}

impl std::fmt::Display for Heard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Echo => write!(f, "it only echoes the requests"),
            Self::OtherVersion { found } => write!(
                f,
                "it uses version {found} of the protocol, but this program uses version {}",
                minimal_surprise_link::PROTOCOL_VERSION
            ),
            Self::Frames => write!(f, "its frames are not replies"),
            Self::Bytes { count } => write!(f, "it sent {count} bytes without a message"),
        }
    }
}

fn present(ports: &[String]) -> String {
    match ports {
        [] => "this machine has no serial ports".to_owned(),
        ports => format!("this machine has {}", ports.join(", ")),
    }
}
