//! The table `[[experiment]]` of a suite: besides its own keys, one for every setting that a suite
//! may list, with one value or several.

use super::{Experiment, FREE};
use minimal_surprise_evolution::settings::SETTINGS;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;

/// Keys that are no settings.
const OWN: [&str; 5] = ["name", "runs", "predictions", "first-seed", "optional"];

/// Settings that every experiment lists, because runs are labelled with them.
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
            let keys: Vec<&str> = OWN
                .into_iter()
                .chain(lists.by_ref().map(|s| s.list))
                .collect();
            D::Error::custom(format!("unknown key `{key}`; keys are {}", keys.join(", ")))
        })
    }
}

/// One value or several, as text.
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

impl<'de> Deserialize<'de> for Experiment {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ExperimentVisitor)
    }
}

struct ExperimentVisitor;

impl<'de> Visitor<'de> for ExperimentVisitor {
    type Value = Experiment;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an experiment")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut table: A) -> Result<Experiment, A::Error> {
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
        Ok(Experiment {
            name: name.ok_or_else(|| A::Error::missing_field("name"))?,
            runs: runs.ok_or_else(|| A::Error::missing_field("runs"))?,
            predictions,
            first_seed,
            optional,
            values,
        })
    }
}
