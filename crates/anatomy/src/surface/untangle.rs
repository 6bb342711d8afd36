//! Parts what smoothing has moved through itself: the walls of narrow furrows.
//!
//! The surface of the voxels does not cross itself, so vertices of triangles that cross are drawn back towards their places on
//! it, in steps and no further than it takes, with their neighbours a step behind, so that no kink is left.

use monro_geometry::{CrossingFinder, Incidence, Patient, Point, TriangleMesh};

/// Steps from a vertex's place to the one on the voxels' surface, and so the rings that follow it.
const STEPS: u8 = 4;
/// Searches after which what is left is told instead; heads take one to seven.
const ROUNDS: usize = 32;

/// Draws vertices back to `free` (their places before they were moved, mm) where the mesh crosses itself, until it does not;
/// the number of pairs of triangles that still cross: some where `free` crosses itself.
pub(super) fn untangle(mesh: &mut TriangleMesh, free: &[Point<Patient>]) -> usize {
    let finder = CrossingFinder::new(mesh);
    let mut pairs = finder.all().pairs;
    if pairs.is_empty() {
        return 0;
    }
    let mut retreat = Retreat::new(mesh, free);
    for _ in 0..ROUNDS {
        if pairs.is_empty() || !retreat.step(mesh, &pairs) {
            break;
        }
        pairs = finder.among(mesh, &retreat.moved()).pairs;
    }
    pairs.len()
}

/// How far back each vertex is.
struct Retreat<'a> {
    smooth: Vec<Point<Patient>>,
    free: &'a [Point<Patient>],
    around: Incidence,
    back: Vec<u8>,
    moved: Vec<bool>,
}

impl<'a> Retreat<'a> {
    fn new(mesh: &TriangleMesh, free: &'a [Point<Patient>]) -> Self {
        Self {
            smooth: mesh.vertices.clone(),
            free,
            around: Incidence::new(&mesh.triangles, mesh.vertices.len()),
            back: vec![0; mesh.vertices.len()],
            moved: vec![false; mesh.triangles.len()],
        }
    }

    /// Draws the corners of crossing triangles one step back; `false` where none of them has one left.
    fn step(&mut self, mesh: &mut TriangleMesh, pairs: &[[u32; 2]]) -> bool {
        let corners = pairs.iter().flatten().flat_map(|&t| mesh.triangles[t as usize]);
        let mut stack: Vec<(u32, u8)> =
            corners.map(|v| (v, self.back[v as usize] + 1)).filter(|(_, back)| *back <= STEPS).collect();
        let any = !stack.is_empty();
        while let Some((v, back)) = stack.pop() {
            let at = v as usize;
            if self.back[at] >= back {
                continue;
            }
            self.back[at] = back;
            mesh.vertices[at] = self.smooth[at].lerp(self.free[at], f64::from(back) / f64::from(STEPS));
            for &t in self.around.of(at) {
                self.moved[t as usize] = true;
                stack.extend(mesh.triangles[t as usize].map(|w| (w, back - 1)));
            }
        }
        any
    }

    /// The triangles that have moved so far, in order.
    fn moved(&self) -> Vec<u32> {
        (0..).zip(&self.moved).filter(|(_, moved)| **moved).map(|(t, _)| t).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Smoothing, isosurface, smooth};
    use super::*;
    use monro_geometry::{Grid, Volume};

    /// A ball with a furrow of one voxel that winds through its upper half.
    fn furrowed() -> TriangleMesh {
        let grid = Grid::axis_aligned([34; 3], [1.0; 3], [-16.6, -16.3, -16.5]).expect("grid");
        let inside = |p: Point<Patient>| {
            let furrow = (p.x - 4.0 * (0.6 * p.y + 0.3 * p.z).sin()).abs() < 0.9 && p.z > -4.0;
            (p - Point::ORIGIN).norm() < 14.0 && !furrow
        };
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            f32::from(u8::from(inside(grid.centre(i, j, k))))
        });
        isosurface(&Volume::new(grid, data.collect()).expect("count"), 0.5)
    }

    #[test]
    fn walls_of_a_narrow_furrow_do_not_pass_through_each_other() {
        let voxels = furrowed();
        assert!(voxels.crossings().pairs.is_empty());
        let mut mesh = voxels.clone();
        smooth(&mut mesh, Smoothing::default());
        let smoothed = mesh.clone();
        assert!(!mesh.crossings().pairs.is_empty(), "nothing to part");
        assert_eq!(untangle(&mut mesh, &voxels.vertices), 0);
        assert!(mesh.crossings().pairs.is_empty());
        let kept = mesh.vertices.iter().zip(&smoothed.vertices).filter(|(a, b)| a == b).count();
        assert!(kept * 2 > mesh.vertices.len(), "only {kept} of {} stay smooth", mesh.vertices.len());
        assert!((mesh.signed_volume() / voxels.signed_volume() - 1.0).abs() < 2e-3);
    }

    #[test]
    fn what_crosses_from_the_start_is_counted_and_ends_the_rounds() {
        let mut two = furrowed();
        let mut other = two.clone();
        other.vertices.iter_mut().for_each(|p| p.x += 5.3);
        two.append(&other);
        let free = two.vertices.clone();
        assert_eq!(untangle(&mut two, &free), two.crossings().pairs.len());
        assert_eq!(two.vertices, free);
    }
}
