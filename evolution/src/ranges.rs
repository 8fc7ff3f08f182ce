//! Range checks on values read from a run directory, performed while parsing: a value out of range
//! causes an error with its position, so that drawings and loops only receive valid values.

use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// Maximum valid time, in seconds: about 300 years.
const SECONDS_MAX: f64 = 1e10;

/// Reads a number from 0 to 1.
pub(crate) fn fraction<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    f64::deserialize(from).and_then(to_1)
}

/// Reads numbers from 0 to 1.
pub(crate) fn fractions<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    Vec::deserialize(from)?.into_iter().map(to_1).collect()
}

/// Reads a time in seconds.
pub(crate) fn seconds<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(from)?;
    if (0.0..=SECONDS_MAX).contains(&value) {
        return Ok(value);
    }
    Err(D::Error::custom(format!(
        "{value} seconds; expected from 0 to {SECONDS_MAX}"
    )))
}

/// Reads a hash.
pub(crate) fn hash<'de, D: Deserializer<'de>>(from: D) -> Result<String, D::Error> {
    let text = String::deserialize(from)?;
    hash_of(&text).map_err(D::Error::custom)
}

/// Reads a hash that may be missing.
pub(crate) fn optional_hash<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<String>, D::Error> {
    let text: Option<String> = Option::deserialize(from)?;
    let hash = text.as_deref().map(hash_of).transpose();
    hash.map_err(D::Error::custom)
}

fn to_1<E: Error>(value: f64) -> Result<f64, E> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(E::custom(format!("{value}; expected a number from 0 to 1")))
}

/// Parses a SHA-256 from a file, ignoring surrounding white space.
pub(crate) fn hash_of(text: &str) -> Result<String, String> {
    let hash = text.trim();
    let is_digit = |c: char| matches!(c, '0'..='9' | 'a'..='f');
    if hash.len() == 64 && hash.chars().all(is_digit) {
        return Ok(hash.to_owned());
    }
    let begin: String = hash.chars().take(70).collect();
    Err(format!(
        "{begin:?}; expected a hash of 64 hexadecimal digits, 0 to 9 and a to f"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Row {
        #[serde(deserialize_with = "fraction")]
        share: f64,
        #[serde(deserialize_with = "seconds")]
        wall_s: f64,
    }

    #[test]
    fn only_numbers_in_range_are_read_and_errors_name_the_line() {
        let read = |row: &str| -> Result<Row, String> {
            let text = format!("share,wall_s\n{row}\n");
            let mut rows = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
            rows.next()
                .expect("a row")
                .map_err(|e: csv::Error| e.to_string())
        };
        for good in ["0,0", "1,1e10", "0.5,3"] {
            let row = read(good).unwrap();
            assert!(row.share <= 1.0 && row.wall_s <= 1e10);
        }
        for bad in [
            "NaN,0", "inf,0", "-1,0", "2,0", "0,-1", "0,inf", "0,NaN", "x,0", ",0",
        ] {
            let error = read(bad).unwrap_err();
            assert!(error.contains("line: 2"), "{bad}: {error}");
        }
    }

    #[test]
    fn a_hash_is_64_hexadecimal_digits() {
        let good = "0123456789abcdef".repeat(4);
        assert_eq!(hash_of(&format!("{good}\n")), Ok(good.clone()));
        for bad in [
            "",
            "zzz",
            &good[1..],
            &good.to_uppercase(),
            &good.replace('0', "g"),
        ] {
            assert!(hash_of(bad).is_err(), "{bad}");
        }
    }
}
