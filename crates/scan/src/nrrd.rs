//! NRRD: `.nrrd`, and `.nhdr` with its data file in the same folder; raw or gzip; LPS, RAS or LAS space.
//!
//! Not read, and refused by name: other encodings (text, hex, bzip2), other spaces, lists of data files, data outside
//! the folder, more than three dimensions.

use crate::error::{Problem, header, unsupported};
use crate::raster::{Element, Endian, Layout, Packing, Raster, grid};
use crate::text;
use flate2::{Compression, write::GzEncoder};
use monro_geometry::{Affine, Grid, Matrix3, Volume};
use std::io::Write;

/// A parsed header, and where its data are.
#[derive(Debug)]
pub struct Header {
    layout: Layout,
    packing: Packing,
    line_skip: u64,
    /// Bytes to skip; -1: the voxels are the last bytes.
    byte_skip: i64,
    /// Name of the detached data file, in the same folder; `None`: the data follow the header.
    pub data_file: Option<String>,
    end: usize,
}

/// Whether the bytes begin like a NRRD file.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(b"NRRD00")
}

/// Parses a header, which ends with an empty line (or, detached, with the file).
///
/// # Errors
/// Unsupported variety, missing or malformed fields, data outside the folder.
pub fn decode_header(bytes: &[u8]) -> Result<Header, Problem> {
    let (fields, end) = fields(bytes)?;
    if fields.get("dimension")? != "3" {
        let what = format!("a NRRD of dimension {}", fields.get("dimension")?);
        let way_out =
            "give one three-dimensional volume; segments that overlap (layers) must be exported as one label map";
        return Err(unsupported(what, way_out));
    }
    let element = fields.element()?;
    // Before the order of the bytes, which text has none of.
    let packing = fields.packing()?;
    let layout = Layout { grid: fields.grid()?, element, endian: fields.endian(element)?, slope: 1.0, intercept: 0.0 };
    let byte_skip = fields.whole("byte skip", ["byte skip", "byteskip"])?;
    let line_skip = fields.whole("line skip", ["line skip", "lineskip"])?.max(0).cast_unsigned();
    if byte_skip < -1 || byte_skip == -1 && packing != Packing::Raw {
        return Err(header("byte skip", format!("{byte_skip} with this encoding")));
    }
    Ok(Header { layout, packing, line_skip, byte_skip, data_file: fields.data_file()?, end })
}

impl Header {
    /// Attaches the voxels: `bytes` is this file itself, or the detached data file.
    ///
    /// # Errors
    /// When the bytes cannot hold the voxels.
    pub fn with_data(self, bytes: &[u8]) -> Result<Raster<'_>, Problem> {
        let mut data = if self.data_file.is_some() { bytes } else { bytes.get(self.end..).unwrap_or_default() };
        for _ in 0..self.line_skip {
            let Some(end) = data.iter().position(|&b| b == b'\n') else { break };
            data = &data[end + 1..];
        }
        let need = self.layout.grid.len() * self.layout.element.size();
        let skip = match self.byte_skip {
            -1 => data.len().saturating_sub(need),
            n => usize::try_from(n).unwrap_or(usize::MAX),
        };
        // Of compressed voxels, bytes are skipped behind the compression.
        let (before, behind) = if self.packing == Packing::Raw { (skip, 0) } else { (0, skip) };
        let mut raster = Raster::new(self.layout, data.get(before..).unwrap_or_default(), self.packing)?;
        raster.skip(behind)?;
        Ok(raster)
    }
}

/// The user's own fields, `key:=value`.
pub(crate) fn free_fields(bytes: &[u8]) -> Vec<(String, String)> {
    let lines = text::lines(bytes).map(|(line, _)| line).take_while(|l| !l.is_empty());
    let pair = |l: &[u8]| {
        let line = String::from_utf8_lossy(l);
        line.split_once(":=").map(|(k, v)| (k.to_owned(), v.to_owned()))
    };
    lines.filter_map(pair).collect()
}

struct Fields(Vec<(String, String)>);

/// Fields (keys in lower case) up to the empty line, and where the data begin.
fn fields(bytes: &[u8]) -> Result<(Fields, usize), Problem> {
    let mut out = Vec::new();
    let mut end = bytes.len();
    for (n, (line, after)) in text::lines(bytes).enumerate() {
        end = after;
        if line.is_empty() {
            break;
        }
        let line = String::from_utf8_lossy(line);
        if n == 0 || line.starts_with('#') {
            continue;
        }
        let Some((key, value)) = line.split_once(':') else {
            return Err(header("NRRD", format!("line {:?} has no ':'", text::excerpt(&line))));
        };
        // "key:=value" is free text of the user.
        if !value.starts_with('=') {
            out.push((key.trim().to_ascii_lowercase(), value.trim().to_owned()));
        }
    }
    Ok((Fields(out), end))
}

impl Fields {
    fn find(&self, keys: &[&str]) -> Option<&str> {
        self.0.iter().find(|(k, _)| keys.contains(&k.as_str())).map(|(_, v)| v.as_str())
    }

    fn get(&self, key: &'static str) -> Result<&str, Problem> {
        self.find(&[key]).ok_or_else(|| header(key, "is missing"))
    }

    fn whole(&self, field: &'static str, keys: [&str; 2]) -> Result<i64, Problem> {
        let value = self.find(&keys).unwrap_or("0");
        value.parse().map_err(|_| header(field, format!("{:?} is no whole number", text::excerpt(value))))
    }

    fn element(&self) -> Result<Element, Problem> {
        Ok(match self.get("type")?.to_ascii_lowercase().as_str() {
            "signed char" | "int8" | "int8_t" => Element::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Element::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Element::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Element::U16,
            "int" | "signed int" | "int32" | "int32_t" => Element::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Element::U32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => Element::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Element::U64,
            "float" => Element::F32,
            "double" => Element::F64,
            other => return Err(unsupported(format!("NRRD type {:?}", text::excerpt(other)), "save it as 16-bit HU")),
        })
    }

    fn endian(&self, element: Element) -> Result<Endian, Problem> {
        match self.get("endian") {
            Ok("little") => Ok(Endian::Little),
            Ok("big") => Ok(Endian::Big),
            Err(_) if element.size() == 1 => Ok(Endian::Little),
            Err(missing) => Err(missing),
            Ok(other) => Err(header("endian", format!("{:?} is neither little nor big", text::excerpt(other)))),
        }
    }

    fn packing(&self) -> Result<Packing, Problem> {
        match self.get("encoding")?.to_ascii_lowercase().as_str() {
            "raw" => Ok(Packing::Raw),
            "gzip" | "gz" => Ok(Packing::Gzip),
            other => Err(unsupported(
                format!("NRRD encoding {:?}", text::excerpt(other)),
                "save it with encoding raw or gzip",
            )),
        }
    }

    fn data_file(&self) -> Result<Option<String>, Problem> {
        match self.find(&["data file", "datafile"]) {
            None => Ok(None),
            Some(list) if list.starts_with("LIST") || list.contains('%') => {
                Err(unsupported(format!("data file {:?}", text::excerpt(list)), "save it as one .nrrd file"))
            }
            Some(name) => text::plain_name(name).map(Some),
        }
    }

    /// Signs that take the file's space to LPS.
    fn space(&self) -> Result<[f64; 3], Problem> {
        let none = || Problem::NoOrientation("no space field".into());
        match self.find(&["space"]).ok_or_else(none)?.to_ascii_lowercase().as_str() {
            "left-posterior-superior" | "lps" => Ok([1.0, 1.0, 1.0]),
            "right-anterior-superior" | "ras" => Ok([-1.0, -1.0, 1.0]),
            "left-anterior-superior" | "las" => Ok([1.0, -1.0, 1.0]),
            other => Err(Problem::NoOrientation(format!("space {:?} is not a patient space", text::excerpt(other)))),
        }
    }

    fn grid(&self) -> Result<Grid, Problem> {
        let dims = text::dims("sizes", self.get("sizes")?)?;
        let signs = self.space()?;
        if let Some(units) =
            self.find(&["space units"]).filter(|u| u.split('"').any(|w| !w.trim().is_empty() && w != "mm"))
        {
            return Err(unsupported(format!("space units {:?}", text::excerpt(units)), "save it in millimetres"));
        }
        let directions = vectors("space directions", self.get("space directions")?)?;
        let &[a, b, c] = directions.as_slice() else {
            return Err(header("space directions", format!("{} vectors instead of 3", directions.len())));
        };
        let &[origin] = vectors("space origin", self.get("space origin")?)?.as_slice() else {
            return Err(header("space origin", "is not one vector"));
        };
        let rows = core::array::from_fn(|r| [a[r], b[r], c[r]].map(|v| v * signs[r]));
        grid(dims, Affine::new(Matrix3 { rows }, core::array::from_fn(|r| origin[r] * signs[r])))
    }
}

/// Vectors written as `(x,y,z)`.
fn vectors(field: &'static str, value: &str) -> Result<Vec<[f64; 3]>, Problem> {
    let inner = value.split(['(', ')']).map(str::trim).filter(|w| !w.is_empty());
    inner.map(|w| text::numbers(field, &w.replace(',', " "))).collect()
}

/// A CT as gzip-compressed `.nrrd` in LPS space.
pub fn encode_i16(volume: &Volume<i16>) -> Vec<u8> {
    let voxels: Vec<u8> = volume.data().iter().flat_map(|v| v.to_le_bytes()).collect();
    encode(volume.grid(), "int16", &voxels, Compression::fast(), "")
}

/// Labels as gzip-compressed `.nrrd` in LPS space; `extra` holds further header lines (`key:=value`), as 3D Slicer's
/// segmentations want them, each ended by a newline.
pub fn encode_u8(volume: &Volume<u8>, extra: &str) -> Vec<u8> {
    encode(volume.grid(), "uint8", volume.data(), Compression::default(), extra)
}

fn encode(grid: &Grid, element: &str, voxels: &[u8], level: Compression, extra: &str) -> Vec<u8> {
    let [x, y, z] = grid.dims();
    let m = grid.patient_from_voxel();
    let vector = |v: [f64; 3]| format!("({},{},{})", v[0], v[1], v[2]);
    let [a, b, c] = [0, 1, 2].map(|axis| vector(m.linear.column(axis)));
    let origin = vector(m.offset);
    let head = format!(
        "NRRD0004\ntype: {element}\ndimension: 3\nspace: left-posterior-superior\nsizes: {x} {y} {z}\n\
         space directions: {a} {b} {c}\nkinds: domain domain domain\nendian: little\nencoding: gzip\n\
         space origin: {origin}\n{extra}\n"
    );
    let mut encoder = GzEncoder::new(head.into_bytes(), level);
    let written = encoder.write_all(voxels);
    debug_assert!(written.is_ok(), "writing to memory cannot fail");
    encoder.finish().unwrap_or_default()
}
