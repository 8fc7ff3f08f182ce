//! What can go wrong between this program and a robot.

use super::PortName;
use minimal_surprise_controller::{KERNEL_ID, KernelId};
use minimal_surprise_link::Refusal;

/// A port, and what is wrong with it or with what is behind it.
#[derive(Debug, thiserror::Error)]
#[error("--port = {port}: {problem}{}", left.as_ref().map_or(String::new(), |left| format!("; {left}")))]
pub struct RobotError {
    /// The port.
    pub port: PortName,
    /// What is wrong.
    pub problem: Problem,
    /// How the robot is left and what to do about it, if not as it was found.
    pub left: Option<String>,
}

/// What is wrong.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// Nothing has this name.
    #[error("no such port; {}", present(ports))]
    NoSuchPort {
        /// The ports that there are.
        ports: Vec<String>,
    },
    /// A file, a folder or another device has this name.
    #[error("a file, folder or device that is no serial port; {}", present(ports))]
    NotAPort {
        /// The ports that there are.
        ports: Vec<String>,
    },
    /// It cannot be handed to the operating system.
    #[error(
        "its name is not UTF-8, and ports with such names cannot be opened; give a symbolic link to \
         it another name, and use that"
    )]
    NotUtf8,
    /// Another program has it.
    #[error("the port is in use by another program; close that first")]
    InUse,
    /// The operating system does not give it.
    #[error("the port cannot be opened: {0}")]
    NotOpened(serialport::Error),
    /// Not a byte has come.
    #[error(
        "silence for {seconds:.1} s; expected a robot that is switched on, at {baud} baud (--baud){reader}{RESTARTS}"
    )]
    Silent {
        /// How long it was waited for.
        seconds: f64,
        /// The speed.
        baud: u32,
        /// Who else may have read what came.
        reader: OtherReader,
    },
    /// Something has come, but nothing that a robot says.
    #[error(
        "another device is talking: {heard}; expected a robot at {baud} baud (--baud){reader}{RESTARTS}"
    )]
    OtherDevice {
        /// What was heard.
        heard: Heard,
        /// The speed.
        baud: u32,
        /// Who else may have read what came.
        reader: OtherReader,
    },
    /// The robot computes differently.
    #[error("the robot is kernel {robot}, this program is kernel {KERNEL_ID}; update one of them")]
    OtherKernel {
        /// The robot's.
        robot: KernelId,
    },
    /// The port has gone.
    #[error("the line broke while the robot was {doing}: {error}{}", doing.consequence())]
    Broken {
        /// What was going on.
        doing: Doing,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// The robot has answered before, and does no longer.
    #[error("no answer any more, while the robot was {doing}{}{reader}", doing.consequence())]
    Unanswered {
        /// What was going on.
        doing: Doing,
        /// Who else may have read what came.
        reader: OtherReader,
    },
    /// The user has asked for an end.
    #[error("interrupted while the robot was {doing}{}", doing.consequence())]
    Interrupted {
        /// What was going on.
        doing: Doing,
    },
    /// The robot says no.
    #[error("refused while the robot was {doing}: {refusal}{}", doing.consequence_of(*refusal))]
    Refused {
        /// What was going on.
        doing: Doing,
        /// Its reason.
        refusal: Refusal,
    },
    /// An answer to another question.
    #[error("an answer that does not belong to the question, while the robot was {doing}")]
    OtherAnswer {
        /// What was going on.
        doing: Doing,
    },
    /// Numbers that no robot can have.
    #[error("the robot reports impossible {what}")]
    Impossible {
        /// Which, and why.
        what: String,
    },
    /// It says that it has done it, and has not.
    #[error("the robot confirmed the genome, but runs {runs}; run the command again")]
    NotInUse {
        /// What it runs.
        runs: String,
    },
}

/// Ends a message about a robot that has not answered yet.
const RESTARTS: &str =
    "; a board that restarts when its port is opened may need longer, as with --wait 10";

/// Another program that reads the same port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherReader {
    /// There may be one.
    Possible,
    /// Bytes had arrived, and were gone when they were to be read.
    Certain,
}

impl std::fmt::Display for OtherReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Possible => "; another program may be reading the port",
            Self::Certain => "; another program is reading the port: close that first",
        })
    }
}

/// What a robot is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// Saying who it is.
    Identifying,
    /// Starting, stopping, or forgetting the past.
    Switching,
    /// Being written to.
    Receiving,
    /// Taking a genome into use.
    Committing,
    /// Single steps.
    Stepping,
    /// Telling how it is going.
    Reporting,
}

impl Doing {
    /// What this means for the robot, if that is not plain.
    fn consequence(self) -> &'static str {
        match self {
            Self::Receiving => "; it keeps the genome that it had",
            Self::Committing => {
                "; it has either the genome that it had or the new one: run the command again"
            }
            _ => "",
        }
    }

    /// The same after a refusal. A genome that is refused is not in use. But of a lost session it is
    /// not known whether the request had been carried out before, and a memory that could not be
    /// read may have the genome after a restart.
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

/// What came instead of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// What was sent.
    Echo,
    /// A message of another version of the protocol.
    OtherVersion {
        /// That version.
        found: u8,
    },
    /// Frames, but no answer.
    Frames,
    /// Bytes.
    Bytes {
        /// So many.
        count: u64,
    },
}

impl std::fmt::Display for Heard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Echo => write!(f, "it only sends back what it is sent"),
            Self::OtherVersion { found } => write!(
                f,
                "it speaks version {found} of the protocol, this program version {}",
                minimal_surprise_link::PROTOCOL_VERSION
            ),
            Self::Frames => write!(f, "its frames are no answers"),
            Self::Bytes { count } => write!(f, "{count} bytes without a message came from it"),
        }
    }
}

fn present(ports: &[String]) -> String {
    match ports {
        [] => "none is found on this machine".to_owned(),
        ports => format!("on this machine are {}", ports.join(", ")),
    }
}
