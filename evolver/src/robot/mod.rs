//! A robot on a serial line: identification, genome transfer, single steps, telemetry.
//!
//! This module adds the port, the clock and the retries that [`minimal_surprise_link`] leaves to
//! the host.

mod error;
mod held;
mod line;
mod plausible;
mod port_name;

pub use error::{Doing, Heard, OtherReader, Problem, RobotError};
pub use held::{Afterwards, standing};
pub use port_name::PortName;

use line::{Line, is_lost_session};
use minimal_surprise_controller::{KERNEL_ID, KernelId, SensorBits, Surprise};
use minimal_surprise_evolution::text::terminal;
use minimal_surprise_link::{
    CHUNK_BYTES_MAX, Faults, GenomeInUse, LineCounters, Reply, Report, Request, Stepped,
};
use plausible::{check_identity, check_report, check_surprise};
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A robot's firmware and state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Name and version of the firmware.
    pub firmware: String,
    /// The firmware's arithmetic.
    pub kernel: KernelId,
    /// The genome in use.
    pub genome: GenomeInUse,
    /// True if the control loop is running.
    pub running: bool,
    /// The robot's faults.
    pub faults: Faults,
}

impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = if self.running { "running" } else { "stopped" };
        let genome = describe(self.genome);
        write!(f, "{}, {state}, {genome}", self.firmware)?;
        for fault in fault_names(self.faults) {
            write!(f, ", {fault}")?;
        }
        Ok(())
    }
}

/// Describes the genome in use.
#[must_use]
pub fn describe(genome: GenomeInUse) -> String {
    match genome {
        GenomeInUse::BuiltIn => "the built-in genome".to_owned(),
        GenomeInUse::Slot {
            slot,
            write_count,
            length,
            crc,
        } => format!("genome {write_count} in slot {slot} ({length} bytes, CRC {crc:08x})"),
    }
}

/// Returns a description of each reported fault.
#[must_use]
pub fn fault_names(faults: Faults) -> Vec<&'static str> {
    let names = [
        (Faults::NO_GENOME, "no genome"),
        (Faults::SLOT_DAMAGED, "a slot is damaged"),
        (Faults::FLASH, "flash error"),
        (Faults::NEIGHBOURS_STALE, "neighbour data too old"),
        (Faults::WATCHDOG, "restarted by the watchdog"),
    ];
    let set = names
        .into_iter()
        .filter(|&(fault, _)| faults.contains(fault));
    let unknown = names
        .iter()
        .fold(faults.0, |bits, (fault, _)| bits & !fault.0);
    let unknown = (unknown != 0).then_some("an unknown fault");
    set.map(|(_, name)| name).chain(unknown).collect()
}

/// Returns the length and CRC of a container, by which a robot identifies the genome in use; `None`
/// if the bytes cannot be a container.
#[must_use]
pub fn length_and_crc(container: &[u8]) -> Option<(u16, u32)> {
    let (_, crc) = container.split_last_chunk()?;
    let length = u16::try_from(container.len()).ok()?;
    Some((length, u32::from_le_bytes(*crc)))
}

/// Returns whether the genome in use is this container.
#[must_use]
pub fn is_in_use(genome: GenomeInUse, container: &[u8]) -> bool {
    match genome {
        GenomeInUse::BuiltIn => false,
        GenomeInUse::Slot { length, crc, .. } => length_and_crc(container) == Some((length, crc)),
    }
}

/// A robot that has identified itself.
pub struct Robot {
    line: Line,
    identity: Identity,
    /// Number of steps requested since the last reset.
    steps: u64,
    /// The robot's latest report in this conversation.
    reported: Option<Surprise>,
}

impl Robot {
    /// Opens the port and asks the robot to identify itself; tries for up to `wait`. Once `stop` is
    /// set, only the requests that restore the robot's state are sent.
    ///
    /// # Errors
    /// [`RobotError`] if the port does not exist, no device replies, or a different device replies.
    pub fn connect(
        port: &PortName,
        baud: u32,
        wait: Duration,
        stop: &'static AtomicBool,
    ) -> Result<Self, RobotError> {
        let mut line = Line::open(port, baud, wait, stop)?;
        let identity = identify(&mut line)?;
        Ok(Self {
            line,
            identity,
            steps: 0,
            reported: None,
        })
    }

    /// Ignores `stop` after this call.
    fn finish(&mut self) {
        self.line.finish();
    }

    /// Returns the robot's latest identification.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Identifies the robot again, in a new conversation.
    ///
    /// # Errors
    /// [`RobotError`] if the line fails, the robot does not reply, rejects the request or sends a
    /// reply that does not match, or the user interrupts.
    pub fn identify(&mut self) -> Result<&Identity, RobotError> {
        self.line.start_over();
        self.reported = None;
        self.identity = identify(&mut self.line)?;
        Ok(&self.identity)
    }

    /// Rejects a robot that uses different arithmetic.
    ///
    /// # Errors
    /// [`Problem::OtherKernel`] if the robot's kernel differs from this program's.
    pub fn check_kernel(&self) -> Result<(), RobotError> {
        let robot = self.identity.kernel;
        if robot == KERNEL_ID {
            Ok(())
        } else {
            Err(self.line.about(Problem::OtherKernel { robot }))
        }
    }

    /// Writes a genome into the unused slot and makes the robot run it. Calls `written` with the
    /// number of bytes received so far. The robot must be stopped. The transfer can be interrupted
    /// until the genome is complete.
    ///
    /// # Errors
    /// [`RobotError`] if the transfer fails. In that case, the robot keeps its old genome; after a
    /// failure while [`Doing::Committing`], it has either the old or the new genome.
    pub fn write(
        &mut self,
        container: &[u8],
        mut written: impl FnMut(usize),
    ) -> Result<(), RobotError> {
        let Some((length, crc)) = length_and_crc(container) else {
            let refusal = minimal_surprise_link::Refusal::ImpossibleLength;
            let doing = Doing::Receiving;
            return Err(self.line.about(Problem::Refused { doing, refusal }));
        };
        self.done(Doing::Receiving, &Request::Begin { length, crc })?;
        let mut offset = 0;
        for data in container.chunks(CHUNK_BYTES_MAX) {
            self.done(Doing::Receiving, &Request::Chunk { offset, data })?;
            offset += data.len() as u16;
            written(offset.into());
        }
        self.finish();
        let committed = self
            .line
            .ask(Doing::Committing, &Request::Commit, |reply| match reply {
                Reply::Committed { .. } => Some(()),
                _ => None,
            });
        match committed {
            // The reply may have been lost, so ask the robot which genome it runs.
            Err(error) if matches!(error.problem, Problem::Unanswered { .. }) => {
                self.identify().map_err(|_| error)?;
            }
            committed => {
                committed?;
                self.identify()?;
            }
        }
        if is_in_use(self.identity.genome, container) {
            Ok(())
        } else {
            let runs = describe(self.identity.genome);
            Err(self.line.about(Problem::NotInUse { runs }))
        }
    }

    /// Starts the control loop.
    ///
    /// # Errors
    /// [`RobotError`] if the robot does not reply or rejects the request.
    pub fn start(&mut self) -> Result<(), RobotError> {
        self.done(Doing::Switching, &Request::Start)
    }

    /// Stops the motors and the control loop.
    ///
    /// # Errors
    /// [`RobotError`] if the robot does not reply or rejects the request.
    pub fn stop(&mut self) -> Result<(), RobotError> {
        self.done(Doing::Switching, &Request::Stop)
    }

    /// Resets the controller. The robot must be stopped.
    ///
    /// # Errors
    /// [`RobotError`] if the robot does not reply or rejects the request.
    pub fn reset(&mut self) -> Result<(), RobotError> {
        self.steps = 0;
        self.done(Doing::Switching, &Request::Reset)
    }

    /// Performs one control step with these readings. The robot must be stopped and have been
    /// reset.
    ///
    /// # Errors
    /// [`RobotError`] if the robot does not reply or rejects the request.
    pub fn step(&mut self, sensors: SensorBits) -> Result<Stepped, RobotError> {
        let request = Request::Step { sensors };
        let stepped = self
            .line
            .ask(Doing::Stepping, &request, |reply| match reply {
                Reply::Stepped(stepped) => Some(stepped),
                _ => None,
            })?;
        self.steps += 1;
        self.possible(check_surprise(stepped.surprise, Some(self.steps)))?;
        Ok(stepped)
    }

    /// Returns the robot's telemetry; `None` if the robot restarted since the last request.
    ///
    /// # Errors
    /// [`RobotError`] if the robot does not reply or rejects the request.
    pub fn telemetry(&mut self) -> Result<Option<(Report, LineCounters)>, RobotError> {
        let told = self
            .line
            .ask(Doing::Reporting, &Request::Telemetry, |reply| match reply {
                Reply::Telemetry { report, line } => Some((report, line)),
                _ => None,
            });
        match told {
            Err(error) if is_lost_session(&error.problem) => {
                self.identify()?;
                Ok(None)
            }
            told => {
                let (report, line) = told?;
                self.possible(check_report(&report))?;
                if let Some(recent) = self
                    .reported
                    .and_then(|before| since(before, report.surprise))
                {
                    self.possible(check_surprise(recent, None))?;
                }
                self.reported = Some(report.surprise);
                Ok(Some((report, line)))
            }
        }
    }

    fn possible(&self, checked: Result<(), String>) -> Result<(), RobotError> {
        checked.map_err(|what| self.line.about(Problem::Impossible { what }))
    }

    /// Sends a request whose reply is only a confirmation.
    fn done(&mut self, doing: Doing, request: &Request<'_>) -> Result<(), RobotError> {
        self.line
            .ask(doing, request, |reply| (reply == Reply::Done).then_some(()))
    }
}

/// Returns the difference between two reports; `None` if the counts were reset in between.
#[must_use]
pub fn since(before: Surprise, now: Surprise) -> Option<Surprise> {
    Some(Surprise {
        mispredicted_bits: now
            .mispredicted_bits
            .checked_sub(before.mispredicted_bits)?,
        seen_bits: now.seen_bits.checked_sub(before.seen_bits)?,
    })
}

fn identify(line: &mut Line) -> Result<Identity, RobotError> {
    let identity = line.ask(
        Doing::Identifying,
        &Request::Identify,
        |reply| match reply {
            Reply::Identity(identity) => Some(check_identity(&identity).map(|()| Identity {
                firmware: printable(identity.firmware, identity.version),
                kernel: identity.kernel,
                genome: identity.genome,
                running: identity.running,
                faults: identity.faults,
            })),
            _ => None,
        },
    )?;
    identity.map_err(|what| line.about(Problem::Impossible { what }))
}

/// Joins name and version, and escapes terminal control characters.
fn printable(firmware: &str, version: &str) -> String {
    terminal(&format!("{firmware} {version}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_robot_cannot_control_a_terminal() {
        let name = printable("a\u{1b}[2J\u{202e}b", "1\n");
        assert_eq!(name, r"a\u{1b}[2J\u{202e}b 1\n");
    }
}
