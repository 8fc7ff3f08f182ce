//! `evolver bench`: measures the speed of this program.

use super::BadInput;
use crate::bench::{self, Report};
use minimal_surprise_sim::EnginePath;

/// Measures the program's speed and prints the results.
///
/// # Errors
/// [`BadInput`] if the environment names a vector path that this processor does not support.
pub fn bench(json: bool) -> anyhow::Result<()> {
    let path = EnginePath::from_environment().map_err(BadInput::new)?;
    let report = bench::run(path, |what| {
        if !json {
            tell!("measuring: {what}");
        }
    })?;
    if json {
        show_line!("{}", serde_json::to_string(&report)?);
    } else {
        show_line!("{}", text(&report, path));
    }
    Ok(())
}

fn text(report: &Report, path: EnginePath) -> String {
    let millions = |speed: f64| format!("{:.1}", speed / 1e6);
    let memory = report
        .peak_rss_mb
        .map_or("unknown".to_owned(), |mb| format!("{mb:.1}"));
    let rows = [
        ("plain", millions(report.plain)),
        ("fast", millions(report.fast)),
        ("fast, 20x20", millions(report.fast_20x20)),
        (
            "fast, no shortcut for repeated states",
            millions(report.fast_no_shortcut),
        ),
        ("fast, 10 % noise", millions(report.fast_noise)),
        ("f32 program", millions(report.f32)),
        ("fast over f32", format!("{:.1}", report.ratio_fast_f32)),
        (
            "two threads over two processes",
            format!("{:.3}", report.threads_2_efficiency),
        ),
        (
            "cost at 1,000,000 robots over 100",
            format!("{:.2}", report.million_robots_over_100),
        ),
        ("memory of an evolution, MB", memory),
    ];
    let mut text = format!(
        "path {}; speeds in million robot-steps per CPU-second, model C, 15x15\n",
        path.name()
    );
    for (name, value) in rows {
        text += &format!("\n{name:<38} {value:>8}");
    }
    text
}
