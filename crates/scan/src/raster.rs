//! A parsed header and the stream of its voxels, common to all single-file formats.

use crate::error::{Problem, header};
use crate::hu::HuNotes;
use monro_geometry::{Affine, Grid, Patient, Volume, Voxel};
use std::io::{self, ErrorKind, Read};

/// No head CT comes near this many voxels (1 GiB as 16-bit).
pub(crate) const MAX_VOXELS: u64 = 1 << 29;
/// Most voxels in a row: NIfTI, in which a case keeps its images, has no larger number.
const LONGEST: u64 = i16::MAX as u64;

/// Deflate cannot expand a stream by more than this factor, so a header that promises more is lying.
const DEFLATE_LIMIT: u64 = 1032;

/// How far a scaled value may be from a whole number, over it, to be that: the last digits of a slope in single precision.
const SINGLE: f64 = 1e-6;

/// Type of a stored voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say all")]
pub enum Element {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Element {
    /// Bytes per voxel.
    pub const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// Byte order of stored voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// What a header says: shape, placement (LPS mm), stored type, and the scale `value = stored * slope + intercept`.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Dimensions and placement.
    pub grid: Grid,
    /// Stored type.
    pub element: Element,
    /// Byte order.
    pub endian: Endian,
    /// Scale factor.
    pub slope: f64,
    /// Offset after scaling.
    pub intercept: f64,
}

/// A parsed header with the stream of its voxels, not yet read.
pub struct Raster<'a> {
    /// The header.
    pub layout: Layout,
    /// What is worth telling the user about the header.
    pub warnings: Vec<String>,
    body: Box<dyn Read + 'a>,
    packing: Packing,
}

impl core::fmt::Debug for Raster<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Raster").field("layout", &self.layout).field("warnings", &self.warnings).finish_non_exhaustive()
    }
}

/// Bytes behind the voxels of a compressed file at most, besides as many as the voxels'.
const MOST_BEHIND: u64 = 1 << 20;

/// How voxel bytes lie in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    Raw,
    Gzip,
    Zlib,
}

impl<'a> Raster<'a> {
    /// From a header and the bytes of its voxels.
    pub(crate) fn new(layout: Layout, bytes: &'a [u8], packing: Packing) -> Result<Self, Problem> {
        let body: Box<dyn Read + 'a> = match packing {
            Packing::Raw => Box::new(bytes),
            Packing::Gzip => Box::new(flate2::read::MultiGzDecoder::new(bytes)),
            Packing::Zlib => Box::new(flate2::read::ZlibDecoder::new(bytes)),
        };
        Self::from_stream(layout, body, bytes.len() as u64, packing)
    }

    /// As [`Raster::new`], with a stream whose first bytes (a header) have been read already.
    pub(crate) fn from_stream(
        layout: Layout,
        body: Box<dyn Read + 'a>,
        stored: u64,
        packing: Packing,
    ) -> Result<Self, Problem> {
        let mut raster = Self { layout, warnings: Vec::new(), body, packing };
        raster.check_promise(stored)?;
        if packing == Packing::Raw && stored > raster.bytes() {
            raster.warnings.push(format!(
                "{} bytes lie behind the voxels that the header promises: they are left out; the dimensions may be wrong, or the \
                 data begin further on",
                stored - raster.bytes()
            ));
        }
        Ok(raster)
    }

    /// Leaves out the first bytes of the voxels' stream.
    pub(crate) fn skip(&mut self, count: usize) -> Result<(), Problem> {
        let mut chunk = vec![0u8; 1 << 16];
        let mut left = count;
        while left > 0 {
            let want = chunk.len().min(left);
            if fill(&mut self.body, &mut chunk[..want])? < want {
                return Err(Problem::Truncated { expected: count as u64 + self.bytes(), found: (count - left) as u64 });
            }
            left -= want;
        }
        Ok(())
    }

    /// Refuses before anything is allocated a header that promises more voxels than its file can hold.
    fn check_promise(&self, stored: u64) -> Result<(), Problem> {
        let expected = self.bytes();
        match self.packing {
            Packing::Raw if expected > stored => Err(Problem::Truncated { expected, found: stored }),
            Packing::Raw => Ok(()),
            _ if expected > stored.saturating_mul(DEFLATE_LIMIT) => Err(Problem::TooShort { expected, stored }),
            _ => Ok(()),
        }
    }

    /// Bytes of all voxels, decompressed.
    fn bytes(&self) -> u64 {
        self.layout.grid.len() as u64 * self.layout.element.size() as u64
    }

    /// The values as HU, rounded, kept within -1024 (air) and 32767; the notes count what was changed.
    ///
    /// # Errors
    /// Truncated or damaged data; no finite value at all.
    pub fn into_hu(mut self) -> Result<(Volume<i16>, HuNotes), Problem> {
        let mut data: Vec<i16> = Vec::with_capacity(self.layout.grid.len());
        let mut notes = HuNotes::default();
        self.each_value(|value| {
            data.push(notes.hu(value));
            Ok(())
        })?;
        if notes.not_finite == data.len() as u64 {
            return Err(Problem::NothingFinite(data.len()));
        }
        Ok((Volume::new(self.layout.grid, data)?, notes))
    }

    /// The values as labels.
    ///
    /// # Errors
    /// A value that is not a whole number from 0 to 65535; truncated or damaged data.
    pub fn into_labels(mut self) -> Result<Volume<u16>, Problem> {
        let grid = self.layout.grid;
        let scaled = self.layout.slope != 1.0;
        let mut data: Vec<u16> = Vec::with_capacity(grid.len());
        self.each_value(|value| {
            // Slopes in single precision: 255 times one 255th is a little more than 1.
            let whole = if scaled { value.round() } else { value };
            let label = whole as u16;
            if f64::from(label) != whole || (value - whole).abs() > SINGLE * whole.abs().max(1.0) {
                return Err(Problem::NotALabel { value, voxel: grid.voxel(data.len()) });
            }
            data.push(label);
            Ok(())
        })?;
        Ok(Volume::new(grid, data)?)
    }

    /// Streams all scaled values in storage order.
    fn each_value(&mut self, mut each: impl FnMut(f64) -> Result<(), Problem>) -> Result<(), Problem> {
        let Layout { element, endian, slope, intercept, .. } = self.layout;
        let expected = self.bytes();
        let mut found = 0;
        let mut chunk = vec![0u8; 1 << 16];
        while found < expected {
            let want = chunk.len().min(usize::try_from(expected - found).unwrap_or(usize::MAX));
            let got = fill(&mut self.body, &mut chunk[..want])?;
            found += got as u64;
            if got < want {
                return Err(Problem::Truncated { expected, found });
            }
            values(&chunk[..got], element, endian, |stored| each(stored * slope + intercept))?;
        }
        if self.packing == Packing::Raw { Ok(()) } else { self.read_to_the_sum(expected) }
    }

    /// Reads a gzip or zlib stream to its end, where it checks its sum: a damaged one may have more than the voxels.
    fn read_to_the_sum(&mut self, expected: u64) -> Result<(), Problem> {
        let most = expected + MOST_BEHIND;
        let behind = io::copy(&mut (&mut self.body).take(most + 1), &mut io::sink());
        match behind.map_err(|e| Problem::Corrupt(format!("behind the last voxel: {e}")))? {
            more if more > most => {
                Err(Problem::Corrupt(format!("there are more than {most} bytes behind the last voxel")))
            }
            _ => Ok(()),
        }
    }
}

/// Reads until the buffer is full or the stream ends; gives the bytes read.
pub(crate) fn fill(body: &mut dyn Read, buffer: &mut [u8]) -> Result<usize, Problem> {
    let mut done = 0;
    while done < buffer.len() {
        match body.read(&mut buffer[done..]) {
            Ok(0) => break,
            Ok(n) => done += n,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            // A gzip stream that ends early is a short file, not a damaged one.
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => break,
            Err(e) => return Err(Problem::Corrupt(e.to_string())),
        }
    }
    Ok(done)
}

/// Calls `each` for every stored value of a whole number of elements.
fn values(
    bytes: &[u8],
    element: Element,
    endian: Endian,
    mut each: impl FnMut(f64) -> Result<(), Problem>,
) -> Result<(), Problem> {
    macro_rules! stored {
        ($type:ty) => {{
            for raw in bytes.as_chunks::<{ size_of::<$type>() }>().0 {
                let value =
                    if endian == Endian::Little { <$type>::from_le_bytes(*raw) } else { <$type>::from_be_bytes(*raw) };
                each(value as f64)?;
            }
        }};
    }
    match element {
        Element::I8 => stored!(i8),
        Element::U8 => stored!(u8),
        Element::I16 => stored!(i16),
        Element::U16 => stored!(u16),
        Element::I32 => stored!(i32),
        Element::U32 => stored!(u32),
        Element::I64 => stored!(i64),
        Element::U64 => stored!(u64),
        Element::F32 => stored!(f32),
        Element::F64 => stored!(f64),
    }
    Ok(())
}

/// A grid from header values, refused when empty or beyond the limit.
pub(crate) fn grid(dims: [u64; 3], placement: Affine<Patient, Voxel>) -> Result<Grid, Problem> {
    let count = dims.iter().try_fold(1u64, |n, &d| n.checked_mul(d));
    if count.is_none_or(|n| n > MAX_VOXELS) {
        return Err(Problem::TooLarge { dims, limit: MAX_VOXELS });
    }
    if let Some(long) = dims.iter().find(|&&d| d > LONGEST) {
        return Err(header("dimensions", format!("{dims:?}: {long} voxels in a row; at most {LONGEST} are read")));
    }
    if dims.contains(&0) {
        return Err(header("dimensions", format!("{dims:?} is empty")));
    }
    Ok(Grid::new(dims.map(|d| d as usize), placement)?)
}
