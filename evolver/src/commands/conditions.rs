//! The conditions of one run: a run directory says them, a genome takes flags.

use super::BadInput;
use crate::settings::{Given, Settings, model_name};
use clap::Args;
use minimal_surprise_controller::{EncodedGenome, Prediction};
use std::path::Path;

/// Flags that go with a genome file.
#[derive(Debug, Args)]
pub struct GenomeConditions {
    /// For a genome: width and height of the torus, in cells [default: 15x15].
    #[arg(long, value_name = "WxH", allow_hyphen_values = true)]
    grid: Option<String>,
    /// For a genome: swarm size [default: 100].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    robots: Option<String>,
    /// For a genome: steps [default: 500].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    steps: Option<String>,
    /// For a genome: probability that a sensor bit is flipped [default: 0].
    #[arg(long, value_name = "P", allow_hyphen_values = true)]
    noise: Option<String>,
    /// For a genome: root of all random numbers [default: the seed that it evolved with, else 0].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<String>,
}

impl GenomeConditions {
    fn flags(&self) -> [(&'static str, &Option<String>); 5] {
        [
            ("grid", &self.grid),
            ("robots", &self.robots),
            ("steps", &self.steps),
            ("noise", &self.noise),
            ("seed", &self.seed),
        ]
    }

    /// Refuses flags beside something that says the conditions itself.
    ///
    /// # Errors
    /// [`BadInput`] names the flag.
    pub(super) fn refuse_beside(&self, what: &str, path: &Path) -> Result<(), BadInput> {
        match self.flags().iter().find(|(_, given)| given.is_some()) {
            None => Ok(()),
            Some((flag, _)) => Err(BadInput::new(format!(
                "--{flag} and {what} exclude each other; {} says what to run",
                path.display()
            ))),
        }
    }

    /// The settings of a run of a genome.
    ///
    /// # Errors
    /// [`BadInput`] names the flag, the value and what would be valid.
    pub(super) fn settings(&self, encoded: &EncodedGenome<'_>) -> Result<Settings, BadInput> {
        let topology = encoded.topology();
        let mut given = Given::default();
        for (key, value) in self.flags() {
            given.flag(key, value.as_deref());
        }
        given.flag("sensor-model", Some(model_name(topology.model())));
        match topology.prediction() {
            Prediction::Free => {}
            Prediction::PartlyPredefined(template) => {
                given.flag("predefine-partly", Some(template.name()));
            }
            Prediction::Predefined(template) => given.flag("predefine", Some(template.name())),
        }
        let seed = encoded.provenance().seed.unwrap_or(0);
        Settings::resolve(&given, || seed).map_err(BadInput::new)
    }
}
