//! POLYDATA: a mesh.

use crate::openigtlink::content::Fault;
use crate::openigtlink::matrix::{patient_of, ras_of};
use crate::openigtlink::{IgtlError, R, W};
use monro_geometry::TriangleMesh;

/// A run of cells `k, i1 .. ik`, as on the wire, every index checked.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cells {
    words: Vec<u32>,
    count: u32,
}

impl Cells {
    /// From lists of point indices.
    pub fn new<'a>(cells: impl IntoIterator<Item = &'a [u32]>) -> Self {
        let mut all = Self::default();
        for cell in cells {
            all.words.push(cell.len() as u32);
            all.words.extend_from_slice(cell);
            all.count += 1;
        }
        all
    }

    /// Number of cells.
    pub const fn len(&self) -> usize {
        self.count as usize
    }

    /// Whether there is none.
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The point indices of each cell.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let mut rest = self.words.as_slice();
        core::iter::from_fn(move || {
            let (&k, tail) = rest.split_first()?;
            let (cell, after) = tail.split_at_checked(k as usize)?;
            rest = after;
            Some(cell)
        })
    }

    fn decode(bytes: &[u8], count: u32, points: usize) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        let mut words = Vec::new();
        for _ in 0..count {
            let k = r.u32("cell size")?;
            words.push(k);
            for _ in 0..k {
                let index = r.u32("cell")?;
                if index as usize >= points {
                    return Err(Fault::Index { index, points });
                }
                words.push(index);
            }
        }
        if r.left() > 0 {
            let expected = format!("a cell section of {} for {count} cells", bytes.len() - r.left());
            return Err(Fault::Size { size: bytes.len(), expected });
        }
        Ok(Self { words, count })
    }
}

/// What an attribute means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttributeKind {
    /// 0: any number of components.
    Scalars,
    /// 1: three components.
    Vectors,
    /// 2: three components.
    Normals,
    /// 3: nine components.
    Tensors,
    /// 4: four components.
    Rgba,
    /// 5: texture coordinates.
    Texture,
}

impl AttributeKind {
    const ALL: [Self; 6] = [Self::Scalars, Self::Vectors, Self::Normals, Self::Tensors, Self::Rgba, Self::Texture];
}

/// Values at the points or cells of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute {
    /// What the values mean.
    pub kind: AttributeKind,
    /// One tuple a cell instead of one a point.
    pub on_cells: bool,
    /// Values in a tuple.
    pub components: u8,
    /// Name.
    pub name: String,
    /// All tuples, one after the other.
    pub values: Vec<f32>,
}

/// A mesh. Points in mm, RAS by convention.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PolyData {
    /// Points.
    pub points: Vec<[f32; 3]>,
    /// Vertex cells.
    pub vertices: Cells,
    /// Polylines.
    pub lines: Cells,
    /// Polygons.
    pub polygons: Cells,
    /// Triangle strips.
    pub strips: Cells,
    /// Values at points or cells.
    pub attributes: Vec<Attribute>,
}

struct AttributeHeader {
    code: u8,
    components: u8,
    tuples: u32,
}

impl PolyData {
    /// From a mesh in the patient frame; the axes are turned to RAS.
    pub fn from_mesh(mesh: &TriangleMesh) -> Self {
        Self {
            points: mesh.vertices.iter().map(|&p| ras_of(p)).collect(),
            polygons: Cells::new(mesh.triangles.iter().map(|t| t.as_slice())),
            ..Self::default()
        }
    }

    /// As a mesh in the patient frame: polygons as fans, strips unrolled, axes turned from RAS.
    pub fn to_mesh(&self) -> TriangleMesh {
        let vertices = self.points.iter().map(|&p| patient_of(p)).collect();
        let fans = self.polygons.iter().flat_map(|c| c.windows(2).skip(1).map(|w| [c[0], w[0], w[1]]));
        let strips = self.strips.iter().flat_map(|c| {
            c.windows(3).enumerate().map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
        });
        TriangleMesh { vertices, triangles: fans.chain(strips).collect() }
    }

    pub(in crate::openigtlink) fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        let mut head = [0u32; 10];
        for v in &mut head {
            *v = r.u32("polydata header")?;
        }
        let n = head[0] as usize;
        let size = n.checked_mul(12).filter(|&s| s <= r.left());
        if size.is_none() {
            return Err(Fault::Size { size: bytes.len(), expected: format!("room for {n} points") });
        }
        let points = r.many(n, |r| r.floats("point"))?;
        let mut cells = |at: usize| -> Result<Cells, Fault> {
            let section = r.take(head[at + 1] as usize, "cell section")?;
            Cells::decode(section, head[at], n)
        };
        let (vertices, lines, polygons, strips) = (cells(1)?, cells(3)?, cells(5)?, cells(7)?);
        let attributes = attributes(&mut r, head[9] as usize)?;
        if r.left() > 0 {
            let expected = format!("{} (what its counts say)", bytes.len() - r.left());
            return Err(Fault::Size { size: bytes.len(), expected });
        }
        Ok(Self { points, vertices, lines, polygons, strips, attributes })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        self.check()?;
        w.u32(self.points.len() as u32);
        for cells in [&self.vertices, &self.lines, &self.polygons, &self.strips] {
            w.u32(cells.count);
            w.u32(4 * cells.words.len() as u32);
        }
        w.u32(self.attributes.len() as u32);
        self.points.iter().for_each(|p| w.floats(p));
        for cells in [&self.vertices, &self.lines, &self.polygons, &self.strips] {
            cells.words.iter().for_each(|&v| w.u32(v));
        }
        self.encode_attributes(w);
        Ok(())
    }

    fn encode_attributes(&self, w: &mut W) {
        for a in &self.attributes {
            w.u8(a.kind as u8 + if a.on_cells { 0x10 } else { 0 });
            w.u8(a.components);
            w.u32((a.values.len() / usize::from(a.components.max(1))) as u32);
        }
        let before = w.0.len();
        self.attributes.iter().for_each(|a| w.c_text(&a.name));
        if (w.0.len() - before) % 2 == 1 {
            w.u8(0);
        }
        self.attributes.iter().for_each(|a| w.floats(&a.values));
    }

    fn check(&self) -> Result<(), IgtlError> {
        let points = self.points.len();
        for cells in [&self.vertices, &self.lines, &self.polygons, &self.strips] {
            if let Some(&index) = cells.iter().flatten().find(|&&i| i as usize >= points) {
                return Err(IgtlError::Index { index, points });
            }
        }
        for a in &self.attributes {
            if a.components == 0 || !a.values.len().is_multiple_of(a.components.into()) {
                let expected = format!("a multiple of {} values for attribute '{}'", a.components, a.name);
                let type_name = "POLYDATA".to_owned();
                return Err(IgtlError::ContentSize { type_name, size: a.values.len(), expected });
            }
        }
        Ok(())
    }
}

fn attributes(r: &mut R<'_>, n: usize) -> Result<Vec<Attribute>, Fault> {
    let headers = r.many(n, |r| -> Result<_, Fault> {
        Ok(AttributeHeader {
            code: r.u8("attribute type")?,
            components: r.u8("attribute components")?,
            tuples: r.u32("attribute tuples")?,
        })
    })?;
    let names_at = r.left();
    let names = r.many(n, |r| r.c_text("attribute name"))?;
    if (names_at - r.left()) % 2 == 1 {
        r.u8("padding after names")?;
    }
    headers.into_iter().zip(names).map(|(h, name)| attribute(r, &h, name)).collect()
}

fn attribute(r: &mut R<'_>, h: &AttributeHeader, name: String) -> Result<Attribute, Fault> {
    let kind = AttributeKind::ALL.get(usize::from(h.code & 0x0f)).copied();
    let (Some(kind), 0 | 0x10) = (kind, h.code & 0xf0) else {
        return Err(Fault::Value { field: "attribute type", value: h.code.into() });
    };
    let n = u64::from(h.tuples) * u64::from(h.components);
    if 4 * n > r.left() as u64 {
        return Err(Fault::Value { field: "number of attribute values", value: n });
    }
    let values = r.many(n as usize, |r| r.f32("attribute value"))?;
    Ok(Attribute { kind, on_cells: h.code & 0x10 != 0, components: h.components, name, values })
}
