//! `evolver monitor`: what a robot does, live.

use super::evaluate::flag;
use super::{BadInput, PortArgs};
use crate::output;
use crate::robot::{Robot, fault_names};
use crate::settings::count;
use crate::signals::on_signal;
use clap::Args;
use console::Term;
use minimal_surprise_controller::Surprise;
use minimal_surprise_link::{LineCounters, Report};
use serde_json::json;
use std::io;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Where the robot is, and how to show it.
#[derive(Debug, Args)]
pub struct MonitorArgs {
    #[command(flatten)]
    port: PortArgs,
    /// End after so many seconds [default: at Ctrl-C].
    #[arg(long = "for", value_name = "SECONDS", allow_hyphen_values = true)]
    seconds: Option<String>,
    /// Print a JSON object a second.
    #[arg(long)]
    json: bool,
}

/// Shows every second what the robot has done.
///
/// # Errors
/// [`BadInput`] if there is no such robot, or it goes away.
pub fn monitor(arguments: &MonitorArgs) -> anyhow::Result<()> {
    let seconds = match &arguments.seconds {
        None => u32::MAX,
        Some(text) => flag("for", text, |text| count(text, u32::MAX))?,
    };
    let (port, baud) = arguments.port.checked()?;
    let (stop, stopped) = channel();
    on_signal(move || {
        // A second Ctrl-C has nobody left to tell.
        let _ = stop.send(());
    })?;
    let mut robot = Robot::connect(&port, baud).map_err(BadInput::new)?;
    tell!("{port}: {}", robot.identity());
    let show = if arguments.json {
        Show::Json
    } else if output::stdout_is_screen() {
        Show::OneLine
    } else {
        Show::Lines
    };
    let started = Instant::now();
    let mut before = None;
    for second in 0..=u64::from(seconds) {
        let next = started + Duration::from_secs(second);
        let left = next.saturating_duration_since(Instant::now());
        match stopped.recv_timeout(left) {
            Err(RecvTimeoutError::Timeout) => {}
            _ => break,
        }
        let Some((report, line)) = robot.telemetry().map_err(BadInput::new)? else {
            tell!("{port}: it was restarted; {}", robot.identity());
            before = None;
            continue;
        };
        // The first one is what the first second is compared with.
        if second > 0 {
            let sample = Sample {
                second,
                report,
                line,
                recent: before.and_then(|before| since(before, report.surprise)),
            };
            match show.sample(&sample) {
                // Whoever read this has seen enough.
                Err(error) if output::is_gone(&error) => return Ok(()),
                shown => shown?,
            }
        }
        before = Some(report.surprise);
    }
    if matches!(show, Show::OneLine) {
        show!("\n");
    }
    Ok(())
}

/// What happened between two reports; none if the counts began anew.
fn since(before: Surprise, now: Surprise) -> Option<Surprise> {
    Some(Surprise {
        mispredicted_bits: now
            .mispredicted_bits
            .checked_sub(before.mispredicted_bits)?,
        seen_bits: now.seen_bits.checked_sub(before.seen_bits)?,
    })
}

/// Share of bits mispredicted; none before the first.
fn share(surprise: Surprise) -> Option<f64> {
    (surprise.seen_bits > 0).then(|| surprise.mispredicted_bits as f64 / surprise.seen_bits as f64)
}

/// One second.
struct Sample {
    second: u64,
    report: Report,
    line: LineCounters,
    recent: Option<Surprise>,
}

/// How it is shown.
enum Show {
    OneLine,
    Lines,
    Json,
}

impl Show {
    fn sample(&self, sample: &Sample) -> io::Result<()> {
        match self {
            Self::OneLine => {
                let terminal = Term::stdout();
                terminal.clear_line()?;
                let columns = usize::from(terminal.size().1).saturating_sub(1);
                let text: String = sample.text().chars().take(columns).collect();
                terminal.write_str(&text)
            }
            Self::Lines => output::try_write(format_args!("{}\n", sample.text())),
            Self::Json => output::try_write(format_args!("{}\n", sample.json())),
        }
    }
}

impl Sample {
    fn text(&self) -> String {
        let words =
            |share: Option<f64>| share.map_or("-".to_owned(), |share| format!("{share:.3}"));
        let report = self.report;
        let mut text = format!(
            "{} s  {}  surprise {} (in this second {})  straight {}, of these held back {}  \
             left {}  right {}",
            self.second,
            if report.running {
                "running"
            } else {
                "standing"
            },
            words(share(report.surprise)),
            words(self.recent.and_then(share)),
            report.straight,
            report.held_back,
            report.turned_left,
            report.turned_right,
        );
        for fault in fault_names(report.faults) {
            text += "  ";
            text += fault;
        }
        text
    }

    fn json(&self) -> serde_json::Value {
        let Self {
            second,
            report,
            line,
            recent,
        } = self;
        json!({
            "second": second,
            "running": report.running,
            "surprise": share(report.surprise),
            "surprise_in_this_second": recent.and_then(share),
            "mispredicted_bits": report.surprise.mispredicted_bits,
            "seen_bits": report.surprise.seen_bits,
            "straight": report.straight,
            "held_back": report.held_back,
            "turned_left": report.turned_left,
            "turned_right": report.turned_right,
            "faults": fault_names(report.faults),
            "line": line,
        })
    }
}
