//! Conversion of drawings to pixels.

use super::drawing::Drawing;
use super::style::PictureError;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Maximum number of pixels of a picture, 8000 × 8000.
const PIXELS_MAX: f64 = 64e6;

/// Millimetres per inch.
const INCH: f64 = 25.4;

/// A picture as pixels, row by row from the north-west corner.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Red, green and blue of each pixel.
    pub rgb: Vec<u8>,
}

impl Pixels {
    /// Renders the drawing scaled to this width, in pixels.
    ///
    /// # Errors
    /// [`PictureError::TooLarge`] if the picture has more than 64 million pixels;
    /// [`PictureError::Encoding`] if the drawing cannot be converted.
    pub fn of(drawing: &Drawing, width: u32) -> Result<Self, PictureError> {
        let tree = Tree::from_str(&drawing.svg(), &Options::default())
            .map_err(|error| PictureError::Encoding(error.to_string()))?;
        let scale = f64::from(width) / f64::from(tree.size().width());
        // A partially covered last row would be translucent, so it is left out.
        let height = (f64::from(tree.size().height()) * scale).floor().max(1.0);
        let too_large = PictureError::TooLarge {
            width: f64::from(width),
            height,
        };
        if f64::from(width) * height > PIXELS_MAX {
            return Err(too_large);
        }
        let Some(mut pixmap) = Pixmap::new(width, height as u32) else {
            return Err(too_large);
        };
        let scale = scale as f32;
        resvg::render(
            &tree,
            Transform::from_scale(scale, scale),
            &mut pixmap.as_mut(),
        );
        // The background is opaque, so no pixel is translucent.
        let rgb = pixmap.data().chunks_exact(4).flat_map(|pixel| {
            let [red, green, blue, _] = [pixel[0], pixel[1], pixel[2], pixel[3]];
            [red, green, blue]
        });
        Ok(Self {
            width,
            height: pixmap.height(),
            rgb: rgb.collect(),
        })
    }

    /// Renders a drawing of [`super::Size::Screen`] at its own size, in pixels.
    ///
    /// # Errors
    /// [`PictureError::TooLarge`] if the picture has more than 64 million pixels;
    /// [`PictureError::Encoding`] if the drawing cannot be converted.
    pub fn of_screen(drawing: &Drawing) -> Result<Self, PictureError> {
        Self::of(drawing, drawing.width().ceil() as u32)
    }
}

/// Encodes a drawing of [`super::Size::Paper`] as PNG with this resolution.
///
/// # Errors
/// [`PictureError::TooLarge`] if the picture has more than 64 million pixels;
/// [`PictureError::Encoding`] if the drawing cannot be converted or encoded.
pub fn png(drawing: &Drawing, dots_per_inch: u32) -> Result<Vec<u8>, PictureError> {
    let dots = f64::from(dots_per_inch);
    let pixels = Pixels::of(drawing, (drawing.width() / INCH * dots).round() as u32)?;
    let mut info = png::Info::with_size(pixels.width, pixels.height);
    info.color_type = png::ColorType::Rgb;
    info.bit_depth = png::BitDepth::Eight;
    let per_metre = (dots / INCH * 1000.0).round() as u32;
    info.pixel_dims = Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    });
    let encode = || {
        let mut bytes = Vec::new();
        let mut writer = png::Encoder::with_info(&mut bytes, info)?.write_header()?;
        writer.write_image_data(&pixels.rgb)?;
        writer.finish()?;
        Ok(bytes)
    };
    encode().map_err(|error: png::EncodingError| PictureError::Encoding(error.to_string()))
}
