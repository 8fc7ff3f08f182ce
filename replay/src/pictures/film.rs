//! Animations: one frame per state, as GIF, or as MP4 if ffmpeg is installed.

use super::raster::Pixels;
use super::state;
use super::style::{PictureError, Style, last_shown};
use crate::recording::Recording;
use gif::{DisposalMethod, Encoder, Frame, Repeat};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::process::{Command, Stdio};

/// An animation of a run.
#[derive(Clone, Copy, Debug)]
pub struct Film<'a> {
    /// The run to show.
    pub recording: &'a Recording,
    /// Style of the frames; `size` is [`super::Size::Screen`].
    pub style: &'a Style,
    /// Number of steps between two frames; the last state is always shown.
    pub every: u32,
    /// Frames per second.
    pub frames_per_second: u32,
}

/// Number of frames drawn in parallel.
const AT_ONCE: usize = 16;

/// Time that a GIF shows its last frame before it restarts, in hundredths of a second.
const PAUSE: u16 = 200;

/// Palette index of pixels that a GIF frame leaves unchanged.
const UNCHANGED: u8 = 0;

type Rgb = [u8; 3];

impl Film<'_> {
    /// Returns the states that are shown.
    #[must_use]
    pub fn states(&self) -> Vec<usize> {
        let last = last_shown(self.recording, self.style.colouring);
        let mut states: Vec<usize> = (0..last).step_by(self.every.max(1) as usize).collect();
        states.push(last);
        states
    }

    /// Draws all frames and passes them on in order.
    fn each(
        &self,
        mut take: impl FnMut(Pixels) -> Result<(), PictureError>,
    ) -> Result<(), PictureError> {
        for states in self.states().chunks(AT_ONCE) {
            let frames = states.par_iter().map(|&t| {
                let drawing = state::frame(self.recording, t, self.style)?;
                Pixels::of_screen(&drawing)
            });
            for frame in frames.collect::<Result<Vec<_>, _>>()? {
                take(frame)?;
            }
        }
        Ok(())
    }

    /// Encodes the run as a looping GIF.
    ///
    /// # Errors
    /// [`PictureError`] if the recording lacks the requested data, or a frame is too large or
    /// cannot be encoded.
    pub fn gif(&self) -> Result<Vec<u8>, PictureError> {
        let mut palette = Palette::default();
        let mut frames: Vec<Frame<'static>> = Vec::new();
        let mut before: Option<Indexed> = None;
        let mut size = (0, 0);
        self.each(|pixels| {
            let indexed = palette.indexed(&pixels)?;
            size = (indexed.width, indexed.height);
            let mut frame = indexed.changed_since(before.as_ref());
            frame.delay = (100.0 / f64::from(self.frames_per_second)).round() as u16;
            // Compressed immediately, because many uncompressed frames would not fit into memory.
            frame.make_lzw_pre_encoded();
            frames.push(frame);
            before = Some(indexed);
            Ok(())
        })?;
        if let Some(last) = frames.last_mut() {
            last.delay = PAUSE;
        }
        let encode = || {
            let mut bytes = Vec::new();
            let mut encoder = Encoder::new(&mut bytes, size.0, size.1, &palette.colours)?;
            encoder.set_repeat(Repeat::Infinite)?;
            for frame in &frames {
                encoder.write_lzw_pre_encoded_frame(frame)?;
            }
            drop(encoder);
            Ok(bytes)
        };
        encode().map_err(|error: gif::EncodingError| PictureError::Encoding(error.to_string()))
    }

    /// Encodes the run as MP4 (H.264), using ffmpeg.
    ///
    /// # Errors
    /// [`PictureError`] if the recording lacks the requested data, a frame is too large, ffmpeg is
    /// missing or fails, or a temporary file cannot be used.
    pub fn mp4(&self) -> Result<Vec<u8>, PictureError> {
        // MP4 is not written sequentially, so it cannot be written to a pipe.
        let folder = tempfile::tempdir().map_err(PictureError::Ffmpeg)?;
        let file = folder.path().join("film.mp4");
        let mut ffmpeg = None;
        let mut size = None;
        let outcome = self.each(|pixels| {
            let child = match &mut ffmpeg {
                None => ffmpeg.insert(self.start_ffmpeg(&pixels, &file)?),
                Some(child) => child,
            };
            size = Some((pixels.width, pixels.height));
            match &mut child.stdin {
                // ffmpeg has stopped: its exit code and its messages give the reason.
                Some(pipe) => match pipe.write_all(&pixels.rgb) {
                    Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                        Err(PictureError::Ffmpeg(error))
                    }
                    _ => Ok(()),
                },
                None => Ok(()),
            }
        });
        let Some(mut child) = ffmpeg else {
            return outcome.map(|()| Vec::new());
        };
        drop(child.stdin.take());
        let mut said = String::new();
        if let Some(pipe) = &mut child.stderr {
            // The messages matter only if ffmpeg fails.
            let _ = pipe.read_to_string(&mut said);
        }
        let status = child.wait().map_err(PictureError::Ffmpeg)?;
        outcome?;
        if !status.success() {
            let last = said.lines().rev().find(|line| !line.trim().is_empty());
            let last = last.map_or_else(|| status.to_string(), str::to_owned);
            return Err(PictureError::FfmpegFailed(last));
        }
        std::fs::read(&file).map_err(PictureError::Ffmpeg)
    }

    /// Checks whether ffmpeg is installed, before any output is written.
    ///
    /// # Errors
    /// [`PictureError`] if ffmpeg cannot be started.
    pub fn look_for_ffmpeg() -> Result<(), PictureError> {
        let asked = Command::new("ffmpeg")
            .arg("-version")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        asked.map(|_| ()).map_err(not_started)
    }

    fn start_ffmpeg(
        &self,
        pixels: &Pixels,
        file: &std::path::Path,
    ) -> Result<std::process::Child, PictureError> {
        let ground = self.style.theme.ground.replace('#', "0x");
        let size = format!("{}x{}", pixels.width, pixels.height);
        let rate = self.frames_per_second.to_string();
        Command::new("ffmpeg")
            .args(["-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &size, "-r", &rate, "-i", "-"])
            // Players require even sides and colours at half the resolution.
            .args([
                "-vf",
                &format!("pad=ceil(iw/2)*2:ceil(ih/2)*2:color={ground}"),
            ])
            .args(["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-y"])
            .arg(file)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(not_started)
    }
}

fn not_started(error: std::io::Error) -> PictureError {
    match error.kind() {
        ErrorKind::NotFound => PictureError::NoFfmpeg,
        _ => PictureError::Ffmpeg(error),
    }
}

/// The colours of a GIF, in order of appearance.
///
/// A GIF needs few, because robots look the same in every cell. Once the palette is full, text is
/// drawn in the nearest colours.
struct Palette {
    /// Red, green and blue of each colour; the first stands for unchanged pixels.
    colours: Vec<u8>,
    indices: BTreeMap<Rgb, u8>,
}

impl Default for Palette {
    fn default() -> Self {
        Self {
            colours: vec![0; 3],
            indices: BTreeMap::new(),
        }
    }
}

impl Palette {
    fn index(&mut self, colour: Rgb) -> u8 {
        if let Some(&index) = self.indices.get(&colour) {
            return index;
        }
        let index = match u8::try_from(self.colours.len() / 3) {
            Ok(free) => {
                self.colours.extend(colour);
                free
            }
            Err(_) => self.nearest(colour),
        };
        self.indices.insert(colour, index);
        index
    }

    fn nearest(&self, colour: Rgb) -> u8 {
        let distance = |other: &[u8]| -> u32 {
            let channels = other.iter().zip(colour);
            channels
                .map(|(&a, b)| u32::from(a.abs_diff(b)).pow(2))
                .sum()
        };
        let colours = (0..=u8::MAX).zip(self.colours.chunks_exact(3)).skip(1);
        let nearest = colours.min_by_key(|(_, other)| distance(other));
        nearest.map_or(UNCHANGED, |(index, _)| index)
    }

    fn indexed(&mut self, pixels: &Pixels) -> Result<Indexed, PictureError> {
        let side = |side: u32| {
            u16::try_from(side).map_err(|_| PictureError::TooLarge {
                width: f64::from(pixels.width),
                height: f64::from(pixels.height),
            })
        };
        // Most pixels have the same colour as the previous one.
        let mut last: Option<(Rgb, u8)> = None;
        let colours = pixels.rgb.chunks_exact(3).map(|pixel| {
            let colour = [pixel[0], pixel[1], pixel[2]];
            match last {
                Some((same, index)) if same == colour => index,
                _ => {
                    let index = self.index(colour);
                    last = Some((colour, index));
                    index
                }
            }
        });
        let colours = colours.collect();
        Ok(Indexed {
            width: side(pixels.width)?,
            height: side(pixels.height)?,
            colours,
        })
    }
}

/// Pixels as palette indices.
struct Indexed {
    width: u16,
    height: u16,
    colours: Vec<u8>,
}

impl Indexed {
    /// Returns the smallest rectangle with all changes; unchanged pixels in it are left out.
    fn changed_since(&self, before: Option<&Self>) -> Frame<'static> {
        let whole = Frame {
            width: self.width,
            height: self.height,
            dispose: DisposalMethod::Keep,
            ..Frame::default()
        };
        let Some(before) = before else {
            return Frame {
                buffer: Cow::Owned(self.colours.clone()),
                ..whole
            };
        };
        let is_changed = |&(x, y): &(u16, u16)| {
            let at = usize::from(y) * usize::from(self.width) + usize::from(x);
            self.colours[at] != before.colours[at]
        };
        let (mut left, mut top, mut right, mut bottom) = (self.width, self.height, 0, 0);
        let all = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        for (x, y) in all.filter(is_changed) {
            (left, top) = (left.min(x), top.min(y));
            (right, bottom) = (right.max(x + 1), bottom.max(y + 1));
        }
        if left >= right {
            // Nothing changed, but a frame needs at least one pixel.
            (left, top, right, bottom) = (0, 0, 1, 1);
        }
        let inside = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
        let buffer = inside.map(|at| {
            if is_changed(&at) {
                self.colours[usize::from(at.1) * usize::from(self.width) + usize::from(at.0)]
            } else {
                UNCHANGED
            }
        });
        Frame {
            left,
            top,
            width: right - left,
            height: bottom - top,
            transparent: Some(UNCHANGED),
            buffer: Cow::Owned(buffer.collect()),
            ..whole
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(level: u8) -> Rgb {
        [level; 3]
    }

    #[test]
    fn a_full_palette_gives_the_nearest_colour() {
        let mut palette = Palette::default();
        for level in 0..=254 {
            assert_eq!(palette.index(grey(level)), level + 1);
        }
        assert_eq!(palette.colours.len(), 3 * 256);
        assert_eq!(palette.index([10, 10, 11]), 11);
        assert_eq!(palette.index(grey(255)), 255);
    }

    #[test]
    fn a_frame_is_the_rectangle_that_changed() {
        let still = Indexed {
            width: 4,
            height: 3,
            colours: vec![1; 12],
        };
        let mut moved = vec![1; 12];
        (moved[5], moved[10]) = (2, 3);
        let moved = Indexed {
            colours: moved,
            ..still
        };
        let still = Indexed {
            width: 4,
            height: 3,
            colours: vec![1; 12],
        };
        let frame = moved.changed_since(Some(&still));
        assert_eq!((frame.left, frame.top), (1, 1));
        assert_eq!((frame.width, frame.height), (2, 2));
        assert_eq!(*frame.buffer, [2, 0, 0, 3]);
        let frame = moved.changed_since(Some(&moved));
        assert_eq!(
            (frame.width, frame.height, &*frame.buffer),
            (1, 1, &[0][..])
        );
    }
}
