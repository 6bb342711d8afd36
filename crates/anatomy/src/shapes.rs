//! Shapes of the elements of any mesh, made here or elsewhere, in the measures and bounds of [`crate::tetra`].

use crate::tetra::{BadShapes, LARGEST_DIHEDRAL, LEAST_DIHEDRAL, LEAST_RADIUS_RATIO, MeshReport};
use monro_geometry::{TetMesh, TetQuality};
use rayon::prelude::*;

/// Shapes of all elements of a mesh in some numbers. Angles in degrees; a radius ratio is 1 for a regular element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSummary {
    /// Smallest dihedral angle.
    pub dihedral_min: f64,
    /// Largest dihedral angle.
    pub dihedral_max: f64,
    /// First percentile of the elements' smallest dihedral angles.
    pub dihedral_p1: f64,
    /// Smallest radius ratio.
    pub radius_ratio_min: f64,
    /// Median radius ratio.
    pub radius_ratio_median: f64,
    /// Elements beyond the bounds of shape, if any.
    pub bad: Option<BadShapes>,
}

impl ShapeSummary {
    /// Measures all elements, on all threads; zeros for a mesh without elements.
    pub fn of(mesh: &TetMesh) -> Self {
        let shapes: Vec<TetQuality> = (0..mesh.tets.len()).into_par_iter().map(|t| mesh.quality(t)).collect();
        let mut low: Vec<f64> = shapes.iter().map(|q| q.min_dihedral.to_degrees()).collect();
        let mut ratio: Vec<f64> = shapes.iter().map(|q| q.radius_ratio).collect();
        low.sort_unstable_by(f64::total_cmp);
        ratio.sort_unstable_by(f64::total_cmp);
        let at = |sorted: &[f64], percent: usize| sorted.get(sorted.len() * percent / 100).copied().unwrap_or(0.0);
        Self {
            dihedral_min: at(&low, 0),
            dihedral_max: shapes.iter().map(|q| q.max_dihedral.to_degrees()).fold(0.0, f64::max),
            dihedral_p1: at(&low, 1),
            radius_ratio_min: at(&ratio, 0),
            radius_ratio_median: at(&ratio, 50),
            bad: bad(mesh, &shapes),
        }
    }
}

impl From<&MeshReport> for ShapeSummary {
    fn from(report: &MeshReport) -> Self {
        Self {
            dihedral_min: report.dihedral_min,
            dihedral_max: report.dihedral_max,
            dihedral_p1: report.dihedral_p1,
            radius_ratio_min: report.radius_ratio_min,
            radius_ratio_median: report.radius_ratio_median,
            bad: report.bad_shapes,
        }
    }
}

/// How near an element is to the bounds of shape: below 1 it misses one.
fn room(q: &TetQuality) -> f64 {
    let low = q.min_dihedral.to_degrees() / LEAST_DIHEDRAL;
    let high = (180.0 - q.max_dihedral.to_degrees()) / (180.0 - LARGEST_DIHEDRAL);
    low.min(high).min(q.radius_ratio / LEAST_RADIUS_RATIO)
}

fn bad(mesh: &TetMesh, shapes: &[TetQuality]) -> Option<BadShapes> {
    let missing = || shapes.iter().map(room).enumerate().filter(|(_, room)| *room < 1.0);
    let (worst, _) = missing().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let corners = mesh.corners(worst).map(|p| p.to_array());
    let worst_at = [0, 1, 2].map(|a| corners.iter().map(|c| c[a]).sum::<f64>() / 4.0);
    Some(BadShapes { count: missing().count(), worst_at })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tetra::{MeshOptions, mesh};
    use monro_geometry::{Grid, Point, Volume};

    /// The mesher's own report says the same of its meshes.
    #[test]
    fn a_mesh_read_again_has_the_shapes_that_its_maker_told() {
        let grid = Grid::axis_aligned([20; 3], [2.0; 3], [-19.0; 3]).expect("grid");
        let inside = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            u8::from(grid.centre(i, j, k).distance(Point::ORIGIN) < 14.0)
        };
        let labels = Volume::new(grid, (0..grid.len()).map(inside).collect()).expect("count");
        let (made, report) = mesh(&labels, &MeshOptions::new(&[1], &[1], 2000)).expect("a ball");
        assert_eq!(ShapeSummary::of(&made), ShapeSummary::from(&report));
    }

    #[test]
    fn a_flat_element_is_placed() {
        let flat = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.3, 0.3, 1e-6]].map(Point::from_array).to_vec();
        let found = ShapeSummary::of(&TetMesh { vertices: flat, tets: vec![[0, 1, 2, 3]], labels: vec![1] });
        assert!(found.bad.is_some_and(|b| b.count == 1 && b.worst_at[0] == 0.325), "{found:?}");
    }

    #[test]
    fn elements_of_bad_shape_are_counted_and_the_worst_is_placed() {
        let mut mesh = TetMesh::default();
        // A good one, a flat one (dihedral angles next to 0 and 180) and a thin spike, apart from each other.
        for (x, [a, b, c, d]) in [
            (0.0, [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]]),
            (10.0, [[1., 0., 0.], [0., 1., 0.1], [-1., 0., 0.], [0., -1., 0.1]]),
            (20.0, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 9.]]),
        ] {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend([a, b, c, d].map(|p: [f64; 3]| Point::new(p[0] + x, p[1], p[2])));
            mesh.tets.push([0, 1, 2, 3].map(|i| first + i));
            mesh.labels.push(4);
            if mesh.volume(mesh.tets.len() - 1) < 0.0 {
                mesh.tets.last_mut().expect("pushed").swap(0, 1);
            }
        }
        let bad = ShapeSummary::of(&mesh).bad.expect("two");
        assert!(bad.count == 2 && (bad.worst_at[0] - 10.0).abs() < 1e-9, "{bad:?}");
        mesh.tets.truncate(1);
        assert_eq!(ShapeSummary::of(&mesh).bad, None);
    }
}
