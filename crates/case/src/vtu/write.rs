//! Writing.

use super::{DataArray, Kind, UnstructuredGrid};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use core::fmt::Write as _;
use flate2::{Compression, write::ZlibEncoder};
use std::io::Write as _;

/// Encodes a grid as a `.vtu` file.
pub fn encode(grid: &UnstructuredGrid) -> Vec<u8> {
    let points = DataArray::vectors("Points", Kind::Float64, &grid.points);
    let flat = grid.tets.as_flattened().iter().map(|&v| f64::from(v)).collect();
    let connectivity = DataArray::scalars("connectivity", Kind::Int32, flat);
    let offsets = DataArray::scalars("offsets", Kind::Int32, (1..=grid.tets.len()).map(|n| (n * 4) as f64).collect());
    let types = DataArray::scalars("types", Kind::UInt8, vec![10.0; grid.tets.len()]);
    let mut out = String::new();
    out.push_str("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<UnstructuredGrid>\n");
    // Writing to a String cannot fail.
    let _ = writeln!(out, "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">", grid.points.len(), grid.tets.len());
    section(&mut out, "Points", &[&points]);
    section(&mut out, "Cells", &[&connectivity, &offsets, &types]);
    section(&mut out, "PointData", &grid.point_data.iter().collect::<Vec<_>>());
    section(&mut out, "CellData", &grid.cell_data.iter().collect::<Vec<_>>());
    out.push_str("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    out.into_bytes()
}

fn section(out: &mut String, name: &str, arrays: &[&DataArray]) {
    let _ = writeln!(out, "<{name}>");
    for a in arrays {
        let _ = writeln!(
            out,
            "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"binary\">{}</DataArray>",
            a.kind.name(),
            escape(&a.name),
            a.components,
            payload(a)
        );
    }
    let _ = writeln!(out, "</{name}>");
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Header (blocks, block size, last partial block, compressed sizes) and data are two separate base64 runs.
pub(super) fn payload(array: &DataArray) -> String {
    let mut raw = Vec::with_capacity(array.values.len() * array.kind.size());
    for &v in &array.values {
        array.kind.push(v, &mut raw);
    }
    if raw.is_empty() {
        return STANDARD.encode([0u8; 24]);
    }
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::fast());
    // Writing to a Vec cannot fail.
    let _ = zlib.write_all(&raw);
    let compressed = zlib.finish().unwrap_or_default();
    let header = [1, raw.len() as u64, 0, compressed.len() as u64].map(u64::to_le_bytes);
    STANDARD.encode(header.as_flattened()) + &STANDARD.encode(&compressed)
}
