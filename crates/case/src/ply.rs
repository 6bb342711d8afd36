//! PLY surfaces: binary little-endian out; ASCII and binary of either byte order in.
//!
//! Coordinates are LPS mm; the header says so in a comment (`SPACE=LPS`), which 3D Slicer honours. A file that says
//! `SPACE=RAS` is turned to LPS when it is read.

use crate::{Rounding, Space};
use monro_geometry::{Point, TriangleMesh, TriangleMeshError};
use thiserror::Error;

/// Why a PLY file was refused.
#[derive(Debug, Error)]
pub enum PlyError {
    /// The header is not that of a PLY file, or is cut off.
    #[error("PLY header: {0}")]
    Header(String),
    /// The body ends early or holds something that is not a number.
    #[error("PLY {element} {index}: {reason}")]
    Body {
        /// `vertex` or `face`.
        element: String,
        /// Its number.
        index: usize,
        /// What is wrong.
        reason: String,
    },
    /// The mesh itself is faulty.
    #[error("PLY mesh: {0}")]
    Mesh(#[from] TriangleMeshError),
}

/// Encodes a surface, with an optional scalar per vertex (`name`, values) such as a displacement in mm. Positions are
/// `float`, as all programs read them, or `double` where that would not do ([`Rounding::is_fine`]).
pub fn encode(mesh: &TriangleMesh, scalar: Option<(&str, &[f32])>) -> Vec<u8> {
    let single = Rounding::of(mesh).is_fine();
    let real = if single { "float" } else { "double" };
    let property = scalar.map(|(name, _)| format!("property float {name}\n")).unwrap_or_default();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\ncomment SPACE=LPS unit mm\nelement vertex {}\nproperty {real} x\nproperty {real} y\nproperty {real} z\n{property}element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    out.reserve(mesh.vertices.len() * 16 + mesh.triangles.len() * 13);
    for (i, p) in mesh.vertices.iter().enumerate() {
        for c in p.to_array() {
            if single {
                out.extend_from_slice(&(c as f32).to_le_bytes());
            } else {
                out.extend_from_slice(&c.to_le_bytes());
            }
        }
        if let Some((_, values)) = scalar {
            out.extend_from_slice(&values.get(i).copied().unwrap_or(0.0).to_le_bytes());
        }
    }
    for t in &mesh.triangles {
        out.push(3);
        for v in t {
            out.extend_from_slice(&v.to_le_bytes());
        }
    }
    out
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// `b` holds `size()` bytes, least significant first.
    fn value(self, b: &[u8]) -> f64 {
        let four = |b: &[u8]| [b[0], b[1], b[2], b[3]];
        match self {
            Self::I8 => f64::from(b[0].cast_signed()),
            Self::U8 => f64::from(b[0]),
            Self::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            Self::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            Self::I32 => f64::from(i32::from_le_bytes(four(b))),
            Self::U32 => f64::from(u32::from_le_bytes(four(b))),
            Self::F32 => f64::from(f32::from_le_bytes(four(b))),
            Self::F64 => f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
        }
    }
}

enum Property {
    Scalar(Scalar, String),
    List(Scalar, Scalar),
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    length: usize,
    space: Option<Space>,
}

/// Decodes a PLY surface, in LPS whatever the file's axes; polygons are split into fans.
///
/// # Errors
/// A named fault of header, body or mesh. Never allocates more than the file's own size suggests.
pub fn decode(bytes: &[u8]) -> Result<TriangleMesh, PlyError> {
    decode_stated(bytes).map(|(mesh, _)| mesh)
}

/// As [`decode`], with the axes that the file said it was in.
///
/// # Errors
/// As [`decode`].
pub fn decode_stated(bytes: &[u8]) -> Result<(TriangleMesh, Option<Space>), PlyError> {
    let header = parse_header(bytes)?;
    let mut reader = Reader { bytes: &bytes[header.length..], encoding: header.encoding };
    let mut mesh = TriangleMesh::default();
    for element in &header.elements {
        for index in 0..element.count {
            read_row(&mut reader, element, &mut mesh).map_err(|reason| PlyError::Body {
                element: element.name.clone(),
                index,
                reason,
            })?;
        }
    }
    mesh.validate()?;
    header.space.unwrap_or(Space::Lps).to_lps(&mut mesh.vertices);
    Ok((mesh, header.space))
}

fn parse_header(bytes: &[u8]) -> Result<Header, PlyError> {
    let end = b"end_header";
    let at =
        bytes.windows(end.len()).position(|w| w == end).ok_or_else(|| PlyError::Header("no end_header line".into()))?;
    let newline = bytes[at..].iter().position(|&b| b == b'\n').ok_or_else(|| PlyError::Header("cut off".into()))?;
    let text = core::str::from_utf8(&bytes[..at]).map_err(|_| PlyError::Header("not text".into()))?;
    let mut lines = text.lines().map(str::trim);
    if lines.next() != Some("ply") {
        return Err(PlyError::Header("the file does not begin with \"ply\"".into()));
    }
    let mut header = Header { encoding: Encoding::Ascii, elements: Vec::new(), length: at + newline + 1, space: None };
    for line in lines {
        header_line(line, &mut header).ok_or_else(|| PlyError::Header(format!("cannot read the line \"{line}\"")))?;
    }
    Ok(header)
}

fn header_line(line: &str, header: &mut Header) -> Option<()> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words.as_slice() {
        [] => {}
        ["comment" | "obj_info", ..] => header.space = header.space.or_else(|| Space::of_header(line)),
        ["format", "ascii", _] => header.encoding = Encoding::Ascii,
        ["format", "binary_little_endian", _] => header.encoding = Encoding::Little,
        ["format", "binary_big_endian", _] => header.encoding = Encoding::Big,
        ["element", name, count] => {
            let (name, count) = ((*name).to_owned(), count.parse().ok()?);
            header.elements.push(Element { name, count, properties: Vec::new() });
        }
        ["property", "list", count, item, _] => {
            let list = Property::List(Scalar::parse(count)?, Scalar::parse(item)?);
            header.elements.last_mut()?.properties.push(list);
        }
        ["property", kind, name] => {
            let scalar = Property::Scalar(Scalar::parse(kind)?, (*name).to_owned());
            header.elements.last_mut()?.properties.push(scalar);
        }
        _ => return None,
    }
    Some(())
}

fn read_row(reader: &mut Reader<'_>, element: &Element, mesh: &mut TriangleMesh) -> Result<(), String> {
    let mut position = [f64::NAN; 3];
    let mut polygon: Vec<u32> = Vec::new();
    if element.properties.is_empty() {
        return Err("an element without properties cannot be counted".into());
    }
    for property in &element.properties {
        match property {
            Property::Scalar(kind, name) => {
                let value = reader.next(*kind)?;
                if let Some(axis) = ["x", "y", "z"].iter().position(|a| a == name) {
                    position[axis] = value;
                }
            }
            Property::List(count, item) => {
                let n = reader.next(*count)?;
                if !(0.0..=255.0).contains(&n) {
                    return Err(format!("a list of {n} entries"));
                }
                polygon.clear();
                for _ in 0..n as usize {
                    polygon.push(vertex_number(reader.next(*item)?)?);
                }
            }
        }
    }
    match element.name.as_str() {
        "vertex" => mesh.vertices.push(Point::from_array(position)),
        "face" if polygon.len() < 3 => return Err(format!("a face of {} vertices", polygon.len())),
        "face" => mesh.triangles.extend(polygon[1..].windows(2).map(|w| [polygon[0], w[0], w[1]])),
        _ => {}
    }
    Ok(())
}

fn vertex_number(value: f64) -> Result<u32, String> {
    if value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0 {
        Ok(value as u32)
    } else {
        Err(format!("{value} is no vertex number"))
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    encoding: Encoding,
}

impl Reader<'_> {
    fn next(&mut self, kind: Scalar) -> Result<f64, String> {
        if self.encoding == Encoding::Ascii {
            return self.next_word();
        }
        let n = kind.size();
        let (head, rest) = self.bytes.split_at_checked(n).ok_or("the file ends here")?;
        self.bytes = rest;
        let mut raw = [0u8; 8];
        raw[..n].copy_from_slice(head);
        if self.encoding == Encoding::Big {
            raw[..n].reverse();
        }
        Ok(kind.value(&raw))
    }

    fn next_word(&mut self) -> Result<f64, String> {
        let start = self.bytes.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the file ends here")?;
        let rest = &self.bytes[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.bytes = rest;
        let word = String::from_utf8_lossy(word);
        word.parse().map_err(|_| format!("\"{word}\" is not a number"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pyramid() -> TriangleMesh {
        let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.25, 0.25, 1.5]].map(Point::from_array).to_vec();
        TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let mesh = pyramid();
        assert_eq!(decode(&encode(&mesh, None)).expect("own file"), mesh);
        let values = [0.0, 1.0, 2.0, 3.0];
        assert_eq!(decode(&encode(&mesh, Some(("displacement", &values)))).expect("with a scalar"), mesh);
    }

    #[test]
    fn ascii_with_a_quad_and_extra_properties_is_read() {
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";
        let mesh = decode(text.as_bytes()).expect("ascii");
        assert_eq!(mesh.triangles, vec![[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.vertices[2], Point::new(1.0, 1.0, 0.0));
    }

    #[test]
    fn a_count_far_beyond_the_file_is_refused_without_allocating_it() {
        let text = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n1234";
        assert!(matches!(decode(text.as_bytes()), Err(PlyError::Body { index: 0, .. })));
    }

    /// As 3D Slicer writes it; a file without the words is LPS.
    #[test]
    fn a_surface_in_ras_was_read_as_lps() {
        let ours = String::from_utf8_lossy(&encode(&TriangleMesh::default(), None)).into_owned();
        assert_eq!(decode_stated(ours.as_bytes()).expect("own file").1, Some(Space::Lps));
        let text = "ply\nformat ascii 1.0\ncomment VTK generated PLY File\ncomment SPACE=RAS\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n4 2 3\n1 5 3\n3 0 1 2\n";
        let (mesh, space) = decode_stated(text.as_bytes()).expect("RAS");
        assert_eq!((mesh.vertices[1], space), (Point::new(-4.0, -2.0, 3.0), Some(Space::Ras)));
        let (mesh, space) = decode_stated(text.replace("comment SPACE=RAS\n", "").as_bytes()).expect("unsaid");
        assert_eq!((mesh.vertices[1], space), (Point::new(4.0, 2.0, 3.0), None));
    }

    proptest! {
        #[test]
        fn cut_or_corrupted_files_never_panic(cut in 0usize..400, at in 0usize..400, value in 0u8..) {
            let mut bytes = encode(&pyramid(), None);
            let at = at % bytes.len();
            bytes[at] = value;
            bytes.truncate(cut.max(1));
            let _ = decode(&bytes);
        }
    }
}
