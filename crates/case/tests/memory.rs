//! Files that claim far more than they hold are refused before memory is taken for it.
#![cfg(target_os = "linux")]

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::{Compression, write::ZlibEncoder};
use monro_case::vtu;
use std::io::Write;

/// Bytes that an array of the bomb inflates to, of 64 kB.
const CLAIMED: usize = 64 << 20;

/// Most memory that this process ever had, MiB.
fn peak() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).expect("a peak");
    line.trim().trim_end_matches(" kB").parse::<usize>().expect("a number") >> 10
}

/// A payload of [`CLAIMED`] equal bytes, made without ever holding them.
fn bomb(byte: u8) -> String {
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::best());
    (0..CLAIMED >> 16).for_each(|_| zlib.write_all(&vec![byte; 1 << 16]).expect("to memory"));
    let packed = zlib.finish().expect("to memory");
    let header = [1, CLAIMED as u64, 0, packed.len() as u64].map(u64::to_le_bytes);
    STANDARD.encode(header.as_flattened()) + &STANDARD.encode(&packed)
}

/// A file with one tetrahedron, but for what is replaced.
fn file(cells: usize, types: &str, more: &str, fields: &str) -> String {
    format!(
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"><UnstructuredGrid>{fields}<Piece NumberOfPoints=\"4\" NumberOfCells=\"{cells}\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2 3</DataArray><DataArray type=\"Int32\" Name=\"offsets\">4</DataArray><DataArray type=\"UInt8\" Name=\"types\" {types}</DataArray></Cells>{more}</Piece></UnstructuredGrid></VTKFile>"
    )
}

const ONE: &str = "format=\"ascii\">10";

/// What is said of a file, which must not have taken memory.
fn refusal(text: &str) -> String {
    let before = peak();
    let told = vtu::decode(text.as_bytes()).map(|g| g.cell_data.len()).expect_err("refused").to_string();
    let taken = peak() - before;
    assert!(taken < 40, "{taken} MiB for a file of {} kB: {told}", text.len() >> 10);
    told
}

#[test]
fn arrays_that_inflate_to_more_than_the_mesh_took_memory_for_all_of_it() {
    let types = format!("format=\"binary\">{}", bomb(10));
    let told = refusal(&file(1, &types, "", ""));
    assert!(told.contains("types") && told.contains("67108864 values, expected 1 x 1"), "{told}");
    let label = format!(
        "<CellData><DataArray type=\"UInt8\" Name=\"label\" format=\"binary\">{}</DataArray></CellData>",
        bomb(1)
    );
    let told = refusal(&file(1, ONE, &label, ""));
    assert!(told.contains("label") && told.contains("67108864 values, expected 1 x 1"), "{told}");
}

#[test]
fn a_small_file_that_says_it_has_millions_of_cells_took_memory_for_them() {
    let types = format!("format=\"binary\">{}", bomb(10));
    let text = file(CLAIMED, &types, "", "");
    let told = refusal(&text);
    assert!(told.contains("67108864 values") && told.contains(&format!("{} bytes", text.len())), "{told}");
}

/// The sum counts: each of these arrays is within what the file may hold.
#[test]
fn many_arrays_of_the_same_appended_bytes_took_memory_once_each() {
    let array = "<DataArray type=\"UInt8\" Name=\"a\" NumberOfComponents=\"65536\" format=\"appended\" offset=\"0\"/>";
    let more = format!("<CellData>{}</CellData>", array.repeat(100));
    let text = file(1, ONE, &more, "").replace(" compressor=\"vtkZLibDataCompressor\"", "");
    let length = STANDARD.encode([&65536u64.to_le_bytes()[..], &vec![1; 65536]].concat());
    let text =
        text.replace("</VTKFile>", &format!("<AppendedData encoding=\"base64\">_{length}</AppendedData></VTKFile>"));
    let told = refusal(&text);
    assert!(told.contains("65536 values") && told.contains(&format!("{} bytes", text.len())), "{told}");
}

#[test]
fn a_field_array_of_axes_took_memory_for_whatever_it_claims() {
    let field = format!(
        "<FieldData><Array type=\"String\" Name=\"SPACE\" format=\"binary\">{}</Array></FieldData>",
        bomb(b'R')
    );
    let before = peak();
    let grid = vtu::decode(file(1, ONE, "", &field).as_bytes()).expect("says nothing of its axes");
    assert_eq!((grid.tets.len(), grid.space), (1, None));
    assert!(peak() - before < 40, "{} MiB", peak() - before);
}
