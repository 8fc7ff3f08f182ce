//! Topologies: the networks that a genome describes and the predictions that they make.

use crate::network::Shape;
use crate::sensor::{SensorBits, SensorModel};
use serde::{Deserialize, Serialize};

/// Structure whose local pattern serves as a predefined prediction (paper, Sec. 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Template {
    /// Robots ahead and behind, as far as the model senses.
    Line,
    /// One robot directly ahead.
    Pair,
    /// Robots two cells ahead and two cells behind; model C only.
    Square,
    /// Robots on the four diagonals, two cells ahead and two cells behind; model C only.
    TriangularLattice,
}

impl Template {
    /// Every template, in order.
    pub const ALL: [Self; 4] = [
        Self::Line,
        Self::Pair,
        Self::Square,
        Self::TriangularLattice,
    ];

    /// Returns the name used in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Pair => "pair",
            Self::Square => "square",
            Self::TriangularLattice => "triangular-lattice",
        }
    }

    /// Returns the sensors that the template predicts to be occupied; `None` if the model does not
    /// support the template.
    #[must_use]
    pub const fn bits(self, model: SensorModel) -> Option<SensorBits> {
        Some(SensorBits::new(match (self, model) {
            (Self::Line, SensorModel::A) => bits_at(&[0, 5]),
            (Self::Line, SensorModel::B) => bits_at(&[0, 3]),
            (Self::Line, SensorModel::C) => LINE_C,
            (Self::Pair, _) => bits_at(&[0]),
            (Self::Square, SensorModel::C) => bits_at(&[3, 11]),
            (Self::TriangularLattice, SensorModel::C) => bits_at(&[1, 2, 3, 9, 10, 11]),
            (Self::Square | Self::TriangularLattice, _) => return None,
        }))
    }
}

/// Sensors of model C that the line template sets.
const LINE_C: u16 = bits_at(&[0, 3, 8, 11]);

/// Returns a word with the bits of the given sensors set.
const fn bits_at(sensors: &[u8]) -> u16 {
    let mut bits = 0;
    let mut index = 0;
    while index < sensors.len() {
        bits |= 1 << sensors[index];
        index += 1;
    }
    bits
}

/// Division of the predictions between the network and fixed values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Prediction {
    /// The network predicts every sensor.
    #[default]
    Free,
    /// The sensors in the template are always predicted to be occupied; the network predicts the
    /// others. Available only for the line on model C.
    PartlyPredefined(Template),
    /// Every sensor has the fixed prediction of the template; there is no prediction network.
    Predefined(Template),
}

/// A valid combination of sensor model and predictions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Topology {
    model: SensorModel,
    prediction: Prediction,
}

/// Error: the sensor model and the template cannot be combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TopologyError {
    /// Squares and triangular lattices need model C.
    #[error("the template {} does not exist for sensor model {model:?}, only for C", template.name())]
    NoSuchTemplate {
        /// The template requested.
        template: Template,
        /// The sensor model requested.
        model: SensorModel,
    },
    /// Partly predefined predictions exist only for the line on model C.
    #[error("partly predefined predictions exist for the line on sensor model C only, not for the {} on {model:?}", template.name())]
    NotPartly {
        /// The template requested.
        template: Template,
        /// The sensor model requested.
        model: SensorModel,
    },
}

impl Topology {
    /// Every valid topology.
    pub const ALL: [Self; 12] = {
        use Prediction::{Free, PartlyPredefined, Predefined};
        use SensorModel::{A, B, C};
        use Template::{Line, Pair, Square, TriangularLattice};
        const fn of(model: SensorModel, prediction: Prediction) -> Topology {
            Topology { model, prediction }
        }
        [
            of(A, Free),
            of(A, Predefined(Line)),
            of(A, Predefined(Pair)),
            of(B, Free),
            of(B, Predefined(Line)),
            of(B, Predefined(Pair)),
            of(C, Free),
            of(C, PartlyPredefined(Line)),
            of(C, Predefined(Line)),
            of(C, Predefined(Pair)),
            of(C, Predefined(Square)),
            of(C, Predefined(TriangularLattice)),
        ]
    };

    /// Creates a topology if the combination is valid.
    ///
    /// # Errors
    /// [`TopologyError`] if the template and the model cannot be combined.
    pub const fn new(model: SensorModel, prediction: Prediction) -> Result<Self, TopologyError> {
        match prediction {
            Prediction::PartlyPredefined(template)
                if !matches!((template, model), (Template::Line, SensorModel::C)) =>
            {
                Err(TopologyError::NotPartly { template, model })
            }
            Prediction::Predefined(template) if template.bits(model).is_none() => {
                Err(TopologyError::NoSuchTemplate { template, model })
            }
            _ => Ok(Self { model, prediction }),
        }
    }

    /// Returns the sensor model.
    #[must_use]
    pub const fn model(self) -> SensorModel {
        self.model
    }

    /// Returns the division between network and fixed predictions.
    #[must_use]
    pub const fn prediction(self) -> Prediction {
        self.prediction
    }

    /// Returns the number of sensors.
    #[must_use]
    pub const fn sensors(self) -> usize {
        self.model.sensors()
    }

    /// Returns a mask with one bit set for every sensor that the prediction network predicts.
    #[must_use]
    pub const fn predicted(self) -> SensorBits {
        let all = self.model.mask().bits();
        SensorBits::new(match self.prediction {
            Prediction::Free => all,
            Prediction::PartlyPredefined(_) => all & !self.fixed().bits(),
            Prediction::Predefined(_) => 0,
        })
    }

    /// Returns the fixed predictions, with zeros for all other sensors. This is also the prediction
    /// for a robot's first reading.
    #[must_use]
    pub const fn fixed(self) -> SensorBits {
        match self.prediction {
            Prediction::Free => SensorBits::NONE,
            Prediction::PartlyPredefined(template) | Prediction::Predefined(template) => {
                match template.bits(self.model) {
                    Some(bits) => bits,
                    None => SensorBits::NONE,
                }
            }
        }
    }

    /// Returns the shape of the action network.
    #[must_use]
    pub const fn action_shape(self) -> Shape {
        match self.model {
            SensorModel::A => const { Shape::checked(9, 6, 2, false) },
            SensorModel::B => const { Shape::checked(7, 4, 2, false) },
            SensorModel::C => const { Shape::checked(15, 8, 2, false) },
        }
    }

    /// Returns the shape of the prediction network; `None` if all predictions are fixed.
    #[must_use]
    pub const fn prediction_shape(self) -> Option<Shape> {
        match (self.prediction, self.model) {
            (Prediction::Predefined(_), _) => None,
            (Prediction::PartlyPredefined(_), _) => {
                Some(const { Shape::checked(15, 12, 10, true) })
            }
            (Prediction::Free, SensorModel::A) => Some(const { Shape::checked(9, 8, 8, true) }),
            (Prediction::Free, SensorModel::B) => Some(const { Shape::checked(7, 6, 6, true) }),
            (Prediction::Free, SensorModel::C) => Some(const { Shape::checked(15, 14, 14, true) }),
        }
    }

    /// Returns the number of weights of the action network.
    #[must_use]
    pub const fn action_weights(self) -> usize {
        self.action_shape().weights()
    }

    /// Returns the number of weights of the prediction network; 0 if all predictions are fixed.
    #[must_use]
    pub const fn prediction_weights(self) -> usize {
        match self.prediction_shape() {
            Some(shape) => shape.weights(),
            None => 0,
        }
    }

    /// Returns the number of weights of a genome.
    #[must_use]
    pub const fn weights(self) -> usize {
        self.action_weights() + self.prediction_weights()
    }
}

/// Maximum number of weights of a genome: 166 of the action network and 450 of the prediction
/// network.
pub const MAX_WEIGHTS: usize = {
    let mut most = 0;
    let mut index = 0;
    while index < Topology::ALL.len() {
        let weights = Topology::ALL[index].weights();
        if weights > most {
            most = weights;
        }
        index += 1;
    }
    most
};

const _: () = assert!(MAX_WEIGHTS == 616);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_either_valid_and_listed_or_refused() {
        let mut accepted = 0;
        for model in SensorModel::ALL {
            let predictions = Template::ALL
                .into_iter()
                .flat_map(|template| {
                    [
                        Prediction::PartlyPredefined(template),
                        Prediction::Predefined(template),
                    ]
                })
                .chain([Prediction::Free]);
            for prediction in predictions {
                if let Ok(topology) = Topology::new(model, prediction) {
                    assert!(Topology::ALL.contains(&topology), "{topology:?}");
                    accepted += 1;
                }
            }
        }
        assert_eq!(accepted, Topology::ALL.len());
    }

    #[test]
    fn templates_have_the_names_that_files_use() {
        assert_eq!(
            Template::ALL.map(Template::name),
            ["line", "pair", "square", "triangular-lattice"]
        );
    }

    #[test]
    fn templates_predict_the_cells_of_their_structures() {
        for (template, model) in Template::ALL
            .into_iter()
            .flat_map(|template| SensorModel::ALL.map(|model| (template, model)))
        {
            let c_only = matches!(template, Template::Square | Template::TriangularLattice);
            let expected = (!c_only || model == SensorModel::C).then(|| {
                let cells = model.cells().iter().enumerate();
                let bits = cells.map(|(sensor, cell)| {
                    let (ahead, left) = (cell.ahead, cell.left);
                    let occupied = match template {
                        Template::Line => left == 0,
                        Template::Pair => (ahead, left) == (1, 0),
                        Template::Square => ahead.abs() == 2 && left == 0,
                        Template::TriangularLattice => {
                            ahead.abs() == 2 && left == 0 || ahead.abs() == 1 && left.abs() == 1
                        }
                    };
                    u16::from(occupied) << sensor
                });
                SensorBits::new(bits.sum())
            });
            assert_eq!(template.bits(model), expected, "{template:?}, {model:?}");
            if let Some(bits) = expected {
                let topology = Topology::new(model, Prediction::Predefined(template)).unwrap();
                assert_eq!(topology.fixed(), bits);
                assert_eq!(topology.predicted(), SensorBits::NONE);
            }
        }
        for model in SensorModel::ALL {
            let topology = Topology::new(model, Prediction::Free).unwrap();
            assert_eq!(topology.fixed(), SensorBits::NONE);
            assert_eq!(topology.predicted(), model.mask());
        }
    }

    #[test]
    fn networks_have_the_papers_sizes() {
        let sizes = |model, prediction| {
            let topology = Topology::new(model, prediction).unwrap();
            (topology.action_weights(), topology.prediction_weights())
        };
        assert_eq!(sizes(SensorModel::A, Prediction::Free), (84, 162));
        assert_eq!(sizes(SensorModel::B, Prediction::Free), (50, 98));
        assert_eq!(sizes(SensorModel::C, Prediction::Free), (166, 450));
        assert_eq!(
            sizes(SensorModel::C, Prediction::PartlyPredefined(Template::Line)),
            (166, 342)
        );
        assert_eq!(
            sizes(SensorModel::C, Prediction::Predefined(Template::Pair)),
            (166, 0)
        );
    }

    #[test]
    fn the_partly_predefined_line_leaves_ten_sensors_to_the_network() {
        let topology =
            Topology::new(SensorModel::C, Prediction::PartlyPredefined(Template::Line)).unwrap();
        let left: std::vec::Vec<usize> = (0..14).filter(|&k| topology.predicted().get(k)).collect();
        assert_eq!(left, [1, 2, 4, 5, 6, 7, 9, 10, 12, 13]);
    }

    extern crate std;
}
