//! NIfTI-1: one file, `.nii` or `.nii.gz`. RAS inside the file, LPS outside of this module.
//!
//! Not read, and refused by name: header and image in two files (`.hdr`/`.img`), NIfTI-2, colour and complex voxels,
//! more than three dimensions, and files without sform and qform (they do not say which side is left).

mod encode;

pub use encode::{encode_i16, encode_u8, encode_u16};

use crate::error::{Problem, header, unsupported};
use crate::raster::{Element, Endian, Layout, Packing, Raster, fill, grid};
use flate2::read::MultiGzDecoder;
use monro_geometry::{Affine, Matrix3, Patient, Point, Voxel};
use std::io::Read;

const HEADER: usize = 348;

/// What 32 bits of the qform's vector part leave open of the square of its scalar part. Near half a turn, as between LPS
/// and RAS, that is its own size: a third of a milliradian, 0.1 mm at the far corner of a head.
const ROUNDING: [f64; 3] = [0.0, -3e-7, 3e-7];

/// Whether the bytes begin like a NIfTI-1 file, plain (not gzip).
pub(crate) fn looks_like(bytes: &[u8]) -> bool {
    bytes.len() >= HEADER && endian(bytes).is_some()
}

fn endian(bytes: &[u8]) -> Option<Endian> {
    match bytes.get(..4)? {
        [0x5c, 1, 0, 0] => Some(Endian::Little),
        [0, 0, 1, 0x5c] => Some(Endian::Big),
        _ => None,
    }
}

/// Parses the header of a `.nii` or `.nii.gz` file; the voxels are decoded by [`Raster::into_hu`] or
/// [`Raster::into_labels`].
///
/// # Errors
/// Any [`Problem`] of the header: unsupported variety, no orientation, more voxels than the bytes can hold.
pub fn decode(bytes: &[u8]) -> Result<Raster<'_>, Problem> {
    let packing = if bytes.starts_with(&[0x1f, 0x8b]) { Packing::Gzip } else { Packing::Raw };
    let mut stream: Box<dyn Read + '_> =
        if packing == Packing::Gzip { Box::new(MultiGzDecoder::new(bytes)) } else { Box::new(bytes) };
    let mut head = [0u8; HEADER];
    let found = fill(&mut stream, &mut head)?;
    if found < HEADER {
        return Err(Problem::Unrecognised(format!("{found} bytes are too few for a NIfTI header of {HEADER}")));
    }
    let fields = Fields::new(&head)?;
    let (layout, warnings) = fields.layout()?;
    let skip = fields.voxel_offset()? - HEADER as u64;
    let skipped = std::io::copy(&mut (&mut stream).take(skip), &mut std::io::sink())
        .map_err(|e| Problem::Corrupt(e.to_string()))?;
    if skipped < skip {
        return Err(header("vox_offset", format!("{} lies behind the end of the file", skip + HEADER as u64)));
    }
    let before = if packing == Packing::Raw { HEADER as u64 + skip } else { 0 };
    let mut raster = Raster::from_stream(layout, stream, bytes.len() as u64 - before, packing)?;
    raster.warnings.extend(warnings);
    Ok(raster)
}

/// Access to the header's fields by offset.
struct Fields<'a> {
    head: &'a [u8; HEADER],
    endian: Endian,
}

impl<'a> Fields<'a> {
    fn new(head: &'a [u8; HEADER]) -> Result<Self, Problem> {
        const CONVERT: &str = "convert it to a single NIfTI-1 .nii or .nii.gz file";
        let Some(endian) = endian(head) else {
            return Err(match &head[..4] {
                [0x1c, 2, 0, 0] | [0, 0, 2, 0x1c] => unsupported("NIfTI-2", CONVERT),
                _ => Problem::Unrecognised("no NIfTI-1 header".into()),
            });
        };
        match &head[344..348] {
            b"n+1\0" => Ok(Self { head, endian }),
            b"ni1\0" => Err(unsupported("a NIfTI header with its voxels in a second file (.hdr/.img)", CONVERT)),
            other => Err(unsupported(format!("an Analyze 7.5 header (magic {other:?})"), CONVERT)),
        }
    }

    fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        let mut raw: [u8; N] = core::array::from_fn(|i| self.head[offset + i]);
        if self.endian == Endian::Big {
            raw.reverse();
        }
        raw
    }

    fn short(&self, offset: usize) -> i16 {
        i16::from_le_bytes(self.bytes(offset))
    }

    fn float(&self, offset: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.bytes(offset)))
    }

    fn pixdim(&self, axis: usize) -> f64 {
        self.float(76 + 4 * axis)
    }

    fn voxel_offset(&self) -> Result<u64, Problem> {
        let offset = self.float(108);
        if !(offset >= HEADER as f64 && offset <= 1e9) {
            return Err(header("vox_offset", format!("{offset} does not lie behind the header of {HEADER} bytes")));
        }
        Ok(offset as u64)
    }

    fn dims(&self) -> Result<[u64; 3], Problem> {
        let dim: [i16; 8] = core::array::from_fn(|a| self.short(40 + 2 * a));
        let used = usize::try_from(dim[0]).ok().filter(|n| (1..=7).contains(n));
        let used = used.ok_or_else(|| header("dim", format!("{} dimensions", dim[0])))?;
        if used < 3 || dim[4..=used.max(3)].iter().any(|&d| d != 1) {
            let shown = &dim[1..=used];
            return Err(unsupported(format!("an image of dimensions {shown:?}"), "give one three-dimensional volume"));
        }
        let dims = [dim[1], dim[2], dim[3]];
        if dims.iter().any(|&d| d < 1) {
            return Err(header("dim", format!("{dims:?} is empty")));
        }
        Ok(dims.map(|d| d as u64))
    }

    fn element(&self) -> Result<Element, Problem> {
        let code = self.short(70);
        let element = match code {
            2 => Element::U8,
            4 => Element::I16,
            8 => Element::I32,
            16 => Element::F32,
            64 => Element::F64,
            256 => Element::I8,
            512 => Element::U16,
            768 => Element::U32,
            1024 => Element::I64,
            1280 => Element::U64,
            other => {
                return Err(unsupported(format!("NIfTI datatype {other} ({})", name(other)), "save it as 16-bit HU"));
            }
        };
        let bits = self.short(72);
        if bits != 8 * element.size() as i16 {
            return Err(header("bitpix", format!("{bits} contradicts datatype {code}")));
        }
        Ok(element)
    }

    /// Slope and intercept; slope 0 (or not a number, as nibabel writes) means that there is no scale.
    fn scale(&self) -> Result<(f64, f64), Problem> {
        let (slope, intercept) = (self.float(112), self.float(116));
        if slope == 0.0 || slope.is_nan() {
            return Ok((1.0, 0.0));
        }
        if !slope.is_finite() || !intercept.is_finite() {
            return Err(header("scl_slope", format!("scale {slope}, {intercept} is not finite")));
        }
        Ok((slope, intercept))
    }

    /// Factor from the file's length unit to mm.
    fn millimetres(&self, warnings: &mut Vec<String>) -> f64 {
        match self.head[123] & 7 {
            1 => 1e3,
            3 => 1e-3,
            2 => 1.0,
            other => {
                warnings.push(format!("the NIfTI header names no length unit (code {other}); millimetres are assumed"));
                1.0
            }
        }
    }

    fn sform(&self) -> (Matrix3, [f64; 3]) {
        let at = |r: usize, c: usize| self.float(280 + 16 * r + 4 * c);
        let rows = core::array::from_fn(|r| core::array::from_fn(|c| at(r, c)));
        (Matrix3 { rows }, core::array::from_fn(|r| at(r, 3)))
    }

    /// Method 2 of `nifti1.h`: a unit quaternion, the pixdims and qfac.
    /// The scalar part is not stored; `more` is added to its square.
    fn qform(&self, more: f64) -> (Matrix3, [f64; 3]) {
        let [b, c, d] = [256, 260, 264].map(|o| self.float(o));
        let a = (1.0 + more - (b * b + c * c + d * d)).max(0.0).sqrt();
        let rotation = [
            [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
            [2.0 * (b * c + a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d - a * b)],
            [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ];
        let qfac = if self.pixdim(0) < 0.0 { -1.0 } else { 1.0 };
        let scale = [self.pixdim(1), self.pixdim(2), self.pixdim(3) * qfac];
        let rows = rotation.map(|r| [r[0] * scale[0], r[1] * scale[1], r[2] * scale[2]]);
        (Matrix3 { rows }, [268, 272, 276].map(|o| self.float(o)))
    }

    /// Placement in LPS mm: the sform where there is one, else the qform. An sform of a template's space may stretch the head to
    /// the template: beside it the qform, which cannot, is the patient's.
    fn placement(&self, warnings: &mut Vec<String>) -> Result<Affine<Patient, Voxel>, Problem> {
        let mm = self.millimetres(warnings);
        let (has_q, has_s) = (self.short(252) > 0, self.short(254) > 0);
        let lps = |(m, o): (Matrix3, [f64; 3])| {
            let flip = [-mm, -mm, mm];
            // Adding zero turns -0.0 into 0.0.
            let rows = core::array::from_fn(|r| m.rows[r].map(|v| v * flip[r] + 0.0));
            Affine::new(Matrix3 { rows }, core::array::from_fn(|r| o[r] * flip[r] + 0.0))
        };
        let template = matches!(self.short(254), TALAIRACH | MNI);
        if template {
            let used = if has_q {
                "the qform is used"
            } else {
                "distances are the template's if the head was stretched to it"
            };
            warnings.push(format!("the sform (code {}) is that of a template's space; {used}", self.short(254)));
        }
        let stretched = has_s && self.stretched();
        let empty = has_s && self.sform().0.rows.as_flattened().iter().all(|&v| v == 0.0);
        if !template && (stretched || empty) {
            warnings.push(self.doubt((stretched, has_q)));
        }
        match (has_s && !((template || stretched || empty) && has_q), has_q) {
            (false, false) => Err(Problem::NoOrientation("sform_code and qform_code are both 0".into())),
            (false, true) => Ok(lps(self.qform(0.0))),
            (true, q) => {
                let s = lps(self.sform());
                if q {
                    self.compare(&s, &ROUNDING.map(|more| lps(self.qform(more))), warnings);
                }
                Ok(s)
            }
        }
    }

    /// Whether the sform makes voxels larger or smaller than the header says they are along two axes or three, as one does that
    /// was fitted to another head. Along a single one it may be that of a tilted gantry.
    fn stretched(&self) -> bool {
        let (m, _) = self.sform();
        let long = |c: usize| (0..3).map(|r| m.rows[r][c] * m.rows[r][c]).sum::<f64>().sqrt();
        let size = |c: usize| self.pixdim(c + 1).abs();
        let told = (0..3).all(|c| size(c) > 0.0 && long(c) > 0.0);
        told && (0..3).filter(|&c| (long(c) - size(c)).abs() > STRETCH * size(c)).count() > 1
    }

    fn doubt(&self, (stretched, has_q): (bool, bool)) -> String {
        let [x, y, z] = [1, 2, 3].map(|a| self.pixdim(a).abs());
        let what = match stretched {
            true => format!(
                "the sform stretches voxels of {x:.3} x {y:.3} x {z:.3} mm (pixdim) by more than {:.0} %, as one fitted to \
                 another head",
                100.0 * STRETCH
            ),
            false => "the sform is empty".into(),
        };
        let used = if has_q { "the qform is used" } else { "there is no qform, so it is used; distances may be wrong" };
        format!("{what}; {used}")
    }

    /// Warns when sform and all readings of the qform put a corner of the volume at different places.
    fn compare(&self, s: &Affine<Patient, Voxel>, q: &[Affine<Patient, Voxel>], warnings: &mut Vec<String>) {
        let Ok(dims) = self.dims() else { return };
        let corner = |c: usize| {
            let at = |a: usize| if c >> a & 1 == 0 { 0.0 } else { dims[a] as f64 - 1.0 };
            Point::new(at(0), at(1), at(2))
        };
        let apart = |q: &Affine<Patient, Voxel>| {
            (0..8).map(|c| s.point(corner(c)).distance(q.point(corner(c)))).fold(0.0, f64::max)
        };
        let worst = q.iter().map(apart).fold(f64::INFINITY, f64::min);
        let hand = |a: &Affine<Patient, Voxel>| a.linear.determinant() > 0.0;
        let mirrored = q.iter().all(|q| hand(q) != hand(s));
        let mirrored =
            if mirrored { ", and one is the mirror image of the other: left and right may be exchanged" } else { "" };
        if worst > 0.1 {
            warnings.push(format!("sform and qform disagree by up to {worst:.1} mm{mirrored}; the sform is used"));
        }
    }

    fn layout(&self) -> Result<(Layout, Vec<String>), Problem> {
        let mut warnings = Vec::new();
        let dims = self.dims()?;
        let element = self.element()?;
        let (slope, intercept) = self.scale()?;
        let grid = grid(dims, self.placement(&mut warnings)?)?;
        Ok((Layout { grid, element, endian: self.endian, slope, intercept }, warnings))
    }
}

/// By which share of its size an sform may change a voxel.
const STRETCH: f64 = 0.01;

/// Codes of an sform that leads into the space of a template.
const TALAIRACH: i16 = 3;
const MNI: i16 = 4;

fn name(code: i16) -> &'static str {
    match code {
        1 => "1-bit",
        32 | 1792 | 2048 => "complex",
        128 | 2304 => "colour",
        1536 => "128-bit float",
        _ => "unknown",
    }
}
