//! All output to standard output and standard error.
//!
//! The reader may close the pipe, and the disk may be full. Writing a report to a closed pipe is
//! not an error, as in `evolver classify RUN | head`. Long work stops at a point from which it can
//! be resumed ([`event`]). Failures to write to standard error are ignored.
//!
//! Files and pipes receive UTF-8; a terminal receives ASCII if its locale does not support UTF-8.

use crate::exit::Exit;
use crate::signals;
use minimal_surprise_evolution::text::{ascii, terminal_lines};
use std::borrow::Cow;
use std::env;
use std::fmt::Arguments;
use std::io::{self, ErrorKind, IsTerminal, Write, stderr, stdout};
use std::sync::{LazyLock, OnceLock};

/// True if standard output is a terminal; checked at startup, since standard output may be closed
/// later.
static STDOUT_IS_TERMINAL: LazyLock<bool> = LazyLock::new(|| stdout().is_terminal());
static STDERR_IS_TERMINAL: LazyLock<bool> = LazyLock::new(|| stderr().is_terminal());
static LOCALE_IS_UTF8: LazyLock<bool> = LazyLock::new(locale_is_utf8);

/// The error that prevented writing an event.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Inspects the terminals, and disables colours if they are not supported.
pub(crate) fn start() {
    LazyLock::force(&STDOUT_IS_TERMINAL);
    LazyLock::force(&STDERR_IS_TERMINAL);
    if !terminal_has_codes() {
        console::set_colors_enabled(false);
        console::set_colors_enabled_stderr(false);
    }
}

/// Returns whether a terminal supports codes that move the cursor and change colours.
pub(crate) fn terminal_has_codes() -> bool {
    let named = |term: &std::ffi::OsString| !term.is_empty() && term != "dumb";
    cfg!(windows) || env::var_os("TERM").as_ref().is_some_and(named)
}

/// Returns whether standard output is a terminal that can be drawn on.
pub(crate) fn stdout_is_screen() -> bool {
    *STDOUT_IS_TERMINAL && terminal_has_codes()
}

/// Returns whether standard error is a terminal that can be drawn on.
pub(crate) fn stderr_is_screen() -> bool {
    *STDERR_IS_TERMINAL && terminal_has_codes()
}

/// Returns whether standard output is a terminal with an ASCII-only locale.
pub(crate) fn stdout_is_ascii() -> bool {
    *STDOUT_IS_TERMINAL && !*LOCALE_IS_UTF8
}

/// Returns whether standard error is a terminal with an ASCII-only locale.
pub(crate) fn stderr_is_ascii() -> bool {
    *STDERR_IS_TERMINAL && !*LOCALE_IS_UTF8
}

fn locale_is_utf8() -> bool {
    let set = |name| env::var_os(name).filter(|value| !value.is_empty());
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(set);
    let locale = locale.unwrap_or_default().to_string_lossy().to_lowercase();
    cfg!(windows) || locale.contains("utf-8") || locale.contains("utf8")
}

/// Converts the text to characters that standard error can display.
pub(crate) fn for_stderr(text: &str) -> Cow<'_, str> {
    if stderr_is_ascii() {
        ascii(text).into()
    } else {
        text.into()
    }
}

/// Writes to standard output. The caller handles the error.
pub(crate) fn try_write(text: Arguments<'_>) -> io::Result<()> {
    let mut stdout = stdout();
    if stdout_is_ascii() {
        stdout.write_all(ascii(&text.to_string()).as_bytes())?;
    } else {
        stdout.write_fmt(text)?;
    }
    stdout.flush()
}

/// Writes a report to standard output.
pub(crate) fn write(text: Arguments<'_>) {
    check(try_write(text));
}

/// Writes bytes to standard output.
pub(crate) fn write_bytes(bytes: &[u8]) {
    let mut stdout = stdout();
    let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
    check(written);
}

/// Exits if a report could not be written. Output to a closed pipe is discarded; the exit code
/// still reports the result.
pub(crate) fn check(written: io::Result<()>) {
    match written {
        Err(error) if !is_gone(&error) => {
            tell(format_args!("error: standard output: {error}\n"));
            Exit::Failure.now()
        }
        _ => {}
    }
}

/// Writes to standard output during long work. If that fails, requests a stop at the next point
/// from which the work can be resumed; [`lost`] then returns the error.
pub(crate) fn event(text: Arguments<'_>) {
    if let Err(error) = try_write(text) {
        // Keep the first error.
        let _ = LOST.set(error);
        signals::ask_to_stop();
    }
}

/// Returns the error if a stop was requested because writing to standard output failed.
pub(crate) fn lost() -> Option<&'static io::Error> {
    LOST.get()
}

/// Returns whether the error means that the reader of standard output has closed it; on a terminal,
/// every error means this.
pub(crate) fn is_gone(error: &io::Error) -> bool {
    error.kind() == ErrorKind::BrokenPipe || *STDOUT_IS_TERMINAL
}

/// Writes to standard error. Ignores errors, since they cannot be reported.
pub(crate) fn tell(text: Arguments<'_>) {
    // Use a single write, since other processes write to standard error too. Escape control
    // characters, which names and paths may contain.
    let text = terminal_lines(&text.to_string());
    let _ = stderr().write_all(for_stderr(&text).as_bytes());
}

/// Writes a report, or a part of it, to standard output.
macro_rules! show {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

/// Writes a line of a report to standard output.
macro_rules! show_line {
    ($($text:tt)*) => { $crate::output::write(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes a line to standard output during long work.
macro_rules! show_event {
    ($($text:tt)*) => { $crate::output::event(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes a line to standard error.
macro_rules! tell {
    ($($text:tt)*) => { $crate::output::tell(format_args!("{}\n", format_args!($($text)*))) };
}
