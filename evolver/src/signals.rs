//! Signals that request an exit. Signals ignored by the parent process stay ignored: a run under
//! `nohup` survives the closing of its terminal, and Ctrl-C does not stop a script's background
//! jobs.

use crate::exit::Exit;
use signal_hook::{consts, flag};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Signals that request an exit.
#[cfg(unix)]
const SIGNALS: [i32; 3] = [consts::SIGINT, consts::SIGTERM, consts::SIGHUP];
#[cfg(not(unix))]
const SIGNALS: [i32; 2] = [consts::SIGINT, consts::SIGTERM];

/// Interval between checks for signals. Several signals within one interval, such as one from a
/// terminal and one from its shell, count as one.
const LOOK: Duration = Duration::from_millis(50);

/// True once a stop has been requested; work then stops at the next point from which it can be
/// resumed.
static STOP: AtomicBool = AtomicBool::new(false);

/// Returns the flag that requests a stop at the next point from which the work can be resumed.
#[must_use]
pub fn stop() -> &'static AtomicBool {
    &STOP
}

/// Requests a stop at the next point from which the work can be resumed.
pub fn ask_to_stop() {
    STOP.store(true, Ordering::Relaxed);
}

/// Waits until this moment, or until a stop is requested.
pub fn wait_until(moment: Instant) {
    loop {
        let left = moment.saturating_duration_since(Instant::now());
        if left.is_zero() || STOP.load(Ordering::Relaxed) {
            break;
        }
        thread::sleep(LOOK.min(left));
    }
}

/// Installs signal handling: the first signal requests a stop after this generation, the second
/// exits immediately. In both cases the run can be resumed.
///
/// # Errors
/// If the signal handlers cannot be installed or a thread cannot be started.
pub fn stop_on_signal() -> io::Result<&'static AtomicBool> {
    ask_then_end("stopping after this generation", || {})?;
    Ok(stop())
}

/// Installs signal handling: the first signal prints `words` and requests a stop, the second calls
/// `last` and exits.
///
/// # Errors
/// If the signal handlers cannot be installed or a thread cannot be started.
pub fn ask_then_end(words: &'static str, last: impl Fn() + Send + 'static) -> io::Result<()> {
    let mut asked = false;
    on_signal(move || {
        if asked {
            last();
            Exit::Interrupted.now();
        }
        asked = true;
        ask_to_stop();
        tell!("\n{words}; press Ctrl-C again to exit immediately");
    })
}

/// Calls `handle` on a separate thread for every signal that requests an exit.
///
/// # Errors
/// If the signal handlers cannot be installed or a thread cannot be started.
pub fn on_signal(mut handle: impl FnMut() + Send + 'static) -> io::Result<()> {
    let came = Arc::new(AtomicBool::new(false));
    let ignored = ignored();
    for signal in SIGNALS
        .into_iter()
        .filter(|signal| ignored >> (signal - 1) & 1 == 0)
    {
        flag::register(signal, Arc::clone(&came))?;
    }
    thread::Builder::new().spawn(move || {
        loop {
            thread::sleep(LOOK);
            if came.swap(false, Ordering::Relaxed) {
                handle();
            }
        }
    })?;
    Ok(())
}

/// Returns the signals that this process ignores, bit n − 1 for signal n; 0 if the operating system
/// does not list them in `/proc`.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}
