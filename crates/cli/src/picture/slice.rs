//! A slice through a scan, with outlines, path and marks drawn over it.

use super::contour::{self, Contour};
use super::figure::{Figure, PictureError};
use super::svg::{Stroke, path_data, rimmed_text, stroked, text, text_width};
use super::view::SliceView;
use super::{Colour, Image};
use monro_geometry::{Patient, Point, TriangleMesh, Volume};
use rayon::prelude::*;

/// The densities that are shown between black and white, HU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Density shown as middle grey.
    pub level: f64,
    /// Range from black to white.
    pub width: f64,
}

impl Window {
    /// The usual window for brain.
    pub const BRAIN: Self = Self { level: 35.0, width: 90.0 };
    /// A wide window that shows skin and bone beside the brain.
    pub const HEAD: Self = Self { level: 60.0, width: 400.0 };

    /// The grey of a density.
    pub fn grey(self, hounsfield: f64) -> Colour {
        let t = (hounsfield - self.level) / self.width + 0.5;
        Colour([(t.clamp(0.0, 1.0) * 255.0).round() as u8; 3])
    }
}

/// Where the title begins, and its size, pixels.
const TITLE: [f64; 2] = [8.0, 18.0];
const TITLE_SIZE: f64 = 13.0;

/// Something drawn over a slice. Items with a name appear in the legend; equal names appear once.
#[derive(Debug, Clone)]
pub enum Overlay<'a> {
    /// The line where a surface meets the slice.
    Surface {
        /// The surface.
        mesh: &'a TriangleMesh,
        /// How the line is drawn.
        stroke: Stroke,
        /// Name in the legend; empty for none.
        name: &'a str,
    },
    /// The outline of the voxels with the given labels.
    Labels {
        /// The label volume.
        labels: &'a Volume<u8>,
        /// Which labels, taken together.
        of: &'a [u8],
        /// How the line is drawn.
        stroke: Stroke,
        /// Name in the legend; empty for none.
        name: &'a str,
    },
    /// A straight line in space, projected onto the slice.
    Path {
        /// One end.
        from: Point<Patient>,
        /// The other end.
        to: Point<Patient>,
        /// How the line is drawn.
        stroke: Stroke,
        /// Name in the legend; empty for none.
        name: &'a str,
    },
    /// A catheter, drawn at its true width, projected onto the slice; round at its tip.
    Catheter {
        /// Its outer end.
        from: Point<Patient>,
        /// Its tip.
        tip: Point<Patient>,
        /// Outer diameter, mm.
        diameter: f64,
        /// Colour.
        colour: Colour,
        /// Name in the legend; empty for none.
        name: &'a str,
    },
    /// A cross at a point, projected onto the slice.
    Mark {
        /// The point.
        at: Point<Patient>,
        /// Colour.
        colour: Colour,
        /// Name in the legend; empty for none.
        name: &'a str,
    },
}

/// A slice to be drawn.
pub struct SliceRequest<'a> {
    /// Plane, scale and size.
    pub view: SliceView,
    /// Density in HU at a point; `None` outside the scan (black). Called from several threads.
    pub sampler: &'a (dyn Fn(Point<Patient>) -> Option<f64> + Sync),
    /// Densities from black to white.
    pub window: Window,
    /// What is drawn over the scan, first at the bottom.
    pub overlays: Vec<Overlay<'a>>,
    /// Title in the upper left corner.
    pub title: String,
    /// Caption of the figure.
    pub caption: String,
}

impl core::fmt::Debug for SliceRequest<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SliceRequest").field("view", &self.view).field("title", &self.title).finish_non_exhaustive()
    }
}

/// The densities of a volume, as a sampler for [`SliceRequest`].
pub fn sampler(ct: &Volume<i16>) -> impl Fn(Point<Patient>) -> Option<f64> + Sync + '_ {
    |p| ct.trilinear(p)
}

/// The pixels of a slice alone.
pub fn slice_image(
    view: &SliceView,
    sampler: &(dyn Fn(Point<Patient>) -> Option<f64> + Sync),
    window: Window,
) -> Image {
    let [w, h] = view.pixels();
    let mut image = Image::new(w, h, Colour::BLACK);
    image.pixels_mut().par_chunks_mut(w).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            if let Some(hounsfield) = sampler(view.unproject([x as f64 + 0.5, y as f64 + 0.5])) {
                *pixel = window.grey(hounsfield);
            }
        }
    });
    image
}

/// Draws a slice.
///
/// # Errors
/// When the pixels cannot be written as PNG.
pub fn slice_figure(request: &SliceRequest<'_>) -> Result<Figure, PictureError> {
    let view = &request.view;
    let [width, height] = view.pixels().map(|n| n as f64);
    let image = slice_image(view, request.sampler, request.window);
    let overlays: String = request.overlays.iter().map(|o| overlay(o, view)).collect();
    let legend = Legend::new(&request.overlays, width);
    let content = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">{}{overlays}{}{}</svg>\
         <g transform=\"translate(0 {height})\">{}</g>",
        pixels(&image)?,
        frame_letters(view, &request.title),
        scale_bar(view, &request.title),
        legend.drawing
    );
    Ok(Figure { width, height: height + legend.height, content, caption: request.caption.clone() })
}

/// An `image` element with the pixels inside.
pub(crate) fn pixels(image: &Image) -> Result<String, PictureError> {
    let (width, height) = (image.width(), image.height());
    let uri = image.data_uri().map_err(|source| PictureError::Png { width, height, source })?;
    Ok(format!("<image width=\"{width}\" height=\"{height}\" href=\"{uri}\"/>"))
}

/// An overlay as it is drawn.
pub(super) fn overlay(overlay: &Overlay<'_>, view: &SliceView) -> String {
    match overlay {
        Overlay::Surface { mesh, stroke, .. } => lines(&contour::of_mesh(mesh, view), stroke),
        Overlay::Labels { labels, of, stroke, .. } => {
            lines(&contour::of_labels(labels, |l| of.contains(&l), view), stroke)
        }
        Overlay::Path { from, to, stroke, .. } => {
            stroked(&path_data([(&[view.project(*from), view.project(*to)][..], false)]), stroke)
        }
        Overlay::Catheter { from, tip, diameter, colour, .. } => catheter(view, [*from, *tip], *diameter, *colour),
        Overlay::Mark { at, colour, .. } => mark(view.project(*at), *colour),
    }
}

fn lines(contours: &[Contour], stroke: &Stroke) -> String {
    let thin: Vec<Contour> = contours.iter().map(|c| c.thinned(0.6)).filter(|c| c.points.len() > 1).collect();
    stroked(&path_data(thin.iter().map(|c| (&c.points[..], c.closed))), stroke)
}

fn catheter(view: &SliceView, ends: [Point<Patient>; 2], diameter: f64, colour: Colour) -> String {
    let width = (diameter / view.mm_per_pixel()).max(1.5);
    let [a, b] = ends.map(|p| view.project(p));
    let line = |colour: Colour, width: f64, opacity: f64| {
        format!(
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{}\" stroke-width=\"{width:.2}\" \
             stroke-linecap=\"round\" stroke-opacity=\"{opacity}\"/>",
            a[0],
            a[1],
            b[0],
            b[1],
            colour.hex()
        )
    };
    line(Colour::BLACK, width + 1.2, 0.6) + &line(colour, width, 0.85)
}

/// A cross with a dark rim.
fn mark([x, y]: [f64; 2], colour: Colour) -> String {
    let cross = [[[x - 6.0, y], [x + 6.0, y]], [[x, y - 6.0], [x, y + 6.0]]];
    let data = path_data(cross.iter().map(|line| (&line[..], false)));
    stroked(&data, &Stroke::solid(Colour::BLACK, 4.0)) + &stroked(&data, &Stroke::solid(colour, 2.0))
}

fn frame_letters(view: &SliceView, title: &str) -> String {
    let [w, h] = view.pixels().map(|n| n as f64);
    let [left, right, up, down] = view.letters();
    // A title that reaches the middle has the letters below it. Bold text is a tenth wider than usual.
    let title_ends = TITLE[0] + 1.1 * text_width(title, TITLE_SIZE);
    let top = if title_ends > w / 2.0 - 0.5 * text_width(&up, 17.0) - 6.0 { 38.0 } else { 19.0 };
    rimmed_text([7.0, h / 2.0 + 6.0], 17.0, "start", &left)
        + &rimmed_text([w - 7.0, h / 2.0 + 6.0], 17.0, "end", &right)
        + &rimmed_text([w / 2.0, top], 17.0, "middle", &up)
        + &rimmed_text([w / 2.0, h - 8.0], 17.0, "middle", &down)
}

fn scale_bar(view: &SliceView, title: &str) -> String {
    let [w, h] = view.pixels().map(|n| n as f64);
    let room = w * 0.3 * view.mm_per_pixel();
    let length = [100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0].into_iter().find(|l| *l <= room).unwrap_or(0.5);
    let (x0, x1, y) = (10.0, 10.0 + length / view.mm_per_pixel(), h - 10.0);
    let bar = [[x0, y - 4.0], [x0, y], [x1, y], [x1, y - 4.0]];
    let data = path_data([(&bar[..], false)]);
    stroked(&data, &Stroke::solid(Colour::BLACK, 4.0))
        + &stroked(&data, &Stroke::solid(Colour::WHITE, 2.0))
        + &rimmed_text([x0, y - 8.0], 12.0, "start", &format!("{length} mm"))
        + &rimmed_text(TITLE, TITLE_SIZE, "start", title)
}

/// Names of the overlays below a slice, in as many rows as they need.
pub(crate) struct Legend {
    pub(crate) drawing: String,
    pub(crate) height: f64,
}

impl Legend {
    fn new(overlays: &[Overlay<'_>], width: f64) -> Self {
        let items = overlays.iter().map(|o| match o {
            Overlay::Surface { stroke, name, .. }
            | Overlay::Labels { stroke, name, .. }
            | Overlay::Path { stroke, name, .. } => (*name, *stroke),
            Overlay::Catheter { colour, name, .. } => (*name, Stroke::solid(*colour, 5.0)),
            Overlay::Mark { colour, name, .. } => (*name, Stroke::solid(*colour, 2.0)),
        });
        Self::of(items, width)
    }

    /// A legend of named strokes, wrapped at `width` pixels.
    pub(crate) fn of<'a>(items: impl Iterator<Item = (&'a str, Stroke)>, width: f64) -> Self {
        let mut drawing = String::new();
        let mut seen: Vec<&str> = Vec::new();
        let (mut x, mut y) = (2.0, 16.0);
        for (name, stroke) in items {
            if name.is_empty() || seen.contains(&name) {
                continue;
            }
            seen.push(name);
            let wide = 30.0 + text_width(name, 14.0) + 12.0;
            if x > 2.0 && x + wide > width {
                (x, y) = (2.0, y + 19.0);
            }
            let sample = [[x, y - 4.0], [x + 22.0, y - 4.0]];
            let sample = path_data([(&sample[..], false)]);
            // Over the scan a light line stands out, on the white page it would not.
            if stroke.colour.0.iter().all(|c| *c > 180) {
                drawing += &stroked(&sample, &Stroke::solid(Colour::BLACK, stroke.width + 2.0));
            }
            drawing += &stroked(&sample, &stroke);
            drawing += &text([x + 28.0, y], 14.0, "start", "#222", name);
            x += wide;
        }
        Self { height: if seen.is_empty() { 0.0 } else { y + 6.0 }, drawing }
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::sphere;
    use super::super::view::Orientation;
    use super::*;
    use monro_geometry::Grid;

    #[test]
    fn a_bright_voxel_on_the_patients_left_is_on_the_right_of_an_axial_slice() {
        let grid = Grid::axis_aligned([21, 21, 5], [5.0, 5.0, 5.0], [-50.0, -50.0, -10.0]).unwrap();
        let mut ct = Volume::filled(grid, -1000i16);
        let bright = grid.containing(Point::new(30.0, -20.0, 0.0)).unwrap();
        let n = grid.index(bright[0], bright[1], bright[2]);
        ct.data_mut()[n] = 1000;
        let view = SliceView::standard(Orientation::Axial, Point::ORIGIN, 100.0, 200);
        let image = slice_image(&view, &sampler(&ct), Window { level: 0.0, width: 2000.0 });
        let brightest = (0..200 * 200).max_by_key(|n| image.at(n % 200, n / 200).0[0]).unwrap();
        let (x, y) = ((brightest % 200) as f64, (brightest / 200) as f64);
        // Left of the patient is right of the picture, the face is up: (30, -20) mm is pixel (160, 60).
        assert!((x - 160.0).abs() < 1.5 && (y - 60.0).abs() < 1.5, "{x} {y}");
        assert_eq!(view.letters()[1], "L");
    }

    #[test]
    fn a_figure_holds_pixels_outline_letters_scale_and_legend() {
        let mesh = sphere(Point::ORIGIN, 20.0, 5);
        let flat = |_: Point<Patient>| Some(35.0);
        let figure = slice_figure(&SliceRequest {
            view: SliceView::standard(Orientation::Axial, Point::ORIGIN, 100.0, 200),
            sampler: &flat,
            window: Window::BRAIN,
            overlays: vec![
                Overlay::Surface { mesh: &mesh, stroke: Stroke::dashed(Colour::SKY, 1.5), name: "ventricle <before>" },
                Overlay::Mark { at: Point::ORIGIN, colour: Colour::YELLOW, name: "target" },
            ],
            title: "Axial".into(),
            caption: "A \"ball\"".into(),
        })
        .unwrap();
        let svg = figure.inline();
        for part in
            ["data:image/png;base64,", "stroke-dasharray", "ventricle &lt;before&gt;", ">20 mm<", ">R<", ">L<", ">A<"]
        {
            assert!(svg.contains(part), "{part}");
        }
        assert!(svg.contains("aria-label=\"A &quot;ball&quot;\"") && !svg.contains("http"));
        assert!(figure.height > 200.0);
    }

    #[test]
    fn a_long_title_ran_into_the_letters_above() {
        let view = SliceView::standard(Orientation::Axial, Point::ORIGIN, 100.0, 420);
        let top = |title: &str| frame_letters(&view, title).contains("x=\"210.0\" y=\"38.0\"");
        assert!(top("Plane of the path, nearly coronal") && !top("Sagittal, before") && !top(""));
    }

    #[test]
    fn a_white_mark_was_white_on_white_in_the_legend() {
        let drawing = |colour| Legend::of([("doubt", Stroke::solid(colour, 2.0))].into_iter(), 200.0).drawing;
        assert!(drawing(Colour::WHITE).contains(&Colour::BLACK.hex()));
        assert!(!drawing(Colour::SKY).contains(&Colour::BLACK.hex()));
    }

    #[test]
    fn the_window_maps_its_ends_to_black_and_white() {
        let w = Window { level: 40.0, width: 80.0 };
        assert_eq!([w.grey(0.0), w.grey(80.0), w.grey(-9.0)], [Colour::BLACK, Colour::WHITE, Colour::BLACK]);
        assert_eq!(w.grey(40.0), Colour([128; 3]));
    }
}
