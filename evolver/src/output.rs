//! All output to standard output and standard error.
//!
//! The reader may close the pipe, and the disk may be full. A report without a reader ends quietly:
//! `evolver classify RUN | head` is not an error. Work continues to a point from which it can be
//! resumed ([`event`]). What cannot be written to standard error is dropped.
//!
//! Files and pipes get UTF-8; a terminal gets what its locale supports.

use crate::exit::Exit;
use crate::signals;
use minimal_surprise_evolution::text::{ascii, terminal_lines};
use std::borrow::Cow;
use std::env;
use std::fmt::Arguments;
use std::io::{self, ErrorKind, IsTerminal, Write, stderr, stdout};
use std::sync::{LazyLock, OnceLock};

/// Checked once, at the start: a terminal that is closed later no longer counts as one.
static STDOUT_IS_TERMINAL: LazyLock<bool> = LazyLock::new(|| stdout().is_terminal());
static STDERR_IS_TERMINAL: LazyLock<bool> = LazyLock::new(|| stderr().is_terminal());
static LOCALE_IS_UTF8: LazyLock<bool> = LazyLock::new(locale_is_utf8);

/// Why an event could not be written.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Inspects the terminals, and disables colours where they are not supported.
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

/// The text as standard error can show it.
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

/// Exits if a report could not be written. A report whose reader is gone is dropped: the exit code
/// still tells the result.
pub(crate) fn check(written: io::Result<()>) {
    match written {
        Err(error) if !is_gone(&error) => {
            tell(format_args!("error: standard output: {error}\n"));
            Exit::Failure.now()
        }
        _ => {}
    }
}

/// Writes to standard output during work that takes long. If that fails, the work is asked to stop
/// where it can be resumed, and [`lost`] returns the reason.
pub(crate) fn event(text: Arguments<'_>) {
    if let Err(error) = try_write(text) {
        // The first error is kept.
        let _ = LOST.set(error);
        signals::ask_to_stop();
    }
}

/// Why the work was asked to stop, if writing to standard output failed.
pub(crate) fn lost() -> Option<&'static io::Error> {
    LOST.get()
}

/// Returns whether the reader of standard output is gone; for a terminal, any error means that.
pub(crate) fn is_gone(error: &io::Error) -> bool {
    error.kind() == ErrorKind::BrokenPipe || *STDOUT_IS_TERMINAL
}

/// Writes to standard error. Errors are ignored: there is nowhere to report them.
pub(crate) fn tell(text: Arguments<'_>) {
    // In one write, since other processes write there, too. Names and paths may contain anything.
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

/// Writes a line to standard output during work that takes long.
macro_rules! show_event {
    ($($text:tt)*) => { $crate::output::event(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes a line to standard error.
macro_rules! tell {
    ($($text:tt)*) => { $crate::output::tell(format_args!("{}\n", format_args!($($text)*))) };
}
