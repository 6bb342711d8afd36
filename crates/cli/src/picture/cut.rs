//! A tetrahedral mesh cut open: by a plane, or with a part taken away.

use super::Colour;
use super::camera::Camera;
use super::contour::of_tetrahedron;
use super::figure::{Figure, PictureError};
use super::head::Look;
use super::scene::{Body, render};
use super::slice::{Legend, Overlay, overlay, pixels};
use super::svg::{Stroke, path_data, rimmed_text, text};
use super::view::SliceView;
use monro_geometry::{Patient, Plane, Point, Structure, TET_FACES, TetMesh, TriangleMesh, Vector};

/// What the colour of an element says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ColourBy<'a> {
    /// Its label, by number.
    Label,
    /// Its label as the structure of a case that it stands for, by name.
    Structure,
    /// Its shape: three times the inscribed over the circumscribed radius, 0 (flat) to 1 (regular).
    Quality,
    /// A value for each element, between two bounds, with a name for the scale.
    Value {
        /// One value per element.
        values: &'a [f64],
        /// Values at the two ends of the scale.
        range: [f64; 2],
        /// What the value is, with its unit.
        name: &'a str,
    },
}

/// Steps of a continuous colour scale.
const STEPS: usize = 16;

impl ColourBy<'_> {
    /// The colour class of an element: its label, or the step of its value.
    fn class(self, mesh: &TetMesh, t: usize) -> u16 {
        let step = |v: f64| ((v.clamp(0.0, 1.0) * STEPS as f64) as u16).min(STEPS as u16 - 1);
        match self {
            Self::Label | Self::Structure => mesh.labels.get(t).copied().unwrap_or(0),
            Self::Quality => step(mesh.quality(t).radius_ratio),
            Self::Value { values, range: [low, high], .. } => {
                step((values.get(t).copied().unwrap_or(f64::NAN) - low) / (high - low))
            }
        }
    }

    fn colour(self, class: u16) -> Colour {
        match self {
            Self::Label => Colour::of_number(class),
            Self::Structure => Colour::of_label(class),
            _ => Colour::cividis((f64::from(class) + 0.5) / STEPS as f64),
        }
    }

    /// The legend below a figure.
    fn legend(self, classes: &[u16], width: f64) -> Legend {
        let (name, [low, high]) = match self {
            Self::Label | Self::Structure => {
                let name = |c| if self == Self::Structure { label_name(c) } else { format!("label {c}") };
                let names: Vec<(String, Colour)> = classes.iter().map(|&c| (name(c), self.colour(c))).collect();
                return Legend::of(names.iter().map(|(n, c)| (n.as_str(), Stroke::solid(*c, 8.0))), width);
            }
            Self::Quality => ("shape: 0 flat, 1 regular (radius ratio)", [0.0, 1.0]),
            Self::Value { range, name, .. } => (name, range),
        };
        let mut drawing = String::new();
        let wide = (width * 0.5).min(240.0) / STEPS as f64;
        for i in 0..STEPS {
            let colour = self.colour(i as u16).hex();
            let x = 40.0 + i as f64 * wide;
            drawing += &format!("<rect x=\"{x:.1}\" y=\"5\" width=\"{wide:.1}\" height=\"11\" fill=\"{colour}\"/>");
        }
        let end = 44.0 + STEPS as f64 * wide;
        drawing += &text([36.0, 15.0], 12.0, "end", "#222", &super::number(low));
        drawing += &text([end, 15.0], 12.0, "start", "#222", &super::number(high));
        drawing += &text([40.0, 32.0], 12.0, "start", "#222", name);
        Legend { drawing, height: 40.0 }
    }
}

fn label_name(label: u16) -> String {
    let known = Structure::from_label(label);
    known.map_or_else(|| format!("label {label}"), Structure::words)
}

/// The polygons in which the view's plane cuts the elements, coloured, with their edges.
pub fn mesh_cut_figure(mesh: &TetMesh, view: &SliceView, by: ColourBy<'_>, caption: &str) -> Figure {
    let plane = view.plane();
    let mut polygons: Vec<(u16, Vec<[f64; 2]>)> = Vec::new();
    for t in 0..mesh.tets.len() {
        let cut = of_tetrahedron(mesh.corners(t), &plane);
        if !cut.is_empty() {
            polygons.push((by.class(mesh, t), cut.into_iter().map(|p| view.project(p)).collect()));
        }
    }
    polygons.sort_by_key(|p| p.0);
    let [width, height] = view.pixels().map(|n| n as f64);
    let mut drawing = String::new();
    let mut classes = Vec::new();
    for group in polygons.chunk_by(|a, b| a.0 == b.0) {
        let class = group[0].0;
        classes.push(class);
        let data = path_data(group.iter().map(|(_, p)| (&p[..], true)));
        let fill = by.colour(class).hex();
        drawing += &format!("<path d=\"{data}\" fill=\"{fill}\" stroke=\"#333\" stroke-width=\"0.35\"/>");
    }
    let legend = by.legend(&classes, width);
    let content = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">{drawing}{}</svg>\
         <g transform=\"translate(0 {height})\">{}</g>",
        edge_letters(view),
        legend.drawing
    );
    Figure { width, height: height + legend.height, content, caption: caption.to_owned() }
}

/// Draws a path and its end onto a figure of the plane that holds it.
pub fn draw_path(figure: &mut Figure, view: &SliceView, [from, to]: [Point<Patient>; 2]) {
    for stroke in [Stroke::solid(Colour::WHITE, 2.4), Stroke::solid(Colour::BLACK, 1.0)] {
        figure.content += &overlay(&Overlay::Path { from, to, stroke, name: "" }, view);
    }
    figure.content += &overlay(&Overlay::Mark { at: to, colour: Colour::YELLOW, name: "" }, view);
}

fn edge_letters(view: &SliceView) -> String {
    let [w, h] = view.pixels().map(|n| n as f64);
    let [left, right, up, down] = view.letters();
    // With a rim: they may lie over an element of any colour.
    rimmed_text([4.0, h / 2.0], 15.0, "start", &left)
        + &rimmed_text([w - 4.0, h / 2.0], 15.0, "end", &right)
        + &rimmed_text([w / 2.0, 15.0], 15.0, "middle", &up)
        + &rimmed_text([w / 2.0, h - 6.0], 15.0, "middle", &down)
}

/// The mesh without the elements whose middle lies on the plane's positive side, in three dimensions: whole elements,
/// as the solver sees them.
///
/// # Errors
/// When the pixels cannot be written as PNG.
pub fn mesh_open_figure(
    mesh: &TetMesh,
    away: &Plane<Patient>,
    by: ColourBy<'_>,
    (look, pixels_wide): (Look, usize),
    caption: &str,
) -> Result<Figure, PictureError> {
    let kept: Vec<usize> = (0..mesh.tets.len()).filter(|&t| away.signed_distance(middle(mesh, t)) <= 0.0).collect();
    let (surface, owners) = outer_faces(mesh, &kept);
    let classes: Vec<u16> = owners.iter().map(|&t| by.class(mesh, t)).collect();
    let facets: Vec<Colour> = classes.iter().map(|&c| by.colour(c)).collect();
    let body = Body { mesh: &surface, colour: Colour::GREY, opacity: 1.0, facets: &facets };
    let (centre, size) = extent(mesh);
    let side = pixels_wide as f64;
    let mut content = String::new();
    if let Some(camera) = Camera::new(centre, Vector::from_array(look.away()), size * 1.15) {
        content += &pixels(&render(&[body], &camera, pixels_wide))?;
    }
    let mut present = classes;
    present.sort_unstable();
    present.dedup();
    let legend = by.legend(&present, side);
    content += &format!("<g transform=\"translate(0 {side})\">{}</g>", legend.drawing);
    Ok(Figure { width: side, height: side + legend.height, content, caption: caption.to_owned() })
}

fn middle(mesh: &TetMesh, t: usize) -> Point<Patient> {
    let [a, b, c, d] = mesh.corners(t);
    a.lerp(b, 0.5).lerp(c.lerp(d, 0.5), 0.5)
}

/// Faces that belong to one of the elements only, and that element.
fn outer_faces(mesh: &TetMesh, elements: &[usize]) -> (TriangleMesh, Vec<usize>) {
    let mut faces: Vec<([u32; 3], [u32; 3], usize)> = Vec::with_capacity(elements.len() * 4);
    for &t in elements {
        for f in TET_FACES {
            let face = f.map(|i| mesh.tets[t][i]);
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face, t));
        }
    }
    faces.sort_unstable();
    let single = faces.chunk_by(|a, b| a.0 == b.0).filter(|c| c.len() == 1);
    let (triangles, owners) = single.map(|c| (c[0].1, c[0].2)).unzip();
    (TriangleMesh { vertices: mesh.vertices.clone(), triangles }, owners)
}

fn extent(mesh: &TetMesh) -> (Point<Patient>, f64) {
    let Some([low, high]) = monro_geometry::bounds(mesh.vertices.iter().map(|p| p.to_array())) else {
        return (Point::ORIGIN, 1.0);
    };
    let size = (0..3).map(|a| high[a] - low[a]).fold(1.0, f64::max);
    (Point::from_array(low).lerp(Point::from_array(high), 0.5), size)
}

#[cfg(test)]
mod tests {
    use super::super::view::Orientation;
    use super::*;

    fn pair() -> TetMesh {
        let vertices = [[0., 0., 0.], [40., 0., 0.], [0., 40., 0.], [0., 0., 40.], [0., 0., -40.]];
        TetMesh {
            vertices: vertices.map(Point::from_array).to_vec(),
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
            labels: vec![4, 5],
        }
    }

    #[test]
    fn a_cut_shows_the_elements_that_it_meets() {
        let view = SliceView::standard(Orientation::Axial, Point::new(0.0, 0.0, 10.0), 100.0, 100);
        let figure = mesh_cut_figure(&pair(), &view, ColourBy::Structure, "cut");
        assert!(figure.content.contains(">brain<") && !figure.content.contains("left lateral"));
        // Cut at a quarter of its height, the corner tetrahedron is a triangle of 30 mm at pixel (50, 50).
        assert!(figure.content.contains("80.0 50.0") && figure.content.contains("50.0 80.0"));
        let numbered = mesh_cut_figure(&pair(), &view, ColourBy::Label, "cut");
        assert!(numbered.content.contains(">label 4<") && !numbered.content.contains("brain"));
        let values = ColourBy::Value { values: &[0.5, 1.0], range: [0.0, 1.0], name: "strain" };
        assert!(mesh_cut_figure(&pair(), &view, values, "").content.contains(">strain<"));
        assert!(mesh_cut_figure(&TetMesh::default(), &view, ColourBy::Quality, "").content.contains("regular"));
    }

    #[test]
    fn opening_a_mesh_takes_whole_elements_away() {
        let plane = Plane { point: Point::ORIGIN, normal: Vector::new(0.0, 0.0, 1.0) };
        let figure = mesh_open_figure(&pair(), &plane, ColourBy::Structure, (Look::Front, 40), "open").unwrap();
        assert!(figure.content.contains("left lateral ventricle") && !figure.content.contains(">brain<"));
        let (surface, owners) = outer_faces(&pair(), &[0, 1]);
        assert_eq!((surface.triangles.len(), owners.len()), (6, 6));
    }
}
