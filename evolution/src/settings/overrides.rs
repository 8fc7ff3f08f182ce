//! Settings as given by flags and in TOML files.
//!
//! Every value keeps the place where it was given, so that errors can show the place.

use super::table::{SETTINGS, Values};
use super::{SettingError, Settings};
use crate::files::{self, TEXT_BYTES_MAX};
use minimal_surprise_controller::Topology;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// Place where a setting was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A flag on the command line.
    Flag(&'static str),
    /// A method call in a program.
    Builder(&'static str),
    /// A line of a file.
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The setting.
        key: String,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(key) => write!(f, "--{key}"),
            Self::Builder(key) => write!(f, "{key}"),
            Self::Line { path, line, key } => {
                write!(f, "{}, line {line}: {key}", path.display())
            }
        }
    }
}

/// Values that replace defaults, by name. Flags take precedence over files.
#[derive(Clone, Debug, Default)]
pub struct Overrides {
    values: BTreeMap<&'static str, (String, Place)>,
}

impl Overrides {
    /// Adds a flag's value if it was given.
    pub fn flag(&mut self, key: &'static str, value: Option<&str>) {
        if let Some(value) = value {
            let place = Place::Flag(key);
            self.values.insert(key, (value.to_owned(), place));
        }
    }

    /// Adds the values of a TOML file, except those already given.
    ///
    /// # Errors
    /// [`SettingError`] if the file cannot be read, is not TOML, or contains an unknown key or a
    /// value that is neither a number nor a string.
    pub fn file(&mut self, path: &Path) -> Result<(), SettingError> {
        self.text(path, &files::read_text(path, TEXT_BYTES_MAX)?)
    }

    /// Adds the values of a TOML text, except those already given; the path is used in errors.
    ///
    /// # Errors
    /// [`SettingError`] if the text is not TOML, or contains an unknown key or a value that is
    /// neither a number nor a string.
    pub fn text(&mut self, path: &Path, text: &str) -> Result<(), SettingError> {
        let table = toml::de::DeTable::parse(text).map_err(|error| SettingError::Toml {
            path: path.to_owned(),
            error: Box::new(error),
        })?;
        for (name, value) in table.get_ref() {
            let line = 1 + text[..name.span().start].matches('\n').count();
            let place = Place::Line {
                path: path.to_owned(),
                line,
                key: name.get_ref().clone().into_owned(),
            };
            let Some(setting) = SETTINGS.iter().find(|s| s.name == name.get_ref()) else {
                return Err(SettingError::UnknownKey { place });
            };
            let value = value.get_ref();
            let scalar = scalar_text(value).map_err(|problem| SettingError::Invalid {
                place: place.clone(),
                value: format!("({})", value.type_str()),
                problem: problem.to_owned(),
            })?;
            self.values.entry(setting.name).or_insert((scalar, place));
        }
        Ok(())
    }

    /// Returns the first missing setting of those that every run's `config.toml` contains.
    #[must_use]
    pub fn missing(&self) -> Option<&'static str> {
        let defaults = Settings::resolve(&Self::default(), || 0).ok()?;
        let mut always = defaults.config().map(|(name, _)| name);
        always.find(|name| self.place(name).is_none())
    }

    /// Removes a setting.
    pub fn remove(&mut self, key: &str) {
        self.values.remove(key);
    }

    /// Returns the place where a setting was given; `None` if it was not.
    #[must_use]
    pub fn place(&self, key: &str) -> Option<&Place> {
        self.values.get(key).map(|(_, place)| place)
    }

    /// Returns the number of threads, if given.
    ///
    /// # Errors
    /// [`SettingError`] if any value is invalid.
    pub fn threads(&self) -> Result<Option<u32>, SettingError> {
        Ok(self.values()?.threads)
    }

    /// Returns the run directory, if given.
    ///
    /// # Errors
    /// [`SettingError`] if any value is invalid.
    pub fn out(&self) -> Result<Option<PathBuf>, SettingError> {
        Ok(self.values()?.out)
    }

    /// Returns the topology selected by the values.
    ///
    /// # Errors
    /// [`SettingError`] if any value is invalid, or the values select no valid topology.
    pub fn topology(&self) -> Result<Topology, SettingError> {
        super::topology(&self.values()?).map_err(|(keys, problem)| self.invalid(keys, problem))
    }

    /// Returns the given values, and defaults for the other settings.
    pub(super) fn values(&self) -> Result<Values, SettingError> {
        let mut values = Values::default();
        for setting in SETTINGS {
            if let Some((text, _)) = self.values.get(setting.name) {
                (setting.set)(&mut values, text)
                    .map_err(|problem| self.invalid(&[setting.name], problem))?;
            }
        }
        match (self.place("predefine"), self.place("predefine-partly")) {
            (Some(first), Some(second)) => Err(SettingError::Conflict {
                first: first.clone(),
                second: second.clone(),
            }),
            _ => Ok(values),
        }
    }

    /// Creates an error about the first of these settings that was given; if none was, about the
    /// default of the first.
    pub(super) fn invalid(&self, keys: &[&'static str], problem: String) -> SettingError {
        let mut given = keys.iter().filter_map(|key| self.values.get(key).cloned());
        let default = || ("(default)".to_owned(), Place::Flag(keys[0]));
        let (value, place) = given.next().unwrap_or_else(default);
        SettingError::Invalid {
            place,
            value,
            problem,
        }
    }
}

/// Returns a string unchanged, or a number without its underscores.
fn scalar_text(value: &toml::de::DeValue<'_>) -> Result<String, &'static str> {
    if let Some(text) = value.as_str() {
        Ok(text.to_owned())
    } else if let Some(integer) = value.as_integer() {
        if integer.radix() == 10 {
            Ok(integer.as_str().replace('_', ""))
        } else {
            Err("expected a decimal number")
        }
    } else if let Some(float) = value.as_float() {
        Ok(float.as_str().replace('_', ""))
    } else {
        Err("expected a number or a string")
    }
}
