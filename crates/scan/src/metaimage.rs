//! MetaImage: `.mha` (one file) and `.mhd` with its data file in the same folder. Its world is LPS mm, as ITK has it.
//!
//! Not read, and refused by name: lists of slice files, text voxels, several channels, data outside the folder.

use crate::error::{Problem, header, unsupported};
use crate::raster::{Element, Endian, Layout, Packing, Raster, grid};
use crate::text;
use monro_geometry::{Affine, Grid, Matrix3};

/// Header and data together, or where the data are.
#[derive(Debug)]
pub struct Header {
    layout: Layout,
    packing: Packing,
    warnings: Vec<String>,
    /// Bytes to skip in the data; `None`: the voxels are the last bytes.
    skip: Option<u64>,
    /// Name of the detached data file, in the same folder; `None`: the data follow the header.
    pub data_file: Option<String>,
    /// Where the data begin in this file.
    end: usize,
}

/// Whether the bytes begin like a MetaImage header.
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(4096)];
    let key = start.split(|b| matches!(b, b'=' | b'\n')).next().unwrap_or_default().trim_ascii();
    matches!(key, b"ObjectType" | b"NDims" | b"Comment" | b"ObjectSubType")
        && start.split(|&b| b == b'\n').any(|l| l.starts_with(b"NDims"))
}

/// Parses a header; `ElementDataFile` ends it.
///
/// # Errors
/// Unsupported variety, missing or malformed fields, data outside the folder.
pub fn decode_header(bytes: &[u8]) -> Result<Header, Problem> {
    let (fields, end) = fields(bytes)?;
    let fields = Fields(fields);
    fields.refuse_varieties()?;
    let mut warnings = Vec::new();
    let layout = Layout {
        grid: fields.grid(&mut warnings)?,
        element: fields.element()?,
        endian: if fields.flag(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]) {
            Endian::Big
        } else {
            Endian::Little
        },
        slope: 1.0,
        intercept: 0.0,
    };
    let packing = if fields.flag(&["CompressedData"]) { Packing::Zlib } else { Packing::Raw };
    let skip = match fields.get(&["HeaderSize"]) {
        None => Some(0),
        Some("-1") => None,
        Some(n) => Some(n.parse().map_err(|_| header("HeaderSize", format!("{n:?} is no size")))?),
    };
    Ok(Header { layout, packing, warnings, skip, data_file: fields.data_file()?, end })
}

impl Header {
    /// Attaches the voxels: `bytes` is this file itself, or the detached data file.
    ///
    /// # Errors
    /// When the bytes cannot hold the voxels.
    pub fn with_data(self, bytes: &[u8]) -> Result<Raster<'_>, Problem> {
        let need = self.layout.grid.len() * self.layout.element.size();
        // As MetaIO has it: bytes of the file before the data, also where these are in the header's own file.
        let start = match (&self.data_file, self.skip) {
            (None, Some(0)) => self.end,
            (_, Some(skip)) => usize::try_from(skip).unwrap_or(usize::MAX),
            (_, None) => bytes.len().saturating_sub(need),
        };
        let mut raster = Raster::new(self.layout, bytes.get(start..).unwrap_or_default(), self.packing)?;
        raster.warnings.extend(self.warnings);
        Ok(raster)
    }
}

/// Key and value of every line, and where the data begin.
fn fields(bytes: &[u8]) -> Result<(Vec<(String, String)>, usize), Problem> {
    let mut out = Vec::new();
    for (line, end) in text::lines(bytes) {
        let line = String::from_utf8_lossy(line);
        let Some((key, value)) = line.split_once('=') else {
            if line.trim().is_empty() {
                continue;
            }
            return Err(header("MetaImage", format!("line {:?} has no '='", text::excerpt(&line))));
        };
        let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
        let last = key == "ElementDataFile";
        out.push((key, value));
        if last {
            return Ok((out, end));
        }
    }
    Err(header("ElementDataFile", "is missing"))
}

struct Fields(Vec<(String, String)>);

impl Fields {
    fn get(&self, keys: &[&str]) -> Option<&str> {
        self.0.iter().find(|(k, _)| keys.contains(&k.as_str())).map(|(_, v)| v.as_str())
    }

    fn flag(&self, keys: &[&str]) -> bool {
        self.get(keys).is_some_and(|v| v.starts_with(['T', 't', '1']))
    }

    fn refuse_varieties(&self) -> Result<(), Problem> {
        if self.get(&["ObjectType"]).is_some_and(|t| t != "Image") {
            return Err(unsupported("a MetaIO object that is no image", "give an image"));
        }
        let dims = self.get(&["NDims"]).unwrap_or("none");
        if dims != "3" {
            return Err(unsupported(format!("a MetaImage with NDims = {dims}"), "give one three-dimensional volume"));
        }
        let channels = self.get(&["ElementNumberOfChannels"]).unwrap_or("1");
        if channels != "1" {
            return Err(unsupported(format!("a MetaImage of {channels} channels"), "save it as 16-bit HU"));
        }
        if self.get(&["BinaryData"]).is_some_and(|v| v.starts_with(['F', 'f'])) {
            return Err(unsupported("a MetaImage with voxels as text", "save it with BinaryData = True"));
        }
        Ok(())
    }

    fn data_file(&self) -> Result<Option<String>, Problem> {
        match self.get(&["ElementDataFile"]).unwrap_or_default() {
            "LOCAL" | "Local" | "local" => Ok(None),
            list if list.starts_with("LIST") || list.contains('%') => {
                Err(unsupported(format!("ElementDataFile = {list:?}"), "save it as one .mha file"))
            }
            name => text::plain_name(name).map(Some),
        }
    }

    fn element(&self) -> Result<Element, Problem> {
        Ok(match self.get(&["ElementType"]).unwrap_or("none") {
            "MET_CHAR" => Element::I8,
            "MET_UCHAR" => Element::U8,
            "MET_SHORT" => Element::I16,
            "MET_USHORT" => Element::U16,
            "MET_INT" | "MET_LONG" => Element::I32,
            "MET_UINT" | "MET_ULONG" => Element::U32,
            "MET_LONG_LONG" => Element::I64,
            "MET_ULONG_LONG" => Element::U64,
            "MET_FLOAT" => Element::F32,
            "MET_DOUBLE" => Element::F64,
            other => return Err(unsupported(format!("ElementType {other:?}"), "save it as 16-bit HU (MET_SHORT)")),
        })
    }

    fn numbers<const N: usize>(&self, field: &'static str, keys: &[&str]) -> Result<Option<[f64; N]>, Problem> {
        self.get(keys).map(|v| text::numbers(field, v)).transpose()
    }

    fn grid(&self, warnings: &mut Vec<String>) -> Result<Grid, Problem> {
        let dims = self.get(&["DimSize"]).ok_or_else(|| header("DimSize", "is missing"))?;
        let dims = text::dims("DimSize", dims)?;
        let spacing: Option<[f64; 3]> = self.numbers("ElementSpacing", &["ElementSpacing", "ElementSize"])?;
        let spacing = spacing.ok_or_else(|| header("ElementSpacing", "is missing"))?;
        if spacing.iter().any(|&s| !(s.is_finite() && s > 0.0)) {
            return Err(header("ElementSpacing", format!("{spacing:?} mm is not positive")));
        }
        let direction: Option<[f64; 9]> =
            self.numbers("TransformMatrix", &["TransformMatrix", "Rotation", "Orientation"])?;
        let offset = self.numbers("Offset", &["Offset", "Position", "Origin"])?;
        let Some(direction) = direction else {
            return Err(Problem::NoOrientation("no TransformMatrix".into()));
        };
        let offset = offset.unwrap_or_else(|| {
            warnings.push("the header has no Offset; the first voxel is put at 0, 0, 0 mm".into());
            [0.0; 3]
        });
        // The file lists one index axis after the other, so what reads as rows are our columns.
        let rows = core::array::from_fn(|r| core::array::from_fn(|c| direction[3 * c + r] * spacing[c]));
        grid(dims, Affine::new(Matrix3 { rows }, offset))
    }
}
