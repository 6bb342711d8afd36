//! What a display gets once: the surfaces with their bindings to the nodes, the tetrahedra, the plan, the
//! CT.

use crate::bound::Bound;
use crate::container::Arrays;
use crate::{ServeError, half};
use monro_anatomy::surface::thin;
use monro_case::Case;
use monro_geometry::{Embedding, Grid, Patient, Point, TetLocator, TriangleMesh, Volume};
use monro_scan::ReadOptions;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::Path;

/// Voxels sent at most; a finer CT is thinned, for the memory of tablets.
const MOST_VOXELS: usize = 1 << 25;
/// Vertices of all surfaces at most: what an ordinary GPU moves and draws sixty times a second, in several panes.
const MOST_VERTICES: usize = 100_000;

/// The surfaces, the simulated mesh and the plan, as bytes; and the vertices of the soft surfaces, one after the other.
///
/// # Errors
/// When a surface cannot be bound to the mesh.
pub(crate) fn scene(case: &Case) -> Result<(Vec<u8>, Bound), ServeError> {
    let locator = TetLocator::new(&case.tets).map_err(monro_geometry::EmbeddingError::from)?;
    let mut arrays = Arrays::default();
    let [skin, brain, ventricles] = shown([&case.skin, &case.brain, &case.ventricles], MOST_VERTICES);
    let mut surfaces = vec![rigid_surface("skin", &skin, &mut arrays)];
    let mut bound = Bound::default();
    for (name, mesh) in [("brain", &*brain), ("ventricles", &*ventricles)] {
        let embedding = Embedding::with_locator(&locator, &case.tets, &mesh.vertices)?;
        surfaces.push(soft_surface(name, mesh, &embedding, &mut arrays));
        bound.append(&embedding);
    }
    let header = json!({
        "surfaces": surfaces,
        "node_count": case.tets.vertices.len(),
        "nodes_at": arrays.push(case.tets.vertices.iter().flat_map(floats)),
        "tet_count": case.tets.tets.len(),
        "tets_at": arrays.push(case.tets.tets.iter().flatten().map(|i| i.to_le_bytes())),
        "plan": plan(case),
    });
    Ok((arrays.finish(&header), bound))
}

/// Skin, brain and ventricles with so many vertices at most. The ventricles, which are looked at closely, keep theirs up to
/// a fifth of all; skin and brain share the rest.
fn shown(surfaces: [&TriangleMesh; 3], most: usize) -> [Cow<'_, TriangleMesh>; 3] {
    let count = surfaces.map(|s| s.vertices.len());
    if count.iter().sum::<usize>() <= most {
        return surfaces.map(Cow::Borrowed);
    }
    let ventricles = count[2].min(most / 5);
    let half = (most - ventricles) / 2;
    // What one leaves is the other's.
    let skin = count[0].min(half.max(most - ventricles - count[1].min(half)));
    let most = [skin, most - ventricles - skin, ventricles];
    // A closed surface has twice as many triangles as vertices.
    core::array::from_fn(|i| match surfaces[i] {
        mesh if count[i] <= most[i] => Cow::Borrowed(mesh),
        mesh => Cow::Owned(thin(mesh, 2 * most[i])),
    })
}

/// The planned path as JSON.
pub(crate) fn plan(case: &Case) -> Value {
    let (entry, target) = (case.plan.entry().to_array(), case.plan.target().to_array());
    json!({
        "side": case.plan.side().name(),
        "entry_lps_mm": entry,
        "target_lps_mm": target,
        "length_mm": case.plan.length(),
        "skull_angle_deg": case.manifest.skull_angle_deg,
    })
}

fn rigid_surface(name: &str, mesh: &TriangleMesh, arrays: &mut Arrays) -> Value {
    json!({
        "name": name,
        "vertices": mesh.vertices.len(),
        "triangles": mesh.triangles.len(),
        "positions_at": arrays.push(mesh.vertices.iter().flat_map(floats)),
        "indices_at": arrays.push(mesh.triangles.iter().flatten().map(|i| i.to_le_bytes())),
    })
}

fn soft_surface(name: &str, mesh: &TriangleMesh, embedding: &Embedding, arrays: &mut Arrays) -> Value {
    let mut out = rigid_surface(name, mesh, arrays);
    let bindings = || (0..embedding.points()).map(|i| embedding.binding(i));
    out["nodes_at"] = arrays.push(bindings().flat_map(|(n, _)| n.map(u32::to_le_bytes))).into();
    out["weights_at"] = arrays.push(bindings().flat_map(|(_, w)| w.map(f32::to_le_bytes))).into();
    out
}

fn floats(p: &Point<Patient>) -> [[u8; 4]; 3] {
    p.to_array().map(|v| (v as f32).to_le_bytes())
}

/// The CT of a case folder; `None` for a case without images.
///
/// # Errors
/// When there is one that cannot be read.
pub(crate) fn ct(case_dir: &Path) -> Result<Option<Volume<i16>>, ServeError> {
    let path = case_dir.join("ct.nii.gz");
    if !path.is_file() {
        return Ok(None);
    }
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    Ok(Some(monro_scan::read(&path, &options)?.volume))
}

/// A CT as displays get it: half-precision HU with its placement, thinned where it is too fine for them.
pub(crate) fn ct_for_displays(volume: &Volume<i16>) -> Vec<u8> {
    encode_volume(volume, MOST_VOXELS)
}

fn encode_volume(volume: &Volume<i16>, most: usize) -> Vec<u8> {
    let grid = volume.grid();
    let stride = strides(grid, most);
    let dims: [usize; 3] = core::array::from_fn(|a| grid.dims()[a].div_ceil(stride[a]));
    let mut arrays = Arrays::default();
    let voxels = (0..dims[2]).flat_map(|k| (0..dims[1]).flat_map(move |j| (0..dims[0]).map(move |i| [i, j, k])));
    let value = |[i, j, k]: [usize; 3]| volume.at(i * stride[0], j * stride[1], k * stride[2]);
    let at = arrays.push(voxels.map(|v| half::from_i16(value(v)).to_le_bytes()));
    let placement = grid.patient_from_voxel();
    let rows: Vec<[f64; 4]> = (0..3)
        .map(|r| {
            let l = placement.linear.rows[r];
            [l[0] * stride[0] as f64, l[1] * stride[1] as f64, l[2] * stride[2] as f64, placement.offset[r]]
        })
        .collect();
    arrays.finish(&json!({ "dims": dims, "patient_from_voxel": rows, "hu_at": at, "thinned": stride }))
}

/// Every how many voxels are sent along each axis: the finest axis is thinned first.
pub(crate) fn strides(grid: &Grid, most: usize) -> [usize; 3] {
    let (dims, spacing) = (grid.dims(), grid.spacing());
    let mut stride = [1; 3];
    while (0..3).map(|a| dims[a].div_ceil(stride[a])).product::<usize>() > most {
        let step = |a: usize| spacing[a] * stride[a] as f64;
        let finest = (1..3).fold(0, |best, a| if step(a) < step(best) { a } else { best });
        stride[finest] *= 2;
    }
    stride
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_anatomy::surface::weld;
    use monro_geometry::Vector;

    /// A ball, each face of an octahedron cut into four so many times.
    fn ball(cuts: u32, radius: f64) -> TriangleMesh {
        let corner = |x: f64, y: f64, z: f64| Vector::new(x, y, z);
        let (x, y, z) = (corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0));
        let mut faces: Vec<[Vector<Patient>; 3]> = Vec::new();
        for (a, b, c) in [(x, y, z), (y, -x, z), (-x, -y, z), (-y, x, z)] {
            faces.extend([[a, b, c], [b, a, -c]]);
        }
        for _ in 0..cuts {
            let halved = |[a, b, c]: [Vector<Patient>; 3]| {
                let [d, e, f] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            };
            faces = faces.into_iter().flat_map(halved).collect();
        }
        let place = |v: Vector<Patient>| Point::ORIGIN + v * (radius / v.norm());
        let vertices = faces.as_flattened().iter().map(|v| place(*v)).collect();
        let triangles = (0..faces.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        weld(&TriangleMesh { vertices, triangles })
    }

    #[test]
    fn displays_get_no_more_vertices_than_they_can_draw_and_the_same_surface() {
        let [skin, brain, ventricles] = [ball(6, 90.0), ball(6, 70.0), ball(4, 20.0)];
        assert_eq!((skin.vertices.len(), ventricles.vertices.len()), (16386, 1026));
        let given = [&skin, &brain, &ventricles];
        assert!(shown(given, 40_000).iter().zip(given).all(|(s, g)| **s == *g));
        let coarse = shown(given, 9_000);
        assert!(coarse.iter().map(|s| s.vertices.len()).sum::<usize>() <= 9_100);
        assert_eq!(coarse[2].vertices.len(), 1026);
        for (surface, radius) in coarse.iter().zip([90.0, 70.0, 20.0]) {
            assert!(surface.topology().is_closed());
            let off = |p: &Point<Patient>| (p.distance(Point::ORIGIN) - radius).abs();
            assert!(surface.vertices.iter().map(off).fold(0.0, f64::max) < 0.2);
        }
    }

    #[test]
    fn a_fine_ct_is_thinned_along_its_finest_axes_and_stays_in_place() {
        let grid = Grid::axis_aligned([64, 64, 16], [0.5, 0.5, 2.0], [1.0, 2.0, 3.0]).expect("grid");
        assert_eq!(strides(&grid, 64 * 64 * 16), [1, 1, 1]);
        assert_eq!(strides(&grid, 32 * 32 * 16), [2, 2, 1]);
        let volume = Volume::new(grid, (0..grid.len()).map(|n| (n % 64) as i16).collect()).expect("volume");
        let out = encode_volume(&volume, 32 * 32 * 16);
        let length = u32::from_le_bytes([out[4], out[5], out[6], out[7]]) as usize;
        let header: Value = serde_json::from_slice(&out[8..8 + length]).expect("json");
        assert_eq!(header["dims"], json!([32, 32, 16]));
        assert_eq!(header["patient_from_voxel"][0], json!([1.0, 0.0, 0.0, 1.0]));
        let data = &out[8 + length..];
        assert_eq!(data.len(), 32 * 32 * 16 * 2);
        assert_eq!(data[2..4], half::from_i16(2).to_le_bytes());
    }
}
