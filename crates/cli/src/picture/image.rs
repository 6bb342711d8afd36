//! A picture in memory and its PNG.

use super::Colour;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};

/// An RGB picture, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<Colour>,
}

impl Image {
    /// A picture of one colour.
    pub fn new(width: usize, height: usize, colour: Colour) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// Width in pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// The pixel in column `x` of row `y`; panics outside, as an array does.
    pub fn at(&self, x: usize, y: usize) -> Colour {
        self.pixels[y * self.width + x]
    }

    /// All pixels, row by row.
    pub fn pixels_mut(&mut self) -> &mut [Colour] {
        &mut self.pixels
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// A picture without pixels, or one too large for the format.
    pub fn png(&self) -> Result<Vec<u8>, ImageError> {
        let bytes: Vec<u8> = self.pixels.iter().flat_map(|c| c.0).collect();
        let mut out = Vec::new();
        let encoder = PngEncoder::new_with_quality(&mut out, CompressionType::Default, FilterType::Adaptive);
        encoder.write_image(&bytes, self.width as u32, self.height as u32, ExtendedColorType::Rgb8)?;
        Ok(out)
    }

    /// The picture as a `data:` address for a page that must not reach for the network.
    ///
    /// # Errors
    /// As [`Image::png`].
    pub fn data_uri(&self) -> Result<String, ImageError> {
        Ok(format!("data:image/png;base64,{}", STANDARD.encode(self.png()?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_decodes_to_the_same_pixels() {
        let mut picture = Image::new(3, 2, Colour::BLACK);
        picture.pixels_mut()[4] = Colour([1, 2, 3]);
        let decoded = image::load_from_memory(&picture.png().unwrap()).unwrap().to_rgb8();
        assert_eq!(decoded.dimensions(), (3, 2));
        assert_eq!(decoded.get_pixel(1, 1).0, [1, 2, 3]);
        assert_eq!(decoded.get_pixel(0, 0).0, [0, 0, 0]);
        assert!(picture.data_uri().unwrap().starts_with("data:image/png;base64,iVBOR"));
    }

    #[test]
    fn an_empty_picture_is_refused() {
        assert!(Image::new(0, 4, Colour::BLACK).png().is_err());
    }
}
