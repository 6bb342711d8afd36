use super::*;
use proptest::prelude::*;

fn two() -> UnstructuredGrid {
    UnstructuredGrid {
        points: vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.5]],
        tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
        point_data: vec![DataArray::vectors("displacement", Kind::Float32, &[[0.5, 0., -2.]; 5])],
        cell_data: vec![DataArray::scalars("label", Kind::UInt16, vec![4., 5.])],
        space: None,
    }
}

#[test]
fn what_is_written_is_read_back() {
    assert_eq!(decode(&encode(&two())).expect("own file"), two());
    assert_eq!(two().to_mesh().expect("mesh").labels, vec![4, 5]);
    assert_eq!(decode(&encode(&UnstructuredGrid::default())).expect("empty"), UnstructuredGrid::default());
}

/// A field array as 3D Slicer writes it, as text and compressed.
#[test]
fn a_mesh_in_ras_was_read_as_lps() {
    let text = String::from_utf8(encode(&two())).expect("text");
    let stated = |attributes: &str, content: &str| {
        let field = format!(
            "<UnstructuredGrid>\n<FieldData><Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" {attributes}>{content}</Array></FieldData>"
        );
        decode(text.replace("<UnstructuredGrid>", &field).as_bytes()).expect("readable")
    };
    let ras = stated("format=\"ascii\"", "82 65 83 0");
    assert_eq!((ras.space, ras.points[1]), (Some(Space::Ras), [1.0, 0.0, 0.0]));
    assert_eq!(ras.to_mesh().expect("mesh").vertices[1].to_array(), [-1.0, 0.0, 0.0]);
    let letters = DataArray::scalars("", Kind::UInt8, b"RAS\0".map(f64::from).to_vec());
    assert_eq!(stated("format=\"binary\"", &write::payload(&letters)).space, Some(Space::Ras));
    assert_eq!(stated("format=\"ascii\"", "76 80 83 0").space, Some(Space::Lps));
    assert_eq!(stated("format=\"ascii\"", "what").space, None);
}

fn raw_appended() -> Vec<u8> {
    let mut data = Vec::new();
    let mut offsets = Vec::new();
    let mut put = |bytes: Vec<u8>| {
        offsets.push(data.len());
        data.extend_from_slice(&(bytes.len() as u32).to_be_bytes());
        data.extend_from_slice(&bytes);
    };
    let points = [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
    put(points.as_flattened().iter().flat_map(|v| v.to_be_bytes()).collect());
    put([0i64, 1, 2, 3].iter().flat_map(|v| v.to_be_bytes()).collect());
    put(4i64.to_be_bytes().to_vec());
    put(vec![10]);
    let array = |kind: &str, name: &str, n: usize, i: usize| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n}\" format=\"appended\" offset=\"{}\"/>",
            offsets[i]
        )
    };
    let mut file = format!(
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"BigEndian\" header_type=\"UInt32\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_",
        array("Float32", "Points", 3, 0), array("Int64", "connectivity", 1, 1), array("Int64", "offsets", 1, 2), array("UInt8", "types", 1, 3)
    ).into_bytes();
    file.extend_from_slice(&data);
    file.extend_from_slice(b"\n</AppendedData></VTKFile>");
    file
}

#[test]
fn big_endian_raw_appended_data_are_read() {
    let grid = decode(&raw_appended()).expect("raw");
    assert_eq!(grid.tets, vec![[0, 1, 2, 3]]);
    assert_eq!(grid.points[1], [1.0, 0.0, 0.0]);
}

#[test]
fn a_hexahedron_a_wrong_count_and_a_bad_index_are_named() {
    let text = String::from_utf8(encode(&two())).expect("text");
    let ascii = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\">0 0 0 7</DataArray><DataArray type=\"Int32\" Name=\"offsets\">4</DataArray><DataArray type=\"UInt8\" Name=\"types\">KIND</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>";
    assert!(matches!(decode(ascii.replace("KIND", "12").as_bytes()), Err(VtuError::CellType { cell: 0, kind: 12 })));
    assert!(matches!(decode(ascii.replace("KIND", "10").as_bytes()), Err(VtuError::Mesh(_))));
    assert!(matches!(
        decode(text.replace("Name=\"offsets\"", "Name=\"other\"").as_bytes()),
        Err(VtuError::Structure(_))
    ));
    let short = text.replace("Name=\"label\" NumberOfComponents=\"1\"", "Name=\"label\" NumberOfComponents=\"2\"");
    assert!(matches!(decode(short.as_bytes()), Err(VtuError::Array { .. })));
}

#[test]
fn an_inverted_element_and_a_missing_label_are_named() {
    let mut grid = two();
    grid.tets[1].swap(0, 1);
    assert!(matches!(grid.to_mesh(), Err(VtuError::Mesh(_))));
    grid.cell_data.clear();
    assert!(matches!(grid.to_mesh(), Err(VtuError::Structure(_))));
    assert!(find(&grid.point_data, "displacement").is_some());
}

proptest! {
    #[test]
    fn cut_or_corrupted_files_never_panic(cut in 0usize..5000, at in 0usize..5000, value in 0u8.., raw in any::<bool>()) {
        let mut bytes = if raw { raw_appended() } else { encode(&two()) };
        let at = at % bytes.len();
        bytes[at] = value;
        bytes.truncate(cut.max(1));
        let _ = decode(&bytes);
    }
}
