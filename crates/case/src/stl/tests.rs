use super::*;
use proptest::prelude::*;

fn pyramid() -> TriangleMesh {
    let vertices = [[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [0.25, 0.25, 1.5]].map(Point::from_array).to_vec();
    TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]] }
}

#[test]
fn what_is_written_is_read_back_with_shared_vertices() {
    assert_eq!(decode(&encode(&pyramid())).expect("own file"), pyramid());
    assert_eq!(decode(&encode(&TriangleMesh::default())).expect("empty"), TriangleMesh::default());
}

#[test]
fn ascii_is_read_and_its_faults_are_named() {
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 -0\nendloop\nendfacet\n";
    let mesh = decode(format!("solid x\n{facet}endsolid x\n").as_bytes()).expect("ascii");
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (3, 1));
    let bad = format!("solid x\n{facet}{}", facet.replace("1e0", "one"));
    assert!(decode(bad.as_bytes()).expect_err("no number").to_string().contains("triangle 1"));
    let flat = format!("solid x\n{}endsolid\n", facet.replace("1 0 0", "0 0 0"));
    assert!(matches!(decode(flat.as_bytes()), Err(StlError::Mesh(TriangleMeshError::Degenerate(0)))));
    assert!(matches!(decode(&[7; 200]), Err(StlError::Length { bytes: 200, .. })));
}

/// As 3D Slicer writes both kinds; a file without the words is LPS.
#[test]
fn a_surface_in_ras_was_read_as_lps() {
    assert_eq!(decode_stated(&encode(&pyramid())).expect("own file").1, Some(Space::Lps));
    let mut binary = encode(&pyramid());
    binary[..COMMENT].fill(b' ');
    assert_eq!(decode_stated(&binary).expect("unsaid"), (pyramid(), None));
    binary[..27].copy_from_slice(b"3D Slicer output. SPACE=RAS");
    let (mesh, space) = decode_stated(&binary).expect("RAS");
    assert_eq!((mesh.vertices[3], space), (Point::new(-0.25, -0.25, 1.5), Some(Space::Ras)));
    let text = "solid 3D Slicer output. SPACE=RAS\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 2 3\nvertex 1 5 3\nendloop\nendfacet\nendsolid\n";
    let (mesh, space) = decode_stated(text.as_bytes()).expect("ascii RAS");
    assert_eq!((mesh.vertices[1], space), (Point::new(-4.0, -2.0, 3.0), Some(Space::Ras)));
}

proptest! {
    #[test]
    fn cut_or_corrupted_files_never_panic(cut in 0usize..300, at in 0usize..300, value in 0u8..) {
        let mut bytes = encode(&pyramid());
        let at = at % bytes.len();
        bytes[at] = value;
        bytes.truncate(cut.max(1));
        let _ = decode(&bytes);
    }
}

const FACET: &str =
    "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n";
const OTHER: &str =
    "facet normal 0 0 -1\n outer loop\n  vertex 1 0 0\n  vertex 0 0 0\n  vertex 0 -1 0\n endloop\nendfacet\n";

fn fault(bytes: &[u8]) -> String {
    decode(bytes).map(|m| m.triangles.len()).expect_err("refused").to_string()
}

#[test]
fn keywords_in_upper_case_were_refused() {
    let text = format!("solid Part\n{FACET}{OTHER}endsolid Part\n");
    let upper = decode(text.to_uppercase().as_bytes()).expect("upper case");
    assert_eq!(upper, decode(text.as_bytes()).expect("lower case"));
    assert_eq!(upper.triangles.len(), 2);
    assert_eq!(decode(text.replace("vertex", "Vertex").replace('\n', "\r\n").as_bytes()).expect("mixed"), upper);
}

#[test]
fn a_binary_file_that_begins_with_solid_is_no_text() {
    for end in [&b""[..], b"\0\0", b"\r\n"] {
        let mut bytes = encode(&pyramid());
        bytes[..12].copy_from_slice(b"solid ascii\n");
        bytes.extend_from_slice(end);
        assert_eq!(decode(&bytes).expect("binary").triangles, pyramid().triangles, "{end:?} behind it");
    }
}

#[test]
fn bytes_behind_the_triangles_of_a_binary_file_had_it_refused() {
    let mut bytes = encode(&pyramid());
    bytes.extend_from_slice(&[0; 30]);
    assert_eq!(decode(&bytes).expect("padded"), pyramid());
    // Another triangle behind them is none to pass over.
    bytes.extend_from_slice(&[9; 20]);
    let told = fault(&bytes);
    assert!(told.contains("334 bytes") && told.contains("284") && told.contains("4 triangles"), "{told}");
}

#[test]
fn a_binary_file_that_is_cut_off_is_refused_with_both_lengths() {
    let mut bytes = encode(&pyramid());
    for header in [&b"solid"[..], b"other"] {
        bytes[..5].copy_from_slice(header);
        let told = fault(&bytes[..250]);
        assert!(told.contains("250 bytes") && told.contains("284"), "{told}");
    }
}

#[test]
fn a_text_that_is_cut_off_was_read_as_a_smaller_surface() {
    let text = format!("solid x\n{FACET}{OTHER}endsolid x\n");
    let told = fault(text.trim_end_matches("endsolid x\n").as_bytes());
    assert!(told.contains("2 triangle(s)") && told.contains("endsolid") && told.contains("cut off"), "{told}");
    // At any place but behind its last word.
    let end = text.rfind("endsolid").expect("there") + "endsolid".len();
    for cut in 0..end {
        assert!(decode(&text.as_bytes()[..cut]).is_err(), "cut at {cut}: {:?}", &text[..cut]);
    }
    assert_eq!(decode(&text.as_bytes()[..end]).expect("whole").triangles.len(), 2);
    let told = fault(&text.as_bytes()[..text.rfind("endloop").expect("there")]);
    assert!(told.contains("triangle 1"), "{told}");
}

#[test]
fn a_facet_of_more_or_fewer_than_three_vertices_was_joined_with_the_next() {
    let quad = FACET.replace(" endloop", "  vertex 0 0.5 0\n  vertex 0 0.2 0\n  vertex 0.5 0.1 0\n endloop");
    let told = fault(format!("solid x\n{quad}endsolid x\n").as_bytes());
    assert!(told.contains("triangle 0") && told.contains("6 vertices"), "{told}");
    let two = FACET.replace("  vertex 0 1 0\n", "");
    assert!(fault(format!("solid x\n{two}endsolid x\n").as_bytes()).contains("2 vertices"));
    let open = FACET.replace("endfacet\n", "");
    assert!(fault(format!("solid x\n{open}{FACET}endsolid x\n").as_bytes()).contains("triangle 0"));
    let loose = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n";
    assert!(fault(format!("solid x\n{loose}endsolid x\n").as_bytes()).contains("outside of a facet"));
}

#[test]
fn several_solids_in_a_text_are_one_surface() {
    let text = format!("solid a\n{FACET}endsolid a\n\nsolid b\n{OTHER}endsolid b\n");
    assert_eq!(decode(text.as_bytes()).expect("two solids").triangles.len(), 2);
    assert!(fault(text.trim_end_matches("endsolid b\n").as_bytes()).contains("2 triangle(s)"));
}
