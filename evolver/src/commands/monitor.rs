//! `evolver monitor`: shows a robot's activity live.

use super::flag;
use super::port::{PortArgs, failed};
use crate::exit::Exit;
use crate::output;
use crate::robot::{Problem, fault_names, since};
use crate::signals::wait_until;
use clap::Args;
use console::Term;
use minimal_surprise_controller::Surprise;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_link::{LineCounters, Report};
use serde_json::json;
use std::io;
use std::time::{Duration, Instant};

/// Arguments of `evolver monitor`.
#[derive(Debug, Args)]
pub struct MonitorArgs {
    #[command(flatten)]
    port: PortArgs,
    /// Stop after this many seconds [default: at Ctrl-C].
    #[arg(long = "for", value_name = "SECONDS", allow_hyphen_values = true)]
    seconds: Option<String>,
    /// Print one JSON object per second.
    #[arg(long)]
    json: bool,
}

/// Shows the robot's activity every second.
///
/// # Errors
/// If the robot cannot be reached, disconnects, or reports impossible values.
pub fn monitor(arguments: &MonitorArgs) -> anyhow::Result<Exit> {
    // If no time limit is set, an interruption is the normal end.
    let (seconds, interrupted) = match &arguments.seconds {
        None => (u32::MAX, Exit::Done),
        Some(text) => {
            let seconds = flag("for", text, |text| count(text, u32::MAX))?;
            (seconds, Exit::Interrupted)
        }
    };
    let port = arguments.port.name();
    let mut robot = arguments.port.connect()?;
    let show = if arguments.json {
        Show::Json
    } else if output::stdout_is_screen() {
        Show::OneLine
    } else {
        Show::Lines
    };
    let started = Instant::now();
    let mut before = None;
    let mut exit = Exit::Done;
    for second in 0..=u64::from(seconds) {
        wait_until(started + Duration::from_secs(second));
        let told = match robot.telemetry() {
            Err(error) if matches!(error.problem, Problem::Interrupted { .. }) => {
                exit = interrupted;
                break;
            }
            told => told.map_err(failed)?,
        };
        let Some((report, line)) = told else {
            tell!("{port}: the robot restarted; {}", robot.identity());
            before = None;
            continue;
        };
        // The first report is the reference for the first second.
        if second > 0 {
            let sample = Sample {
                second,
                report,
                line,
                recent: before.and_then(|before| since(before, report.surprise)),
            };
            match show.sample(&sample) {
                // A pipe closed by its reader is a normal end.
                Err(error) if output::is_gone(&error) => return Ok(Exit::Done),
                shown => shown?,
            }
        }
        before = Some(report.surprise);
    }
    if matches!(show, Show::OneLine) {
        show!("\n");
    }
    Ok(exit)
}

/// Returns the share of mispredicted bits; `None` before the first bit.
fn share(surprise: Surprise) -> Option<f64> {
    (surprise.seen_bits > 0).then(|| surprise.mispredicted_bits as f64 / surprise.seen_bits as f64)
}

/// The activity in one second.
struct Sample {
    second: u64,
    report: Report,
    line: LineCounters,
    recent: Option<Surprise>,
}

/// The output format.
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
            "{} s  {}  surprise {} (this second {})  straight {}, of which held back {}  \
             left {}  right {}",
            self.second,
            if report.running { "running" } else { "stopped" },
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
