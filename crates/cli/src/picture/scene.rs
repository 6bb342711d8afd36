//! A small software renderer: surfaces with light, one transparent layer each, no graphics card.

use super::camera::Camera;
use super::{Colour, Image};
use monro_geometry::d3::{cross, dot, norm, sub};
use monro_geometry::{TriangleMesh, Vector};
use rayon::prelude::*;

/// A surface in a scene.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a> {
    /// The surface.
    pub mesh: &'a TriangleMesh,
    /// Its colour.
    pub colour: Colour,
    /// 1 is solid. Below 1 its nearest layer lets light through, less so where it is seen edge on.
    pub opacity: f64,
    /// One colour per triangle instead, drawn flat with dark edges, as a mesh is shown; empty for none.
    pub facets: &'a [Colour],
}

impl<'a> Body<'a> {
    /// A smooth solid surface.
    pub const fn solid(mesh: &'a TriangleMesh, colour: Colour) -> Self {
        Self { mesh, colour, opacity: 1.0, facets: &[] }
    }

    /// A smooth transparent surface.
    pub const fn glass(mesh: &'a TriangleMesh, colour: Colour, opacity: f64) -> Self {
        Self { mesh, colour, opacity, facets: &[] }
    }
}

/// Samples along each side of a pixel.
const SUPERSAMPLING: usize = 2;
/// Rows that one task draws.
const BAND: usize = 64;

/// Draws bodies on a square picture of `pixels` x `pixels` over white.
pub fn render(bodies: &[Body<'_>], camera: &Camera, pixels: usize) -> Image {
    let wide = pixels * SUPERSAMPLING;
    let layers = layers(bodies, camera, wide);
    let mut image = Image::new(pixels, pixels, Colour::WHITE);
    image.pixels_mut().par_chunks_mut(pixels.max(1)).enumerate().for_each(|(y, row)| {
        let mut hits = Vec::with_capacity(layers.len());
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = [0f64; 3];
            for n in 0..SUPERSAMPLING * SUPERSAMPLING {
                let (sx, sy) = (x * SUPERSAMPLING + n % SUPERSAMPLING, y * SUPERSAMPLING + n / SUPERSAMPLING);
                let colour = blend(layers.iter().map(|l| l[sy * wide + sx]), &mut hits);
                sum = core::array::from_fn(|c| sum[c] + f64::from(colour[c]));
            }
            let share = (SUPERSAMPLING * SUPERSAMPLING) as f64;
            *pixel = Colour(sum.map(|v| (v / share).round().clamp(0.0, 255.0) as u8));
        }
    });
    image
}

/// What a body shows in a sample: depth, lit colour, and how much it covers.
#[derive(Debug, Clone, Copy)]
struct Sample {
    depth: f32,
    colour: [f32; 3],
    cover: f32,
}

const NOTHING: Sample = Sample { depth: f32::INFINITY, colour: [255.0; 3], cover: 0.0 };

/// One layer for all solid bodies together, and one for each transparent body.
fn layers(bodies: &[Body<'_>], camera: &Camera, wide: usize) -> Vec<Vec<Sample>> {
    let (solid, glass): (Vec<&Body<'_>>, Vec<&Body<'_>>) = bodies.iter().partition(|b| b.opacity >= 1.0);
    let mut out = vec![vec![NOTHING; wide * wide]; 1 + glass.len()];
    for body in solid {
        rasterise(body, camera, wide, &mut out[0]);
    }
    for (body, layer) in glass.into_iter().zip(&mut out[1..]) {
        rasterise(body, camera, wide, layer);
    }
    out
}

/// Nearest layers over farther ones, all over white. `hits` is space to work in.
fn blend(samples: impl Iterator<Item = Sample>, hits: &mut Vec<Sample>) -> [f32; 3] {
    hits.clear();
    hits.extend(samples.filter(|s| s.cover > 0.0));
    hits.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    hits.iter().fold([255.0; 3], |under, s| core::array::from_fn(|c| under[c] + s.cover * (s.colour[c] - under[c])))
}

/// A vertex on the picture: position and depth, and its normal in the viewer's axes.
#[derive(Debug, Clone, Copy)]
struct Seen {
    at: [f64; 3],
    normal: [f64; 3],
}

fn rasterise(body: &Body<'_>, camera: &Camera, wide: usize, samples: &mut [Sample]) {
    let seen: Vec<Seen> = body
        .mesh
        .vertices
        .iter()
        .zip(normals(body.mesh))
        .map(|(&p, n)| Seen { at: camera.project(p, wide), normal: camera.turned(n) })
        .collect();
    samples.par_chunks_mut((wide * BAND).max(1)).enumerate().for_each(|(band, samples)| {
        let first = band * BAND;
        let rows = [first as f64, (first + samples.len() / wide) as f64];
        for (t, triangle) in body.mesh.triangles.iter().enumerate() {
            let corners = triangle.map(|v| seen[v as usize]);
            let ys = corners.map(|c| c.at[1]);
            if ys.iter().any(|y| *y >= rows[0]) && ys.iter().any(|y| *y <= rows[1]) {
                let brush = Brush { body, facet: body.facets.get(t).copied(), wide, first };
                brush.fill(&corners, samples);
            }
        }
    });
}

/// Unit normals at the vertices: the mean of their triangles' normals, weighted by area.
fn normals(mesh: &TriangleMesh) -> Vec<Vector<monro_geometry::Patient>> {
    let mut sums = vec![Vector::ZERO; mesh.vertices.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let area = (b - a).cross(c - a);
        for &v in triangle {
            sums[v as usize] += area;
        }
    }
    sums.into_iter().map(|n| n.normalized().unwrap_or(Vector::ZERO)).collect()
}

struct Brush<'a> {
    body: &'a Body<'a>,
    facet: Option<Colour>,
    wide: usize,
    first: usize,
}

impl Brush<'_> {
    fn fill(&self, corners: &[Seen; 3], samples: &mut [Sample]) {
        let [a, b, c] = corners.map(|v| v.at);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let rows = samples.len() / self.wide;
        let span = |axis: usize, shift: f64, limit: usize| {
            let low = a[axis].min(b[axis]).min(c[axis]) - shift - 0.5;
            let high = a[axis].max(b[axis]).max(c[axis]) - shift + 0.5;
            // Casts of negative numbers end at zero.
            low.ceil() as usize..(high.floor().max(-1.0) + 1.0).min(limit as f64) as usize
        };
        let flat = self.facet.map(|_| flat_normal(corners));
        for row in span(1, self.first as f64, rows) {
            let y = (row + self.first) as f64 + 0.5;
            for x in span(0, 0.0, self.wide) {
                let px = x as f64 + 0.5;
                let wb = ((px - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area;
                let wc = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (px - a[0])) / area;
                let w = [1.0 - wb - wc, wb, wc];
                if w.iter().any(|v| *v < 0.0) {
                    continue;
                }
                let depth = (w[0] * a[2] + w[1] * b[2] + w[2] * c[2]) as f32;
                let sample = &mut samples[row * self.wide + x];
                if depth < sample.depth {
                    let normal = flat.unwrap_or_else(|| mixed(corners, w));
                    *sample = self.lit(depth, normal, w, area);
                }
            }
        }
    }

    /// Colour and cover of a point with the given normal.
    fn lit(&self, depth: f32, normal: [f64; 3], w: [f64; 3], area: f64) -> Sample {
        // Key light from above and the viewer's left, in the viewer's axes; both sides of a surface are lit.
        const LIGHT: [f64; 3] = [-0.41, -0.56, -0.72];
        let facing = if normal[2] > 0.0 { normal.map(|v| -v) } else { normal };
        let diffuse = dot(facing, LIGHT).max(0.0);
        let head_on = -facing[2];
        // Blinn and Phong's half vector between light and viewer.
        let half = [LIGHT[0], LIGHT[1], LIGHT[2] - 1.0];
        let gloss = (dot(facing, half) / norm(half)).max(0.0).powi(40);
        let shade = 0.28 + 0.55 * diffuse + 0.2 * head_on;
        let edge = self.facet.is_some() && w.iter().any(|v| v * area.abs().sqrt() < 0.7);
        let base = self.facet.unwrap_or(self.body.colour).0.map(|v| f64::from(v) * if edge { 0.45 } else { 1.0 });
        let gloss = if self.facet.is_some() { 0.0 } else { 60.0 * gloss };
        let colour = base.map(|v| (v * shade + gloss).min(255.0) as f32);
        let opacity = self.body.opacity;
        let cover = if opacity >= 1.0 { 1.0 } else { opacity + (1.0 - opacity) * (1.0 - head_on).powi(2) * 0.8 };
        Sample { depth, colour, cover: cover as f32 }
    }
}

fn mixed(corners: &[Seen; 3], w: [f64; 3]) -> [f64; 3] {
    let n: [f64; 3] = core::array::from_fn(|a| (0..3).map(|i| corners[i].normal[a] * w[i]).sum());
    unit(n)
}

fn flat_normal(corners: &[Seen; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|v| v.at);
    // Depth is in mm and the rest in pixels; the shading only needs to tell facets apart.
    unit(cross(sub(b, a), sub(c, a)))
}

fn unit(n: [f64; 3]) -> [f64; 3] {
    let length = norm(n);
    if length > 0.0 { n.map(|v| v / length) } else { [0.0, 0.0, -1.0] }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::sphere;
    use super::*;
    use monro_geometry::Point;

    fn front() -> Camera {
        Camera::new(Point::ORIGIN, Vector::new(0.0, 1.0, 0.0), 100.0).unwrap()
    }

    #[test]
    fn a_ball_covers_its_disc_and_no_more() {
        let ball = sphere(Point::ORIGIN, 25.0, 6);
        let image = render(&[Body::solid(&ball, Colour::SKY)], &front(), 100);
        for y in 0..100usize {
            for x in 0..100usize {
                let r = (x as f64 - 49.5).hypot(y as f64 - 49.5);
                let drawn = image.at(x, y) != Colour::WHITE;
                assert!((r < 24.0) <= drawn && (r > 26.0) <= !drawn, "{x} {y}");
            }
        }
    }

    #[test]
    fn the_nearer_body_hides_the_farther_and_glass_lets_it_through() {
        let (near, far) = (sphere(Point::new(0.0, -30.0, 0.0), 20.0, 5), sphere(Point::new(0.0, 30.0, 0.0), 20.0, 5));
        let (red, blue) = (Colour([200, 0, 0]), Colour([0, 0, 200]));
        let middle = |bodies: &[Body<'_>]| render(bodies, &front(), 60).at(30, 30).0;
        let [r, _, b] = middle(&[Body::solid(&far, blue), Body::solid(&near, red)]);
        assert!(r > 100 && b < 90, "{r} {b}");
        let [_, _, b] = middle(&[Body::glass(&near, red, 0.2), Body::solid(&far, blue)]);
        assert!(b > 100, "{b}");
        assert_eq!(middle(&[]), [255; 3]);
    }

    #[test]
    fn light_comes_from_above_and_left() {
        let ball = sphere(Point::ORIGIN, 40.0, 6);
        let image = render(&[Body::solid(&ball, Colour::GREY)], &front(), 100);
        assert!(image.at(30, 25).0[0] > image.at(70, 75).0[0] + 30);
    }
}
