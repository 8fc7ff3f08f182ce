//! Devices on a simulated serial port, which is a pseudo-terminal with a thread at the other end.

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

/// A device on a serial port. It is unplugged on drop.
#[derive(Debug)]
pub struct Device {
    /// Name of the port.
    pub port: String,
    /// The port, held open: otherwise, reads at the other end would fail.
    held: Option<File>,
    unplugged: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Reply to received bytes.
pub enum Answer {
    /// A reply with these bytes.
    Bytes(Vec<u8>),
    /// Unplugging of the line instead of a reply.
    Unplugged,
}

impl Device {
    /// Plugs in a device that replies to received bytes.
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

    /// Plugs in a device on a board that restarts: for the time `silence` after the first byte
    /// arrives, the board receives nothing and sends `noise` repeatedly.
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

    /// Plugs in a device that repeatedly sends the same bytes, even if they are not read.
    ///
    /// # Panics
    /// If no pseudo-terminal can be created.
    #[must_use]
    pub fn talking(bytes: &'static [u8]) -> Self {
        Self::with_thread(move |mut master, unplugged| {
            while !unplugged.load(Ordering::Relaxed) {
                // Bytes that are not read are lost.
                let _ = master.write(bytes);
                thread::sleep(Duration::from_millis(5));
            }
        })
    }

    fn with_thread(run: impl FnOnce(PtyMaster, &AtomicBool) + Send + 'static) -> Self {
        // Processes started by other tests must not inherit the ends of the line. Reads must not
        // block, so that the thread can exit.
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
    grantpt(master).expect("this process owns it");
    unlockpt(master).expect("this process owns it");
    ptsname_r(master).expect("it has a name")
}

impl Drop for Device {
    fn drop(&mut self) {
        self.unplugged.store(true, Ordering::Relaxed);
        self.held = None;
        if let Some(thread) = self.thread.take() {
            // If the thread has panicked, it has already printed its message.
            let _ = thread.join();
        }
    }
}

/// A robot on a serial port.
#[derive(Debug)]
pub struct PluggedRobot {
    robot: Arc<Mutex<LinkRobot>>,
    /// The robot's device on the serial port.
    pub device: Device,
}

/// A fault on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No fault.
    None,
    /// The line is unplugged once the robot has executed this many requests.
    PulledAfter(u64),
    /// After this many requests, the robot's replies are lost.
    MuteAfter(u64),
    /// After this many requests, each reply takes 0.3 s.
    SlowAfter(u64),
}

impl PluggedRobot {
    /// Starts a robot and plugs it in.
    #[must_use]
    pub fn start(flash: Flash, fault: Fault) -> Self {
        Self::restarting(flash, fault, Duration::ZERO, b"")
    }

    /// Starts a robot like [`Self::start`], but on a board that restarts at the first byte: for the
    /// time `silence`, the board sends `noise` and receives nothing.
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

    /// Returns the robot, locked for this thread.
    pub fn robot(&self) -> MutexGuard<'_, LinkRobot> {
        lock(&self.robot)
    }

    /// Unplugs the robot, switches it off and returns the flash.
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
