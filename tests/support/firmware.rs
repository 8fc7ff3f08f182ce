//! Builds the firmware programs and runs them under QEMU.

use crate::tools::Missing;
use defmt_decoder::{DecodeError, Table};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use std::{fs, thread};

/// Exit code of `scripts/thumb-cargo.sh` if it finds no compiler.
const NO_COMPILER: i32 = 69;

/// Maximum run time of a program; needed because a program that has crashed may never exit.
const TIMEOUT: Duration = Duration::from_secs(300);

const TARGET: &str = "thumbv7em-none-eabihf";

/// The machine described by `firmware-example/memory.x`, with a clock that advances by a fixed time
/// per instruction.
pub(crate) const QEMU: &str = "qemu-system-arm";
const QEMU_ARGUMENTS: &str = "-cpu cortex-m4 -machine mps2-an386 \
    -icount shift=10,align=off,sleep=off \
    -nographic -monitor none -serial none \
    -semihosting-config enable=on,target=native -kernel";

/// QEMU's STM32F405. QEMU does not emulate the clocks, timers or pins, but traces writes to their
/// registers.
const QEMU_STM32F4_ARGUMENTS: &str = "-machine netduinoplus2 \
    -nographic -monitor none -serial none -d unimp,int -D";

/// The built programs of `firmware-example`.
pub struct Firmware {
    programs: PathBuf,
    /// The compiler that built them.
    pub compiler: String,
}

/// Returns the folder of the package.
#[must_use]
pub fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware-example")
}

/// Builds all programs in release mode.
///
/// # Errors
/// [`Missing`] if no compiler for the target is installed.
///
/// # Panics
/// If the programs do not compile.
pub fn build() -> Result<Firmware, Missing> {
    let built = cargo_build(&["--bins"])?;
    assert!(built.success, "the firmware:\n{}", built.messages);
    let compiler = built
        .messages
        .lines()
        .find_map(|line| line.strip_prefix("thumb-cargo: compiler: "))
        .unwrap_or_else(|| panic!("no compiler named in:\n{}", built.messages));
    Ok(Firmware {
        compiler: compiler.to_owned(),
        programs: programs(),
    })
}

/// The result of linking a program.
#[derive(Debug)]
pub struct Linked {
    /// True if the program was linked.
    pub success: bool,
    /// The output of compiler and linker.
    pub messages: String,
}

/// Links a program of a package in `firmware-example` in release mode.
///
/// # Errors
/// [`Missing`] if no compiler for the target is installed.
pub fn link(package: &str, program: &str) -> Result<Linked, Missing> {
    cargo_build(&["--package", package, "--bin", program])
}

/// Returns the number of flash bytes that a linked program uses: the size of its loaded sections.
///
/// # Panics
/// If the program was not linked.
#[must_use]
pub fn flash_bytes(program: &str) -> u32 {
    /// Type of a section that has contents, and flag of a section that is loaded into memory.
    const PROGBITS: u32 = 1;
    const ALLOC: u32 = 2;
    let elf = fs::read(programs().join(program)).expect("a linked program");
    let half = |at: usize| usize::from(u16::from_le_bytes([elf[at], elf[at + 1]]));
    let word = |at: usize| {
        let bytes = elf[at..at + 4].try_into().expect("four bytes");
        u32::from_le_bytes(bytes)
    };
    let (table, entry, count) = (word(0x20) as usize, half(0x2e), half(0x30));
    (0..count)
        .map(|index| table + index * entry)
        .filter(|&section| word(section + 4) == PROGBITS && word(section + 8) & ALLOC != 0)
        .map(|section| word(section + 20))
        .sum()
}

/// Returns the ELF file of a linked program.
#[must_use]
pub fn elf(program: &str) -> PathBuf {
    programs().join(program)
}

/// Returns the folder in which the programs are built.
#[must_use]
pub fn target_dir() -> PathBuf {
    directory().join("target")
}

fn programs() -> PathBuf {
    target_dir().join(TARGET).join("release")
}

fn cargo_build(arguments: &[&str]) -> Result<Linked, Missing> {
    let arguments = [&["--locked"], arguments].concat();
    build_in(&directory(), &target_dir(), &arguments)
}

/// Builds a package for the robot's processor in release mode.
///
/// # Errors
/// [`Missing`] if no compiler for the target is installed.
///
/// # Panics
/// If the script that finds the compiler cannot be run.
pub fn build_in(
    directory: &Path,
    target_dir: &Path,
    arguments: &[&str],
) -> Result<Linked, Missing> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/thumb-cargo.sh");
    let output = Command::new(script)
        .args(["build", "--release"])
        .args(arguments)
        .args(["--target", TARGET, "--target-dir"])
        .arg(target_dir)
        .current_dir(directory)
        .output()
        .unwrap_or_else(|error| panic!("scripts/thumb-cargo.sh: {error}"));
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.code() == Some(NO_COMPILER) {
        return Err(Missing(messages));
    }
    Ok(Linked {
        success: output.status.success(),
        messages,
    })
}

impl Firmware {
    /// Returns the ELF file of a program.
    #[must_use]
    pub fn elf(&self, program: &str) -> PathBuf {
        self.programs.join(program)
    }

    /// Runs a program to completion and returns the lines that it logged.
    ///
    /// # Errors
    /// [`Missing`] if QEMU is not installed.
    ///
    /// # Panics
    /// If the program fails or does not exit in time.
    pub fn run(&self, program: &str) -> Result<Vec<String>, Missing> {
        let mut lines = Vec::new();
        let status = run(&self.elf(program), |line| lines.push(line))?;
        let text = lines.join("\n");
        let status =
            status.unwrap_or_else(|error| panic!("{program}: {error}; it logged:\n{text}"));
        assert!(status.success(), "{program}: {status}; it logged:\n{text}");
        Ok(lines)
    }
}

/// Names of the wheels' registers of `mps2` and of the STM32F405 in QEMU's traces.
const MPS2_WHEELS: &str = "mps2_fpgaio_write";
const STM32F4_WHEELS: &str = "GPIOC: unimplemented device write";

/// A program's writes to the wheels' registers before and during a fault, as traced by QEMU.
#[derive(Debug)]
pub struct Faulted {
    /// Writes to the wheels' registers, one line each.
    pub wheels: Vec<String>,
    /// The program's log or, for the STM32F405, the exceptions traced by QEMU.
    pub log: String,
}

/// Runs the `faults` program of `mps2`, which triggers this fault and exits.
///
/// # Errors
/// [`Missing`] if QEMU is not installed.
///
/// # Panics
/// If the program does not fail.
pub fn fault_on_mps2(elf: &Path, fault: &str, trace: &Path) -> Result<Faulted, Missing> {
    let mut log = Vec::new();
    let arguments = QEMU_ARGUMENTS.replace(
        "-semihosting",
        &format!("-trace {MPS2_WHEELS} -D {} -semihosting", trace.display()),
    );
    let arguments = arguments.replace("=native", &format!("=native,arg=faults,arg={fault}"));
    let status = run_with(&arguments, elf, |line| log.push(line))?;
    let status = status.unwrap_or_else(|error| panic!("{fault}: {error}; it logged {log:?}"));
    assert_eq!(status.code(), Some(1), "{fault}: {log:?}");
    Ok(Faulted {
        wheels: lines(trace, MPS2_WHEELS),
        log: log.join("\n"),
    })
}

/// Runs the `faults-stm32f4` program, which triggers this fault, until it has written to the
/// wheels' registers three times: once to turn the wheels and twice to stop them.
///
/// # Errors
/// [`Missing`] if QEMU is not installed.
///
/// # Panics
/// If QEMU fails.
pub fn fault_on_stm32f4(elf: &Path, fault: &str, trace: &Path) -> Result<Faulted, Missing> {
    let child = Command::new(QEMU)
        .args(QEMU_STM32F4_ARGUMENTS.split_whitespace())
        .arg(trace)
        .arg("-semihosting-config")
        .arg(format!("enable=on,target=native,arg=faults,arg={fault}"))
        .arg("-kernel")
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn();
    let mut child = match child {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(no_qemu()),
        child => child.unwrap_or_else(|error| panic!("{QEMU}: {error}")),
    };
    let end = Instant::now() + Duration::from_secs(60);
    while lines(trace, STM32F4_WHEELS).len() < 3 && Instant::now() < end {
        thread::sleep(Duration::from_millis(10));
    }
    child.kill().expect("QEMU can be killed");
    child.wait().expect("QEMU has ended");
    Ok(Faulted {
        wheels: lines(trace, STM32F4_WHEELS),
        log: lines(trace, "").join("\n"),
    })
}

/// Returns the lines of a file that begin with `start`; none if the file does not exist yet.
fn lines(path: &Path, start: &str) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap_or_default();
    // The last line may be incomplete.
    let text = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
    let lines = text.lines().filter(|line| line.starts_with(start));
    lines.map(str::to_owned).collect()
}

/// Runs the program in an ELF file under QEMU and passes each line of the program's log to `line`.
/// Returns the exit status.
///
/// # Errors
/// [`Missing`] if QEMU is not installed. The inner error if the file or the log cannot be read or
/// QEMU cannot be run.
pub fn run(elf: &Path, line: impl FnMut(String)) -> Result<io::Result<ExitStatus>, Missing> {
    run_with(QEMU_ARGUMENTS, elf, line)
}

fn run_with(
    arguments: &str,
    elf: &Path,
    line: impl FnMut(String),
) -> Result<io::Result<ExitStatus>, Missing> {
    let child = Command::new(QEMU)
        .args(arguments.split_whitespace())
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn();
    match child {
        Ok(mut child) => {
            let result = follow(elf, &mut child, line);
            if result.is_err() {
                // QEMU may already have exited; the error is then ignored.
                let _ = child.kill();
                let _ = child.wait();
            }
            Ok(result)
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(no_qemu()),
        Err(error) => Ok(Err(error)),
    }
}

pub(crate) fn no_qemu() -> Missing {
    Missing(format!(
        "no {QEMU} here; on Debian: apt-get install --no-install-recommends {QEMU}"
    ))
}

/// Decodes the log of the running program until the program exits.
fn follow(elf: &Path, child: &mut Child, mut line: impl FnMut(String)) -> io::Result<ExitStatus> {
    let table = Table::parse(&fs::read(elf)?).map_err(io::Error::other)?;
    let table = table.ok_or_else(|| io::Error::other("the program holds no log formats"))?;
    let mut decoder = table.new_stream_decoder();
    let mut output = child.stdout.take().expect("stdout is a pipe");
    let (sender, chunks) = mpsc::channel();
    thread::spawn(move || {
        let mut chunk = [0; 4096];
        while let Ok(length @ 1..) = output.read(&mut chunk) {
            if sender.send(chunk[..length].to_vec()).is_err() {
                break;
            }
        }
    });
    let end = Instant::now() + TIMEOUT;
    let overdue = || io::Error::new(io::ErrorKind::TimedOut, "the program did not end in time");
    loop {
        match chunks.recv_timeout(end.saturating_duration_since(Instant::now())) {
            Ok(chunk) => decoder.received(&chunk),
            Err(mpsc::RecvTimeoutError::Disconnected) => return child.wait(),
            Err(mpsc::RecvTimeoutError::Timeout) => return Err(overdue()),
        }
        loop {
            match decoder.decode() {
                Ok(frame) => line(frame.display_message().to_string()),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => return Err(io::Error::other("a malformed log")),
            }
        }
    }
}
