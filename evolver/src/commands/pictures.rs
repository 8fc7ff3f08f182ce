//! `evolver replay` with output to files: stills and animations.

use super::new_file::{refuse_existing, write_file};
use super::{BadInput, flag};
use clap::{ArgGroup, Args, ValueEnum};
use minimal_surprise_evolution::files::Existing;
use minimal_surprise_evolution::settings::count;
use minimal_surprise_replay::palette::{DARK, LIGHT, Theme};
use minimal_surprise_replay::pictures::film::Film;
use minimal_surprise_replay::pictures::raster::png;
use minimal_surprise_replay::pictures::{Drawing, Picture, PictureError, Size, Style, still};
use minimal_surprise_replay::recording::Recording;
use minimal_surprise_replay::scene::Colouring;
use std::path::{Path, PathBuf};

/// Flags of `evolver replay` for pictures.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures")]
#[command(group = ArgGroup::new("still").args(["svg", "png"]).multiple(true))]
#[command(group = ArgGroup::new("film").args(["gif", "mp4"]).multiple(true))]
#[command(group = ArgGroup::new("picture").args(["svg", "png", "gif", "mp4"]).multiple(true))]
pub struct PictureArgs {
    /// Write a still as SVG; the file must not exist.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write a still as PNG; the file must not exist.
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Write an animation as GIF; the file must not exist.
    #[arg(long, value_name = "FILE")]
    gif: Option<PathBuf>,
    /// Write an animation as MP4, encoded by ffmpeg; the file must not exist.
    #[arg(long, value_name = "FILE")]
    mp4: Option<PathBuf>,
    /// Content of a still [default: damage with --remove or --reposition, else state].
    #[arg(long, value_enum, requires = "still")]
    what: Option<Picture>,
    /// The state that a still shows, 0 to the number of steps [default: the last].
    #[arg(long, value_name = "T", requires = "still", allow_hyphen_values = true)]
    at: Option<String>,
    /// Select this robot: mark its sensor readings and predictions.
    #[arg(
        long,
        value_name = "N",
        requires = "picture",
        allow_hyphen_values = true
    )]
    robot: Option<String>,
    /// The background.
    #[arg(long, value_enum, default_value_t, requires = "picture")]
    theme: Ground,
    /// Width of a still, in millimetres; the default is one column of a paper.
    #[arg(
        long,
        value_name = "MM",
        default_value = "85",
        requires = "still",
        allow_hyphen_values = true
    )]
    width_mm: String,
    /// Resolution of a PNG, in dots per inch.
    #[arg(
        long,
        value_name = "N",
        default_value = "300",
        requires = "png",
        allow_hyphen_values = true
    )]
    dpi: String,
    /// Side of a cell in an animation, in pixels.
    #[arg(
        long,
        value_name = "N",
        default_value = "16",
        requires = "film",
        allow_hyphen_values = true
    )]
    cell_px: String,
    /// Number of steps between two frames of an animation [default: about a hundred frames].
    #[arg(long, value_name = "N", requires = "film", allow_hyphen_values = true)]
    every: Option<String>,
    /// Frames per second of an animation.
    #[arg(
        long,
        value_name = "N",
        default_value = "10",
        requires = "film",
        allow_hyphen_values = true
    )]
    fps: String,
}

/// The background.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Ground {
    /// Dark on light.
    #[default]
    Light,
    /// Light on dark.
    Dark,
}

impl Ground {
    fn theme(self) -> &'static Theme {
        match self {
            Self::Light => &LIGHT,
            Self::Dark => &DARK,
        }
    }
}

/// Approximate number of frames of an animation without `--every`.
const FRAMES: usize = 100;

impl PictureArgs {
    fn files(&self) -> [(&'static str, Option<&Path>); 4] {
        [
            ("svg", self.svg.as_deref()),
            ("png", self.png.as_deref()),
            ("gif", self.gif.as_deref()),
            ("mp4", self.mp4.as_deref()),
        ]
    }

    /// Returns whether any picture is requested.
    pub(super) fn is_any(&self) -> bool {
        self.files().iter().any(|(_, file)| file.is_some())
    }

    /// Rejects files that exist, before anything is computed.
    ///
    /// # Errors
    /// [`BadInput`] if a file exists; the message names the flag and the file.
    pub(super) fn refuse_existing(&self, overwrite: bool) -> Result<(), BadInput> {
        let files = self.files().into_iter();
        let mut given = files.filter_map(|(flag, file)| Some((flag, file?)));
        given.try_for_each(|(flag, file)| refuse_existing(flag, file, overwrite))
    }

    /// Writes the pictures.
    ///
    /// # Errors
    /// [`BadInput`] if a flag is invalid; the message lists the valid values.
    pub(super) fn write(
        &self,
        recording: &Recording,
        colouring: Colouring,
        existing: Existing,
    ) -> anyhow::Result<()> {
        let width = flag("width-mm", &self.width_mm, |text| between(text, 40, 500))?;
        let dpi = flag("dpi", &self.dpi, |text| between(text, 50, 1200))?;
        let cell = flag("cell-px", &self.cell_px, |text| between(text, 4, 64))?;
        let fps = flag("fps", &self.fps, |text| count(text, 50))?;
        let steps = recording.steps() as u32;
        let every = match &self.every {
            Some(text) => flag("every", text, |text| count(text, steps))?,
            None => recording.steps().div_ceil(FRAMES) as u32,
        };
        let robot = match &self.robot {
            Some(text) => Some(flag("robot", text, number)? as usize),
            None => None,
        };
        let at = match &self.at {
            Some(text) => Some(flag("at", text, number)?),
            None => None,
        };
        let what = self.what.unwrap_or(match recording.origin.damage {
            Some(_) => Picture::Damage,
            None => Picture::State,
        });
        if let (Some(at), false) = (at, matches!(what, Picture::State | Picture::Damage)) {
            let what = what.to_possible_value();
            let what = what.as_ref().map_or("", |value| value.get_name());
            return Err(BadInput::new(format!(
                "--at = {at}: --what = {what} shows the whole run; only state and damage show one state"
            ))
            .into());
        }
        if self.mp4.is_some() {
            Film::look_for_ffmpeg().map_err(|error| self.about(error))?;
        }
        let style = |size| Style {
            size,
            theme: self.theme.theme(),
            colouring,
            robot,
        };
        if self.svg.is_some() || self.png.is_some() {
            let style = style(Size::Paper(f64::from(width)));
            let drawing = still(recording, what, at, &style).map_err(|error| self.about(error))?;
            self.write_still(&drawing, dpi, existing)?;
        }
        let style = style(Size::Screen(cell));
        let film = Film {
            recording,
            style: &style,
            every,
            frames_per_second: fps,
        };
        if let Some(file) = &self.gif {
            let bytes = film.gif().map_err(|error| self.about(error))?;
            write_file("gif", file, &bytes, existing)?;
        }
        if let Some(file) = &self.mp4 {
            let bytes = film.mp4().map_err(|error| self.about(error))?;
            write_file("mp4", file, &bytes, existing)?;
        }
        Ok(())
    }

    fn write_still(&self, drawing: &Drawing, dpi: u32, existing: Existing) -> anyhow::Result<()> {
        if let Some(file) = &self.svg {
            write_file("svg", file, drawing.svg().as_bytes(), existing)?;
        }
        if let Some(file) = &self.png {
            let bytes = png(drawing, dpi).map_err(|error| self.about(error))?;
            write_file("png", file, &bytes, existing)?;
        }
        Ok(())
    }

    /// Attributes an error to its flag.
    fn about(&self, error: PictureError) -> anyhow::Error {
        let given = |flag: &str, value: &Option<String>| {
            let value = value.as_deref().unwrap_or_default();
            BadInput::new(format!("--{flag} = {value}: {error}"))
        };
        match &error {
            PictureError::Encoding(_) | PictureError::Ffmpeg(_) | PictureError::FfmpegFailed(_) => {
                return error.into();
            }
            PictureError::NoState { .. } => given("at", &self.at),
            PictureError::NoRobot { .. } => given("robot", &self.robot),
            PictureError::TooNarrow { .. } => {
                BadInput::new(format!("--width-mm = {}: {error}", self.width_mm))
            }
            PictureError::NoFfmpeg => {
                let file = self.mp4.as_ref().map(|file| file.display().to_string());
                given("mp4", &file)
            }
            _ => BadInput::new(error),
        }
        .into()
    }
}

fn number(text: &str) -> Result<u32, String> {
    text.parse()
        .map_err(|_| "expected a whole number, 0 or more".to_owned())
}

fn between(text: &str, least: u32, most: u32) -> Result<u32, String> {
    match text.parse() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("expected a whole number from {least} to {most}")),
    }
}
