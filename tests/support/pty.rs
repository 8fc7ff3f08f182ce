//! Devices behind a simulated serial port: a pseudo-terminal with a thread at its other end.

use crate::link_robot::{Flash, LinkRobot};
use minimal_surprise_link::Server;
use nix::fcntl::OFlag;
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// A device on a serial port. Dropping it unplugs it.
#[derive(Debug)]
pub struct Device {
    /// The name of its port.
    pub port: String,
    /// The port, held open: otherwise the other end would read errors.
    held: Option<File>,
    unplugged: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// The answer to bytes that have arrived.
pub enum Answer {
    /// These bytes.
    Bytes(Vec<u8>),
    /// The line is unplugged.
    Unplugged,
}

impl Device {
    /// Plugs in a device that answers what arrives.
    ///
    /// # Panics
    /// If no pseudo-terminal can be created.
    #[must_use]
    pub fn plug_in(mut answer: impl FnMut(&[u8]) -> Answer + Send + 'static) -> Self {
        Self::with_thread(move |mut master, unplugged| {
            let mut buffer = [0; 256];
            while !unplugged.load(Ordering::Relaxed) {
                let count = match master.read(&mut buffer) {
                    Ok(count) => count,
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {
                        thread::sleep(Duration::from_micros(100));
                        continue;
                    }
                    Err(_) => break,
                };
                match answer(&buffer[..count]) {
                    Answer::Bytes(bytes) if master.write_all(&bytes).is_ok() => {}
                    _ => break,
                }
            }
        })
    }

    /// Plugs in a device behind a board that restarts: after the first byte arrives, it receives
    /// nothing for `silence` and sends `noise` repeatedly.
    ///
    /// # Panics
    /// If no pseudo-terminal can be created.
    #[must_use]
    pub fn restarting(
        silence: Duration,
        noise: &'static [u8],
        mut answer: impl FnMut(&[u8]) -> Answer + Send + 'static,
    ) -> Self {
        let mut first = None;
        Self::plug_in(move |bytes| {
            let first = *first.get_or_insert_with(Instant::now);
            match first.elapsed() < silence {
                true => Answer::Bytes(noise.to_vec()),
                false => answer(bytes),
            }
        })
    }

    /// Plugs in a device that sends the same bytes repeatedly, whether or not anyone listens.
    ///
    /// # Panics
    /// If no pseudo-terminal can be created.
    #[must_use]
    pub fn talking(bytes: &'static [u8]) -> Self {
        Self::with_thread(move |mut master, unplugged| {
            while !unplugged.load(Ordering::Relaxed) {
                // Bytes that nobody reads are lost.
                let _ = master.write(bytes);
                thread::sleep(Duration::from_millis(5));
            }
        })
    }

    fn with_thread(run: impl FnOnce(PtyMaster, &AtomicBool) + Send + 'static) -> Self {
        // Processes started by other tests must not inherit the ends of the line, and a thread
        // waiting for bytes must not be waited for.
        let flags = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC | OFlag::O_NONBLOCK;
        let master = posix_openpt(flags).expect("a pseudo-terminal");
        let port = name(&master);
        let held = File::options()
            .read(true)
            .write(true)
            .open(&port)
            .expect("the other end");
        let mut raw = tcgetattr(&held).expect("its settings");
        cfmakeraw(&mut raw);
        tcsetattr(&held, SetArg::TCSANOW, &raw).expect("its settings");
        let unplugged = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&unplugged);
        Self {
            port,
            held: Some(held),
            unplugged,
            thread: Some(thread::spawn(move || run(master, &flag))),
        }
    }
}

fn name(master: &PtyMaster) -> String {
    grantpt(master).expect("it is ours");
    unlockpt(master).expect("it is ours");
    ptsname_r(master).expect("it has a name")
}

impl Drop for Device {
    fn drop(&mut self) {
        self.unplugged.store(true, Ordering::Relaxed);
        self.held = None;
        if let Some(thread) = self.thread.take() {
            // Its panic message has been printed.
            let _ = thread.join();
        }
    }
}

/// A robot on a serial port.
#[derive(Debug)]
pub struct PluggedRobot {
    robot: Arc<Mutex<LinkRobot>>,
    /// Its line.
    pub device: Device,
}

/// A fault on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No fault.
    None,
    /// It is unplugged when the robot has carried out this many requests.
    PulledAfter(u64),
    /// From then on, the robot's answers are lost.
    MuteAfter(u64),
    /// From then on, each answer takes 0.3 s.
    SlowAfter(u64),
}

impl PluggedRobot {
    /// Starts a robot and plugs it in.
    #[must_use]
    pub fn start(flash: Flash, fault: Fault) -> Self {
        Self::restarting(flash, fault, Duration::ZERO, b"")
    }

    /// Like [`Self::start`], with a board that restarts at the first byte: for `silence` it sends
    /// `noise` and receives nothing.
    #[must_use]
    pub fn restarting(flash: Flash, fault: Fault, silence: Duration, noise: &'static [u8]) -> Self {
        let robot = Arc::new(Mutex::new(LinkRobot::start(flash)));
        let behind = Arc::clone(&robot);
        let mut server = Server::new();
        let device = Device::restarting(silence, noise, move |bytes| {
            let mut robot = lock(&behind);
            let mut answers = Vec::new();
            for &byte in bytes {
                answers.extend_from_slice(server.feed(byte, &mut *robot).unwrap_or(&[]));
            }
            match fault {
                Fault::PulledAfter(done) if robot.done >= done => Answer::Unplugged,
                Fault::MuteAfter(done) if robot.done >= done => Answer::Bytes(Vec::new()),
                Fault::SlowAfter(done) if robot.done >= done => {
                    thread::sleep(Duration::from_millis(300));
                    Answer::Bytes(answers)
                }
                _ => Answer::Bytes(answers),
            }
        });
        Self { robot, device }
    }

    /// The robot.
    pub fn robot(&self) -> MutexGuard<'_, LinkRobot> {
        lock(&self.robot)
    }

    /// Unplugs the robot, switches it off and returns its flash.
    ///
    /// # Panics
    /// If the robot has panicked.
    #[must_use]
    pub fn stop(self) -> Flash {
        drop(self.device);
        let robot = Arc::into_inner(self.robot).expect("the thread has ended");
        robot.into_inner().expect("it has not panicked").stop()
    }
}

fn lock(robot: &Mutex<LinkRobot>) -> MutexGuard<'_, LinkRobot> {
    robot.lock().expect("the robot has not panicked")
}
