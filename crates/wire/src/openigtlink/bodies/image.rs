//! IMAGE: a voxel volume.

use crate::openigtlink::content::{Fault, exactly};
use crate::openigtlink::{IgtlError, R, W};

/// Type of one pixel component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScalarType {
    /// 2.
    I8,
    /// 3.
    U8,
    /// 4.
    I16,
    /// 5.
    U16,
    /// 6.
    I32,
    /// 7.
    U32,
    /// 10.
    F32,
    /// 11.
    F64,
}

impl ScalarType {
    const ALL: [(u8, Self, usize); 8] = [
        (2, Self::I8, 1),
        (3, Self::U8, 1),
        (4, Self::I16, 2),
        (5, Self::U16, 2),
        (6, Self::I32, 4),
        (7, Self::U32, 4),
        (10, Self::F32, 4),
        (11, Self::F64, 8),
    ];

    fn from_code(code: u8) -> Result<Self, Fault> {
        let found = Self::ALL.iter().find(|(c, ..)| *c == code);
        found.map(|(_, t, _)| *t).ok_or(Fault::Value { field: "scalar type", value: code.into() })
    }

    fn entry(self) -> (u8, usize) {
        Self::ALL.iter().find(|(_, t, _)| *t == self).map_or((3, 1), |(c, _, size)| (*c, *size))
    }

    /// Bytes of one component.
    pub fn size(self) -> usize {
        self.entry().1
    }
}

/// Byte order of the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// 1.
    Big,
    /// 2.
    Little,
}

/// Axes in which the placement is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageAxes {
    /// 1.
    Ras,
    /// 2.
    Lps,
}

/// An image volume. `i` runs fastest, components are interleaved.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Components of a pixel.
    pub components: u8,
    /// Type of one component.
    pub scalar: ScalarType,
    /// Byte order of `pixels`.
    pub order: ByteOrder,
    /// Axes of `axes` and `centre`.
    pub coordinates: ImageAxes,
    /// Pixels along i, j, k.
    pub size: [u16; 3],
    /// Direction times spacing of each axis, mm.
    pub axes: [[f32; 3]; 3],
    /// Centre of the volume (not of the first voxel), mm.
    pub centre: [f32; 3],
    /// First pixel of the part that is sent.
    pub part_start: [u16; 3],
    /// Size of the part that is sent.
    pub part_size: [u16; 3],
    /// Raw pixels of the part.
    pub pixels: Vec<u8>,
}

impl Image {
    /// The centre of a volume whose first voxel's centre is `first` (mm): `first + sum (size - 1) / 2 * axis`.
    pub fn centre_of(first: [f32; 3], axes: &[[f32; 3]; 3], size: [u16; 3]) -> [f32; 3] {
        core::array::from_fn(|c| first[c] + (0..3).map(|a| 0.5 * (f32::from(size[a]) - 1.0) * axes[a][c]).sum::<f32>())
    }

    /// Centre of the first voxel, mm.
    pub fn first_voxel(&self) -> [f32; 3] {
        let half = Self::centre_of([0.0; 3], &self.axes, self.size);
        core::array::from_fn(|c| self.centre[c] - half[c])
    }

    fn expected_bytes(&self) -> usize {
        let n: usize = self.part_size.iter().map(|&s| usize::from(s)).product();
        n * usize::from(self.components) * self.scalar.size()
    }

    pub(in crate::openigtlink) fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        r.u16("image header version")?;
        let components = r.u8("components")?;
        let scalar = ScalarType::from_code(r.u8("scalar type")?)?;
        let order = match r.u8("byte order")? {
            1 => ByteOrder::Big,
            2 => ByteOrder::Little,
            other => return Err(Fault::Value { field: "byte order", value: other.into() }),
        };
        let coordinates = match r.u8("coordinates")? {
            1 => ImageAxes::Ras,
            2 => ImageAxes::Lps,
            other => return Err(Fault::Value { field: "coordinates", value: other.into() }),
        };
        let size = sizes(&mut r)?;
        let axes = [r.floats("i axis")?, r.floats("j axis")?, r.floats("k axis")?];
        let centre = r.floats("centre")?;
        let (part_start, part_size) = (sizes(&mut r)?, sizes(&mut r)?);
        let mut image =
            Self { components, scalar, order, coordinates, size, axes, centre, part_start, part_size, pixels: vec![] };
        exactly(bytes, 72 + image.expected_bytes())?;
        image.check_part()?;
        image.pixels = r.rest().to_vec();
        Ok(image)
    }

    fn check_part(&self) -> Result<(), Fault> {
        for a in 0..3 {
            let end = u32::from(self.part_start[a]) + u32::from(self.part_size[a]);
            if end > u32::from(self.size[a]) {
                return Err(Fault::Value { field: "end of sub-volume", value: end.into() });
            }
        }
        Ok(())
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        let expected = self.expected_bytes();
        if self.pixels.len() != expected {
            let (type_name, size) = ("IMAGE".to_owned(), self.pixels.len());
            return Err(IgtlError::ContentSize { type_name, size, expected: expected.to_string() });
        }
        w.u16(1);
        w.u8(self.components);
        w.u8(self.scalar.entry().0);
        w.u8(if self.order == ByteOrder::Big { 1 } else { 2 });
        w.u8(if self.coordinates == ImageAxes::Ras { 1 } else { 2 });
        self.size.iter().for_each(|&s| w.u16(s));
        self.axes.iter().for_each(|a| w.floats(a));
        w.floats(&self.centre);
        self.part_start.iter().chain(&self.part_size).for_each(|&s| w.u16(s));
        w.bytes(&self.pixels);
        Ok(())
    }
}

fn sizes(r: &mut R<'_>) -> Result<[u16; 3], Fault> {
    Ok([r.u16("size")?, r.u16("size")?, r.u16("size")?])
}
