//! Reading.

use super::PlyError;
use super::header::{Element, Encoding, Property, Scalar, parse_header};
use super::polygon::Polygon;
use crate::Space;
use monro_geometry::{Point, TriangleMesh};

/// Decodes a PLY surface, in LPS whatever the file's axes; polygons are split into triangles.
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
    let (mut mesh, mut polygons) = (TriangleMesh::default(), Vec::new());
    for element in &header.elements {
        let polygon = element.polygon();
        for index in 0..element.count {
            read_row(&mut reader, element, polygon, (&mut mesh, &mut polygons)).map_err(|reason| PlyError::Body {
                element: element.name.clone(),
                index,
                reason,
            })?;
        }
    }
    reader.ends(header.elements.last().map_or(1, Element::least_bytes))?;
    mesh.validate()?;
    polygons.iter().for_each(|polygon| polygon.mend(&mut mesh));
    header.space.unwrap_or(Space::Lps).to_lps(&mut mesh.vertices);
    Ok((mesh, header.space))
}

fn read_row(
    reader: &mut Reader<'_>,
    element: &Element,
    corners: Option<usize>,
    (mesh, polygons): (&mut TriangleMesh, &mut Vec<Polygon>),
) -> Result<(), String> {
    let mut position = [f64::NAN; 3];
    let mut polygon: Vec<u32> = Vec::new();
    if element.properties.is_empty() {
        return Err("an element without properties cannot be counted".into());
    }
    for (i, property) in element.properties.iter().enumerate() {
        match property {
            Property::Scalar(kind, name) => {
                let value = reader.next(*kind)?;
                if let Some(axis) = ["x", "y", "z"].iter().position(|a| a == name) {
                    position[axis] = value;
                }
            }
            Property::List { count, item, name } => {
                let n = reader.count(*count, *item, name)?;
                if Some(i) == corners {
                    polygon = (0..n).map(|_| vertex_number(reader.next(*item)?)).collect::<Result<_, String>>()?;
                } else {
                    reader.skip(*item, n)?;
                }
            }
        }
    }
    match element.name.as_str() {
        "vertex" => mesh.vertices.push(Point::from_array(position)),
        "face" if polygon.len() < 3 => return Err(format!("a face of {} vertices", polygon.len())),
        "face" => {
            let first = mesh.triangles.len();
            mesh.triangles.extend(polygon[1..].windows(2).map(|w| [polygon[0], w[0], w[1]]));
            if polygon.len() > 3 {
                polygons.push(Polygon { first, corners: polygon.len() as u32 });
            }
        }
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
    /// Refuses what is left behind the last element, of `row` bytes at least: a header that counts too few would lose it. Less is
    /// padding.
    fn ends(&self, row: usize) -> Result<(), PlyError> {
        let (left, row) = match self.encoding {
            // Also control characters that end a file elsewhere.
            Encoding::Ascii => (self.bytes.split(|b| *b <= b' ').map(<[u8]>::len).sum(), 1),
            _ => (self.bytes.len(), row),
        };
        if left >= row { Err(PlyError::Surplus(left)) } else { Ok(()) }
    }

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

    /// Entries of a list. More than what is left of the file can hold are refused before anything is made for them.
    fn count(&mut self, kind: Scalar, item: Scalar, name: &str) -> Result<usize, String> {
        let n = self.next(kind)?;
        // In ASCII each entry is a digit behind a space.
        let least = if self.encoding == Encoding::Ascii { 2 } else { item.size() };
        let left = self.bytes.len();
        if n.fract() != 0.0 || n < 0.0 || !n.is_finite() {
            return Err(format!("{n} is no number of entries of the list \"{name}\""));
        }
        if n > (left / least) as f64 {
            return Err(format!("the list \"{name}\" has {n} entries, but only {left} bytes follow"));
        }
        Ok(n as usize)
    }

    /// Passes over `n` numbers.
    fn skip(&mut self, kind: Scalar, n: usize) -> Result<(), String> {
        if self.encoding == Encoding::Ascii {
            return (0..n).try_for_each(|_| self.next_word().map(drop));
        }
        self.bytes = n.checked_mul(kind.size()).and_then(|n| self.bytes.get(n..)).ok_or("the file ends here")?;
        Ok(())
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
