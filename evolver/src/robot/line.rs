//! A serial port, and requests sent over it one at a time.

use super::error::{Doing, Heard, OtherReader, Problem, RobotError};
use super::port_name::PortName;
use minimal_surprise_link::{Client, MalformedMessage, Refusal, Reply, Request};
use serialport::SerialPort;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Time limit for sending a request; at 9,600 baud, the longest request takes 160 ms.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);
/// Pause before a retry if a port reported that it was ready but was not.
const PAUSE: Duration = Duration::from_millis(1);

/// A flag that is never set, for operations that must not be interrupted.
static NEVER: AtomicBool = AtomicBool::new(false);

/// An open port and its conversation with a robot.
pub(super) struct Line {
    name: PortName,
    baud: u32,
    port: Box<dyn SerialPort>,
    client: Client,
    /// Number of bytes received in this conversation.
    received: u64,
    /// True once any reply has been received.
    answered: bool,
    /// True if bytes had arrived but another program read them first.
    shared: bool,
    /// Flag that stops the sending of requests once it is set.
    stop: &'static AtomicBool,
}

impl Line {
    /// Opens the port without sending anything. The first request is repeated for up to `wait`.
    /// Once `stop` is set, no more requests are sent.
    pub(super) fn open(
        name: &PortName,
        baud: u32,
        wait: Duration,
        stop: &'static AtomicBool,
    ) -> Result<Self, RobotError> {
        let about = |problem| RobotError {
            port: name.clone(),
            problem,
            left: None,
        };
        let path = name.0.as_path();
        if path.is_file() || path.is_dir() {
            return Err(about(Problem::NotAPort { ports: ports() }));
        }
        // The serial library accepts only UTF-8.
        let text = path.to_str().ok_or_else(|| about(Problem::NotUtf8))?;
        let port = open_port(text, baud).map_err(|error| {
            about(match error.kind {
                serialport::ErrorKind::Io(ErrorKind::NotFound) => {
                    Problem::NoSuchPort { ports: ports() }
                }
                // On Windows, this is also the error for a missing port.
                serialport::ErrorKind::NoDevice if cfg!(unix) => Problem::InUse,
                serialport::ErrorKind::Unknown if is_another_device(path) => {
                    Problem::NotAPort { ports: ports() }
                }
                _ => Problem::NotOpened(error),
            })
        })?;
        let patience = Request::Identify.timeout_ms().into();
        let attempts = wait.as_millis().div_ceil(patience) as u32 + 1;
        Ok(Self {
            name: name.clone(),
            baud,
            port,
            client: Client::new(rand::random(), attempts),
            received: 0,
            answered: false,
            shared: false,
            stop,
        })
    }

    /// Ignores `stop` after this call.
    pub(super) fn finish(&mut self) {
        self.stop = &NEVER;
    }

    /// Starts a new conversation.
    pub(super) fn start_over(&mut self) {
        self.client = Client::new(rand::random(), Client::ATTEMPTS_MAX);
        self.received = 0;
    }

    /// Sends a request, repeatedly if necessary, until a reply arrives; `take` extracts the result.
    pub(super) fn ask<T>(
        &mut self,
        doing: Doing,
        request: &Request<'_>,
        take: impl FnOnce(Reply<'_>) -> Option<T>,
    ) -> Result<T, RobotError> {
        if self.answered {
            self.client.set_attempts_max(Client::ATTEMPTS_MAX);
        }
        let patience = Duration::from_millis(request.timeout_ms().into());
        let started = Instant::now();
        let mut bytes = match self.client.request(request) {
            Ok(bytes) => bytes.to_vec(),
            // Unreachable in practice: requests are always completed, and a conversation allows
            // more requests than any run needs.
            Err(error) => {
                let error = io::Error::other(error);
                return Err(self.about(Problem::Broken { doing, error }));
            }
        };
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(self.about(Problem::Interrupted { doing }));
            }
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
            left: None,
        }
    }

    /// Returns the problem that explains a missing reply.
    fn silence(&self, doing: Doing, waited: Duration) -> Problem {
        let baud = self.baud;
        let reader = match self.shared {
            true => OtherReader::Certain,
            false => OtherReader::Possible,
        };
        let heard = match self.client.last_malformed() {
            _ if self.answered => return Problem::Unanswered { doing, reader },
            Some(MalformedMessage::WrongWay) => Heard::Echo,
            Some(MalformedMessage::OtherVersion { found }) => Heard::OtherVersion { found },
            Some(_) => Heard::Frames,
            None if self.received > 0 => Heard::Bytes {
                count: self.received,
            },
            None => {
                let seconds = waited.as_secs_f64();
                return Problem::Silent {
                    seconds,
                    baud,
                    reader,
                };
            }
        };
        Problem::OtherDevice {
            heard,
            baud,
            reader,
        }
    }

    fn send(&mut self, doing: Doing, mut bytes: &[u8]) -> Result<(), RobotError> {
        let deadline = Instant::now() + SEND_TIMEOUT;
        while !bytes.is_empty() {
            match self.by(deadline, |port| port.write(bytes)) {
                Ok(Some(count)) => bytes = &bytes[count..],
                // A line that accepts no bytes will not reply either; the missing reply is
                // reported.
                Ok(None) => break,
                Err(error) => return Err(self.broken(doing, error)),
            }
        }
        Ok(())
    }

    /// Receives bytes and returns their number; `None` at the deadline.
    fn receive(
        &mut self,
        doing: Doing,
        deadline: Instant,
        buffer: &mut [u8],
    ) -> Result<Option<usize>, RobotError> {
        let mut gone = false;
        let read = self.by(deadline, |port| {
            let read = port.read(buffer);
            gone |= is_not_ready(&read);
            read
        });
        self.shared |= gone;
        read.map_err(|error| self.broken(doing, error))
    }

    /// Reads or writes as soon as the port is ready; returns `None` at the deadline.
    fn by(
        &mut self,
        deadline: Instant,
        mut transfer: impl FnMut(&mut dyn SerialPort) -> io::Result<usize>,
    ) -> io::Result<Option<usize>> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.port.set_timeout(left)?;
            match transfer(&mut *self.port) {
                transferred if is_not_ready(&transferred) => sleep(PAUSE),
                Ok(count) => return Ok(Some(count)),
                Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(None),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    fn broken(&self, doing: Doing, error: io::Error) -> RobotError {
        self.about(Problem::Broken { doing, error })
    }
}

/// Returns whether a port that reported that it was ready transferred nothing. An unplugged line
/// also transfers nothing, but then reports an error instead of being ready.
fn is_not_ready(transferred: &io::Result<usize>) -> bool {
    match transferred {
        Ok(count) => *count == 0,
        Err(error) => error.kind() == ErrorKind::WouldBlock,
    }
}

/// Opens a port that waits only before a read or write, never during one. Otherwise, if another
/// program took the byte that had arrived, the read would wait for the next byte without a time
/// limit.
#[cfg(unix)]
fn open_port(name: &str, baud: u32) -> serialport::Result<Box<dyn SerialPort>> {
    let port = serialport::new(name, baud).open_native()?;
    // The flag applies to the open file, which both descriptors share.
    let set = filedescriptor::FileDescriptor::dup(&port)
        .and_then(|mut duplicate| duplicate.set_non_blocking(true));
    match set {
        Ok(()) => Ok(Box::new(port)),
        Err(error) => {
            let kind = serialport::ErrorKind::Io(ErrorKind::Other);
            Err(serialport::Error::new(kind, error.to_string()))
        }
    }
}

/// Returns whether this path exists and is not a terminal line.
#[cfg(unix)]
fn is_another_device(path: &Path) -> bool {
    use nix::libc::{O_NOCTTY, O_NONBLOCK};
    use std::io::IsTerminal;
    use std::os::unix::fs::OpenOptionsExt;
    let mut options = std::fs::OpenOptions::new();
    options.read(true).custom_flags(O_NOCTTY | O_NONBLOCK);
    options.open(path).is_ok_and(|file| !file.is_terminal())
}

#[cfg(not(unix))]
fn is_another_device(_: &Path) -> bool {
    false
}

/// Opens a port whose reads and writes have a time limit.
#[cfg(not(unix))]
fn open_port(name: &str, baud: u32) -> serialport::Result<Box<dyn SerialPort>> {
    serialport::new(name, baud).timeout(SEND_TIMEOUT).open()
}

/// Returns whether the robot has lost the session.
pub(super) fn is_lost_session(problem: &Problem) -> bool {
    matches!(
        problem,
        Problem::Refused {
            refusal: Refusal::NoSession,
            ..
        }
    )
}

/// Returns the names of the ports that the operating system lists.
fn ports() -> Vec<String> {
    let ports = serialport::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.port_name).collect()
}
