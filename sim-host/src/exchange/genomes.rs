//! `action_genomes` and `prediction_genomes`: weights of the best genome of each generation.
//!
//! Each generation has three rows of decimal numbers, for the input, hidden and output neurons of
//! one network in genome order (see [`minimal_surprise_controller::network`]), then a blank line.
//! All rows are padded with random numbers to the length of the longest row of the model's
//! prediction network, which is the row of its hidden weights: 80 for sensor model A, 48 for B, 224
//! for C, and 192 for C with the line partly predefined.

use super::{ExchangeError, Lines, Problem, number};
use minimal_surprise_controller::fixed::{FRACTION_BITS, WEIGHT_MAX_Q3_12};
use minimal_surprise_controller::network::Shape;
use minimal_surprise_controller::{Genome, Prediction, Topology};

/// Rows of one generation's network, as in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct GenomeRows {
    /// Line number of the first row, counted from 1; the other rows follow it.
    pub line: usize,
    /// The rows of the input, hidden and output neurons, including the padding.
    pub rows: [Vec<f64>; 3],
}

const ROWS: [&str; 3] = ["input row", "hidden row", "output row"];

/// Parses the text of an `action_genomes` or a `prediction_genomes` file: the networks of one or
/// more generations, starting with generation 0.
///
/// # Errors
/// [`ExchangeError`] if a line is invalid; it contains the number of the first invalid line.
pub fn read_genomes(text: &str) -> Result<Vec<GenomeRows>, ExchangeError> {
    generations(text).map(|rows| rows?.numbers()).collect()
}

/// Iterates over the generations (one or more) of an `action_genomes` or a `prediction_genomes`
/// file. Returns their rows as text, so that only the numbers that are used must be valid. The
/// iterator ends after an error.
pub fn generations(text: &str) -> impl Iterator<Item = Result<RowsOfText<'_>, ExchangeError>> {
    let (mut lines, mut generation, mut ended) = (Lines::of(text), 0, false);
    core::iter::from_fn(move || {
        if ended {
            return None;
        }
        let rows = next_rows(&mut lines, generation);
        generation += 1;
        ended = rows.is_err() || !lines.text_follows();
        Some(rows)
    })
}

/// Reads three rows and the blank lines after them.
fn next_rows<'a>(
    lines: &mut Lines<'a>,
    generation: usize,
) -> Result<RowsOfText<'a>, ExchangeError> {
    let line = lines.next;
    let mut rows = [""; 3];
    for (row, name) in rows.iter_mut().zip(ROWS) {
        let missing = || format!("the {name} of generation {generation}");
        let (line, text) = lines.required(missing)?;
        if text.is_empty() {
            let missing = missing();
            return Err(Problem::Ended { missing }.at(line));
        }
        *row = text;
    }
    if lines.text_follows() {
        let (line, text) = lines.required(String::new)?;
        return Err(super::unexpected("a blank line after three rows", text).at(line));
    }
    lines.skip_blank();
    Ok(RowsOfText { line, rows })
}

/// The rows of one generation's network, not parsed yet.
#[derive(Clone, Copy, Debug)]
pub struct RowsOfText<'a> {
    line: usize,
    rows: [&'a str; 3],
}

impl RowsOfText<'_> {
    /// Parses the numbers in the rows.
    ///
    /// # Errors
    /// [`ExchangeError`] if a line is invalid; it contains the number of the first invalid line.
    pub fn numbers(&self) -> Result<GenomeRows, ExchangeError> {
        let mut rows = [const { Vec::new() }; 3];
        for ((line, text), row) in (self.line..).zip(self.rows).zip(&mut rows) {
            for field in text.split_whitespace() {
                let value: f64 = number(line, field)?;
                if !value.is_finite() {
                    let found = field.into();
                    return Err(Problem::NotANumber { found }.at(line));
                }
                row.push(value);
            }
        }
        let line = self.line;
        Ok(GenomeRows { line, rows })
    }
}

/// Name of one of a genome's two networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NetworkName {
    /// The action network.
    Action,
    /// The prediction network.
    Prediction,
}

impl core::fmt::Display for NetworkName {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Action => "action",
            Self::Prediction => "prediction",
        })
    }
}

/// A weight beyond ±32767/4096 ≈ ±7.9998, which was limited to that range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaturatedWeight {
    /// The network whose file contains the weight.
    pub network: NetworkName,
    /// Line number of the weight, counted from 1.
    pub line: usize,
    /// Position of the weight in the line, counted from 1.
    pub column: usize,
    /// Index of the weight in the genome.
    pub index: usize,
    /// The value in the file.
    pub value: f64,
    /// The weight used instead, Q3.12.
    pub weight_q3_12: i16,
}

/// A genome imported from text, with the losses of the conversion.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedGenome {
    /// The genome; each weight is the nearest Q3.12 value, ties away from zero.
    pub genome: Genome,
    /// Largest difference between a weight that fits and the number in the file: at most 1/8192.
    pub rounding_error_max: f64,
    /// Every weight that does not fit, in genome order.
    pub saturated: Vec<SaturatedWeight>,
}

/// Reason why the rows do not form a genome of the topology.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A row has a length that the topology's networks do not have.
    #[error(
        "{network} genomes, line {line}: a row of {found} numbers; this topology's rows have {}",
        listed(expected)
    )]
    RowLength {
        /// The network whose file contains the row.
        network: NetworkName,
        /// Line number of the row, counted from 1.
        line: usize,
        /// Number of values in the row.
        found: usize,
        /// Valid lengths of the row.
        expected: Vec<usize>,
    },
    /// The topology has a prediction network, but its rows are missing.
    #[error("this topology has a prediction network; its genomes are needed too")]
    NoPrediction,
}

fn listed(lengths: &[usize]) -> String {
    let lengths: Vec<String> = lengths.iter().map(usize::to_string).collect();
    lengths.join(" or ")
}

/// Creates a genome from the rows of one generation. If all predictions are predefined, the genome
/// has no prediction network, and rows for it are ignored.
///
/// # Errors
/// [`ImportError`] if the length of a row does not match the topology, or the rows of the
/// prediction network are missing.
pub fn import_genome(
    topology: Topology,
    action: &GenomeRows,
    prediction: Option<&GenomeRows>,
) -> Result<ImportedGenome, ImportError> {
    let mut weights = Vec::with_capacity(topology.weights());
    let mut rounding_error_max = 0.0_f64;
    let mut saturated = Vec::new();
    let mut networks = vec![(NetworkName::Action, topology.action_shape(), action)];
    if let Some(shape) = topology.prediction_shape() {
        let rows = prediction.ok_or(ImportError::NoPrediction)?;
        networks.push((NetworkName::Prediction, shape, rows));
    }
    let expected = row_lengths(topology);
    for (network, shape, rows) in networks {
        let counts = [
            2 * shape.inputs(),
            shape.hidden() * shape.hidden_row(),
            shape.outputs() * shape.hidden(),
        ];
        for ((line, row), count) in (rows.line..).zip(&rows.rows).zip(counts) {
            if !expected.contains(&row.len()) {
                return Err(ImportError::RowLength {
                    network,
                    line,
                    found: row.len(),
                    expected,
                });
            }
            for (column, &value) in (1..).zip(&row[..count]) {
                let (weight_q3_12, fits) = to_q3_12(value);
                if fits {
                    let error = (value - from_q3_12(weight_q3_12)).abs();
                    rounding_error_max = rounding_error_max.max(error);
                } else {
                    saturated.push(SaturatedWeight {
                        network,
                        line,
                        column,
                        index: weights.len(),
                        value,
                        weight_q3_12,
                    });
                }
                weights.push(weight_q3_12);
            }
        }
    }
    Ok(ImportedGenome {
        genome: Genome::from_weights(topology, &weights)
            .expect("as many weights as the topology has, each within ±32767"),
        rounding_error_max,
        saturated,
    })
}

/// Returns the valid lengths of rows: the number of hidden weights of the topology's prediction
/// network or, if it has none, of any prediction network of its sensor model.
fn row_lengths(topology: Topology) -> Vec<usize> {
    let hidden = |shape: Shape| shape.hidden() * shape.hidden_row();
    let same = |other: &Topology| match topology.prediction() {
        Prediction::Predefined(_) => other.model() == topology.model(),
        _ => *other == topology,
    };
    let shapes = Topology::ALL.into_iter().filter(same);
    shapes
        .filter_map(Topology::prediction_shape)
        .map(hidden)
        .collect()
}

/// Returns the nearest weight, and true if the value is within half a unit of that weight.
fn to_q3_12(value: f64) -> (i16, bool) {
    let limit = f64::from(WEIGHT_MAX_Q3_12);
    let scaled = (value * f64::from(1 << FRACTION_BITS)).round();
    (scaled.clamp(-limit, limit) as i16, scaled.abs() <= limit)
}

fn from_q3_12(weight: i16) -> f64 {
    f64::from(weight) / f64::from(1 << FRACTION_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use minimal_surprise_controller::{SensorModel, Template};

    /// Returns a generation whose rows count up in units of 1/4096, padded to a length.
    fn text(length: usize) -> String {
        let row = |start: usize| -> String {
            let row = start..start + length;
            row.map(|k| format!("{:.6} ", k as f64 / 4096.0)).collect()
        };
        format!("{}\n{}\n{}\n\n", row(0), row(1000), row(2000))
    }

    fn topology(model: SensorModel, prediction: Prediction) -> Topology {
        Topology::new(model, prediction).unwrap()
    }

    #[test]
    fn rows_are_cut_to_the_layers_in_genome_order() {
        let rows = read_genomes(&text(48)).unwrap().remove(0);
        let free = topology(SensorModel::B, Prediction::Free);
        let imported = import_genome(free, &rows, Some(&rows)).unwrap();
        // For B, 7–4–2 has 14, 28 and 8 weights; 7–6–6 has 14, 48 and 36.
        let counted = |ranges: [core::ops::Range<i16>; 3]| -> Vec<i16> {
            ranges.into_iter().flatten().collect()
        };
        let action = counted([0..14, 1000..1028, 2000..2008]);
        let prediction = counted([0..14, 1000..1048, 2000..2036]);
        assert_eq!(imported.genome.action_weights(), action);
        assert_eq!(imported.genome.prediction_weights(), prediction);
        assert!(imported.rounding_error_max < 1e-6, "six decimals");
        assert_eq!(imported.saturated, []);
    }

    #[test]
    fn a_predefined_genome_needs_no_prediction_rows_but_others_do() {
        let rows = read_genomes(&text(224)).unwrap().remove(0);
        let predefined = Prediction::Predefined(Template::Line);
        let line = topology(SensorModel::C, predefined);
        let imported = import_genome(line, &rows, None).unwrap();
        assert_eq!(imported.genome.weights().len(), 166);
        assert_eq!(
            import_genome(Topology::default(), &rows, None),
            Err(ImportError::NoPrediction)
        );
    }

    #[test]
    fn rows_of_another_model_are_refused_with_their_line() {
        let partly = Prediction::PartlyPredefined(Template::Line);
        let predefined = Prediction::Predefined(Template::Line);
        for (topology, lengths) in [
            (topology(SensorModel::A, Prediction::Free), vec![80]),
            (topology(SensorModel::B, Prediction::Free), vec![48]),
            (topology(SensorModel::C, Prediction::Free), vec![224]),
            (topology(SensorModel::C, partly), vec![192]),
            (topology(SensorModel::C, predefined), vec![224, 192]),
        ] {
            for length in [48, 80, 192, 224, 225, 1] {
                let mut rows = read_genomes(&text(length)).unwrap().remove(0);
                let imported = import_genome(topology, &rows, Some(&rows));
                assert_eq!(imported.is_ok(), lengths.contains(&length), "{length}");
                if imported.is_ok() {
                    rows.rows[1].pop();
                    let error = import_genome(topology, &rows, Some(&rows)).unwrap_err();
                    let expected = ImportError::RowLength {
                        network: NetworkName::Action,
                        line: 2,
                        found: length - 1,
                        expected: lengths.clone(),
                    };
                    assert_eq!(error, expected);
                }
            }
        }
    }

    #[test]
    fn the_largest_rounding_and_every_weight_that_does_not_fit_are_reported() {
        let mut rows = read_genomes(&text(48)).unwrap().remove(0);
        rows.rows[0][3] = 0.1; // 409.6 units, rounded to 410: an error of 0.4/4096.
        rows.rows[1][5] = -8.0;
        rows.rows[2][7] = 7.9998; // 32767.18 units.
        rows.rows[2][40] = 100.0; // Padding.
        let model_b = topology(SensorModel::B, Prediction::Predefined(Template::Pair));
        let imported = import_genome(model_b, &rows, None).unwrap();
        assert!((imported.rounding_error_max - 0.4 / 4096.0).abs() < 1e-12);
        assert_eq!(imported.genome.weights()[3], 410);
        let saturated = SaturatedWeight {
            network: NetworkName::Action,
            line: 2,
            column: 6,
            index: 19,
            value: -8.0,
            weight_q3_12: -32767,
        };
        assert_eq!(imported.saturated, [saturated]);
        assert_eq!(imported.genome.weights()[19], -32767);
        assert_eq!(imported.genome.weights()[49], 32767);
    }

    #[test]
    fn weights_round_to_the_nearest_and_never_to_minus_32768() {
        assert_eq!(to_q3_12(0.5 / 4096.0), (1, true));
        assert_eq!(to_q3_12(-0.5 / 4096.0), (-1, true));
        assert_eq!(to_q3_12(32767.4 / 4096.0), (32767, true));
        assert_eq!(to_q3_12(-32767.4 / 4096.0), (-32767, true));
        assert_eq!(to_q3_12(-8.0), (-32767, false));
        assert_eq!(to_q3_12(1e300), (32767, false));
    }

    #[test]
    fn a_generation_can_be_read_although_others_are_invalid() {
        let of = |text| -> Vec<_> { generations(text).collect() };
        let rows = of("x\n2\n3\n\n4\n5\n6\n\n7\n8\n");
        assert!(rows[0].as_ref().unwrap().numbers().is_err());
        let second = rows[1].as_ref().unwrap().numbers().unwrap();
        assert_eq!((second.line, &second.rows[2][..]), (5, &[6.0][..]));
        assert_eq!(rows[2].as_ref().unwrap_err().line, 11);
        assert_eq!(rows.len(), 3);
    }

    #[test]
    fn text_that_is_not_three_rows_and_a_blank_line_is_refused() {
        let refused = |text: &str| read_genomes(text).unwrap_err();
        assert_eq!(refused("").line, 1);
        assert_eq!(refused("1 2\n3 4\n").line, 3);
        assert_eq!(refused("1 2\n3 4\n\n1 2\n").line, 3);
        assert_eq!(refused("1\n2\n3\n\n1\n2\n").line, 7);
        assert!(matches!(
            refused("1\n2\n3\n4\n"),
            ExchangeError {
                line: 4,
                problem: Problem::Expected { .. }
            }
        ));
        for field in ["x", "NaN", "inf", "1,5"] {
            let error = refused(&format!("1\n2 {field}\n3\n"));
            let found = field.to_string();
            assert_eq!(error, Problem::NotANumber { found }.at(2));
        }
        assert_eq!(read_genomes("1\n2\n3\n\n4\n5\n6").unwrap().len(), 2);
    }
}
