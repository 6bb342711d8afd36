//! Pictures, drawn by the program itself: slices with outlines, the head in three dimensions, cut meshes.
//!
//! A [`Figure`] is SVG: pixels as PNG inside, lines and letters as vectors over them. Slices follow the radiological
//! convention ([`Orientation`]). Nothing here reads a file or knows where the data came from.

mod camera;
mod colour;
mod contour;
mod cut;
mod figure;
mod head;
mod image;
mod scene;
mod shapes;
mod slice;
mod svg;
mod view;

#[cfg(test)]
mod phantom_tests;

pub use camera::Camera;
pub use colour::{Colour, SERIES};
pub use contour::{Contour, of_labels as contours_of_labels, of_mesh as contours_of_mesh};
pub use cut::{ColourBy, draw_path, mesh_cut_figure, mesh_open_figure};
pub use figure::{Figure, PictureError};
pub use head::{HeadCatheter, HeadScene, Look, head_figure};
pub use image::Image;
pub use scene::{Body, render};
pub use shapes::{cylinder, sphere};
pub use slice::{Overlay, SliceRequest, Window, sampler, slice_figure, slice_image};
pub use svg::{Dash, Stroke, escape};
pub use view::{Orientation, SliceView};

pub(crate) use slice::Legend;
pub(crate) use svg::{path_data, stroked, text, text_width};

/// A number for people: about four significant digits, no trailing zeros, an exponent only where it helps.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if !(-4..6).contains(&magnitude) {
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let fixed = format!("{value:.*}", usize::try_from(3 - magnitude).unwrap_or(0));
    if fixed.contains('.') { fixed.trim_end_matches('0').trim_end_matches('.').to_owned() } else { fixed }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_short_and_exact_enough() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (12.345_6, "12.35"),
            (-0.012_34, "-0.01234"),
            (37_336.0, "37336"),
            (1e9, "1e9"),
            (2.5e-7, "2.5e-7"),
            (f64::NAN, "not finite"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }
}
