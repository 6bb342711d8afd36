//! Smoothing that does not shrink: the windowed sinc filter of Taubin, Zhang and Golub (ECCV 1996).

use monro_geometry::{Patient, Point, TriangleMesh, Vector, by_point};
use std::f64::consts::PI;

/// How a surface from voxels is smoothed. The enclosed volume is restored afterwards in either case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Smoothing {
    /// As the voxels give it.
    None,
    /// Low-pass filter over the umbrella operator.
    WindowedSinc {
        /// Degree of the polynomial, i.e. passes over the mesh.
        iterations: usize,
        /// Pass band in `0..2` (eigenvalues of the umbrella operator); smaller is smoother.
        pass_band: f64,
    },
}

impl Default for Smoothing {
    /// 20 passes with pass band 0.25: the ventricles of phantoms in voxels of 0.9 x 0.9 x 1.25 mm are 0.09 mm from their
    /// truth on average, where the bare steps are 0.13 mm off and a pass band of 0.05 leaves 0.25 mm.
    fn default() -> Self {
        Self::WindowedSinc { iterations: 20, pass_band: 0.25 }
    }
}

/// Smooths in place and restores the volume of a closed mesh by a shift along the normals. Connectivity stays.
pub fn smooth(mesh: &mut TriangleMesh, smoothing: Smoothing) {
    let Smoothing::WindowedSinc { iterations, pass_band } = smoothing else { return };
    if mesh.triangles.is_empty() || iterations == 0 {
        return;
    }
    let volume = mesh.signed_volume();
    filter(mesh, iterations, pass_band.clamp(1e-4, 1.999));
    restore_volume(mesh, volume);
}

/// Moves every vertex by one distance along its normal until the enclosed volume is `wanted`.
pub(super) fn restore_volume(mesh: &mut TriangleMesh, wanted: f64) {
    for _ in 0..3 {
        let area = mesh.area();
        if area <= 0.0 {
            return;
        }
        let shift = (wanted - mesh.signed_volume()) / area;
        let normals = mesh.vertex_normals();
        for (p, n) in mesh.vertices.iter_mut().zip(normals) {
            *p += n * shift;
        }
    }
}

/// Neighbours of each vertex in one flat list.
struct Neighbours {
    first: Vec<u32>,
    list: Vec<u32>,
}

impl Neighbours {
    fn new(mesh: &TriangleMesh) -> Self {
        // On a closed, oriented surface the edge after each corner lists every neighbour exactly once.
        let next = mesh.triangles.iter().flat_map(|t| (0..3).map(|c| (t[c], t[(c + 1) % 3])));
        let (first, list) = by_point(next, mesh.vertices.len());
        Self { first, list }
    }

    /// `out = (x + average of neighbours) * scale - subtract`, the Chebyshev step: `I - K/2` with `K` the umbrella
    /// operator maps a vertex to the middle between it and its neighbours' average.
    fn step(&self, x: &[[f64; 3]], scale: f64, subtract: Option<&[[f64; 3]]>, out: &mut [[f64; 3]]) {
        for (v, o) in out.iter_mut().enumerate() {
            let ring = &self.list[self.first[v] as usize..self.first[v + 1] as usize];
            let mut sum = [0.0; 3];
            for &w in ring {
                let p = x[w as usize];
                sum = [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]];
            }
            let inverse = if ring.is_empty() { 0.0 } else { 1.0 / ring.len() as f64 };
            for a in 0..3 {
                let average = if ring.is_empty() { x[v][a] } else { sum[a] * inverse };
                o[a] = (x[v][a] + average) * scale - subtract.map_or(0.0, |s| s[v][a]);
            }
        }
    }
}

/// `x <- sum_n w_n c_n T_n(I - K/2) x` with the Chebyshev coefficients of a low pass and a Hamming window.
fn filter(mesh: &mut TriangleMesh, degree: usize, pass_band: f64) {
    let neighbours = Neighbours::new(mesh);
    let origin = mesh.vertices[0];
    let start: Vec<[f64; 3]> = mesh.vertices.iter().map(|&p| (p - origin).to_array()).collect();
    let c = coefficients(degree, pass_band);
    let mut result: Vec<[f64; 3]> = start.iter().map(|p| p.map(|x| x * c[0])).collect();
    let mut before = start;
    let mut now = vec![[0.0; 3]; before.len()];
    neighbours.step(&before, 0.5, None, &mut now);
    let mut next = vec![[0.0; 3]; before.len()];
    for (n, &weight) in c.iter().enumerate().skip(1) {
        for (r, x) in result.iter_mut().zip(&now) {
            *r = [0, 1, 2].map(|a| r[a] + weight * x[a]);
        }
        if n < degree {
            neighbours.step(&now, 1.0, Some(&before), &mut next);
            std::mem::swap(&mut before, &mut now);
            std::mem::swap(&mut now, &mut next);
        }
    }
    for (p, r) in mesh.vertices.iter_mut().zip(result) {
        let moved: Point<Patient> = origin + Vector::from_array(r);
        *p = moved;
    }
}

/// Coefficients of the windowed step function, scaled so that they sum to 1 (a constant stays as it is).
fn coefficients(degree: usize, pass_band: f64) -> Vec<f64> {
    let theta = (1.0 - pass_band / 2.0).acos();
    let window = |n: f64| 0.54 + 0.46 * (n * PI / (degree as f64 + 1.0)).cos();
    let mut c: Vec<f64> = (0..=degree)
        .map(|n| match n {
            0 => theta / PI,
            n => window(n as f64) * 2.0 * (n as f64 * theta).sin() / (n as f64 * PI),
        })
        .collect();
    let sum: f64 = c.iter().sum();
    c.iter_mut().for_each(|x| *x /= sum);
    c
}

#[cfg(test)]
mod tests {
    use super::super::isosurface;
    use super::*;
    use monro_geometry::{Grid, Volume};

    /// A binary ball of radius 12 mm off the lattice.
    fn voxel_ball() -> TriangleMesh {
        let grid = Grid::axis_aligned([31; 3], [1.0; 3], [-15.2, -14.9, -15.05]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            if (grid.centre(i, j, k) - Point::ORIGIN).norm() < 12.0 { 1.0 } else { 0.0 }
        });
        isosurface(&Volume::new(grid, data.collect()).expect("count"), 0.5)
    }

    fn roughness(m: &TriangleMesh) -> f64 {
        m.vertices.iter().map(|p| ((*p - Point::ORIGIN).norm() - 12.0).abs()).sum::<f64>() / m.vertices.len() as f64
    }

    #[test]
    fn steps_vanish_and_the_volume_stays() {
        let mut m = voxel_ball();
        let (volume, rough) = (m.signed_volume(), roughness(&m));
        smooth(&mut m, Smoothing::default());
        assert!((m.signed_volume() / volume - 1.0).abs() < 2e-4);
        assert!(roughness(&m) < 0.5 * rough, "{} of {rough}", roughness(&m));
        assert!(roughness(&m) < 0.1, "{}", roughness(&m));
    }

    #[test]
    fn coefficients_keep_constants_and_damp_the_highest_frequency() {
        let c = coefficients(20, 0.05);
        assert!((c.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // K = 2 is T_n(0): 1, 0, -1, 0, ...
        let at_two: f64 =
            c.iter().enumerate().filter(|(n, _)| n % 2 == 0).map(|(n, x)| if n % 4 == 0 { *x } else { -x }).sum();
        assert!(at_two.abs() < 0.01, "{at_two}");
    }
}
