//! STL surfaces: binary out; binary and ASCII in.
//!
//! STL knows no shared vertices: equal corners become one vertex when it is read. Coordinates are LPS mm; the format has no
//! place to say so but the comment (`SPACE=LPS`), which 3D Slicer honours. A file that says `SPACE=RAS` there, or on the
//! line that begins with `solid`, is turned to LPS when it is read.

mod ascii;

use crate::Space;
use monro_geometry::{Point, TriangleMesh, TriangleMeshError};
use std::collections::HashMap;
use thiserror::Error;

/// Bytes of the comment, of the count and of one triangle.
const COMMENT: usize = 80;
const HEAD: usize = COMMENT + 4;
const TRIANGLE: usize = 50;

/// Why an STL file was refused.
#[derive(Debug, Error)]
pub enum StlError {
    /// Neither a binary file of the length that its count says nor text that begins with `solid`.
    #[error(
        "STL: {bytes} bytes are neither ASCII (\"solid ...\") nor the {expected} of a binary file of {triangles} triangles: it is cut off, holds more, or is none; export it anew"
    )]
    Length {
        /// Bytes in the file.
        bytes: usize,
        /// Bytes that the count asks for.
        expected: u64,
        /// The count.
        triangles: u32,
    },
    /// A triangle cannot be read.
    #[error("STL triangle {triangle}: {reason}")]
    Triangle {
        /// Its number.
        triangle: usize,
        /// What is wrong.
        reason: String,
    },
    /// A text without its last line.
    #[error("STL: the text ends after {triangles} triangle(s) without \"endsolid\": it is cut off; export it anew")]
    Cut {
        /// Whole triangles before its end.
        triangles: usize,
    },
    /// The mesh itself is faulty.
    #[error("STL mesh: {0}")]
    Mesh(#[from] TriangleMeshError),
}

/// Encodes a surface as binary STL.
pub fn encode(mesh: &TriangleMesh) -> Vec<u8> {
    let mut out = b"SPACE=LPS unit mm".to_vec();
    out.resize(COMMENT, b' ');
    out.extend_from_slice(&(mesh.triangles.len() as u32).to_le_bytes());
    out.reserve(mesh.triangles.len() * TRIANGLE);
    for t in 0..mesh.triangles.len() {
        let area = mesh.area_vector(t);
        let normal = area * (1.0 / area.norm().max(f64::MIN_POSITIVE));
        let corners = mesh.corners(t).map(Point::to_array);
        for v in core::iter::once(normal.to_array()).chain(corners).flatten() {
            out.extend_from_slice(&(v as f32).to_le_bytes());
        }
        out.extend_from_slice(&[0, 0]);
    }
    out
}

/// Decodes an STL surface, in LPS whatever the file's axes; equal corners become one vertex.
///
/// # Errors
/// A file that is no STL, a triangle that cannot be read, that is not finite or that has two equal corners.
pub fn decode(bytes: &[u8]) -> Result<TriangleMesh, StlError> {
    decode_stated(bytes).map(|(mesh, _)| mesh)
}

/// As [`decode`], with the axes that the file said it was in.
///
/// # Errors
/// As [`decode`].
pub fn decode_stated(bytes: &[u8]) -> Result<(TriangleMesh, Option<Space>), StlError> {
    let count = bytes.get(COMMENT..HEAD).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let expected = HEAD as u64 + u64::from(count) * TRIANGLE as u64;
    let (header, corners) = if is_binary(bytes.len() as u64, expected, count) {
        (&bytes[..COMMENT], binary(&bytes[HEAD..expected as usize]))
    } else if is_text(bytes) {
        let text = bytes.trim_ascii_start();
        (text.split(|&b| b == b'\n').next().unwrap_or(text), ascii::corners(bytes)?)
    } else {
        return Err(StlError::Length { bytes: bytes.len(), expected, triangles: count });
    };
    let mut mesh = welded(&corners);
    mesh.validate()?;
    let space = Space::of_header(&String::from_utf8_lossy(header));
    space.unwrap_or(Space::Lps).to_lps(&mut mesh.vertices);
    Ok((mesh, space))
}

/// The length decides: some binary files begin with "solid" as well. Less than a triangle may follow the triangles (padding
/// by some programs and by ways of sending files); what is longer is no accident.
fn is_binary(bytes: u64, expected: u64, count: u32) -> bool {
    bytes == expected || count > 0 && bytes > expected && bytes - expected < TRIANGLE as u64
}

/// Text begins with "solid" and has no zeros, which a binary file has in its count and behind each triangle.
fn is_text(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_start();
    let solid = text.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    solid && !bytes[..bytes.len().min(HEAD + TRIANGLE)].contains(&0)
}

fn binary(body: &[u8]) -> Vec<[f32; 3]> {
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let corner = |b: &[u8]| [number(b), number(&b[4..]), number(&b[8..])];
    body.chunks_exact(TRIANGLE).flat_map(|t| [corner(&t[12..]), corner(&t[24..]), corner(&t[36..])]).collect()
}

fn welded(corners: &[[f32; 3]]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(corners.len() / 3);
    let mut number = |c: &[f32; 3]| {
        // Zero has two signs.
        let key = c.map(|x| (x + 0.0).to_bits());
        *known.entry(key).or_insert_with(|| {
            mesh.vertices.push(Point::from_array(c.map(f64::from)));
            mesh.vertices.len() as u32 - 1
        })
    };
    let numbers: Vec<u32> = corners.iter().map(&mut number).collect();
    mesh.triangles = numbers.as_chunks::<3>().0.to_vec();
    mesh
}

#[cfg(test)]
mod tests;
