//! Files of every reader, cut off or with bytes overwritten at random: none may panic, nor take memory for what it does not hold.

use core::fmt::Write as _;
use monro_case::vtu::{self, DataArray, Kind, UnstructuredGrid};
use monro_case::{msh, ply, stl};
use monro_geometry::{Point, TetMesh, TriangleMesh};
use proptest::prelude::*;

/// Most memory that reading may add to what this process had, MiB. The files are some kB.
#[cfg(target_os = "linux")]
const MOST: usize = 48;

fn mesh() -> TetMesh {
    let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.5]];
    TetMesh {
        vertices: vertices.map(Point::from_array).to_vec(),
        tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
        labels: vec![4, 5],
    }
}

fn surface() -> TriangleMesh {
    mesh().surface(|_| true)
}

fn ply_text() -> Vec<u8> {
    let s = surface();
    let mut out = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\nproperty list uint float texcoord\nproperty list uint int vertex_indices\nend_header\n",
        s.vertices.len(),
        s.triangles.len()
    );
    for p in &s.vertices {
        let _ = writeln!(out, "{} {} {}", p.x, p.y, p.z);
    }
    for [a, b, c] in &s.triangles {
        let _ = writeln!(out, "2 0.5 0.25 3 {a} {b} {c}");
    }
    out.into_bytes()
}

/// With counts of four bytes, which may claim much.
fn ply_binary(big: bool) -> Vec<u8> {
    let text = String::from_utf8(ply_text()).expect("text");
    let (header, body) = text.split_at(text.find("end_header\n").expect("header") + 11);
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = header.replace("ascii", order).into_bytes();
    let mut put = |le: [u8; 4]| {
        let be = [le[3], le[2], le[1], le[0]];
        out.extend_from_slice(if big { &be } else { &le });
    };
    for line in body.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        for (i, word) in words.iter().enumerate() {
            if words.len() == 3 || i == 1 || i == 2 {
                put(word.parse::<f32>().expect("a number").to_le_bytes());
            } else {
                put(word.parse::<u32>().expect("a number").to_le_bytes());
            }
        }
    }
    out
}

fn stl_text() -> Vec<u8> {
    let s = surface();
    let mut out = String::from("solid x\n");
    for t in 0..s.triangles.len() {
        out.push_str("facet normal 0 0 0\nouter loop\n");
        for p in s.corners(t) {
            let _ = writeln!(out, "vertex {} {} {}", p.x, p.y, p.z);
        }
        out.push_str("endloop\nendfacet\n");
    }
    (out + "endsolid x\n").into_bytes()
}

fn grid() -> UnstructuredGrid {
    let mut grid = UnstructuredGrid::from_mesh(&mesh());
    grid.point_data.push(DataArray::vectors("displacement", Kind::Float32, &[[0.5, 0., -2.]; 5]));
    grid
}

/// Text, or appended raw data of which each array has a length of four bytes.
fn vtu_plain(appended: bool) -> Vec<u8> {
    let mut data = Vec::new();
    let mut array = |kind: &str, name: &str, n: usize, values: &str| {
        let head = format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n}\"");
        if !appended {
            return format!("{head} format=\"ascii\">{values}</DataArray>");
        }
        let offset = data.len();
        let words: Vec<f64> = values.split(' ').map(|w| w.parse().expect("a number")).collect();
        let raw: Vec<u8> = match kind {
            "Float64" => words.iter().flat_map(|v| v.to_le_bytes()).collect(),
            "Int32" => words.iter().flat_map(|v| (*v as i32).to_le_bytes()).collect(),
            _ => words.iter().map(|v| *v as u8).collect(),
        };
        data.extend_from_slice(&(raw.len() as u32).to_le_bytes());
        data.extend_from_slice(&raw);
        format!("{head} format=\"appended\" offset=\"{offset}\"/>")
    };
    let points = array("Float64", "Points", 3, "0 0 0 1 0 0 0 1 0 0 0 1");
    let cells = [
        array("Int32", "connectivity", 1, "0 1 2 3"),
        array("Int32", "offsets", 1, "4"),
        array("UInt8", "types", 1, "10"),
    ];
    let label = array("UInt8", "label", 1, "7");
    let mut out = format!(
        "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" header_type=\"UInt32\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points>{points}</Points><Cells>{}</Cells><CellData>{label}</CellData></Piece></UnstructuredGrid>",
        cells.concat()
    )
    .into_bytes();
    if appended {
        out.extend_from_slice(b"<AppendedData encoding=\"raw\">_");
        out.extend_from_slice(&data);
        out.extend_from_slice(b"</AppendedData>");
    }
    out.extend_from_slice(b"</VTKFile>");
    out
}

const MSH_4: &str = "$Comments\nx\n$EndComments\n$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 0 0\n$EndEntities\n$Nodes\n1 4 1 9\n3 1 0 4\n1\n2\n3\n9\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n2 1 2 3 9\n$EndElements\n$ElementData\n1\n\"label\"\n1\n0.0\n3\n0\n1\n1\n2 5\n$EndElementData\n";
const MSH_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n2 4 2 6 1 1 2 3 4\n$EndElements\n";

type Reader = fn(&[u8]) -> Result<(), String>;

fn refused<T>(read: Result<T, impl ToString>) -> Result<(), String> {
    read.map(drop).map_err(|e| e.to_string())
}

/// A valid file of each kind and its reader.
fn files() -> Vec<(&'static str, Vec<u8>, Reader)> {
    let vtu: Reader = |b| refused(vtu::decode(b).and_then(|g| g.to_mesh()));
    let msh: Reader = |b| refused(msh::decode(b));
    let ply: Reader = |b| refused(ply::decode(b));
    let stl: Reader = |b| refused(stl::decode(b));
    vec![
        ("PLY, ours", ply::encode(&surface(), Some(("v", &[1.0; 5]))), ply),
        ("PLY, text", ply_text(), ply),
        ("PLY, little", ply_binary(false), ply),
        ("PLY, big", ply_binary(true), ply),
        ("STL, ours", stl::encode(&surface()), stl),
        ("STL, text", stl_text(), stl),
        ("VTU, ours", vtu::encode(&grid()), vtu),
        ("VTU, text", vtu_plain(false), vtu),
        ("VTU, appended", vtu_plain(true), vtu),
        ("MSH, ours", msh::encode(&mesh()), msh),
        ("MSH 4.1, text", MSH_4.as_bytes().to_vec(), msh),
        ("MSH 2.2, text", MSH_2.as_bytes().to_vec(), msh),
    ]
}

/// Most memory that this process ever had, MiB.
#[cfg(target_os = "linux")]
fn peak() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).expect("a peak");
    line.trim().trim_end_matches(" kB").parse::<usize>().expect("a number") >> 10
}

#[test]
fn a_file_cut_off_anywhere_is_refused_and_told_why() {
    for (name, bytes, read) in files() {
        assert_eq!(read(&bytes), Ok(()), "{name}");
        // The number or the line at the very end of a text may be whole all the same, and XML be closed behind its data.
        let last = bytes.len() - if name == "VTU, appended" { 40 } else { 3 };
        // What stands behind the elements may be left out.
        let whole = |cut: &usize| bytes[..*cut].trim_ascii_end().ends_with(b"$EndElements");
        for cut in (0..last).filter(|cut| !whole(cut)) {
            let told = read(&bytes[..cut]).expect_err(&format!("{name}, {cut} of {} bytes", bytes.len()));
            assert!(told.len() > 10 && told.len() < 1000, "{name}, {cut}: {told}");
        }
    }
}

/// Some runs of bytes, where they begin, how long they are and what is written there.
fn runs() -> impl Strategy<Value = Vec<(usize, usize, u8)>> {
    let value = prop_oneof![Just(0u8), Just(0xff), Just(0x7f), Just(b'9'), any::<u8>()];
    prop::collection::vec((any::<usize>(), 1usize..9, value), 1..6)
}

#[test]
fn overwritten_bytes_never_panic_nor_take_memory() {
    #[cfg(target_os = "linux")]
    let before = peak();
    for (name, bytes, read) in files() {
        // A runner counts its cases over all its runs.
        let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
            failure_persistence: None,
            ..ProptestConfig::with_cases(400)
        });
        let tried = runner.run(&(runs(), any::<Option<usize>>()), |(runs, cut)| {
            let mut bytes = bytes.clone();
            for (at, n, value) in runs {
                let at = at % bytes.len();
                let end = (at + n).min(bytes.len());
                bytes[at..end].fill(value);
            }
            bytes.truncate(cut.map_or(bytes.len(), |c| c % bytes.len()));
            let _ = read(&bytes);
            Ok(())
        });
        assert!(tried.is_ok(), "{name}: {tried:?}");
        #[cfg(target_os = "linux")]
        assert!(peak() - before < MOST, "{name}: {} MiB", peak() - before);
    }
}
