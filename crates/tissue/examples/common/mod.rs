//! A small reader and writer of VTU files for the examples: ASCII, or base64 with zlib as meshio writes it.

#![allow(dead_code, reason = "each example uses its own part")]
#![allow(unreachable_pub, reason = "a module shared by examples")]

use base64::Engine;
use monro_geometry::{Point, TetMesh};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::Path;

/// A data array: values and components per entry.
pub type Array = (Vec<f64>, usize);

/// What a file holds.
pub struct Vtu {
    pub points: Vec<[f64; 3]>,
    pub tets: Vec<[u32; 4]>,
    pub point_data: BTreeMap<String, Array>,
    pub cell_data: BTreeMap<String, Array>,
}

impl Vtu {
    /// Reads a file; panics with the path when it cannot.
    pub fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let section = |name: &str| arrays(&text, name);
        let points = section("Points").remove("Points").expect("points").0;
        let mut cells = section("Cells");
        let tets = cells.remove("connectivity").expect("connectivity").0;
        Self {
            points: points.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect(),
            tets: tets.chunks_exact(4).map(|t| [0, 1, 2, 3].map(|i| t[i] as u32)).collect(),
            point_data: section("PointData"),
            cell_data: section("CellData"),
        }
    }

    /// The mesh in millimetres; labels from the cell array `region` plus `first_label`.
    pub fn mesh(&self, to_mm: f64, first_label: u16) -> TetMesh {
        let vertices = self.points.iter().map(|p| Point::from_array(p.map(|v| v * to_mm))).collect();
        let labels = match self.cell_data.get("region") {
            Some((r, _)) => r.iter().map(|&r| r as u16 + first_label).collect(),
            None => vec![first_label; self.tets.len()],
        };
        TetMesh { vertices, tets: self.tets.clone(), labels }
    }

    /// Vertices in the named set.
    pub fn set(&self, name: &str) -> Vec<u32> {
        let (flags, _) = &self.point_data[&format!("set_{name}")];
        (0..flags.len() as u32).filter(|&v| flags[v as usize] != 0.0).collect()
    }

    /// A point array of three components.
    pub fn vectors(&self, name: &str) -> Vec<[f64; 3]> {
        self.point_data[name].0.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
    }
}

fn arrays(text: &str, section: &str) -> BTreeMap<String, Array> {
    let mut out = BTreeMap::new();
    let Some(start) = text.find(&format!("<{section}>")) else { return out };
    let end = text.find(&format!("</{section}>")).expect("closed section");
    let zlib = text.contains("vtkZLibDataCompressor");
    for part in text[start..end].split("<DataArray").skip(1) {
        let (head, rest) = part.split_once('>').expect("tag");
        let body = rest.split("</DataArray>").next().unwrap_or("").trim();
        let attribute = |name: &str| head.split(&format!("{name}=\"")).nth(1).and_then(|r| r.split('"').next());
        let kind = attribute("type").unwrap_or("Float64");
        let values = if attribute("format") == Some("ascii") {
            body.split_ascii_whitespace().map(|v| v.parse().expect("number")).collect()
        } else {
            assert!(zlib, "only zlib-compressed binary arrays are read here");
            numbers(&inflate(body), kind)
        };
        let components = attribute("NumberOfComponents").and_then(|n| n.parse().ok()).unwrap_or(1);
        out.insert(attribute("Name").unwrap_or(section).to_string(), (values, components));
    }
    out
}

fn inflate(body: &str) -> Vec<u8> {
    let engine = base64::engine::general_purpose::STANDARD;
    let word = |b: &[u8], i: usize| u32::from_le_bytes(b[4 * i..4 * i + 4].try_into().expect("word")) as usize;
    let first = engine.decode(&body[..16]).expect("base64");
    let blocks = word(&first, 0);
    let head_len = (4 * (3 + blocks)).div_ceil(3) * 4;
    let head = engine.decode(&body[..head_len]).expect("base64");
    let data = engine.decode(&body[head_len..]).expect("base64");
    let (mut out, mut at) = (Vec::new(), 0);
    for i in 0..blocks {
        let size = word(&head, 3 + i);
        flate2::read::ZlibDecoder::new(&data[at..at + size]).read_to_end(&mut out).expect("zlib");
        at += size;
    }
    out
}

fn numbers(bytes: &[u8], kind: &str) -> Vec<f64> {
    macro_rules! read {
        ($t:ty, $n:literal) => {
            bytes.chunks_exact($n).map(|b| <$t>::from_le_bytes(b.try_into().expect("size")) as f64).collect()
        };
    }
    match kind {
        "Float32" => read!(f32, 4),
        "Float64" => read!(f64, 8),
        "Int32" => read!(i32, 4),
        "UInt32" => read!(u32, 4),
        "Int64" => read!(i64, 8),
        "UInt64" => read!(u64, 8),
        "UInt8" | "Int8" => bytes.iter().map(|&b| f64::from(b)).collect(),
        other => panic!("array type {other}"),
    }
}

/// Writes an ASCII file with one point array `displacement`.
pub fn write_vtu(path: &Path, points: &[[f64; 3]], tets: &[[u32; 4]], displacement: &[[f64; 3]]) {
    let mut f = std::io::BufWriter::new(std::fs::File::create(path).expect("output file"));
    let rows =
        |v: &[[f64; 3]]| v.iter().map(|p| format!("{:.12e} {:.12e} {:.12e}\n", p[0], p[1], p[2])).collect::<String>();
    let (n, m) = (points.len(), tets.len());
    let cells: String = tets.iter().map(|t| format!("{} {} {} {}\n", t[0], t[1], t[2], t[3])).collect();
    let offsets: String = (1..=m).map(|i| format!("{}\n", 4 * i)).collect();
    let array = |kind: &str, name: &str, components: usize, body: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">\n{body}</DataArray>\n"
        )
    };
    let text = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{n}\" NumberOfCells=\"{m}\">\n<Points>\n{}</Points>\n<Cells>\n{}{}{}</Cells>\n\
         <PointData>\n{}</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        array("Float64", "Points", 3, &rows(points)),
        array("Int32", "connectivity", 1, &cells),
        array("Int32", "offsets", 1, &offsets),
        array("UInt8", "types", 1, &"10\n".repeat(m)),
        array("Float64", "displacement", 3, &rows(displacement)),
    );
    f.write_all(text.as_bytes()).expect("written");
}
