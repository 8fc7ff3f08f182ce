//! `plan`: lists the runs.

use super::choice::Chosen;
use crate::exit::Exit;
use crate::suite::Resilience;

/// Prints the plan: settings with their numbers of runs, re-evaluations, damage and the amount of
/// work.
pub(super) fn print(chosen: &Chosen) -> Exit {
    let (plan, suite, searches) = (&chosen.plan, &chosen.source.suite, chosen.searches());
    for experiment in &plan.experiments {
        show_line!("{}", experiment.name);
        for settings in experiment.settings() {
            show_line!("  {:<40} {:>4} runs", settings.label, settings.number);
        }
    }
    let is_planned = |of: &str| plan.experiments.iter().any(|e| e.name == of);
    for again in &suite.reevaluations {
        let of: Vec<&str> = again.of.iter().map(String::as_str).collect();
        let of: Vec<&str> = of.into_iter().filter(|of| is_planned(of)).collect();
        if !of.is_empty() {
            show_line!("{}", again.name);
            show_line!("  {:<40} {:>4} new starts", of.join(", "), again.starts);
        }
    }
    let resiliences = suite.resiliences.iter();
    for damage in resiliences.filter(|damage| is_planned(&damage.of)) {
        let Resilience { of, structure, .. } = damage;
        show_line!("{}", damage.name);
        show_line!(
            "  {:<40} {:>4} areas, {} times",
            format!("{of}, {structure}"),
            damage.robots_in_areas.len(),
            damage.repeat
        );
        if damage.further_runs > 0 && searches.contains(damage) {
            show_line!(
                "  if no run of {of} has a {structure}: up to {} more runs",
                damage.further_runs
            );
        }
    }
    let robot_steps: f64 = plan
        .runs()
        .by_settings()
        .map(|alike| {
            let settings = alike.settings();
            let generations = f64::from(settings.generations()) * alike.number() as f64;
            settings.robot_steps_per_generation() as f64 * generations
        })
        .sum();
    show_line!(
        "\n{} different runs, {} robot-steps",
        plan.runs().number(),
        in_words(robot_steps)
    );
    Exit::Done
}

/// Formats a large number.
fn in_words(number: f64) -> String {
    match number {
        1e9.. => format!("{:.1} billion", number / 1e9),
        1e6.. => format!("{:.1} million", number / 1e6),
        _ => format!("{number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::in_words;

    #[test]
    fn a_small_plan_is_not_said_to_be_nothing() {
        assert_eq!(in_words(450e9), "450.0 billion");
        assert_eq!(in_words(14.4e6), "14.4 million");
        assert_eq!(in_words(72_000.0), "72000");
    }
}
