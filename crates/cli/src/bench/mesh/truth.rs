//! How far the ventricles of a mesh lie from the analytic surface that a phantom's voxels were painted from.

use monro_anatomy::phantom::HeadModel;
use monro_anatomy::surface::{SurfaceOptions, isosurface, label_surface};
use monro_geometry::{Bvh, Grid, Patient, Point, Structure, TetMesh, TriangleMesh, Volume};
use serde_json::{Value, json};

/// Cell of the lattice on which the analytic surface is triangulated, mm.
const STEP: f64 = 0.6;
/// Room around the ventricles' voxels, mm.
const ROOM: f64 = 4.0;

/// The analytic surface of all ventricles together.
#[derive(Debug)]
pub(crate) struct Truth {
    surface: TriangleMesh,
    bvh: Bvh,
}

impl Truth {
    /// Triangulates the surface around the ventricles' voxels; `None` where there are none.
    pub(crate) fn new(model: &HeadModel, labels: &Volume<u16>) -> Option<Self> {
        let grid = labels.grid();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for at in (0..grid.len()).filter(|&at| is_ventricle(labels.data()[at])) {
            let [i, j, k] = grid.voxel(at);
            for (a, x) in grid.centre(i, j, k).to_array().into_iter().enumerate() {
                (low[a], high[a]) = (low[a].min(x - ROOM), high[a].max(x + ROOM));
            }
        }
        let dims = core::array::from_fn(|a| ((high[a] - low[a]) / STEP).ceil().max(0.0) as usize + 1);
        let grid = Grid::axis_aligned(dims, [STEP; 3], low).ok()?;
        let depth = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            -model.ventricle_distance(grid.centre(i, j, k)) as f32
        });
        let surface = isosurface(&Volume::new(grid, depth.collect()).ok()?, 0.0);
        let bvh = Bvh::new(&surface);
        Some(Self { surface, bvh })
    }

    /// Distances both ways between the truth and the ventricles of a mesh, mm: the greater mean, 95th percentile and
    /// maximum, and the place of the maximum.
    pub(crate) fn compare(&self, mesh: &TetMesh) -> Value {
        self.distances(&mesh.surface(is_ventricle))
    }

    /// The same for the smoothed surface of the voxels: what no mesh made of them can better.
    pub(crate) fn compare_voxels(&self, labels: &Volume<u16>) -> Value {
        let made = label_surface(labels, is_ventricle, &SurfaceOptions::default());
        made.map_or(Value::Null, |surface| self.distances(&surface.mesh))
    }

    fn distances(&self, found: &TriangleMesh) -> Value {
        if found.triangles.is_empty() {
            return Value::Null;
        }
        let corners = (0..found.triangles.len()).map(|t| centroid(found.corners(t)));
        let there: Vec<Point<Patient>> = found.vertices.iter().copied().chain(corners).collect();
        let there = Distances::new(&there, &self.bvh);
        let back = Distances::new(&self.surface.vertices, &Bvh::new(found));
        let far = if there.max >= back.max { &there } else { &back };
        json!({
            "mean_mm": there.mean.max(back.mean), "p95_mm": there.p95.max(back.p95), "max_mm": far.max, "max_at": far.at.to_array(),
            "mesh_to_truth_max_mm": there.max, "truth_to_mesh_max_mm": back.max,
        })
    }
}

fn is_ventricle(label: u16) -> bool {
    Structure::from_label(label).is_some_and(Structure::is_ventricle)
}

fn centroid(corners: [Point<Patient>; 3]) -> Point<Patient> {
    Point::from_array(core::array::from_fn(|a| corners.iter().map(|p| p.to_array()[a]).sum::<f64>() / 3.0))
}

struct Distances {
    mean: f64,
    p95: f64,
    max: f64,
    at: Point<Patient>,
}

impl Distances {
    fn new(points: &[Point<Patient>], to: &Bvh) -> Self {
        let mut all: Vec<(f64, Point<Patient>)> =
            points.iter().filter_map(|&p| Some((to.nearest(p)?.distance, p))).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mean = all.iter().map(|d| d.0).sum::<f64>() / all.len().max(1) as f64;
        let (max, at) = all.last().copied().unwrap_or((0.0, Point::ORIGIN));
        Self { mean, p95: all.get(all.len() * 95 / 100).map_or(0.0, |d| d.0), max, at }
    }
}
