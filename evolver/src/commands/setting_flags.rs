//! Flags for settings, generated from the table of settings; and flags for the conditions of a
//! single run from a genome file.

use super::BadInput;
use clap::builder::{OsStringValueParser, ValueParser};
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use minimal_surprise_controller::Prediction;
use minimal_surprise_evolution::genome_file::GenomeFile;
use minimal_surprise_evolution::settings::{Overrides, SETTINGS, Setting, Settings, model_name};
use minimal_surprise_evolution::text::text_of_path;
use std::ffi::OsString;
use std::path::Path;

fn arg(setting: &Setting, help: String) -> Arg {
    let arg = Arg::new(setting.name)
        .long(setting.name)
        .value_name(setting.value_name)
        .help(help);
    if setting.is_path {
        arg.value_parser(ValueParser::new(OsStringValueParser::new()))
    } else {
        arg.allow_hyphen_values(true)
    }
}

fn with_default(text: &str, default: &str) -> String {
    match default {
        "" => text.to_owned(),
        default => format!("{text} [default: {default}]"),
    }
}

fn values_of<'a>(matches: &ArgMatches, settings: impl Iterator<Item = &'a Setting>) -> Overrides {
    let mut overrides = Overrides::default();
    for setting in settings {
        if setting.is_path {
            let path = matches.get_one::<OsString>(setting.name);
            overrides.flag(
                setting.name,
                path.map(|path| text_of_path(Path::new(path))).as_deref(),
            );
        } else {
            let text = matches.get_one::<String>(setting.name);
            overrides.flag(setting.name, text.map(String::as_str));
        }
    }
    overrides
}

/// Makes a type with [`Overrides`] the flags of some settings.
macro_rules! flags {
    ($name:ident, $settings:expr, $arg:expr) => {
        impl Args for $name {
            fn augment_args(command: Command) -> Command {
                let arg: fn(&'static Setting) -> Arg = $arg;
                command.args($settings.map(arg))
            }

            fn augment_args_for_update(command: Command) -> Command {
                Self::augment_args(command)
            }
        }

        impl FromArgMatches for $name {
            fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
                Ok(Self(values_of(matches, $settings)))
            }

            fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
                *self = Self::from_arg_matches(matches)?;
                Ok(())
            }
        }
    };
}

/// All settings as flags.
#[derive(Clone, Debug, Default)]
pub struct SettingFlags(pub(super) Overrides);

flags!(SettingFlags, SETTINGS.iter(), |setting| {
    let arg = arg(setting, with_default(setting.meaning(), setting.default));
    // A run is resumed with its own settings, on any number of threads.
    match setting.name {
        "threads" => arg,
        _ => arg.conflicts_with("resume"),
    }
});

/// Settings that baselines depend on.
const BASELINE: [&str; 9] = [
    "sensor-model",
    "predefine",
    "predefine-partly",
    "grid",
    "robots",
    "steps",
    "noise",
    "repetitions",
    "seed",
];

fn baseline() -> impl Iterator<Item = &'static Setting> {
    SETTINGS.iter().filter(|s| BASELINE.contains(&s.name))
}

/// The flags for baselines.
#[derive(Clone, Debug, Default)]
pub struct BaselineFlags(Overrides);

flags!(BaselineFlags, baseline(), |setting| {
    let (meaning, default) = match setting.name {
        "seed" => ("Root of all random numbers", "0"),
        _ => (setting.meaning(), setting.default),
    };
    arg(setting, with_default(meaning, default))
});

impl BaselineFlags {
    /// Returns the settings to compute baselines for.
    ///
    /// # Errors
    /// [`BadInput`] if a flag is invalid; the message lists the valid values.
    pub(super) fn settings(&self) -> Result<Settings, BadInput> {
        Settings::resolve(&self.0, || 0).map_err(BadInput::new)
    }
}

/// Settings that are needed to run a genome but are not in its file.
const CONDITIONS: [&str; 5] = ["grid", "robots", "steps", "noise", "seed"];

fn conditions() -> impl Iterator<Item = &'static Setting> {
    SETTINGS.iter().filter(|s| CONDITIONS.contains(&s.name))
}

/// Flags for running a genome file.
#[derive(Clone, Debug, Default)]
pub struct GenomeConditions(Overrides);

flags!(GenomeConditions, conditions(), |setting| {
    let (meaning, default) = match setting.name {
        "seed" => (
            "Root of all random numbers",
            "the seed it evolved with, else 0",
        ),
        _ => (setting.meaning(), setting.default),
    };
    let help = format!(
        "For a genome: {}{}",
        meaning[..1].to_lowercase(),
        &meaning[1..]
    );
    arg(setting, with_default(&help, default))
});

impl GenomeConditions {
    /// Rejects these flags if the file already records the conditions.
    ///
    /// # Errors
    /// [`BadInput`] if a flag was given.
    pub(super) fn refuse_beside(&self, what: &str, path: &Path) -> Result<(), BadInput> {
        match conditions().find(|setting| self.0.place(setting.name).is_some()) {
            None => Ok(()),
            Some(Setting { name, .. }) => Err(BadInput::new(format!(
                "--{name} cannot be combined with {what}; {} records its own conditions",
                path.display()
            ))),
        }
    }

    /// Returns the settings for a run of a genome.
    ///
    /// # Errors
    /// [`BadInput`] if a flag is invalid; the message lists the valid values.
    pub(super) fn settings(&self, genome: &GenomeFile) -> Result<Settings, BadInput> {
        let topology = genome.topology();
        let mut overrides = self.0.clone();
        overrides.flag("sensor-model", Some(model_name(topology.model())));
        match topology.prediction() {
            Prediction::Free => {}
            Prediction::PartlyPredefined(template) => {
                overrides.flag("predefine-partly", Some(template.name()));
            }
            Prediction::Predefined(template) => overrides.flag("predefine", Some(template.name())),
        }
        let seed = genome.provenance().seed.unwrap_or(0);
        Settings::resolve(&overrides, || seed).map_err(BadInput::new)
    }
}
