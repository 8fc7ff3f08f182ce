//! Runs a program in a pseudo-terminal, sends it keys and reads its screen.

use crate::program::Evolver;
use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::process::Command;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Maximum time to wait for contents of the screen.
const PATIENCE: Duration = Duration::from_secs(60);

/// A program that runs in a terminal; it is killed on drop.
pub struct Terminal {
    child: Box<dyn Child + Send + Sync>,
    master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    output: Receiver<Vec<u8>>,
    parser: vt100::Parser,
    /// Everything that the program has sent.
    sent: Vec<u8>,
    line_settings: u32,
}

fn size(rows: u16, columns: u16) -> PtySize {
    PtySize {
        rows,
        cols: columns,
        pixel_width: 0,
        pixel_height: 0,
    }
}

fn some(count: u16) -> NonZeroU16 {
    NonZeroU16::new(count).expect("a window has rows and columns")
}

fn line_settings(master: &(dyn MasterPty + Send)) -> u32 {
    let settings = master.get_termios().expect("it is a terminal");
    settings.local_flags.bits()
}

impl Terminal {
    /// Starts the program in a terminal with this number of rows and columns, 256 colours and
    /// UTF-8.
    ///
    /// # Panics
    /// If the program cannot be started.
    #[must_use]
    pub fn start(
        evolver: &Evolver,
        window: (u16, u16),
        variables: &[(&str, &str)],
        arguments: &[&str],
    ) -> Self {
        let variables = variables.iter().map(|&(name, value)| (name, Some(value)));
        Self::start_with(evolver, window, variables, arguments)
    }

    /// Starts the program like [`Self::start`], but with these environment variables; a variable
    /// without a value is unset.
    ///
    /// # Panics
    /// If the program cannot be started.
    #[must_use]
    pub fn start_with<'a>(
        evolver: &Evolver,
        (rows, columns): (u16, u16),
        variables: impl IntoIterator<Item = (&'a str, Option<&'a str>)>,
        arguments: &[&str],
    ) -> Self {
        let pair = native_pty_system()
            .openpty(size(rows, columns))
            .expect("a pseudo-terminal");
        let mut command = CommandBuilder::new(evolver.program());
        command.args(arguments);
        command.cwd(evolver.folder());
        for unwanted in [
            "CARGO",
            "CI",
            "NO_COLOR",
            "COLORTERM",
            "CLICOLOR",
            "CLICOLOR_FORCE",
            "FORCE_COLOR",
            "TERM_PROGRAM",
        ] {
            command.env_remove(unwanted);
        }
        command.env("TERM", "xterm-256color");
        command.env("LC_ALL", "C.UTF-8");
        for (name, value) in variables {
            match value {
                Some(value) => command.env(name, value),
                None => command.env_remove(name),
            }
        }
        let line_settings = line_settings(&*pair.master);
        let child = pair.slave.spawn_command(command).expect("it starts");
        let mut reader = pair.master.try_clone_reader().expect("its output");
        let keys = pair.master.take_writer().expect("its input");
        let (sender, output) = channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut buffer) {
                if sender.send(buffer[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        Self {
            child,
            master: pair.master,
            keys,
            output,
            parser: vt100::Parser::new(some(rows), some(columns), 0),
            sent: Vec::new(),
            line_settings,
        }
    }

    /// Types keys.
    ///
    /// # Panics
    /// If the terminal is closed.
    pub fn types(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).expect("it listens");
        self.keys.flush().expect("it listens");
    }

    /// Resizes the window.
    ///
    /// # Panics
    /// If the terminal is closed.
    pub fn resize(&mut self, rows: u16, columns: u16) {
        self.parser.screen_mut().set_size(some(rows), some(columns));
        self.master.resize(size(rows, columns)).expect("it is open");
    }

    /// Returns the current screen.
    #[must_use]
    pub fn screen(&self) -> &vt100::Screen {
        self.parser.screen()
    }

    /// Returns the rows of the screen, without trailing spaces.
    #[must_use]
    pub fn rows(&self) -> Vec<String> {
        let (_, columns) = self.screen().size();
        let rows = self.screen().rows(0, columns.into());
        rows.map(|row| row.trim_end().to_owned()).collect()
    }

    /// Waits until the screen shows these words.
    ///
    /// # Panics
    /// If the words do not appear in time.
    pub fn wait_for(&mut self, words: &str) {
        self.wait_until(words, true);
    }

    /// Waits until the screen no longer shows these words.
    ///
    /// # Panics
    /// If the words do not disappear in time.
    pub fn wait_while(&mut self, words: &str) {
        self.wait_until(words, false);
    }

    /// Waits until the condition holds for the screen; its contents may arrive in pieces.
    ///
    /// # Panics
    /// If the condition does not become true in time.
    pub fn wait_until_it_shows(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let started = Instant::now();
        while !holds(self) {
            let left = PATIENCE.saturating_sub(started.elapsed());
            match self.output.recv_timeout(left) {
                Ok(bytes) => self.takes(&bytes),
                Err(error) => panic!("no {what}, {error}:\n{}", self.screen().contents()),
            }
        }
    }

    fn takes(&mut self, bytes: &[u8]) {
        self.parser.process(bytes);
        self.sent.extend_from_slice(bytes);
    }

    /// Returns everything that the program has sent, including escape codes.
    #[must_use]
    pub fn sent(&self) -> String {
        String::from_utf8_lossy(&self.sent).into_owned()
    }

    fn wait_until(&mut self, words: &str, shown: bool) {
        let started = Instant::now();
        while self.screen().contents().contains(words) != shown {
            let left = PATIENCE.saturating_sub(started.elapsed());
            match self.output.recv_timeout(left) {
                Ok(bytes) => self.takes(&bytes),
                Err(error) => panic!(
                    "{words:?} shown: {}, {error}:\n{}",
                    !shown,
                    self.screen().contents()
                ),
            }
        }
    }

    /// Types keys, and waits until the screen shows these words.
    ///
    /// # Panics
    /// If the words do not appear in time.
    pub fn after(&mut self, keys: &str, words: &str) {
        self.types(keys);
        self.wait_for(words);
    }

    /// Sends a signal to the program.
    ///
    /// # Panics
    /// If the program has exited.
    pub fn signal(&self, signal: &str) {
        let id = self.child.process_id().expect("the program is running");
        let sent = Command::new("sh")
            .args(["-c", &format!("kill -{signal} {id}")])
            .status();
        assert!(sent.is_ok_and(|status| status.success()), "kill {id}");
    }

    /// Waits for the program to exit; returns its exit code.
    ///
    /// # Panics
    /// If the program does not exit in time.
    pub fn ended(&mut self) -> u32 {
        let started = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child process") {
                break status;
            }
            assert!(started.elapsed() < PATIENCE, "the program is still running");
            match self.output.recv_timeout(Duration::from_millis(20)) {
                Ok(bytes) => self.takes(&bytes),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    std::thread::sleep(Duration::from_millis(5));
                }
            }
        };
        // The last output may not have been read yet.
        while let Ok(bytes) = self.output.recv_timeout(Duration::from_millis(500)) {
            self.takes(&bytes);
        }
        status.exit_code()
    }

    /// Checks whether the screen, the cursor and the line settings are restored for a shell.
    #[must_use]
    pub fn is_restored(&self) -> bool {
        let screen = self.screen();
        !screen.alternate_screen()
            && !screen.hide_cursor()
            && line_settings(&*self.master) == self.line_settings
    }
}

/// Runs a shell command in a terminal, closes the terminal once `when` returns true, and waits for
/// the shell to exit.
///
/// # Panics
/// If the shell does not start or exit in time.
pub fn close_terminal_of(evolver: &Evolver, line: &str, when: impl Fn() -> bool) {
    let pair = native_pty_system()
        .openpty(size(24, 80))
        .expect("a pseudo-terminal");
    let mut command = CommandBuilder::new("sh");
    command.args(["-c", line]);
    command.cwd(evolver.folder());
    let mut shell = pair.slave.spawn_command(command).expect("the shell starts");
    drop(pair.slave);
    let started = Instant::now();
    let wait = || {
        assert!(started.elapsed() < PATIENCE, "{line}");
        std::thread::sleep(Duration::from_millis(2));
    };
    while !when() {
        wait();
    }
    drop(pair.master);
    while shell.try_wait().expect("a child process").is_none() {
        wait();
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // The program may already have exited; its process is removed when this process exits.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
