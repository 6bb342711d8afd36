//! Marching cubes over a voxel field: closed, oriented, two-manifold, and the same on any number of threads.

use super::cases::{Cases, FACES, Loop, MIDDLE, ambiguous, edge_corners};
use monro_geometry::{Patient, Point, TriangleMesh, Volume};
use rayon::prelude::*;

/// Layers of cells per work unit. Fixed, so that the vertex order does not depend on the number of threads.
const SLAB: usize = 8;
const NONE: u32 = u32::MAX;
/// Marks a vertex in the middle of a cell; those are numbered after all vertices on edges.
const INNER: u32 = 1 << 31;

/// The surface where `field` (trilinear between voxel centres) equals `level`, normals pointing to lower values.
///
/// Ambiguous faces are decided by the bilinear saddle, so both cells at a face agree and the result is two-manifold for
/// any data. It is closed unless the inside reaches the outermost voxels, where it stays open; pad the field to close
/// it. A value exactly at the level counts as inside; NaN counts as outside. Works for any placement, mirrored ones too.
pub fn isosurface(field: &Volume<f32>, level: f32) -> TriangleMesh {
    let [nx, ny, nz] = field.grid().dims();
    if nx < 2 || ny < 2 || nz < 2 {
        return TriangleMesh::default();
    }
    let starts: Vec<usize> = (0..nz - 1).step_by(SLAB).collect();
    let slabs: Vec<Slab<'_>> = starts
        .into_par_iter()
        .map(|k| {
            let mut slab = Slab::new(field, level);
            slab.run(k, (k + SLAB).min(nz - 1));
            slab
        })
        .collect();
    join(&slabs, field.grid().patient_from_voxel().linear.determinant() < 0.0)
}

/// A slab numbers its own vertices from 0. Those on the plane it shares with the next slab come last ("ghosts"), in the
/// order in which the next slab numbers them first.
struct Slab<'a> {
    field: &'a Volume<f32>,
    level: f32,
    positions: Vec<Point<Patient>>,
    inner: Vec<Point<Patient>>,
    triangles: Vec<[u32; 3]>,
    ghosts: u32,
    /// Vertices on the x and y edges of the lower and upper plane, and on the z edges between.
    low: [Vec<u32>; 2],
    high: [Vec<u32>; 2],
    rising: Vec<u32>,
}

/// Inside bits of four neighbouring corners of a plane, and of single voxels.
struct Plane {
    quads: Vec<u8>,
    inside: Vec<u8>,
}

impl<'a> Slab<'a> {
    fn new(field: &'a Volume<f32>, level: f32) -> Self {
        let [nx, ny, _] = field.grid().dims();
        let row = || vec![NONE; nx * ny];
        Self {
            field,
            level,
            positions: Vec::new(),
            inner: Vec::new(),
            triangles: Vec::new(),
            ghosts: 0,
            low: [row(), row()],
            high: [row(), row()],
            rising: row(),
        }
    }

    fn run(&mut self, from: usize, to: usize) {
        let mut plane = self.plane(from);
        self.number_plane(&plane, from);
        for k in from..to {
            std::mem::swap(&mut self.low, &mut self.high);
            let above = self.plane(k + 1);
            self.number_rising(&plane, &above, k);
            let own = self.positions.len() as u32;
            self.number_plane(&above, k + 1);
            self.ghosts = self.positions.len() as u32 - own;
            self.cells(&plane, &above, k);
            plane = above;
        }
        if to + 1 == self.field.grid().dims()[2] {
            self.ghosts = 0;
        }
    }

    fn plane(&self, k: usize) -> Plane {
        let [nx, ny, _] = self.field.grid().dims();
        let values = &self.field.data()[k * nx * ny..(k + 1) * nx * ny];
        let inside: Vec<u8> = values.iter().map(|&v| u8::from(v >= self.level)).collect();
        let mut quads = vec![0; nx * ny];
        for j in 0..ny - 1 {
            let (a, b) = (&inside[j * nx..(j + 1) * nx], &inside[(j + 1) * nx..(j + 2) * nx]);
            for (i, q) in quads[j * nx..(j + 1) * nx - 1].iter_mut().enumerate() {
                *q = a[i] | a[i + 1] << 1 | b[i] << 2 | b[i + 1] << 3;
            }
        }
        Plane { quads, inside }
    }

    /// Vertices on the x and y edges of plane `k`, into `high`.
    fn number_plane(&mut self, plane: &Plane, k: usize) {
        let [nx, ny, _] = self.field.grid().dims();
        for axis in 0..2 {
            let (step, count) = if axis == 0 { (1, [nx - 1, ny]) } else { (nx, [nx, ny - 1]) };
            for j in 0..count[1] {
                for at in j * nx..j * nx + count[0] {
                    if plane.inside[at] != plane.inside[at + step] {
                        self.high[axis][at] = self.vertex(k * nx * ny + at, step, axis);
                    }
                }
            }
        }
    }

    fn number_rising(&mut self, plane: &Plane, above: &Plane, k: usize) {
        let n = plane.inside.len();
        for at in 0..n {
            if plane.inside[at] != above.inside[at] {
                self.rising[at] = self.vertex(k * n + at, n, 2);
            }
        }
    }

    /// Adds the cut of the edge from voxel `at` to `at + step` along `axis`.
    fn vertex(&mut self, at: usize, step: usize, axis: usize) -> u32 {
        let (a, b) = (f64::from(self.field.data()[at]), f64::from(self.field.data()[at + step]));
        let t = (f64::from(self.level) - a) / (b - a);
        // Kept off the ends: a cut in a voxel centre would give triangles without area.
        let t = if t.is_nan() { 0.5 } else { t.clamp(1e-3, 1.0 - 1e-3) };
        let grid = self.field.grid();
        let mut v = grid.voxel(at).map(|c| c as f64);
        v[axis] += t;
        self.positions.push(grid.patient_from_voxel().point(Point::from_array(v)));
        self.positions.len() as u32 - 1
    }

    fn cells(&mut self, plane: &Plane, above: &Plane, k: usize) {
        let [nx, ny, _] = self.field.grid().dims();
        let cases = Cases::get();
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                let at = j * nx + i;
                let config = plane.quads[at] | above.quads[at] << 4;
                if config != 0 && config != 255 {
                    let joined = if cases.is_ambiguous(config) { self.joined(config, [i, j, k]) } else { 0 };
                    for one in cases.loops(config, joined) {
                        self.emit(one, at);
                    }
                }
            }
        }
    }

    /// The ambiguous faces whose inside corners are joined: those where the saddle lies inside.
    fn joined(&self, config: u8, [i, j, k]: [usize; 3]) -> usize {
        let value =
            |c: usize| f64::from(self.field.at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2))) - f64::from(self.level);
        let mut bits = 0;
        for (n, f) in FACES.iter().filter(|f| ambiguous(config, f)).enumerate() {
            let (even, odd) = (value(f[0]) * value(f[2]), value(f[1]) * value(f[3]));
            let (inside, outside) = if config >> f[0] & 1 == 1 { (even, odd) } else { (odd, even) };
            bits |= usize::from(inside > outside) << n;
        }
        bits
    }

    fn emit(&mut self, one: &Loop, at: usize) {
        let mut ids = [NONE; 13];
        for &e in &one.edges {
            ids[usize::from(e)] = self.id(e, at);
        }
        if one.triangles.len() == one.edges.len() {
            let points = one.edges.iter().map(|&e| self.positions[ids[usize::from(e)] as usize]);
            let sum = points.fold([0.0; 3], |s, p| [s[0] + p.x, s[1] + p.y, s[2] + p.z]);
            ids[usize::from(MIDDLE)] = INNER | self.inner.len() as u32;
            self.inner.push(Point::from_array(sum.map(|s| s / one.edges.len() as f64)));
        }
        self.triangles.extend(one.triangles.iter().map(|t| t.map(|e| ids[usize::from(e)])));
    }

    fn id(&self, edge: u8, at: usize) -> u32 {
        let nx = self.field.grid().dims()[0];
        let [c, _] = edge_corners(edge);
        let at = at + (c & 1) + (c >> 1 & 1) * nx;
        match (edge >> 2, c >> 2) {
            (2, _) => self.rising[at],
            (axis, 0) => self.low[usize::from(axis)][at],
            (axis, _) => self.high[usize::from(axis)][at],
        }
    }
}

fn join(slabs: &[Slab<'_>], mirrored: bool) -> TriangleMesh {
    let own = |s: &Slab<'_>| s.positions.len() - s.ghosts as usize;
    let on_edges: usize = slabs.iter().map(own).sum();
    let mut mesh = TriangleMesh::default();
    mesh.vertices.reserve(on_edges);
    mesh.triangles.reserve(slabs.iter().map(|s| s.triangles.len()).sum());
    let (mut first, mut first_inner) = (0u32, on_edges as u32);
    for s in slabs {
        mesh.vertices.extend_from_slice(&s.positions[..own(s)]);
        // Ghosts continue the own vertices, and the next slab starts with them: one offset serves both.
        let number = |v: u32| if v & INNER == 0 { first + v } else { first_inner + (v ^ INNER) };
        mesh.triangles.extend(s.triangles.iter().map(|t| {
            let [a, b, c] = t.map(number);
            if mirrored { [a, c, b] } else { [a, b, c] }
        }));
        first += own(s) as u32;
        first_inner += s.inner.len() as u32;
    }
    slabs.iter().for_each(|s| mesh.vertices.extend_from_slice(&s.inner));
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Affine, Grid, Matrix3};
    use proptest::prelude::*;

    fn ball(n: usize, spacing: [f64; 3], radius: f64) -> Volume<f32> {
        let origin = [0, 1, 2].map(|a| -(n as f64 - 1.0) / 2.0 * spacing[a]);
        let grid = Grid::axis_aligned([n; 3], spacing, origin).expect("grid");
        let value = |at| {
            let [i, j, k] = grid.voxel(at);
            (radius - (grid.centre(i, j, k) - Point::ORIGIN).norm()) as f32
        };
        Volume::new(grid, (0..grid.len()).map(value).collect()).expect("count")
    }

    #[test]
    fn a_ball_is_closed_outward_and_has_its_volume() {
        let m = isosurface(&ball(41, [1.0, 0.9, 1.1], 15.0), 0.0);
        m.validate().expect("valid");
        let t = m.topology();
        assert!(t.is_closed() && t.is_manifold() && t.is_oriented() && t.euler() == 2, "{t:?}");
        // Chords of a trilinear distance: the error is of order h^2 / r^2 = 0.5 %.
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 15f64.powi(3);
        assert!((m.signed_volume() / exact - 1.0).abs() < 0.005, "{}", m.signed_volume() / exact);
    }

    #[test]
    fn a_mirrored_placement_still_points_outward() {
        let v = ball(21, [1.0; 3], 7.0);
        let mirror = Matrix3 { rows: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.3, 1.0]] };
        let grid = Grid::new([21; 3], Affine::new(mirror, [5.0, 6.0, 7.0])).expect("grid");
        let m = isosurface(&Volume::new(grid, v.into_data()).expect("count"), 0.0);
        assert!(m.signed_volume() > 0.0 && m.topology().is_oriented());
    }

    fn padded(values: &[f32], n: usize) -> Volume<f32> {
        let grid = Grid::axis_aligned([n; 3], [1.0; 3], [0.0; 3]).expect("grid");
        let inner = |c: usize| c > 0 && c < n - 1;
        let mut next = values.iter().copied().cycle();
        let data =
            (0..grid.len()).map(|at| if grid.voxel(at).into_iter().all(inner) { next.next().unwrap() } else { -1.0 });
        Volume::new(grid, data.collect()).expect("count")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn random_fields_give_closed_oriented_manifolds(values in proptest::collection::vec(-1.0..1.0f32, 1000)) {
            let m = isosurface(&padded(&values, 12), 0.0);
            m.validate().unwrap();
            let t = m.topology();
            prop_assert!(t.is_closed() && t.is_oriented() && t.is_manifold(), "{:?}", t);
        }

        #[test]
        fn random_masks_give_closed_oriented_manifolds(values in proptest::collection::vec(0..2u8, 1000)) {
            let values: Vec<f32> = values.into_iter().map(|v| f32::from(v) - 0.5).collect();
            let m = isosurface(&padded(&values, 12), 0.0);
            let t = m.topology();
            prop_assert!(t.is_closed() && t.is_oriented() && t.is_manifold(), "{:?}", t);
        }
    }

    #[test]
    fn one_thread_and_four_give_the_same_bits() {
        let v = ball(40, [1.0; 3], 13.3);
        let run =
            |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("pool").install(|| isosurface(&v, 0.0));
        assert_eq!(run(1), run(4));
    }

    #[test]
    fn not_a_number_is_outside_and_gives_finite_vertices() {
        let mut v = ball(21, [1.0; 3], 7.0);
        let at = v.grid().index(10, 10, 17);
        v.data_mut()[at] = f32::NAN;
        isosurface(&v, 0.0).validate().expect("finite");
        assert!(isosurface(&Volume::filled(*v.grid(), f32::NAN), 0.0).triangles.is_empty());
    }
}
