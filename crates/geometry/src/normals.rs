//! Normals of a surface whose points move.

use crate::Incidence;

/// The triangles around each point of a surface, to compute its normals anew in every frame without allocation: first the
/// area vectors of the triangles, then their sums around the points.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SurfaceNormals {
    triangles: Vec<[u32; 3]>,
    around: Incidence,
}

impl SurfaceNormals {
    /// For a surface of `points` points. Triangles with corners beyond them are left out.
    pub fn new(triangles: &[[u32; 3]], points: usize) -> Self {
        let known = |t: &&[u32; 3]| t.iter().all(|&v| (v as usize) < points);
        let triangles: Vec<[u32; 3]> = triangles.iter().filter(known).copied().collect();
        let around = Incidence::new(&triangles, points);
        Self { triangles, around }
    }

    /// Number of points.
    pub const fn points(&self) -> usize {
        self.around.points()
    }

    /// Number of triangles.
    pub const fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Twice the area vectors of the triangles `first..first + out.len()` of the surface as it is now (`points` as
    /// `[x, y, z, unused]`); the fourth lane is 0. Threads may share the work.
    ///
    /// # Panics
    /// When `points` has fewer points than the surface or `out` goes beyond its triangles.
    pub fn areas_from(&self, first: usize, points: &[[f32; 4]], out: &mut [[f32; 4]]) {
        let points = &points[..self.points()];
        let triangles = &self.triangles[first..first + out.len()];
        for (o, t) in out.iter_mut().zip(triangles) {
            let [a, b, c] = t.map(|v| points[v as usize]);
            let (e, f) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
            *o = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0], 0.0];
        }
    }

    /// Area-weighted unit normals of the points `first..first + out.len()` from the area vectors of all triangles, zero where
    /// a point has no area around it; the fourth lane is 0. Threads may share the work; the bits do not depend on how.
    ///
    /// # Panics
    /// When `areas` has fewer vectors than the surface has triangles or `out` goes beyond its points.
    pub fn apply_from(&self, first: usize, areas: &[[f32; 4]], out: &mut [[f32; 4]]) {
        let areas = &areas[..self.triangles()];
        for (i, o) in out.iter_mut().enumerate() {
            let mut sum = [0f32; 4];
            for &t in self.around.of(first + i) {
                let area = areas[t as usize];
                sum = core::array::from_fn(|a| sum[a] + area[a]);
            }
            let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
            let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
            *o = sum.map(|x| x * scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Point, TriangleMesh};
    use proptest::prelude::*;

    /// A ball of latitudes and longitudes with poles, outward.
    fn ball(n: u32) -> TriangleMesh {
        let mut mesh = TriangleMesh { vertices: vec![Point::new(0.0, 0.0, -1.0)], triangles: Vec::new() };
        let step = std::f64::consts::PI / f64::from(n);
        for k in 1..n {
            for i in 0..2 * n {
                let (a, b) = (f64::from(k) * step, f64::from(i) * step);
                mesh.vertices.push(Point::new(a.sin() * b.cos(), a.sin() * b.sin(), -a.cos()));
            }
        }
        mesh.vertices.push(Point::new(0.0, 0.0, 1.0));
        let top = mesh.vertices.len() as u32 - 1;
        let at = |k: u32, i: u32| 1 + (k - 1) * 2 * n + i % (2 * n);
        for i in 0..2 * n {
            mesh.triangles.extend([[0, at(1, i + 1), at(1, i)], [top, at(n - 1, i), at(n - 1, i + 1)]]);
            for k in 1..n - 1 {
                let (low, high) = ([at(k, i), at(k, i + 1)], [at(k + 1, i), at(k + 1, i + 1)]);
                mesh.triangles.extend([[low[0], low[1], high[0]], [low[1], high[1], high[0]]]);
            }
        }
        mesh
    }

    fn areas(normals: &SurfaceNormals, points: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let mut areas = vec![[9.0; 4]; normals.triangles()];
        areas.chunks_mut(70).enumerate().for_each(|(c, out)| normals.areas_from(70 * c, points, out));
        areas
    }

    fn lanes(mesh: &TriangleMesh) -> Vec<[f32; 4]> {
        mesh.vertices.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32, 7.0]).collect()
    }

    #[test]
    fn normals_are_those_of_the_mesh_in_any_chunks() {
        let mesh = ball(24);
        let normals = SurfaceNormals::new(&mesh.triangles, mesh.vertices.len());
        let points = lanes(&mesh);
        let (mut whole, mut parts) = (vec![[9.0; 4]; points.len()], vec![[9.0; 4]; points.len()]);
        let areas = areas(&normals, &points);
        normals.apply_from(0, &areas, &mut whole);
        parts.chunks_mut(100).enumerate().for_each(|(c, out)| normals.apply_from(100 * c, &areas, out));
        assert_eq!(whole, parts);
        for ((n, exact), p) in whole.iter().zip(mesh.vertex_normals()).zip(&mesh.vertices) {
            assert!((0..3).all(|a| (f64::from(n[a]) - exact.to_array()[a]).abs() < 1e-4), "{n:?} {exact:?}");
            // On a ball they are the points themselves, but for the size of the triangles.
            assert!((0..3).all(|a| (f64::from(n[a]) - p.to_array()[a]).abs() < 0.03) && n[3] == 0.0);
        }
    }

    #[test]
    fn points_without_area_have_no_normal() {
        let normals = SurfaceNormals::new(&[[0, 1, 2], [0, 1, 9]], 4);
        let mut out = [[1.0; 4]; 4];
        normals.apply_from(0, &areas(&normals, &[[1.0; 4]; 4]), &mut out);
        assert_eq!(out, [[0.0; 4]; 4]);
    }

    proptest! {
        /// Open fans, several at a point, edges with more than two triangles, turned and repeated ones.
        #[test]
        fn any_soup_has_the_normals_of_its_triangles(
            corners in proptest::collection::vec(proptest::array::uniform3(0..12u32), 0..60),
            places in proptest::array::uniform12(proptest::array::uniform3(-1.0..1.0f32)),
        ) {
            let triangles: Vec<[u32; 3]> = corners.into_iter().filter(|[a, b, c]| a != b && b != c && c != a).collect();
            let points = places.map(|[x, y, z]| [x, y, z, 0.0]);
            let mut out = [[0.0; 4]; 12];
            let normals = SurfaceNormals::new(&triangles, 12);
            normals.apply_from(0, &areas(&normals, &points), &mut out);
            for (v, n) in out.iter().enumerate() {
                let mut sum = [0f64; 3];
                for t in triangles.iter().filter(|t| t.contains(&(v as u32))) {
                    let [a, b, c] = t.map(|i| places[i as usize].map(f64::from));
                    let (e, f): ([f64; 3], [f64; 3]) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
                    for i in 0..3 {
                        sum[i] += e[(i + 1) % 3] * f[(i + 2) % 3] - e[(i + 2) % 3] * f[(i + 1) % 3];
                    }
                }
                let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                prop_assume!(length == 0.0 || length > 1e-2);
                if length > 0.0 {
                    prop_assert!((0..3).all(|i| (f64::from(n[i]) - sum[i] / length).abs() < 1e-3), "{v}: {n:?} {sum:?}");
                }
            }
        }
    }
}
