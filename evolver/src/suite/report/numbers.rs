//! Formatting of numbers, and rows as CSV.

use serde::Serialize;

/// Formats a number with its noun, in the plural if needed.
pub(super) fn plural(number: usize, what: &str) -> String {
    let s = if number == 1 { "" } else { "s" };
    format!("{number} {what}{s}")
}

/// Formats a number with `digits` decimals, without a sign if it rounds to zero.
pub(super) fn number(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

/// Formats a p-value.
pub(super) fn p_value(p: f64) -> String {
    if p < 0.001 {
        "p < 0.001".to_owned()
    } else {
        format!("p = {p:.3}")
    }
}

/// Serializes rows as CSV.
pub(super) fn csv_text(rows: &[impl Serialize]) -> String {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        table
            .serialize(row)
            .expect("writing plain rows to memory cannot fail");
    }
    let bytes = table
        .into_inner()
        .expect("flushing a buffer in memory cannot fail");
    String::from_utf8(bytes).expect("text stays text")
}
