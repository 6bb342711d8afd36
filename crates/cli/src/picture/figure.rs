//! A finished figure: SVG with whatever pixels it needs inside.

use image::ImageError;
use thiserror::Error;

/// Why a figure could not be drawn.
#[derive(Debug, Error)]
pub enum PictureError {
    /// The picture could not be encoded.
    #[error("a picture of {width} x {height} pixels cannot be written as PNG: {source}")]
    Png {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// What the encoder said.
        source: ImageError,
    },
}

/// A drawing with its caption.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Width in pixels.
    pub width: f64,
    /// Height in pixels.
    pub height: f64,
    /// What is inside the `svg` element.
    pub content: String,
    /// One sentence below the figure; also read aloud in its place.
    pub caption: String,
}

impl Figure {
    /// The figure for a page that holds it inline.
    pub fn inline(&self) -> String {
        format!(
            "<svg viewBox=\"0 0 {0:.0} {1:.0}\" width=\"{0:.0}\" height=\"{1:.0}\" role=\"img\" aria-label=\"{2}\" \
             font-family=\"system-ui, sans-serif\">{3}</svg>",
            self.width,
            self.height,
            super::svg::escape(&self.caption),
            self.content
        )
    }

    /// The figure as a file of its own.
    pub fn standalone(&self) -> String {
        self.inline().replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" ", 1)
    }

    /// Several figures as one, side by side, tops aligned.
    pub fn beside(figures: &[Self], gap: f64, caption: &str) -> Self {
        let mut content = String::new();
        let (mut x, mut height) = (0.0, 0f64);
        for figure in figures {
            content += &format!("<g transform=\"translate({x:.1} 0)\">{}</g>", figure.content);
            x += figure.width + gap;
            height = height.max(figure.height);
        }
        Self { width: (x - gap).max(0.0), height, content, caption: caption.to_owned() }
    }
}
