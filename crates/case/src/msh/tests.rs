use super::*;
use monro_geometry::{Point, TetMesh};
use proptest::prelude::*;

fn two() -> TetMesh {
    let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.5]];
    TetMesh {
        vertices: vertices.map(Point::from_array).to_vec(),
        tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
        labels: vec![4, 5],
    }
}

#[test]
fn what_is_written_is_read_back() {
    assert_eq!(
        decode(&encode(&two())).expect("own file"),
        Imported { mesh: two(), unused: Vec::new(), unlabelled: false, others: Vec::new(), remarks: Vec::new() }
    );
}

#[test]
fn each_interface_is_a_named_group_with_its_triangles() {
    let bytes = encode(&two());
    let text = String::from_utf8_lossy(&bytes);
    for name in ["\"label_4-label_5\"", "\"label_4-outside\"", "\"label_5-outside\"", "3 4 \"label_4\""] {
        assert!(text.contains(name), "{name}");
    }
    // 1 + 3 + 3 triangles and 2 tetrahedra, each a tag and its nodes, in 5 blocks of three integers and a count.
    let start = text.find("$Elements\n").map(|_| bytes.windows(10).position(|w| w == b"$Elements\n").unwrap_or(0) + 10);
    let end = bytes.windows(13).position(|w| w == b"\n$EndElements").unwrap_or(0);
    assert_eq!(end - start.unwrap_or(0), 4 * 8 + 5 * (12 + 8) + 7 * 4 * 8 + 2 * 5 * 8);
}

const ASCII_4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 1 7 0\n$EndEntities\n$Nodes\n1 4 1 9\n3 1 0 4\n1\n2\n3\n9\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n2 2 1 2\n2 1 2 1\n1 1 2 3\n3 1 4 1\n2 1 2 3 9\n$EndElements\n";
const ASCII_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n8 9 9 9\n$EndNodes\n$Elements\n2\n1 2 2 0 1 1 2 3\n2 4 2 6 1 1 2 3 4\n$EndElements\n";

#[test]
fn text_of_both_versions_is_read_with_its_groups() {
    let new = decode(ASCII_4.as_bytes()).expect("4.1").mesh;
    assert_eq!((new.tets.as_slice(), new.labels.as_slice(), new.vertices.len()), (&[[0, 1, 2, 3]][..], &[7][..], 4));
    let Imported { mesh: old, unused, .. } = decode(ASCII_2.as_bytes()).expect("2.2");
    assert_eq!(unused, [8]);
    assert_eq!((old.labels.as_slice(), old.vertices.len()), (&[6][..], 4));
}

#[test]
fn faults_are_named_with_their_element() {
    let fault = |text: String| decode(text.as_bytes()).expect_err("refused").to_string();
    assert!(fault(ASCII_4.replace("2 1 2 3 9\n", "2 1 2 3 5\n")).contains("element 2 uses node 5"));
    assert!(fault(ASCII_4.replace("2 1 2 3 9\n", "2 1 3 2 9\n")).contains("tetrahedron 0 has volume"));
    assert!(fault(ASCII_4.replace("1 1 7 0", "1 1 70000 0")).contains("70000"));
    assert!(fault(ASCII_4.replace("4.1", "3.0")).contains("3.0"));
    assert!(fault(ASCII_4.replace("2 1 2 3 9\n", "2 1 2 x 9\n")).contains("\"x\""));
    assert!(
        fault(ASCII_2.replace("$Elements\n2\n", "$Elements\n3\n3 4 2 6 1 2 3 1 4\n"))
            .contains("tetrahedra 0 and 1 have the same")
    );
    assert!(fault(ASCII_2.replace("2 4 2 6 1 1 2 3 4", "2 2 2 6 1 1 2 3")).contains("no linear tetrahedron"));
}

#[test]
fn quadratic_elements_were_called_no_linear_ones_and_left_out_in_silence() {
    let ten = ASCII_2.replace("$Elements\n2\n", "$Elements\n3\n7 11 2 6 1 1 2 3 4 1 2 3 4 1 2\n");
    assert_eq!(decode(ten.as_bytes()).expect("one is linear").others, [("quadratic tetrahedra", 1)]);
    let none = decode(ten.replace("2 4 2 6 1 1 2 3 4", "2 2 2 6 1 1 2 3").as_bytes()).expect_err("refused").to_string();
    assert!(none.contains("1 quadratic tetrahedra") && none.contains("ElementOrder"), "{none}");
}

#[test]
fn elements_without_group_or_entity_have_the_label_one_and_it_is_told() {
    let read = decode(ASCII_2.replace("2 4 2 6 1", "2 4 2 0 0").as_bytes()).expect("unlabelled");
    assert_eq!((read.unlabelled, read.mesh.labels.as_slice()), (true, &[1][..]));
    assert!(!decode(ASCII_2.as_bytes()).expect("labelled").unlabelled);
}

proptest! {
    #[test]
    fn cut_or_corrupted_files_never_panic(cut in 0usize..2000, at in 0usize..2000, value in 0u8.., text in any::<bool>()) {
        let mut bytes = if text { ASCII_4.as_bytes().to_vec() } else { encode(&two()) };
        let at = at % bytes.len();
        bytes[at] = value;
        bytes.truncate(cut.max(1));
        let _ = decode(&bytes);
    }
}
