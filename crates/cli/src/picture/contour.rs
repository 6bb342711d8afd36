//! Where surfaces and labels meet a plane.

use super::view::SliceView;
use monro_geometry::{Patient, Plane, Point, TriangleMesh, Volume};
use rayon::prelude::*;

/// A polyline on the picture, in pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Contour {
    /// Its points; the first is not repeated at the end.
    pub points: Vec<[f64; 2]>,
    /// Whether the last point is joined to the first.
    pub closed: bool,
}

/// An edge of a grid or mesh, as a key that the two faces beside it share.
type Edge = (u32, u32);

/// A crossed face: the two edges where the line goes in and out, with the points there.
type Segment = [(Edge, [f64; 2]); 2];

/// The lines where a surface meets the view's plane.
pub fn of_mesh(mesh: &TriangleMesh, view: &SliceView) -> Vec<Contour> {
    let plane = view.plane();
    let side: Vec<f64> = mesh.vertices.iter().map(|&p| plane.signed_distance(p)).collect();
    let cut = |a: u32, b: u32| -> (Edge, [f64; 2]) {
        let (a, b) = (a.min(b), a.max(b));
        let (da, db) = (side[a as usize], side[b as usize]);
        let p = mesh.vertices[a as usize].lerp(mesh.vertices[b as usize], da / (da - db));
        ((a, b), view.project(p))
    };
    let mut segments: Vec<Segment> = Vec::new();
    for t in &mesh.triangles {
        // A vertex on the plane counts as above it, so that no line is lost or doubled there.
        let above = t.map(|v| side[v as usize] >= 0.0);
        if above[0] == above[1] && above[1] == above[2] {
            continue;
        }
        // The corner that is alone on its side: the line runs between its two edges.
        let lone = (0..3).find(|&i| above[i] != above[(i + 1) % 3] && above[i] != above[(i + 2) % 3]).unwrap_or(0);
        segments.push([cut(t[lone], t[(lone + 1) % 3]), cut(t[lone], t[(lone + 2) % 3])]);
    }
    chain(&segments)
}

/// The outlines of the voxels that `keep` accepts, interpolated to half coverage.
pub fn of_labels(labels: &Volume<u8>, keep: impl Fn(u8) -> bool + Sync, view: &SliceView) -> Vec<Contour> {
    let [w, h] = view.pixels();
    let (columns, rows) = (w + 1, h + 1);
    let field: Vec<f64> = (0..columns * rows)
        .into_par_iter()
        .map(|n| coverage(labels, &keep, view.unproject([(n % columns) as f64, (n / columns) as f64])) - 0.5)
        .collect();
    let mut segments: Vec<Segment> = Vec::new();
    for y in 0..h {
        for x in 0..w {
            square(&field, columns, [x, y], &mut segments);
        }
    }
    chain(&segments)
}

/// How much of the neighbourhood of a point is accepted: trilinear between voxel centres, 0 outside.
fn coverage(labels: &Volume<u8>, keep: &impl Fn(u8) -> bool, p: Point<Patient>) -> f64 {
    let v = labels.grid().voxel_from_patient().point(p).to_array();
    let dims = labels.grid().dims();
    let base = v.map(f64::floor);
    let mut sum = 0.0;
    for corner in 0..8usize {
        let mut weight = 1.0;
        let mut at = [0usize; 3];
        for a in 0..3 {
            let step = (corner >> a & 1) as f64;
            let index = base[a] + step;
            if !(index >= 0.0 && index < dims[a] as f64) {
                weight = 0.0;
                break;
            }
            let t = v[a] - base[a];
            weight *= if step > 0.0 { t } else { 1.0 - t };
            at[a] = index as usize;
        }
        if weight > 0.0 && keep(labels.at(at[0], at[1], at[2])) {
            sum += weight;
        }
    }
    sum
}

/// Marching squares on one cell; an ambiguous cell is parted so that the accepted corners stay apart.
fn square(field: &[f64], columns: usize, [x, y]: [usize; 2], segments: &mut Vec<Segment>) {
    let corners = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]];
    let index = |[x, y]: [usize; 2]| y * columns + x;
    let value = corners.map(|c| field[index(c)]);
    let mut crossed = Vec::with_capacity(4);
    for i in 0..4 {
        let j = (i + 1) % 4;
        if (value[i] >= 0.0) != (value[j] >= 0.0) {
            let t = value[i] / (value[i] - value[j]);
            let at = |a: usize| corners[i][a] as f64 * (1.0 - t) + corners[j][a] as f64 * t;
            let (a, b) = (index(corners[i]) as u32, index(corners[j]) as u32);
            crossed.push(((a.min(b), a.max(b)), [at(0), at(1)]));
        }
    }
    match crossed[..] {
        [a, b] => segments.push([a, b]),
        [a, b, c, d] if value[0] >= 0.0 => segments.extend([[d, a], [b, c]]),
        [a, b, c, d] => segments.extend([[a, b], [c, d]]),
        _ => {}
    }
}

/// Joins segments end to end.
fn chain(segments: &[Segment]) -> Vec<Contour> {
    let mut ends: Vec<(Edge, u32)> = Vec::with_capacity(segments.len() * 2);
    for (i, s) in segments.iter().enumerate() {
        ends.extend([(s[0].0, i as u32), (s[1].0, i as u32)]);
    }
    ends.sort_unstable();
    let mut used = vec![false; segments.len()];
    let mut out = Vec::new();
    // Open lines first, from one of their free ends; what is left then are rings.
    let free = |e: Edge| ends.partition_point(|x| x.0 <= e) - ends.partition_point(|x| x.0 < e) == 1;
    let starts = (0..segments.len()).flat_map(|i| [(i, 0), (i, 1)]);
    let open: Vec<(usize, usize)> = starts.filter(|&(i, end)| free(segments[i][end].0)).collect();
    let rings = (0..segments.len()).map(|i| (i, 0));
    for (start, end) in open.into_iter().chain(rings) {
        if !used[start] {
            out.push(walk(segments, &ends, &mut used, start, end));
        }
    }
    out
}

fn walk(segments: &[Segment], ends: &[(Edge, u32)], used: &mut [bool], start: usize, end: usize) -> Contour {
    let mut points = vec![segments[start][end].1];
    let first = segments[start][end].0;
    let (mut at, mut leave) = (start, 1 - end);
    loop {
        used[at] = true;
        let (edge, p) = segments[at][leave];
        if edge == first {
            return Contour { points, closed: true };
        }
        points.push(p);
        let from = ends.partition_point(|x| x.0 < edge);
        let next = ends[from..].iter().take_while(|x| x.0 == edge).map(|x| x.1 as usize).find(|&s| !used[s]);
        let Some(next) = next else { return Contour { points, closed: false } };
        leave = usize::from(segments[next][0].0 == edge);
        at = next;
    }
}

impl Contour {
    /// Without points nearer than `step` pixels to the one before.
    pub fn thinned(&self, step: f64) -> Self {
        let mut points: Vec<[f64; 2]> = Vec::with_capacity(self.points.len());
        for (i, &p) in self.points.iter().enumerate() {
            let far = points.last().is_none_or(|q| (p[0] - q[0]).hypot(p[1] - q[1]) >= step);
            if far || (i + 1 == self.points.len() && !self.closed) {
                points.push(p);
            }
        }
        Self { points, closed: self.closed }
    }
}

/// The polygon in which a plane cuts a tetrahedron: three or four points in order, or none.
pub(crate) fn of_tetrahedron(corners: [Point<Patient>; 4], plane: &Plane<Patient>) -> Vec<Point<Patient>> {
    let d = corners.map(|p| plane.signed_distance(p));
    let (above, below): (Vec<usize>, Vec<usize>) = (0..4).partition(|&i| d[i] >= 0.0);
    let cut = |a: usize, b: usize| corners[a].lerp(corners[b], d[a] / (d[a] - d[b]));
    match (&above[..], &below[..]) {
        (&[a], &[b, c, e]) | (&[b, c, e], &[a]) => vec![cut(a, b), cut(a, c), cut(a, e)],
        (&[a, b], &[c, e]) => vec![cut(a, c), cut(a, e), cut(b, e), cut(b, c)],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::sphere;
    use super::super::view::Orientation;
    use super::*;
    use monro_geometry::Grid;

    #[test]
    fn a_sphere_is_cut_in_one_closed_circle() {
        let centre = Point::new(10.0, -5.0, 3.0);
        let mesh = sphere(centre, 30.0, 6);
        for (orientation, offset) in [(Orientation::Axial, [0.0, 0.0, 12.0]), (Orientation::Sagittal, [-7.5, 0.0, 0.0])]
        {
            let at = Point::new(centre.x + offset[0], centre.y + offset[1], centre.z + offset[2]);
            let view = SliceView::standard(orientation, at, 100.0, 400);
            let contours = of_mesh(&mesh, &view);
            assert_eq!(contours.len(), 1);
            assert!(contours[0].closed && contours[0].points.len() > 50);
            let off = offset[0] + offset[2];
            let radius = (900.0f64 - off * off).sqrt() * 4.0;
            for [x, y] in &contours[0].points {
                assert!(((x - 200.0).hypot(y - 200.0) - radius).abs() < 1.0, "{x} {y} {radius}");
            }
        }
    }

    #[test]
    fn a_plane_through_vertices_neither_loses_nor_doubles_lines() {
        let mesh = sphere(Point::ORIGIN, 10.0, 3);
        let view = SliceView::standard(Orientation::Axial, Point::ORIGIN, 40.0, 100);
        let contours = of_mesh(&mesh, &view);
        assert!(contours.len() == 1 && contours[0].closed, "{}", contours.len());
    }

    #[test]
    fn an_open_surface_gives_an_open_line() {
        let mut mesh = sphere(Point::ORIGIN, 10.0, 4);
        let keep: Vec<[u32; 3]> =
            (0..mesh.triangles.len()).filter(|&t| mesh.corners(t)[0].x < 2.0).map(|t| mesh.triangles[t]).collect();
        mesh.triangles = keep;
        let view = SliceView::standard(Orientation::Axial, Point::new(0.0, 0.0, 0.3), 40.0, 100);
        let contours = of_mesh(&mesh, &view);
        assert!(contours.len() == 1 && !contours[0].closed);
    }

    #[test]
    fn the_outline_of_a_labelled_ball_is_its_circle() {
        let grid = Grid::axis_aligned([40, 40, 40], [1.0; 3], [-19.5; 3]).unwrap();
        let mut labels = Volume::filled(grid, 0u8);
        for n in 0..grid.len() {
            let [i, j, k] = grid.voxel(n);
            labels.data_mut()[n] = if grid.centre(i, j, k).distance(Point::ORIGIN) < 12.0 { 5 } else { 0 };
        }
        let view = SliceView::standard(Orientation::Coronal, Point::ORIGIN, 40.0, 80);
        let contours = of_labels(&labels, |l| l == 5, &view);
        assert!(contours.len() == 1 && contours[0].closed);
        for [x, y] in &contours[0].points {
            // Half a voxel is a pixel here; a staircase of voxels strays by less than one voxel.
            assert!(((x - 40.0).hypot(y - 40.0) - 24.0).abs() < 2.0);
        }
    }

    #[test]
    fn thinning_keeps_ends_of_open_lines() {
        let line = Contour { points: (0..=100).map(|i| [f64::from(i) * 0.1, 0.0]).collect(), closed: false };
        let thin = line.thinned(1.0);
        assert!(thin.points.len() <= 12 && thin.points.last() == Some(&[10.0, 0.0]));
    }

    #[test]
    fn a_tetrahedron_is_cut_in_a_triangle_or_a_quadrilateral() {
        let t = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point::from_array);
        let plane = |z| Plane { point: Point::new(0.0, 0.0, z), normal: monro_geometry::Vector::new(0.0, 0.0, 1.0) };
        assert_eq!(of_tetrahedron(t, &plane(0.5)).len(), 3);
        assert_eq!(of_tetrahedron(t, &plane(2.0)).len(), 0);
        let slanted = Plane::new(Point::new(0.25, 0.25, 0.25), monro_geometry::Vector::new(1.0, 1.0, -1.0)).unwrap();
        let quad = of_tetrahedron(t, &slanted);
        assert!(quad.iter().all(|p| slanted.signed_distance(*p).abs() < 1e-12));
    }
}
