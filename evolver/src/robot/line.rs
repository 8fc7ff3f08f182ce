//! One serial port, and one question after another over it.

use super::error::{Doing, Heard, Problem, RobotError};
use minimal_surprise_link::{Client, MalformedMessage, Refusal, Reply, Request};
use serialport::SerialPort;
use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest that sending a request may take; at 9,600 baud the longest takes 160 ms.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);

/// How a user names a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortName(pub String);

impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A port with a conversation.
pub(super) struct Line {
    name: PortName,
    baud: u32,
    port: Box<dyn SerialPort>,
    client: Client,
    /// Bytes that have come in this conversation.
    received: u64,
    /// Whether an answer has ever come.
    answered: bool,
}

impl Line {
    /// Opens the port; says nothing yet.
    pub(super) fn open(name: &PortName, baud: u32) -> Result<Self, RobotError> {
        let about = |problem| RobotError {
            port: name.clone(),
            problem,
        };
        let path = Path::new(&name.0);
        if path.is_file() || path.is_dir() {
            return Err(about(Problem::NotAPort { ports: ports() }));
        }
        let opened = serialport::new(&name.0, baud).timeout(SEND_TIMEOUT).open();
        let port = opened.map_err(|error| {
            about(match error.kind {
                serialport::ErrorKind::Io(ErrorKind::NotFound) => {
                    Problem::NoSuchPort { ports: ports() }
                }
                _ => Problem::NotOpened(error),
            })
        })?;
        Ok(Self {
            name: name.clone(),
            baud,
            port,
            client: new_client(),
            received: 0,
            answered: false,
        })
    }

    /// Begins another conversation.
    pub(super) fn start_over(&mut self) {
        self.client = new_client();
        self.received = 0;
    }

    /// Asks, as often as it takes, until the answer is there; `take` gets out of it what is wanted.
    pub(super) fn ask<T>(
        &mut self,
        doing: Doing,
        request: &Request<'_>,
        take: impl FnOnce(Reply<'_>) -> Option<T>,
    ) -> Result<T, RobotError> {
        let patience = Duration::from_millis(request.timeout_ms().into());
        let started = Instant::now();
        let mut bytes = match self.client.request(request) {
            Ok(bytes) => bytes.to_vec(),
            // Every question is asked to its end, and a conversation has more than any run needs.
            Err(error) => {
                let error = io::Error::other(error);
                return Err(self.about(Problem::Broken { doing, error }));
            }
        };
        loop {
            self.send(doing, &bytes)?;
            let deadline = Instant::now() + patience;
            let mut buffer = [0; 256];
            while let Some(count) = self.receive(doing, deadline, &mut buffer)? {
                self.received += count as u64;
                for &byte in &buffer[..count] {
                    let Some(reply) = self.client.feed(byte) else {
                        continue;
                    };
                    self.answered = true;
                    let problem = match reply {
                        Reply::Refused(refusal) => Problem::Refused { doing, refusal },
                        reply => match take(reply) {
                            Some(taken) => return Ok(taken),
                            None => Problem::OtherAnswer { doing },
                        },
                    };
                    return Err(self.about(problem));
                }
            }
            match self.client.timed_out() {
                Ok(again) => bytes = again.to_vec(),
                Err(_) => return Err(self.about(self.silence(doing, started.elapsed()))),
            }
        }
    }

    pub(super) fn about(&self, problem: Problem) -> RobotError {
        RobotError {
            port: self.name.clone(),
            problem,
        }
    }

    /// Why there was no answer.
    fn silence(&self, doing: Doing, waited: Duration) -> Problem {
        let baud = self.baud;
        let heard = match self.client.last_malformed() {
            _ if self.answered => return Problem::Unanswered { doing },
            Some(MalformedMessage::WrongWay) => Heard::Echo,
            Some(MalformedMessage::OtherVersion { found }) => Heard::OtherVersion { found },
            Some(MalformedMessage::NotAMessage) => Heard::Frames,
            None if self.received > 0 => Heard::Bytes {
                count: self.received,
            },
            None => {
                let seconds = waited.as_secs_f64();
                return Problem::Silent { seconds, baud };
            }
        };
        Problem::OtherDevice { heard, baud }
    }

    fn send(&mut self, doing: Doing, bytes: &[u8]) -> Result<(), RobotError> {
        let sent = self
            .port
            .set_timeout(SEND_TIMEOUT)
            .map_err(io::Error::from)
            .and_then(|()| self.port.write_all(bytes));
        match sent {
            // A line that takes nothing is one that does not answer either.
            Err(error) if error.kind() != ErrorKind::TimedOut => Err(self.broken(doing, error)),
            _ => Ok(()),
        }
    }

    /// Bytes that have come; none at the deadline.
    fn receive(
        &mut self,
        doing: Doing,
        deadline: Instant,
        buffer: &mut [u8],
    ) -> Result<Option<usize>, RobotError> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let read = self
                .port
                .set_timeout(left)
                .map_err(io::Error::from)
                .and_then(|()| self.port.read(buffer));
            match read {
                Ok(0) => return Err(self.broken(doing, ErrorKind::UnexpectedEof.into())),
                Ok(count) => return Ok(Some(count)),
                Err(error) => match error.kind() {
                    ErrorKind::TimedOut => return Ok(None),
                    ErrorKind::Interrupted => {}
                    _ => return Err(self.broken(doing, error)),
                },
            }
        }
    }

    fn broken(&self, doing: Doing, error: io::Error) -> RobotError {
        self.about(Problem::Broken { doing, error })
    }
}

fn new_client() -> Client {
    Client::new(rand::random(), Client::ATTEMPTS_MAX)
}

/// Whether the robot has lost the conversation.
pub(super) fn is_lost_session(problem: &Problem) -> bool {
    matches!(
        problem,
        Problem::Refused {
            refusal: Refusal::NoSession,
            ..
        }
    )
}

/// The names of the ports that the operating system tells of.
fn ports() -> Vec<String> {
    let ports = serialport::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.port_name).collect()
}
