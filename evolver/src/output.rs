//! Standard output, where the reader may have gone: `evolver classify RUN | head` is no error.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stdout};

/// Writes to standard output; ends the program quietly if nobody reads it any more.
pub(crate) fn write(text: Arguments<'_>) {
    let mut stdout = stdout();
    check(stdout.write_fmt(text).and_then(|()| stdout.flush()));
}

/// The same for bytes.
pub(crate) fn write_bytes(bytes: &[u8]) {
    let mut stdout = stdout();
    check(stdout.write_all(bytes).and_then(|()| stdout.flush()));
}

fn check(written: std::io::Result<()>) {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        Err(error) => {
            eprintln!("error: standard output: {error}");
            std::process::exit(1);
        }
        Ok(()) => {}
    }
}

macro_rules! show {
    ($($text:tt)*) => { $crate::output::write(format_args!($($text)*)) };
}

macro_rules! show_line {
    ($($text:tt)*) => { $crate::output::write(format_args!("{}\n", format_args!($($text)*))) };
}
