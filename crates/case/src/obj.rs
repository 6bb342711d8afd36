//! Wavefront OBJ surfaces, written only: named objects in one file. Coordinates are LPS mm; the first comment says so
//! (`SPACE=LPS`), which 3D Slicer honours.

use crate::Rounding;
use core::fmt::Write as _;
use monro_geometry::TriangleMesh;

/// Encodes surfaces as objects of the given names; blanks in names become underscores.
pub fn encode(objects: &[(&str, &TriangleMesh)]) -> Vec<u8> {
    let mut out = String::from("# SPACE=LPS unit mm\n");
    let mut first = 1;
    // Writing to a String cannot fail.
    for (name, mesh) in objects {
        let _ = writeln!(out, "o {}", name.split_whitespace().collect::<Vec<_>>().join("_"));
        // Shorter where that does.
        let single = Rounding::of(mesh).is_fine();
        for [x, y, z] in mesh.vertices.iter().map(|p| p.to_array()) {
            let _ = if single {
                writeln!(out, "v {} {} {}", x as f32, y as f32, z as f32)
            } else {
                writeln!(out, "v {x} {y} {z}")
            };
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| v + first);
            let _ = writeln!(out, "f {a} {b} {c}");
        }
        first += mesh.vertices.len() as u32;
    }
    out.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    #[test]
    fn numbers_go_on_over_objects_and_names_have_no_blanks() {
        let vertices = [[0., 0., 0.5], [1., 0., 0.], [0., 1., 0.]].map(Point::from_array).to_vec();
        let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2]] };
        let text = String::from_utf8(encode(&[("a b", &mesh), ("c", &mesh)])).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[..6], ["# SPACE=LPS unit mm", "o a_b", "v 0 0 0.5", "v 1 0 0", "v 0 1 0", "f 1 2 3"]);
        assert_eq!(lines[10], "f 4 5 6");
    }
}
