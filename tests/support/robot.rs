//! The robot under QEMU, with a serial port.

use crate::firmware::{Firmware, QEMU, no_qemu};
use crate::tools::Missing;
use minimal_surprise_link::{Client, GaveUp, Reply, Request};
use serialport::SerialPort;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// The arguments documented in `firmware-example/src/bin/robot.rs`. QEMU's clock shows wall-clock
/// time.
const QEMU_ARGUMENTS: &str = "-cpu cortex-m4 -machine mps2-an386 -nographic -monitor none \
    -serial pty -semihosting-config enable=on,target=native -kernel";

/// A running robot. It is killed on drop.
#[derive(Debug)]
pub struct QemuRobot {
    child: Child,
    /// The robot's serial port.
    pub port: String,
    /// The port, held open: QEMU checks only once per second whether a closed port is open again.
    _open: File,
}

impl QemuRobot {
    /// Starts the robot. Its flash is `flash.bin` in `folder`, which is created if missing; its log
    /// is discarded.
    ///
    /// # Errors
    /// [`Missing`] if QEMU is not installed.
    ///
    /// # Panics
    /// If QEMU does not print the name of the port.
    pub fn start(firmware: &Firmware, folder: &Path) -> Result<Self, Missing> {
        let child = Command::new(QEMU)
            .args(QEMU_ARGUMENTS.split_whitespace())
            .arg(firmware.elf("robot"))
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn();
        let mut child = match child {
            Ok(child) => child,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(no_qemu()),
            Err(error) => panic!("{QEMU}: {error}"),
        };
        let mut output = BufReader::new(child.stdout.take().expect("stdout is a pipe"));
        let mut line = Vec::new();
        output
            .read_until(b'\n', &mut line)
            .expect("QEMU can be read");
        let line = String::from_utf8_lossy(&line).into_owned();
        let port = line
            .split_whitespace()
            .find(|word| word.starts_with("/dev"));
        let port = port.unwrap_or_else(|| panic!("no serial port in {line:?}"));
        let port = port.to_owned();
        // If the pipe were full, the next log line would block the robot.
        thread::spawn(move || io::copy(&mut output, &mut io::sink()));
        let open = OpenOptions::new().read(true).write(true).open(&port);
        Ok(Self {
            child,
            _open: open.expect("QEMU has just created the port"),
            port,
        })
    }

    /// Cuts the robot's power by sending SIGKILL to QEMU.
    ///
    /// # Panics
    /// If QEMU cannot be killed.
    pub fn kill(mut self) {
        self.child.kill().expect("QEMU can be killed");
        self.child.wait().expect("QEMU has ended");
    }
}

impl Drop for QemuRobot {
    fn drop(&mut self) {
        // QEMU may already have exited; the error is then ignored.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The host's end of a serial line to a robot.
pub struct Line {
    port: Box<dyn SerialPort>,
    client: Client,
}

/// Error: the robot did not reply.
#[derive(Debug)]
pub enum LineError {
    /// The port reports an error because the robot is off.
    Port(io::Error),
    /// The robot does not reply.
    GaveUp(GaveUp),
}

impl From<io::Error> for LineError {
    fn from(error: io::Error) -> Self {
        Self::Port(error)
    }
}

impl Line {
    /// Opens a port and starts a session with this number.
    ///
    /// # Errors
    /// If the port does not exist.
    pub fn open(port: &str, session: u32) -> io::Result<Self> {
        let port = serialport::new(port, 115_200)
            .timeout(Duration::from_millis(10))
            .open()?;
        Ok(Self {
            port,
            client: Client::new(session, Client::ATTEMPTS_MAX),
        })
    }

    /// Sends a request and passes the reply to `answer`.
    ///
    /// # Errors
    /// [`LineError`] if the port reports an error or the robot does not reply.
    ///
    /// # Panics
    /// If the request cannot be sent.
    pub fn ask<T>(
        &mut self,
        request: &Request<'_>,
        answer: impl FnOnce(Reply<'_>) -> T,
    ) -> Result<T, LineError> {
        let wait = Duration::from_millis(request.timeout_ms().into());
        let frame = self
            .client
            .request(request)
            .expect("the request can be sent");
        self.port.write_all(frame)?;
        let mut overdue = Instant::now() + wait;
        loop {
            let mut bytes = [0; 64];
            let arrived = match self.port.read(&mut bytes) {
                Ok(0) => return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into()),
                Ok(arrived) => arrived,
                Err(error) if error.kind() == io::ErrorKind::TimedOut => 0,
                Err(error) => return Err(error.into()),
            };
            for &byte in &bytes[..arrived] {
                if let Some(reply) = self.client.feed(byte) {
                    return Ok(answer(reply));
                }
            }
            if Instant::now() > overdue {
                let frame = self.client.timed_out().map_err(LineError::GaveUp)?;
                self.port.write_all(frame)?;
                overdue = Instant::now() + wait;
            }
        }
    }
}
