//! Fewer triangles, same surface: quadric decimation that is checked afterwards.

use super::smooth::restore_volume;
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify, typed_to_bytes};
use monro_geometry::{Topology, TriangleMesh, Vector};

/// Largest loss of enclosed volume that is made good by a shift along the normals; more means a part has gone.
const VOLUME_TOLERANCE: f64 = 0.1;

/// Reduces a mesh to about `target_triangles`, or to as few as keep it what it was: closed, manifold, oriented, the
/// same Euler number and pieces. The enclosed volume of a closed mesh is restored (chords lie inside a convex surface);
/// a target that costs more than a tenth of it, or breaks the topology, is raised by steps of 1.4, at last to the mesh
/// itself. Coincident vertices are welded first.
pub fn decimate(mesh: &TriangleMesh, target_triangles: usize) -> TriangleMesh {
    let welded = weld(mesh);
    let before = (welded.topology(), welded.signed_volume());
    let mut target = target_triangles.max(4);
    while target < welded.triangles.len() {
        let mut candidate = reduce(&welded, target, SimplifyOptions::RegularizeLight);
        if same_kind(&before.0, &candidate.topology())
            && (candidate.signed_volume() - before.1).abs() <= VOLUME_TOLERANCE * before.1.abs()
        {
            if before.0.is_closed() {
                restore_volume(&mut candidate, before.1);
            }
            return candidate;
        }
        target = target * 7 / 5;
    }
    welded
}

/// Reduces a mesh to about `target_triangles` for looking at: as [`decimate`] where that gets there, else small pieces and
/// handles go, which [`decimate`] keeps at any price.
pub fn thin(mesh: &TriangleMesh, target_triangles: usize) -> TriangleMesh {
    let kept = decimate(mesh, target_triangles);
    if kept.triangles.len() <= target_triangles * 11 / 10 {
        return kept;
    }
    reduce(&kept, target_triangles, SimplifyOptions::RegularizeLight | SimplifyOptions::Prune)
}

fn same_kind(before: &Topology, after: &Topology) -> bool {
    after.boundary_edges <= before.boundary_edges
        && after.non_manifold_edges <= before.non_manifold_edges
        && after.non_manifold_vertices <= before.non_manifold_vertices
        && after.misoriented_edges <= before.misoriented_edges
        && after.euler() == before.euler()
        && after.components == before.components
}

/// Merges vertices with the same coordinates, drops triangles that collapse and vertices without a triangle.
pub fn weld(mesh: &TriangleMesh) -> TriangleMesh {
    let mut order: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    // Adding 0 turns -0 into 0, which compare equal but have other bits.
    let key = |v: u32| mesh.vertices[v as usize].to_array().map(|x| (x + 0.0).to_bits());
    order.sort_unstable_by_key(|&v| (key(v), v));
    let mut first = vec![0u32; mesh.vertices.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&v| first[v as usize] = same[0]);
    }
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| first[v as usize]));
    compact(mesh, triangles.filter(|[a, b, c]| a != b && b != c && c != a))
}

fn compact(mesh: &TriangleMesh, triangles: impl Iterator<Item = [u32; 3]>) -> TriangleMesh {
    let mut number = vec![u32::MAX; mesh.vertices.len()];
    let mut out = TriangleMesh::default();
    for t in triangles {
        let triangle = t.map(|v| {
            if number[v as usize] == u32::MAX {
                number[v as usize] = out.vertices.len() as u32;
                out.vertices.push(mesh.vertices[v as usize]);
            }
            number[v as usize]
        });
        out.triangles.push(triangle);
    }
    out
}

fn reduce(mesh: &TriangleMesh, target: usize, options: SimplifyOptions) -> TriangleMesh {
    // Single precision around the first vertex: the absolute position would cost digits.
    let origin = mesh.vertices[0];
    let positions: Vec<[f32; 3]> =
        mesh.vertices.iter().map(|&p| Vector::to_array(p - origin).map(|x| x as f32)).collect();
    let adapter = VertexDataAdapter::new(typed_to_bytes(&positions), size_of::<[f32; 3]>(), 0);
    let adapter = adapter.expect("whole positions, from the first byte on");
    let indices = mesh.triangles.as_flattened();
    let kept = simplify(indices, &adapter, target * 3, f32::MAX, options, None);
    compact(mesh, kept.chunks_exact(3).map(|t| [t[0], t[1], t[2]]))
}

#[cfg(test)]
mod tests {
    use super::super::isosurface;
    use super::*;
    use monro_geometry::{Grid, Point, Volume};

    fn torus(n: usize) -> TriangleMesh {
        let grid = Grid::axis_aligned([n; 3], [40.0 / n as f64; 3], [-20.0; 3]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let p = grid.centre(i, j, k);
            (4.0 - (p.x.hypot(p.y) - 11.0).hypot(p.z)) as f32
        });
        isosurface(&Volume::new(grid, data.collect()).expect("count"), 0.0)
    }

    #[test]
    fn a_torus_stays_a_torus() {
        let m = torus(60);
        let d = decimate(&m, 1500);
        let t = d.topology();
        assert!(t.is_closed() && t.is_manifold() && t.is_oriented() && t.euler() == 0);
        assert!(d.triangles.len() <= 1500, "{}", d.triangles.len());
        assert!((d.signed_volume() / m.signed_volume() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn an_impossible_target_backs_off_instead_of_breaking_the_surface() {
        let m = torus(40);
        let t = decimate(&m, 4).topology();
        assert!(t.is_closed() && t.is_manifold() && t.euler() == 0, "{t:?}");
    }

    #[test]
    fn what_is_for_looking_at_loses_its_crumbs_rather_than_stay_large() {
        let (large, crumb) = (torus(40), torus(6));
        let mut m = large.clone();
        for n in 0..200 {
            let first = m.vertices.len() as u32;
            let away = Vector::new(60.0 * f64::from(n % 10), 60.0 * f64::from(n / 10), 200.0);
            m.vertices.extend(crumb.vertices.iter().map(|p| Point::ORIGIN + (*p - Point::ORIGIN) * 0.1 + away));
            m.triangles.extend(crumb.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        let target = large.triangles.len() / 4;
        assert!(decimate(&m, target).triangles.len() > 2 * target, "the crumbs are kept");
        let t = thin(&m, target);
        assert!(!t.triangles.is_empty() && t.triangles.len() <= target * 11 / 10, "{}", t.triangles.len());
        assert!(t.vertices.iter().any(|p| p.z < 20.0), "the torus is still there");
    }

    #[test]
    fn unwelded_triangles_are_welded() {
        let m = torus(30);
        let soup = TriangleMesh {
            vertices: m.triangles.iter().flatten().map(|&v| m.vertices[v as usize]).collect(),
            triangles: (0..m.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        };
        let w = weld(&soup);
        assert_eq!((w.vertices.len(), w.topology().is_closed()), (m.vertices.len(), true));
        assert!(w.vertices.iter().all(|p: &Point<_>| p.is_finite()));
    }
}
