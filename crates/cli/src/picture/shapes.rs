//! Meshes of simple bodies: catheter, path, markers.

use monro_geometry::{Patient, Point, TriangleMesh, Vector};
use std::f64::consts::{PI, TAU};

/// A sphere with `2^level` bands from pole to pole (`level` 1 to 8).
pub fn sphere(centre: Point<Patient>, radius: f64, level: u32) -> TriangleMesh {
    let bands = 1usize << level.clamp(1, 8);
    let around = 2 * bands;
    let mut mesh = TriangleMesh::default();
    for i in 0..=bands {
        let polar = PI * i as f64 / bands as f64;
        for j in 0..around {
            let turn = TAU * j as f64 / around as f64;
            let d = Vector::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
            mesh.vertices.push(centre + d * radius);
        }
    }
    for i in 0..bands {
        for j in 0..around {
            let at = |i: usize, j: usize| (i * around + j % around) as u32;
            let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            // At the poles one of the two triangles has no area.
            if i + 1 < bands {
                mesh.triangles.push([quad[0], quad[1], quad[2]]);
            }
            if i > 0 {
                mesh.triangles.push([quad[0], quad[2], quad[3]]);
            }
        }
    }
    merge_poles(mesh, bands, around)
}

/// Gives each pole one vertex.
fn merge_poles(mut mesh: TriangleMesh, bands: usize, around: usize) -> TriangleMesh {
    let last = (bands * around) as u32;
    let around = around as u32;
    for t in &mut mesh.triangles {
        *t = t.map(|v| if v < around { 0 } else { v.min(last) });
    }
    mesh.vertices.truncate(last as usize + 1);
    mesh
}

/// A closed cylinder between two points; empty when they coincide.
pub fn cylinder(from: Point<Patient>, to: Point<Patient>, radius: f64) -> TriangleMesh {
    const SIDES: u32 = 24;
    let mut mesh = TriangleMesh::default();
    let Some(axis) = (to - from).normalized() else { return mesh };
    let Some(u) = axis.any_perpendicular() else { return mesh };
    let v = axis.cross(u);
    for j in 0..SIDES {
        let turn = TAU * f64::from(j) / f64::from(SIDES);
        let d = (u * turn.cos() + v * turn.sin()) * radius;
        mesh.vertices.extend([from + d, to + d]);
    }
    mesh.vertices.extend([from, to]);
    for j in 0..SIDES {
        let (a, b) = (2 * j, 2 * ((j + 1) % SIDES));
        mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        mesh.triangles.extend([[2 * SIDES, b, a], [2 * SIDES + 1, a + 1, b + 1]]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spheres_and_cylinders_are_closed_and_enclose_their_volume() {
        let s = sphere(Point::new(1.0, 2.0, 3.0), 10.0, 6);
        assert!(s.topology().is_closed() && s.topology().is_oriented() && s.topology().euler() == 2);
        assert!((s.signed_volume() / (4000.0 * PI / 3.0) - 1.0).abs() < 0.005);
        let c = cylinder(Point::ORIGIN, Point::new(0.0, 3.0, 4.0), 2.0);
        assert!(c.topology().is_closed() && c.topology().is_oriented());
        assert!((c.signed_volume() / (20.0 * PI) - 1.0).abs() < 0.02);
        assert!(cylinder(Point::ORIGIN, Point::ORIGIN, 1.0).triangles.is_empty());
    }
}
