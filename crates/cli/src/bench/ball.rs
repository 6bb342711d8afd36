//! The ball that soft-body engines are compared on: a brain-sized ellipsoid with a ventricle-sized one in it, held by its
//! lowest 15 % of vertices, and probed from the top.

use anyhow::{Context, Result, bail};
use monro_anatomy::tetra::{self, MeshOptions};
use monro_case::vtu::{self, UnstructuredGrid};
use monro_geometry::{Grid, Patient, Point, Structure, TetMesh, Volume};
use std::path::Path;

/// Semi-axes of the ellipsoids, mm.
pub(super) const OUTER: [f64; 3] = [70.0, 55.0, 65.0];
const INNER: [f64; 3] = [30.0, 10.0, 12.5];
/// Edge of the voxels that the ball is meshed from, mm.
const VOXEL: f64 = 2.0;
/// Share of the vertices that is held, from below.
const HELD: f64 = 0.15;
/// Radius around the top within which vertices are driven, mm.
const DRIVEN_MM: f64 = 3.0;

/// Labels of the two regions.
pub(super) fn labels() -> [u16; 2] {
    [Structure::Brain.label().into(), Structure::LeftLateralVentricle.label().into()]
}

/// A ball of about `elements` tetrahedra.
pub(super) fn made(elements: usize) -> Result<TetMesh> {
    let dims = OUTER.map(|r| (2.0 * r / VOXEL) as usize + 5);
    let origin = OUTER.map(|r| -r - 2.0 * VOXEL);
    let grid = Grid::axis_aligned(dims, [VOXEL; 3], origin)?;
    let [tissue, fluid] = labels();
    let inside =
        |p: Point<Patient>, r: [f64; 3]| p.to_array().iter().zip(r).map(|(v, r)| (v / r).powi(2)).sum::<f64>() < 1.0;
    let label = |p: Point<Patient>| {
        if inside(p, INNER) {
            fluid
        } else if inside(p, OUTER) {
            tissue
        } else {
            0
        }
    };
    let at = |i: usize| {
        let v = grid.voxel(i);
        Point::from_array(core::array::from_fn(|a| origin[a] + VOXEL * v[a] as f64))
    };
    let data = (0..grid.len()).map(|i| label(at(i))).collect();
    let labels = Volume::new(grid, data)?;
    let (mesh, _) = tetra::mesh(&labels, &MeshOptions::new(&[tissue, fluid], &[fluid], elements))
        .with_context(|| format!("no ball of {elements} elements"))?;
    Ok(mesh)
}

/// A mesh from a file, scaled to mm: regions by the cell array `label` or, as the peers' meshes have it, `region`
/// (0 tissue, 1 fluid).
pub(super) fn read(file: &Path, scale: f64) -> Result<TetMesh> {
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let grid = vtu::decode(&bytes).with_context(|| format!("{} cannot be used", file.display()))?;
    let vertices: Vec<Point<Patient>> = grid.points.iter().map(|p| Point::from_array(p.map(|v| v * scale))).collect();
    let mesh = TetMesh { vertices, tets: grid.tets.clone(), labels: regions(&grid) };
    mesh.validate().with_context(|| format!("{} cannot be used", file.display()))?;
    let size = extent(&mesh);
    if !(20.0..2000.0).contains(&size) {
        bail!(
            "{} is {size:.3} mm across with --scale {scale}, which is no head; --scale turns its unit into mm (1000 for metres, 1 for mm)",
            file.display()
        );
    }
    Ok(mesh)
}

fn regions(grid: &UnstructuredGrid) -> Vec<u16> {
    let [tissue, fluid] = labels();
    let array = |name: &str| vtu::find(&grid.cell_data, name);
    let is_fluid = |v: f64| v != 0.0 && v != f64::from(Structure::Brain.label());
    let region = |v: &f64| if is_fluid(*v) { fluid } else { tissue };
    match array("label").or_else(|| array("region")) {
        Some(a) => a.values.iter().map(region).collect(),
        None => vec![tissue; grid.tets.len()],
    }
}

fn extent(mesh: &TetMesh) -> f64 {
    let first = mesh.vertices.first().copied().unwrap_or(Point::ORIGIN);
    let far = mesh.vertices.iter().map(|p| p.distance(first)).fold(0.0, f64::max);
    far.max(0.0)
}

/// Where a mesh is held and driven.
#[derive(Debug)]
pub(super) struct Probe {
    /// Vertices held: the lowest.
    pub(super) held: Vec<u32>,
    /// Vertices driven: those at the top.
    pub(super) driven: Vec<u32>,
    /// The highest vertex.
    pub(super) top: Point<Patient>,
}

impl Probe {
    /// On a mesh that is not empty.
    pub(super) fn new(mesh: &TetMesh) -> Result<Self> {
        let mut z: Vec<f64> = mesh.vertices.iter().map(|p| p.z).collect();
        z.sort_by(f64::total_cmp);
        let top = mesh.vertices.iter().max_by(|a, b| a.z.total_cmp(&b.z)).copied().context("the mesh is empty")?;
        let level = z[(z.len() as f64 * HELD) as usize];
        let all = 0..mesh.vertices.len() as u32;
        let held = all.clone().filter(|&v| mesh.vertices[v as usize].z <= level).collect();
        let driven = all.filter(|&v| mesh.vertices[v as usize].distance(top) <= DRIVEN_MM).collect();
        Ok(Self { held, driven, top })
    }
}
