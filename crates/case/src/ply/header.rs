//! The header: elements, their properties and how numbers are stored.

use super::PlyError;
use crate::Space;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scalar {
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

    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// `b` holds `size()` bytes, least significant first.
    pub(super) fn value(self, b: &[u8]) -> f64 {
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

pub(super) enum Property {
    Scalar(Scalar, String),
    List { count: Scalar, item: Scalar, name: String },
}

pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The property that holds the corners of a face. Other lists, such as texture coordinates, may stand beside it.
    pub(super) fn polygon(&self) -> Option<usize> {
        let is_polygon = |p: &Property| matches!(p, Property::List { name, .. } if ["vertex_indices", "vertex_index"].contains(&name.as_str()));
        self.properties.iter().position(is_polygon).filter(|_| self.name == "face")
    }

    /// Bytes of the smallest row in binary: a polygon has three corners, other lists may be empty.
    pub(super) fn least_bytes(&self) -> usize {
        let polygon = self.polygon();
        let bytes = |(i, property): (usize, &Property)| match property {
            Property::Scalar(kind, _) => kind.size(),
            Property::List { count, item, .. } => count.size() + if polygon == Some(i) { 3 * item.size() } else { 0 },
        };
        self.properties.iter().enumerate().map(bytes).sum::<usize>().max(1)
    }

    /// Refuses faces whose corners are nowhere.
    fn check(&self) -> Result<(), PlyError> {
        if self.name != "face" || self.count == 0 || self.polygon().is_some() {
            return Ok(());
        }
        let name = |p: &Property| match p {
            Property::List { name, .. } => Some(format!("\"{name}\"")),
            Property::Scalar(..) => None,
        };
        let lists: Vec<String> = self.properties.iter().filter_map(name).collect();
        let lists = if lists.is_empty() { "none".into() } else { lists.join(", ") };
        Err(PlyError::Header(format!(
            "the {} face(s) have no list \"vertex_indices\" or \"vertex_index\"; lists that are there: {lists}; rename the one that holds the corners",
            self.count
        )))
    }
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) length: usize,
    pub(super) space: Option<Space>,
}

pub(super) fn parse_header(bytes: &[u8]) -> Result<Header, PlyError> {
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
    header.elements.iter().try_for_each(Element::check)?;
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
        ["property", "list", count, item, name] => {
            let (count, item) = (Scalar::parse(count)?, Scalar::parse(item)?);
            let list = Property::List { count, item, name: (*name).to_owned() };
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
