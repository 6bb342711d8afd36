use super::*;
use crate::Space;
use monro_geometry::Point;
use proptest::prelude::*;

fn pyramid() -> TriangleMesh {
    let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.25, 0.25, 1.5]].map(Point::from_array).to_vec();
    TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] }
}

#[test]
fn what_is_written_is_read_back() {
    let mesh = pyramid();
    assert_eq!(decode(&encode(&mesh, None)).expect("own file"), mesh);
    let values = [0.0, 1.0, 2.0, 3.0];
    assert_eq!(decode(&encode(&mesh, Some(("displacement", &values)))).expect("with a scalar"), mesh);
}

#[test]
fn ascii_with_a_quad_and_extra_properties_is_read() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";
    let mesh = decode(text.as_bytes()).expect("ascii");
    assert_eq!(mesh.triangles, vec![[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.vertices[2], Point::new(1.0, 1.0, 0.0));
}

#[test]
fn a_count_far_beyond_the_file_is_refused_without_allocating_it() {
    let text = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n1234";
    assert!(matches!(decode(text.as_bytes()), Err(PlyError::Body { index: 0, .. })));
}

/// As 3D Slicer writes it; a file without the words is LPS.
#[test]
fn a_surface_in_ras_was_read_as_lps() {
    let ours = String::from_utf8_lossy(&encode(&TriangleMesh::default(), None)).into_owned();
    assert_eq!(decode_stated(ours.as_bytes()).expect("own file").1, Some(Space::Lps));
    let text = "ply\nformat ascii 1.0\ncomment VTK generated PLY File\ncomment SPACE=RAS\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n4 2 3\n1 5 3\n3 0 1 2\n";
    let (mesh, space) = decode_stated(text.as_bytes()).expect("RAS");
    assert_eq!((mesh.vertices[1], space), (Point::new(-4.0, -2.0, 3.0), Some(Space::Ras)));
    let (mesh, space) = decode_stated(text.replace("comment SPACE=RAS\n", "").as_bytes()).expect("unsaid");
    assert_eq!((mesh.vertices[1], space), (Point::new(4.0, 2.0, 3.0), None));
}

proptest! {
    #[test]
    fn cut_or_corrupted_files_never_panic(cut in 0usize..400, at in 0usize..400, value in 0u8..) {
        let mut bytes = encode(&pyramid(), None);
        let at = at % bytes.len();
        bytes[at] = value;
        bytes.truncate(cut.max(1));
        let _ = decode(&bytes);
    }
}

/// Faces with a list before and one behind their polygon, and a vertex with a list, in each encoding.
fn with_lists(encoding: &str, count: &str, entries: usize) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {encoding} 1.0\nelement vertex 4\nproperty list uchar short seen_by\nproperty float x\nproperty float y\nproperty float z\nelement face 4\nproperty list {count} float texcoord\nproperty list uchar int vertex_indices\nproperty list {count} double weights\nend_header\n"
    )
    .into_bytes();
    let mut put = |value: f64, kind: &str| {
        let mut raw = match kind {
            "uchar" => vec![value as u8],
            "short" => (value as i16).to_le_bytes().to_vec(),
            "ushort" => (value as u16).to_le_bytes().to_vec(),
            "int" => (value as i32).to_le_bytes().to_vec(),
            "float" => (value as f32).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        };
        match encoding {
            "ascii" => out.extend_from_slice(format!("{value} ").as_bytes()),
            order => {
                raw = if order == "binary_big_endian" { raw.into_iter().rev().collect() } else { raw };
                out.extend_from_slice(&raw);
            }
        }
    };
    let list = |put: &mut dyn FnMut(f64, &str), values: &[f64], count: &str, kind: &str| {
        put(values.len() as f64, count);
        values.iter().for_each(|&v| put(v, kind));
    };
    for p in &pyramid().vertices {
        list(&mut put, &[7.0, -1.0], "uchar", "short");
        p.to_array().iter().for_each(|&v| put(v, "float"));
    }
    for t in &pyramid().triangles {
        list(&mut put, &vec![0.25; entries], count, "float");
        list(&mut put, &t.map(f64::from), "uchar", "int");
        list(&mut put, &vec![-3.5; entries], count, "double");
    }
    out
}

#[test]
fn a_second_list_of_a_face_was_taken_for_its_polygon() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (count, entries) in [("uchar", 6), ("uchar", 0), ("ushort", 300)] {
            let read = decode(&with_lists(encoding, count, entries));
            assert_eq!(read.expect(encoding), pyramid(), "{encoding}, {entries} entries");
        }
    }
}

#[test]
fn a_polygon_of_more_than_255_corners_was_refused() {
    let corner = |i: usize| (i as f64 * core::f64::consts::TAU / 300.0).sin_cos();
    let points: String = (0..300).map(|i| format!("{} {} 0\n", corner(i).1, corner(i).0)).collect();
    let polygon: String = (0..300).map(|i| format!(" {i}")).collect();
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 300\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list ushort int vertex_index\nend_header\n{points}300{polygon}\n"
    );
    assert_eq!(decode(text.as_bytes()).expect("large").triangles.len(), 298);
}

/// An L of six corners in the plane z = 1, from whichever of them it begins.
#[test]
fn a_polygon_that_bends_inwards_became_triangles_outside_of_it() {
    let points = "0 0 1\n2 0 1\n2 1 1\n1 1 1\n1 2 1\n0 2 1\n";
    for first in 0..6 {
        for order in [[0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0]] {
            let corners = order.map(|i| ((i + first) % 6).to_string()).join(" ");
            let text = format!(
                "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n{points}6 {corners}\n"
            );
            let mesh = decode(text.as_bytes()).expect("an L");
            let up = if order[0] == 0 { 1.0 } else { -1.0 };
            let areas: Vec<f64> = (0..mesh.triangles.len()).map(|t| up * mesh.area_vector(t).z).collect();
            assert!(areas.len() == 4 && areas.iter().all(|a| *a >= 0.0), "{corners}: {areas:?}");
            assert!((areas.iter().sum::<f64>() - 3.0).abs() < 1e-12, "{corners}: {areas:?}");
        }
    }
}

#[test]
fn faces_that_the_header_does_not_count_were_lost() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 2 1\n";
    assert!(matches!(decode(text.as_bytes()), Err(PlyError::Surplus(4))));
    let mut own = encode(&pyramid(), None);
    own.extend([0; 12]);
    assert_eq!(decode(&own).expect("padded"), pyramid());
    own.push(0);
    assert!(matches!(decode(&own), Err(PlyError::Surplus(13))));
}

#[test]
fn faces_without_a_polygon_are_refused_with_the_lists_that_are_there() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar float texcoord\nproperty list uchar int corners\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 3 0 1 2\n";
    let told = decode(text.as_bytes()).expect_err("no polygon").to_string();
    assert!(told.contains("\"texcoord\", \"corners\"") && told.contains("vertex_indices"), "{told}");
    let none = text.replace("property list uchar float texcoord\nproperty list uchar int corners", "property int id");
    let told = decode(none.as_bytes()).expect_err("no list").to_string();
    assert!(told.contains("none"), "{told}");
    // Points alone are no fault of the header's.
    let points = text.replace("face 1", "face 0").replace("3 0 1 2 3 0 1 2\n", "");
    assert_eq!(decode(points.as_bytes()).expect("points").vertices.len(), 3);
}

#[test]
fn a_list_longer_than_the_file_is_refused_with_both_sizes() {
    let mut bytes = with_lists("binary_little_endian", "uint", 0);
    let end = bytes.windows(10).position(|w| w == b"end_header").expect("header") + 11;
    bytes.truncate(end + 4 * 17);
    bytes.extend_from_slice(&4_000_000_000u32.to_le_bytes());
    let told = decode(&bytes).expect_err("too long").to_string();
    assert!(told.contains("face 0") && told.contains("4000000000 entries") && told.contains("0 bytes"), "{told}");
}
