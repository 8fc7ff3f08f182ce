//! Runs the `evolver` program as a user would, in a separate folder.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Build profile of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Debug assertions and overflow checks.
    Debug,
    /// Optimised code.
    Release,
}

/// Builds the program, once per process, and returns its path.
///
/// # Panics
/// If the program does not compile.
#[must_use]
pub fn path(profile: Profile) -> PathBuf {
    static DEBUG: OnceLock<PathBuf> = OnceLock::new();
    static RELEASE: OnceLock<PathBuf> = OnceLock::new();
    /// Start one build at a time, because builds would wait for each other anyway.
    static BUILDING: Mutex<()> = Mutex::new(());
    let built = match profile {
        Profile::Debug => &DEBUG,
        Profile::Release => &RELEASE,
    };
    let build = || {
        let _one = BUILDING.lock();
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
        let mut build = escargot::CargoBuild::new()
            .manifest_path(workspace)
            .package("minimal-surprise-evolver")
            .bin("evolver");
        if profile == Profile::Release {
            build = build.release();
        }
        let run = build.run().unwrap_or_else(|error| panic!("{error}"));
        run.path().to_owned()
    };
    built.get_or_init(build).clone()
}

/// The program, with a folder that is empty at first and is removed on drop.
#[derive(Debug)]
pub struct Evolver {
    folder: TempDir,
    program: PathBuf,
}

/// A process that has exited.
#[derive(Debug)]
pub struct Finished {
    /// Exit code; `None` if a signal ended the process.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Finished {
    /// Checks that the program failed, and that the message contains all these words.
    ///
    /// # Panics
    /// If the exit code is not 1, or the message lacks one of the words.
    pub fn assert_failed(&self, words: &[&str]) {
        assert_eq!(self.code, Some(1), "{self:?}");
        for word in words {
            assert!(self.stderr.contains(word), "no {word:?} in {self:?}");
        }
    }
}

/// A process that is running.
#[derive(Debug)]
pub struct Running {
    child: Child,
    lines: Receiver<String>,
}

impl Evolver {
    /// Returns the release program in an empty folder.
    #[must_use]
    pub fn in_empty_folder() -> Self {
        Self::built(Profile::Release)
    }

    /// Returns the program with this build profile in an empty folder.
    ///
    /// # Panics
    /// If no temporary folder can be created.
    #[must_use]
    pub fn built(profile: Profile) -> Self {
        Self {
            folder: TempDir::new().expect("a temporary folder"),
            program: path(profile),
        }
    }

    /// Returns the path of the program.
    #[must_use]
    pub fn program(&self) -> &Path {
        &self.program
    }

    /// Returns the folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    fn command(&self, arguments: &[impl AsRef<OsStr>]) -> Command {
        self.called_by(Command::new(&self.program), arguments)
    }

    fn called_by(&self, mut command: Command, arguments: &[impl AsRef<OsStr>]) -> Command {
        command
            .args(arguments)
            .current_dir(self.folder())
            .env_remove("CARGO")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs the program like [`Evolver::run`], but with an environment variable set.
    ///
    /// # Panics
    /// If `evolver` cannot be started.
    pub fn run_with(&self, variable: (&str, &str), arguments: &[impl AsRef<OsStr>]) -> Finished {
        let mut command = self.command(arguments);
        command.env(variable.0, variable.1);
        finish(&mut command)
    }

    /// Runs the program to completion.
    ///
    /// # Panics
    /// If the program cannot be started.
    pub fn run(&self, arguments: &[impl AsRef<OsStr>]) -> Finished {
        finish(&mut self.command(arguments))
    }

    /// Starts the program.
    ///
    /// # Panics
    /// If the program cannot be started.
    #[must_use]
    pub fn start(&self, arguments: &[impl AsRef<OsStr>]) -> Running {
        // Signals end the program even if the tests ignore signals, as background jobs do.
        let mut command = Command::new("env");
        if cfg!(target_os = "linux") {
            command.arg("--default-signal=INT,TERM,HUP");
        }
        command.arg(&self.program);
        let mut command = self.called_by(command, arguments);
        let mut child = command.spawn().expect("the program starts");
        let stderr = BufReader::new(child.stderr.take().expect("it is piped"));
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Running { child, lines }
    }

    /// Runs a shell command in the folder.
    ///
    /// # Panics
    /// If the shell cannot be started.
    #[must_use]
    pub fn shell(&self, line: &str) -> Child {
        let mut shell = Command::new("sh");
        shell
            .args(["-c", line])
            .current_dir(self.folder())
            .env_remove("CARGO")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        shell.spawn().expect("the shell starts")
    }

    /// Lists all files below the folder, in order.
    #[must_use]
    pub fn files(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut folders = vec![self.folder().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    folders.push(path);
                } else if let Ok(relative) = path.strip_prefix(self.folder()) {
                    found.push(relative.to_string_lossy().into_owned());
                }
            }
        }
        found.sort();
        found
    }

    /// Writes a file in the folder.
    ///
    /// # Panics
    /// If the file cannot be written.
    pub fn write(&self, name: &str, contents: &[u8]) {
        fs::write(self.folder().join(name), contents).unwrap_or_else(|e| panic!("{name}: {e}"));
    }

    /// Reads a file in the folder.
    ///
    /// # Panics
    /// If the file cannot be read.
    #[must_use]
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.folder().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Reads a file in the folder as text.
    #[must_use]
    pub fn text(&self, name: &str) -> String {
        String::from_utf8_lossy(&self.read(name)).into_owned()
    }
}

fn finish(command: &mut Command) -> Finished {
    let output = command.output().expect("the program starts");
    Finished {
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

impl Running {
    /// Waits until the process has written `count` lines to standard error, or has exited.
    pub fn wait_for_lines(&self, count: usize) {
        for _ in 0..count {
            if self.lines.recv_timeout(Duration::from_secs(120)).is_err() {
                return;
            }
        }
    }

    /// Kills the process immediately; returns true if it had already exited successfully.
    ///
    /// # Panics
    /// If the operating system cannot report the state of the process.
    pub fn kill(mut self) -> bool {
        let ended = self.child.try_wait().expect("a child process");
        let _ = self.child.kill();
        let status = self.child.wait().expect("a child process");
        ended.is_some() && status.success()
    }

    /// Sends Ctrl-C to the process and waits for it to exit.
    ///
    /// # Panics
    /// If the process does not exit in time.
    #[must_use]
    pub fn interrupt(self, patience: Duration) -> Finished {
        self.signal("INT");
        self.ended(patience)
    }

    /// Sends a signal to the process.
    ///
    /// # Panics
    /// If the process has exited.
    pub fn signal(&self, signal: &str) {
        // Use the shell's builtin, because a minimal system lacks the `kill` program.
        let command = format!("kill -{signal} {}", self.child.id());
        let sent = Command::new("sh").args(["-c", &command]).status();
        assert!(sent.is_ok_and(|status| status.success()), "{command}");
    }

    /// Waits for the process to exit.
    ///
    /// # Panics
    /// If the process does not exit in time.
    #[must_use]
    pub fn ended(mut self, patience: Duration) -> Finished {
        let started = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child process") {
                break status;
            }
            if started.elapsed() > patience {
                let _ = self.child.kill();
                let said = self.lines.iter().collect::<Vec<_>>();
                panic!("still running after {patience:?}; standard error: {said:?}");
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let mut stdout = String::new();
        if let Some(mut pipe) = self.child.stdout.take() {
            let _ = pipe.read_to_string(&mut stdout);
        }
        Finished {
            code: status.code(),
            stdout,
            stderr: self.lines.iter().collect::<Vec<_>>().join("\n"),
        }
    }
}
