//! The head in three dimensions: skin as glass, ventricles, planned path and catheter.

use super::Colour;
use super::camera::Camera;
use super::figure::{Figure, PictureError};
use super::scene::{Body, render};
use super::shapes::{cylinder, sphere};
use super::slice::{Legend, pixels};
use super::svg::{Stroke, text};
use monro_geometry::{Patient, Point, TriangleMesh, Vector, bounds};

/// What a picture of the head shows.
#[derive(Debug, Clone, Default)]
pub struct HeadScene<'a> {
    /// The skin, drawn as glass.
    pub skin: Option<&'a TriangleMesh>,
    /// The brain, drawn as glass inside the skin.
    pub brain: Option<&'a TriangleMesh>,
    /// Solid surfaces with their colours and names: ventricles above all.
    pub solids: Vec<(&'a TriangleMesh, Colour, &'a str)>,
    /// Planned path: entry and target.
    pub path: Option<[Point<Patient>; 2]>,
    /// Catheters.
    pub catheters: Vec<HeadCatheter<'a>>,
    /// Caption of the figure.
    pub caption: String,
}

/// A catheter in a picture of the head.
#[derive(Debug, Clone, Copy)]
pub struct HeadCatheter<'a> {
    /// Outer end and tip.
    pub ends: [Point<Patient>; 2],
    /// Its diameter, mm.
    pub diameter: f64,
    /// Its colour.
    pub colour: Colour,
    /// Its name; those of one name and colour have one line in the legend.
    pub name: &'a str,
}

/// From where the head is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// From the front.
    Front,
    /// From the patient's left.
    Left,
    /// From the patient's right.
    Right,
    /// From the front, above, and the patient's left.
    FrontLeft,
    /// From the front, above, and the patient's right.
    FrontRight,
    /// From above, face up.
    Above,
}

impl Look {
    pub(crate) const fn away(self) -> [f64; 3] {
        match self {
            Self::Front => [0.0, 1.0, 0.0],
            Self::Left => [-1.0, 0.0, 0.0],
            Self::Right => [1.0, 0.0, 0.0],
            Self::FrontLeft => [-0.75, 0.75, -0.35],
            Self::FrontRight => [0.75, 0.75, -0.35],
            Self::Above => [0.0, 0.0, -1.0],
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Front => "From the front",
            Self::Left => "From the left",
            Self::Right => "From the right",
            Self::FrontLeft => "From the front and left",
            Self::FrontRight => "From the front and right",
            Self::Above => "From above",
        }
    }
}

const SKIN: Colour = Colour([224, 190, 165]);
const BRAIN: Colour = Colour([214, 170, 170]);

/// Draws the head once for each look, side by side, all at one scale.
///
/// # Errors
/// When the pixels cannot be written as PNG.
pub fn head_figure(scene: &HeadScene<'_>, looks: &[Look], pixels_wide: usize) -> Result<Figure, PictureError> {
    let extras = extras(scene);
    let mut bodies: Vec<Body<'_>> = scene.solids.iter().map(|(m, c, _)| Body::solid(m, *c)).collect();
    bodies.extend(extras.iter().map(|(m, c)| Body::solid(m, *c)));
    bodies.extend(scene.brain.map(|m| Body::glass(m, BRAIN, 0.25)));
    bodies.extend(scene.skin.map(|m| Body::glass(m, SKIN, 0.22)));
    let (centre, size) = extent(&bodies);
    let mut views = Vec::new();
    for look in looks {
        let Some(camera) = Camera::new(centre, Vector::from_array(look.away()), size) else { continue };
        let image = render(&bodies, &camera, pixels_wide);
        let side = pixels_wide as f64;
        let content = pixels(&image)? + &text([4.0, 16.0], 13.0, "start", "#222", look.name()) + &edges(&camera, side);
        views.push(Figure { width: side, height: side, content, caption: String::new() });
    }
    let mut figure = Figure::beside(&views, 8.0, &scene.caption);
    let legend = legend(scene, figure.width);
    figure.content += &format!("<g transform=\"translate(0 {:.0})\">{}</g>", figure.height, legend.drawing);
    figure.height += legend.height;
    Ok(figure)
}

/// Which way is where, at the edges of a picture.
fn edges(camera: &Camera, side: f64) -> String {
    let [left, right, up, down] = camera.letters();
    text([4.0, side / 2.0], 15.0, "start", "#222", &left)
        + &text([side - 4.0, side / 2.0], 15.0, "end", "#222", &right)
        + &text([side / 2.0, 16.0], 15.0, "middle", "#222", &up)
        + &text([side / 2.0, side - 6.0], 15.0, "middle", "#222", &down)
}

/// Meshes of path and catheter.
fn extras(scene: &HeadScene<'_>) -> Vec<(TriangleMesh, Colour)> {
    let mut out = Vec::new();
    if let Some([entry, target]) = scene.path {
        out.push((cylinder(entry, target, 0.7), Colour::PLAN));
        out.push((sphere(entry, 2.5, 4), Colour::PLAN));
        out.push((sphere(target, 2.5, 4), Colour::PLAN));
    }
    for &HeadCatheter { ends: [end, tip], diameter, colour, .. } in &scene.catheters {
        out.push((cylinder(end, tip, diameter / 2.0), colour));
        out.push((sphere(tip, diameter / 2.0, 4), colour));
    }
    out
}

fn legend(scene: &HeadScene<'_>, width: f64) -> Legend {
    let mut items: Vec<(&str, Stroke)> = scene.solids.iter().map(|(_, c, n)| (*n, Stroke::solid(*c, 6.0))).collect();
    if scene.path.is_some() {
        items.push(("planned path", Stroke::solid(Colour::PLAN, 3.0)));
        items.push(("target", Stroke::solid(Colour::PLAN, 6.0)));
    }
    // White would not be seen on the page.
    let shown = |c: &HeadCatheter<'_>| if c.colour == Colour::CATHETER { Colour::GREY } else { c.colour };
    items.extend(scene.catheters.iter().map(|c| (c.name, Stroke::solid(shown(c), 5.0))));
    items.dedup_by(|a, b| a.0 == b.0);
    Legend::of(items.into_iter(), width)
}

/// Middle and largest diameter of all bodies together, with a margin.
fn extent(bodies: &[Body<'_>]) -> (Point<Patient>, f64) {
    let all = bodies.iter().flat_map(|b| &b.mesh.vertices);
    let Some([low, high]) = bounds(all.map(|p| p.to_array())) else { return (Point::ORIGIN, 1.0) };
    let size = (0..3).map(|a| high[a] - low[a]).fold(1.0, f64::max);
    (Point::from_array(low).lerp(Point::from_array(high), 0.5), size * 1.12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_scene_is_drawn_and_a_full_one_has_a_legend() {
        assert!(head_figure(&HeadScene::default(), &[Look::Front], 32).is_ok());
        let ball = sphere(Point::ORIGIN, 20.0, 4);
        let scene = HeadScene {
            skin: Some(&ball),
            solids: vec![(&ball, Colour::SKY, "left lateral ventricle")],
            path: Some([Point::new(0.0, -20.0, 0.0), Point::ORIGIN]),
            catheters: vec![HeadCatheter {
                ends: [Point::new(0.0, -30.0, 0.0), Point::ORIGIN],
                diameter: 3.0,
                colour: Colour::CATHETER,
                name: "catheter",
            }],
            caption: "Head".into(),
            ..HeadScene::default()
        };
        let figure = head_figure(&scene, &[Look::Front, Look::Left], 48).unwrap();
        assert_eq!(figure.width, 104.0);
        for part in ["left lateral ventricle", "planned path", "catheter", "From the left", ">R<", ">P<"] {
            assert!(figure.content.contains(part), "{part}");
        }
    }
}
