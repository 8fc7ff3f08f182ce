//! Time and memory use, as reported by the operating system.

#[cfg(not(unix))]
use std::time::Instant;

/// Stopwatch for the CPU time of this process; measures elapsed time if the system does not report
/// CPU time.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    #[cfg(unix)]
    started_seconds: f64,
    #[cfg(not(unix))]
    started: Instant,
}

impl Stopwatch {
    /// Starts measuring.
    #[must_use]
    pub fn start() -> Self {
        Self {
            #[cfg(unix)]
            started_seconds: unix::process_cpu_seconds(),
            #[cfg(not(unix))]
            started: Instant::now(),
        }
    }

    /// Returns the seconds since the stopwatch was started.
    #[must_use]
    pub fn cpu_seconds(self) -> f64 {
        #[cfg(unix)]
        {
            unix::process_cpu_seconds() - self.started_seconds
        }
        #[cfg(not(unix))]
        {
            self.started.elapsed().as_secs_f64()
        }
    }
}

/// Returns the peak memory of any child process that has exited, in MB (10⁶ bytes).
#[must_use]
pub fn children_peak_rss_mb() -> Option<f64> {
    #[cfg(unix)]
    {
        unix::children_peak_rss_mb()
    }
    #[cfg(not(unix))]
    {
        None
    }
}

#[cfg(unix)]
mod unix {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;

    pub(super) fn process_cpu_seconds() -> f64 {
        let usage = getrusage(UsageWho::RUSAGE_SELF).expect("the call takes no input");
        let seconds = |time: nix::sys::time::TimeVal| time.num_microseconds() as f64 / 1e6;
        seconds(usage.user_time()) + seconds(usage.system_time())
    }

    pub(super) fn children_peak_rss_mb() -> Option<f64> {
        let usage = getrusage(UsageWho::RUSAGE_CHILDREN).ok()?;
        let unit_bytes = if cfg!(target_os = "macos") {
            1.0
        } else {
            1024.0
        };
        Some(usage.max_rss() as f64 * unit_bytes / 1e6)
    }
}
