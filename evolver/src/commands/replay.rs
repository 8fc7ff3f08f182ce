//! `evolver replay`: shows a run.

use super::damage::corners;
use super::errors::unusable;
use super::new_file::{refuse_existing, write_file};
use super::pictures::PictureArgs;
use super::setting_flags::GenomeConditions;
use super::{BadInput, flag, read_genome};
use crate::exit::Exit;
use crate::output;
use crate::report::progress::computing;
use crate::signals::{ask_to_stop, on_signal, stop};
use anyhow::Context;
use clap::Args;
use minimal_surprise_evolution::files::{self, DATA_BYTES_MAX, Existing};
use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_evolution::limits::Needs;
use minimal_surprise_evolution::text::{self, TextError, terminal_path};
use minimal_surprise_replay::page::{check_page, page};
use minimal_surprise_replay::recording::{Origin, Recording};
use minimal_surprise_replay::scene::Colouring;
use minimal_surprise_replay::terminal;
use minimal_surprise_replay::terminal::paints::Paints;
use minimal_surprise_sim::damage::Damage;
use minimal_surprise_sim::exchange::Trajectory;
use minimal_surprise_sim::{Area, Scenario, SeedTree};
use std::env;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use supports_color::Stream;

/// Help on the keys in the terminal.
const KEYS: &str = "\
Keys in the terminal:
  space               play, pause
  ← →                 step back, forward; ↑ ↓ (PgUp PgDn) by ten
  0–9 Home End        seek, by tenths of the run
  + -                 speed
  n p (Tab Shift-Tab) select next, previous robot: its readings and predictions; Esc deselects
  c                   colour: structure, surprise, plain
  b                   switch between the swarm before and after damage
  h j k l             scroll, if the grid is larger than the window
  q Ctrl-C            quit";

/// Arguments of `evolver replay`.
#[derive(Debug, Args)]
#[command(after_help = KEYS)]
pub struct ReplayArgs {
    /// A run directory, a genome file, or an agent_trajectory.
    run: PathBuf,
    /// For a run: remove the robots in this area of its final state, and continue. Corners are
    /// inclusive; the area wraps around the edge if x0 > x1 or y0 > y1.
    #[arg(long, value_name = "x0,y0,x1,y1", allow_hyphen_values = true)]
    remove: Option<String>,
    /// For a run: reposition the robots in this area of its final state at random, and continue.
    /// Corners are inclusive; the area wraps around the edge if x0 > x1 or y0 > y1.
    #[arg(
        long,
        value_name = "x0,y0,x1,y1",
        allow_hyphen_values = true,
        conflicts_with = "remove"
    )]
    reposition: Option<String>,
    #[command(flatten)]
    conditions: GenomeConditions,
    /// Meaning of the robots' colours.
    #[arg(long, value_enum, default_value_t)]
    colour: Colouring,
    #[command(flatten)]
    pictures: PictureArgs,
    /// Write a self-contained page for a browser.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Replace an existing file.
    #[arg(long)]
    overwrite: bool,
}

/// Shows a run.
///
/// # Errors
/// [`BadInput`] if the run cannot be read, the run has no steps, a flag is invalid, or memory is
/// insufficient.
pub fn replay(arguments: &ReplayArgs) -> anyhow::Result<Exit> {
    let overwrite = arguments.overwrite;
    let existing = Existing::with_overwrite(overwrite);
    if let Some(file) = &arguments.html {
        refuse_existing("html", file, overwrite)?;
    }
    arguments.pictures.refuse_existing(overwrite)?;
    let recording = recording(arguments)?;
    if recording.steps() == 0 {
        return Err(BadInput::new(format!(
            "{}: contains one state and no steps; nothing to replay",
            arguments.run.display()
        ))
        .into());
    }
    if let Some(file) = &arguments.html {
        let page = page(&recording, arguments.colour, None)
            .map_err(|error| BadInput::new(format!("{}: {error}", arguments.run.display())))?;
        write_file("html", file, page.as_bytes(), existing)?;
        show_line!("{} ({} KB)", terminal_path(file), page.len().div_ceil(1000));
    }
    if arguments.pictures.is_any() {
        arguments
            .pictures
            .write(&recording, arguments.colour, existing)?;
    } else if arguments.html.is_none() {
        // In the terminal, Ctrl-C is read as a key; this handler is for signals from other
        // processes.
        on_signal(ask_to_stop)?;
        return in_terminal(&recording, arguments.colour, stop());
    }
    Ok(Exit::Done)
}

/// Plays a recording in the terminal until the user quits or `stop` is set; returns the matching
/// exit code.
///
/// # Errors
/// [`BadInput`] if standard output is not a terminal.
pub(super) fn in_terminal(
    recording: &Recording,
    colouring: Colouring,
    stop: &AtomicBool,
) -> anyhow::Result<Exit> {
    check_terminal().map_err(|error| {
        BadInput::new(format!(
            "{error}; --html, --svg, --png, --gif and --mp4 write files instead"
        ))
    })?;
    let ascii = output::stdout_is_ascii();
    match terminal::play(recording, colouring, paints(), ascii, stop) {
        // Drawing also fails if the terminal is closed.
        _ if stop.load(Ordering::Relaxed) => Ok(Exit::Interrupted),
        played => played.map(|()| Exit::Done).context("the terminal"),
    }
}

/// Checks that standard output is a terminal that can show a replay.
pub(super) fn check_terminal() -> Result<(), String> {
    if !io::stdout().is_terminal() {
        Err("standard output is not a terminal; `replay` needs one".to_owned())
    } else if !output::terminal_has_codes() {
        let term = env::var_os("TERM").unwrap_or_default();
        Err(format!(
            "this terminal (TERM={}) cannot show the replay: it cannot move the cursor",
            term.to_string_lossy()
        ))
    } else {
        Ok(())
    }
}

/// Returns the colours that `COLORTERM`, `TERM` and `NO_COLOR` allow.
fn paints() -> Paints {
    match supports_color::on(Stream::Stdout) {
        Some(level) if level.has_16m => Paints::True,
        Some(level) if level.has_256 => Paints::Indexed,
        Some(level) if level.has_basic => Paints::Sixteen,
        _ => Paints::None,
    }
}

fn recording(arguments: &ReplayArgs) -> anyhow::Result<Recording> {
    let path = &arguments.run;
    let name = terminal_path(path);
    let conditions = &arguments.conditions;
    if path.is_dir() {
        conditions.refuse_beside("a run directory", path)?;
        let finished = FinishedRun::read_and_check(path).map_err(unusable)?;
        return Ok(of_run(arguments, &name, &finished)?);
    }
    for (flag, given) in [
        ("remove", &arguments.remove),
        ("reposition", &arguments.reposition),
    ] {
        if given.is_some() {
            return Err(BadInput::new(format!(
                "--{flag}: {name} is not a run directory; only the final state of a run can be damaged"
            ))
            .into());
        }
    }
    let bytes = files::read(path, DATA_BYTES_MAX).map_err(unusable)?;
    match text::decode(&bytes) {
        Ok(text) if text.starts_with("Gen:") => {
            conditions.refuse_beside("a trajectory", path)?;
            let trajectory = Trajectory::read(&text)
                .map_err(|error| BadInput::new(format!("{name}, {error}")))?;
            Ok(Recording::of_trajectory(&name, &trajectory).map_err(BadInput::new)?)
        }
        Err(error) if error == TextError::Utf16 || bytes.starts_with(b"Gen:") => {
            Err(BadInput::new(format!("{name}: {error}")).into())
        }
        _ => of_genome(arguments, path, &name),
    }
}

fn of_run(
    arguments: &ReplayArgs,
    name: &str,
    finished: &FinishedRun,
) -> Result<Recording, BadInput> {
    check_size(arguments, finished.settings.scenario())?;
    let grid = finished.settings.scenario().grid();
    let areas = [
        ("remove", &arguments.remove, Damage::Remove as fn(Area) -> _),
        ("reposition", &arguments.reposition, Damage::Reposition),
    ];
    let given = areas.into_iter().find_map(|(flag, text, damage)| {
        let text = text.as_deref()?;
        Some((flag, text, damage))
    });
    let Some((name_of_flag, text, damage)) = given else {
        return computing(finished.settings.scenario(), |after_step| {
            Recording::of_run(name, finished, after_step)
        })
        .map_err(BadInput::new);
    };
    let about = |error: &dyn std::fmt::Display| {
        BadInput::new(format!("--{name_of_flag} = {text}: {error}"))
    };
    let [x0, y0, x1, y1] = flag(name_of_flag, text, corners)?;
    let area = Area::new(grid, x0, y0, x1, y1).map_err(|error| about(&error))?;
    computing(finished.settings.scenario(), |after_step| {
        Recording::of_damage(name, finished, damage(area), after_step)
    })
    .map_err(|error| about(&error))
}

/// Rejects a recording that does not fit in this machine's memory or on a page; called before any
/// step is computed.
fn check_size(arguments: &ReplayArgs, scenario: &Scenario) -> Result<(), BadInput> {
    let needs = Needs::of_recording(scenario);
    needs.check_memory().map_err(BadInput::new)?;
    if arguments.html.is_some() {
        let (robots, steps) = (scenario.robots() as usize, scenario.steps() as usize);
        check_page(robots, steps, scenario.grid())
            .map_err(|error| BadInput::new(format!("{}: {error}", arguments.run.display())))?;
    }
    Ok(())
}

/// Records the run defined by the flags: the first trial of the seed.
fn of_genome(arguments: &ReplayArgs, path: &Path, name: &str) -> anyhow::Result<Recording> {
    let conditions = &arguments.conditions;
    let file = read_genome(path)?;
    let settings = conditions.settings(&file)?;
    let seeds = SeedTree::new(settings.seed());
    let origin = Origin {
        name: name.to_owned(),
        seed: Some(settings.seed()),
        noise: settings.noise(),
        ..Origin::default()
    };
    let scenario = settings.scenario();
    check_size(arguments, scenario)?;
    let trial = scenario.trial(seeds, 0, 0);
    let recording = computing(scenario, |after_step| {
        Recording::of_trial(file.genome(), scenario, &trial, origin, after_step)
    });
    Ok(recording.map_err(BadInput::new)?)
}
