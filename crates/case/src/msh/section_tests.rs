//! Sections beside those of the mesh, what ends them, and labels as data of elements.

use super::*;

const NODES: &str = "$Nodes\n1 5 1 5\n3 0 0 5\n1\n2\n3\n4\n5\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n0 0 -9\n$EndNodes\n";
const ELEMENTS: &str = "$Elements\n1 2 1 2\n3 0 4 2\n1 1 2 3 4\n2 1 3 2 5\n$EndElements\n";
const FORMAT: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
/// Whose contents look like sections.
const COMMENTS: &str = "$Comments\nBy hand.\n$Nodes\n0 of them\n$Elements\n$EndComments\n";

/// A file of version 4.1 without groups, as meshio writes it.
fn plain(data: &str) -> String {
    [FORMAT, NODES, ELEMENTS, data].concat()
}

/// A file of version 2.2 whose elements have these groups.
fn old(groups: [i32; 2], data: &str) -> String {
    let nodes = "$Nodes\n5\n1 0 0 0\n2 9 0 0\n3 0 9 0\n4 0 0 9\n5 0 0 -9\n$EndNodes\n";
    let [one, two] = groups;
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{nodes}$Elements\n2\n1 4 2 {one} 0 1 2 3 4\n2 4 2 {two} 0 1 3 2 5\n$EndElements\n{data}"
    )
}

fn data(name: &str, values: &[&str]) -> String {
    let rows: String = values.iter().enumerate().map(|(i, v)| format!("{} {v}\n", i + 1)).collect();
    format!("$ElementData\n1\n\"{name}\"\n1\n0.0\n3\n0\n1\n{}\n{rows}$EndElementData\n", values.len())
}

fn read(text: &str) -> Imported {
    decode(text.as_bytes()).expect("readable")
}

fn fault(text: &str) -> String {
    decode(text.as_bytes()).expect_err("refused").to_string()
}

#[test]
fn a_comment_before_the_format_was_refused_and_one_behind_it_read_as_nodes() {
    for text in [
        [COMMENTS, "\n", &plain("")].concat(),
        [FORMAT, COMMENTS, NODES, COMMENTS, ELEMENTS, COMMENTS].concat(),
        [COMMENTS, "$Mine\n1\n$EndMine\n", &old([0; 2], COMMENTS)].concat(),
    ] {
        assert_eq!(read(&text).mesh.tets, [[0, 1, 2, 3], [0, 2, 1, 4]]);
    }
    let told = fault(&["solid x\n", &plain("")].concat());
    assert!(told.contains("\"solid x\"") && told.contains("$MeshFormat"), "{told}");
    assert!(fault(COMMENTS).contains("$MeshFormat"));
}

#[test]
fn a_comment_in_a_binary_file_is_passed_over() {
    let mesh = read(&plain("")).mesh;
    let bytes = [COMMENTS.as_bytes(), &encode(&mesh), COMMENTS.as_bytes()].concat();
    assert_eq!(decode(&bytes).expect("readable").mesh, mesh);
}

#[test]
fn elements_beyond_their_count_were_left_out_and_a_file_cut_in_its_last_number_was_read() {
    let told = fault(&plain("").replace("1 2 1 2\n3 0 4 2\n", "1 1 1 1\n3 0 4 1\n"));
    assert!(told.contains("$Elements") && told.contains("\"2 1 3 2 5\"") && told.contains("counts"), "{told}");
    let text = plain("").replace(" 5\n$EndElements", " 52\n$EndElements").replace("\n5\n0 0 0", "\n52\n0 0 0");
    assert_eq!(read(&text).mesh.tets.len(), 2);
    let cut = &plain("")[..plain("").find("\n$EndElements").expect("there")];
    let told = fault(cut);
    assert!(told.contains("$EndElements") && told.contains("cut off"), "{told}");
    assert!(fault(&plain("$Periodic\n1\n")).contains("$EndPeriodic"));
}

#[test]
fn labels_written_as_data_of_elements_were_all_one() {
    for text in [plain(&data("label", &["4", "5.0"])), old([0; 2], &data("label", &["4", "5"]))] {
        let read = read(&text);
        assert_eq!((read.mesh.labels.as_slice(), read.unlabelled), (&[4, 5][..], false));
    }
    // In any order, in parts, and behind data of another name.
    let parts = data("label", &["4"]) + &data("quality", &["0.5", "0.7"]) + &data("label", &["4", "5"]);
    assert_eq!(read(&[FORMAT, &parts, NODES, ELEMENTS].concat()).mesh.labels, [4, 5]);
    assert!(read(&plain(&data("quality", &["0.5", "0.7"]))).unlabelled);
    // meshio 5.3 with NumPy 2.
    assert_eq!(read(&plain(&data("label", &["np.uint16(4)", "np.uint16(5)"]))).mesh.labels, [4, 5]);
}

#[test]
fn labels_as_data_of_elements_in_a_binary_file_were_all_one() {
    let mut out = b"$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n".to_vec();
    let int = |out: &mut Vec<u8>, values: &[i32]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    let size = |out: &mut Vec<u8>, values: &[u64]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    size(&mut out, &[1, 4, 1, 4]);
    int(&mut out, &[3, 0, 0]);
    size(&mut out, &[4, 1, 2, 3, 4]);
    for v in [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1f64] {
        out.extend_from_slice(&v.to_le_bytes());
    }
    out.extend_from_slice(b"\n$EndNodes\n$Elements\n");
    size(&mut out, &[1, 1, 1, 1]);
    int(&mut out, &[3, 0, 4]);
    size(&mut out, &[1, 1, 1, 2, 3, 4]);
    out.extend_from_slice(b"\n$EndElements\n$ElementData\n1\n\"label\"\n1\n0.0\n3\n0\n1\n1\n");
    int(&mut out, &[1]);
    out.extend_from_slice(&9f64.to_le_bytes());
    out.extend_from_slice(b"\n$EndElementData\n");
    assert_eq!(decode(&out).expect("binary").mesh.labels, [9]);
}

#[test]
fn physical_groups_count_before_data_of_elements_and_a_difference_is_told() {
    let both = read(&old([4, 7], &data("label", &["4", "5"])));
    assert_eq!(both.mesh.labels, [4, 7]);
    let [remark] = &both.remarks[..] else { panic!("{:?}", both.remarks) };
    assert!(remark.contains("element 2") && remark.contains('5') && remark.contains('7'), "{remark}");
    assert_eq!(read(&old([4, 5], &data("label", &["4", "5"]))).remarks, [""; 0]);
}

#[test]
fn data_of_elements_that_are_no_labels_are_refused_with_the_element() {
    let told = fault(&plain(&data("label", &["4"])));
    assert!(told.contains("element 2") && told.contains("1 of 2"), "{told}");
    for bad in ["4.5", "-1", "65536", "nan"] {
        let told = fault(&plain(&data("label", &["4", bad])));
        assert!(told.to_lowercase().contains(&format!("element 2: {bad} is no label")), "{told}");
    }
    let told = fault(&plain(&(data("label", &["4", "5"]) + &data("label", &["4", "6"]))));
    assert!(told.contains("element 2") && told.contains("5 and 6"), "{told}");
    let told = fault(&plain(&data("label", &["4 0 0", "5 0 0"]).replace("0\n1\n2\n", "0\n3\n2\n")));
    assert!(told.contains("3 components"), "{told}");
    assert!(fault(&plain(&data("label", &["four"]))).contains("\"four\""));
}
