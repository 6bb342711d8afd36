//! STL surfaces: binary out; binary and ASCII in.
//!
//! STL knows no shared vertices: equal corners become one vertex when it is read. Coordinates are LPS mm; the format has no
//! place to say so but the comment (`SPACE=LPS`), which 3D Slicer honours. A file that says `SPACE=RAS` there, or on the
//! line that begins with `solid`, is turned to LPS when it is read.

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
        "STL: {bytes} bytes are neither ASCII (\"solid ...\") nor the {expected} of a binary file of {triangles} triangles"
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
    // Some binary files begin with "solid" as well: the length decides.
    let (header, corners) = if bytes.len() as u64 == expected {
        (&bytes[..COMMENT], binary(&bytes[HEAD..]))
    } else if bytes.trim_ascii_start().starts_with(b"solid") {
        let text = bytes.trim_ascii_start();
        (text.split(|&b| b == b'\n').next().unwrap_or(text), ascii(bytes)?)
    } else {
        return Err(StlError::Length { bytes: bytes.len(), expected, triangles: count });
    };
    let mut mesh = welded(&corners);
    mesh.validate()?;
    let space = Space::of_header(&String::from_utf8_lossy(header));
    space.unwrap_or(Space::Lps).to_lps(&mut mesh.vertices);
    Ok((mesh, space))
}

fn binary(body: &[u8]) -> Vec<[f32; 3]> {
    let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let corner = |b: &[u8]| [number(b), number(&b[4..]), number(&b[8..])];
    body.chunks_exact(TRIANGLE).flat_map(|t| [corner(&t[12..]), corner(&t[24..]), corner(&t[36..])]).collect()
}

fn ascii(bytes: &[u8]) -> Result<Vec<[f32; 3]>, StlError> {
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let fail = |corners: &[[f32; 3]], reason: String| StlError::Triangle { triangle: corners.len() / 3, reason };
    let text = String::from_utf8_lossy(bytes);
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("vertex") => {
                let numbers: Option<Vec<f32>> = words.map(|w| w.parse().ok()).collect();
                let corner = numbers.and_then(|n| n.try_into().ok());
                corners.push(corner.ok_or_else(|| fail(&corners, format!("\"{}\" is no vertex", line.trim())))?);
            }
            Some("endfacet") if !corners.len().is_multiple_of(3) => {
                return Err(fail(&corners, "the facet has not three vertices".into()));
            }
            _ => {}
        }
    }
    if corners.len().is_multiple_of(3) { Ok(corners) } else { Err(fail(&corners, "the file ends here".into())) }
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
mod tests {
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
        let flat = format!("solid x\n{}", facet.replace("1 0 0", "0 0 0"));
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
}
