//! Experiments of a suite: the table `[[experiment]]`, and its combinations of settings.
//!
//! In addition to its own keys, the table has a key for every setting that a suite may list; the
//! key's value is a single value or a list.

use minimal_surprise_controller::Prediction;
use minimal_surprise_evolution::settings::{
    Overrides, SETTINGS, Setting, SettingError, Settings, model_name, setting,
};
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;

/// Evolutions with every combination of the listed setting values.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentTable {
    /// Name of the experiment.
    pub name: String,
    /// Number of runs per combination, with consecutive seeds from [`ExperimentTable::first_seed`].
    pub runs: u32,
    /// Predictions: `free`, the name of a template, or `partly-line`.
    pub predictions: Vec<String>,
    /// Seed of the first run.
    pub first_seed: u64,
    /// True if the experiment is left out unless requested.
    pub optional: bool,
    /// Values of other settings, by setting name.
    values: BTreeMap<&'static str, Vec<String>>,
}

/// Name for predictions that are not fixed by a template.
const FREE: &str = "free";

/// Settings that have a fixed place in labels.
const LABELLED: [&str; 4] = ["grid", "robots", "sensor-model", "noise"];

impl ExperimentTable {
    /// Returns the listed settings with their values; the one that varies fastest comes first.
    pub fn lists(&self) -> impl Iterator<Item = (&'static Setting, &[String])> {
        let first = ["noise", "robots", "grid", "sensor-model"];
        let others = self.values.keys().copied();
        let others = others.filter(move |name| !first.contains(name));
        let names = first.into_iter().chain(others);
        names.filter_map(|name| Some((setting(name)?, self.values.get(name)?.as_slice())))
    }

    /// Returns the number of combinations of the listed values.
    pub(super) fn combinations(&self) -> u64 {
        self.lists()
            .map(|(_, values)| values.len())
            .chain([self.predictions.len()])
            .fold(1, |product, values| product.saturating_mul(values as u64))
    }

    pub(super) fn smallest_swarm(&self) -> Option<u32> {
        let robots = self.values.get("robots")?.iter();
        robots.filter_map(|robots| robots.parse().ok()).min()
    }

    /// Returns the settings of one combination: noise varies fastest, then robots, grids,
    /// predictions, models, then the other listed settings.
    pub(super) fn settings(&self, combination: u64) -> Result<Settings, SettingError> {
        let mut rest = combination;
        let mut next = |values: usize| {
            let index = rest % values as u64;
            rest /= values as u64;
            index as usize
        };
        let mut overrides = Overrides::default();
        for (setting, values) in self.lists() {
            overrides.flag(setting.name, Some(&values[next(values.len())]));
            if setting.name == "grid" {
                let prediction = &self.predictions[next(self.predictions.len())];
                match prediction.strip_prefix("partly-") {
                    Some(template) => overrides.flag("predefine-partly", Some(template)),
                    None if prediction == FREE => {}
                    None => overrides.flag("predefine", Some(prediction)),
                }
            }
        }
        Settings::resolve(&overrides, || self.first_seed)
    }

    /// Describes settings by model, predictions, grid, swarm size and noise, and by every other
    /// setting with several values in the experiment.
    pub(super) fn label(&self, settings: &Settings) -> String {
        let (scenario, noise) = (settings.scenario(), settings.noise());
        let model = model_name(settings.topology().model()).to_uppercase();
        let mut label = format!("{model}, {}", scenario.grid());
        match settings.topology().prediction() {
            Prediction::Free => {}
            Prediction::Predefined(template) => {
                label += &format!(", {} predefined", template.name())
            }
            Prediction::PartlyPredefined(template) => {
                label += &format!(", {} partly predefined", template.name());
            }
        }
        if scenario.robots() != 100 {
            label += &format!(", {} robots", scenario.robots());
        }
        if noise != 0.0 {
            label += &format!(", {} % noise", 100.0 * noise);
        }
        for (setting, values) in self.lists() {
            if values.len() > 1 && !LABELLED.contains(&setting.name) {
                let value = settings.value(setting.name);
                let value = value.map_or_else(|| setting.default.to_owned(), |v| v.to_string());
                label += &format!(", {} {value}", setting.name);
            }
        }
        label
    }
}

/// Keys that are not settings.
const OWN: [&str; 5] = ["name", "runs", "predictions", "first-seed", "optional"];

/// Settings that every experiment lists, at least with their defaults, because they label runs.
const ALWAYS: [&str; 4] = ["grid", "robots", "sensor-model", "noise"];

/// A key of an experiment.
enum Key {
    Own(&'static str),
    Setting(&'static str),
}

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let key = String::deserialize(deserializer)?;
        let own = OWN.into_iter().find(|own| *own == key).map(Self::Own);
        let mut lists = SETTINGS.iter().filter(|setting| !setting.list.is_empty());
        let found = own.or_else(|| {
            let setting = lists.clone().find(|setting| setting.list == key);
            setting.map(|setting| Self::Setting(setting.name))
        });
        found.ok_or_else(|| {
            let keys = OWN
                .into_iter()
                .chain(lists.by_ref().map(|setting| setting.list));
            let keys: Vec<String> = keys.map(|key| format!("`{key}`")).collect();
            let keys = keys.join(", ");
            D::Error::custom(format!("unknown field `{key}`, expected one of {keys}"))
        })
    }
}

/// One or several values, as text.
struct Values(Vec<String>);

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValuesVisitor)
    }
}

struct ValuesVisitor;

impl<'de> Visitor<'de> for ValuesVisitor {
    type Value = Values;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a string, or a list of them")
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Values, E> {
        Ok(Values(vec![value.to_owned()]))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Values, E> {
        Ok(Values(vec![value.to_string()]))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Values, E> {
        Ok(Values(vec![value.to_string()]))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Values, E> {
        Ok(Values(vec![value.to_string()]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Values, A::Error> {
        let mut values = Vec::new();
        while let Some(Values(value)) = sequence.next_element()? {
            match <[String; 1]>::try_from(value) {
                Ok([value]) => values.push(value),
                Err(_) => return Err(A::Error::custom("a list in a list")),
            }
        }
        Ok(Values(values))
    }
}

impl<'de> Deserialize<'de> for ExperimentTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ExperimentVisitor)
    }
}

struct ExperimentVisitor;

impl<'de> Visitor<'de> for ExperimentVisitor {
    type Value = ExperimentTable;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an experiment")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut table: A) -> Result<ExperimentTable, A::Error> {
        let (mut name, mut runs) = (None, None);
        let (mut first_seed, mut optional) = (1, false);
        let mut predictions = vec![FREE.to_owned()];
        let defaults = SETTINGS.iter().filter(|s| ALWAYS.contains(&s.name));
        let mut values: BTreeMap<_, _> = defaults
            .map(|setting| (setting.name, vec![setting.default.to_owned()]))
            .collect();
        while let Some(key) = table.next_key()? {
            match key {
                Key::Own("name") => name = Some(table.next_value()?),
                Key::Own("runs") => runs = Some(table.next_value()?),
                Key::Own("first-seed") => first_seed = table.next_value()?,
                Key::Own("optional") => optional = table.next_value()?,
                Key::Own(_) => predictions = table.next_value::<Values>()?.0,
                Key::Setting(setting) => {
                    values.insert(setting, table.next_value::<Values>()?.0);
                }
            }
        }
        Ok(ExperimentTable {
            name: name.ok_or_else(|| A::Error::missing_field("name"))?,
            runs: runs.ok_or_else(|| A::Error::missing_field("runs"))?,
            predictions,
            first_seed,
            optional,
            values,
        })
    }
}
