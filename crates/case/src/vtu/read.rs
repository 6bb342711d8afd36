//! Reading.

use super::numbers::{Layout, Wanted, numbers};
use super::{DataArray, Kind, UnstructuredGrid, VtuError};
use crate::Space;
use roxmltree::{Document, Node};

/// Letters that a field array of axes may have: more than `LPS` or `RAS` and what ends it.
const SPACE_LETTERS: usize = 64;

/// Decodes a `.vtu` file.
///
/// # Errors
/// A named fault. No array is decoded that holds more than the mesh asks for, nor all together more than a file of that
/// size can hold of a mesh.
pub fn decode(bytes: &[u8]) -> Result<UnstructuredGrid, VtuError> {
    let (xml, appended) = split_appended(bytes)?;
    let document = Document::parse(&xml)?;
    let root = document.root_element();
    if root.attribute("type") != Some("UnstructuredGrid") {
        let kind = root.attribute("type").unwrap_or("none");
        return Err(VtuError::Structure(format!("VTKFile of type {kind}, not UnstructuredGrid")));
    }
    let compressor = root.attribute("compressor");
    if !matches!(compressor, None | Some("vtkZLibDataCompressor")) {
        return Err(VtuError::Structure(format!("compressor {} is not read, only zlib", compressor.unwrap_or(""))));
    }
    let layout = Layout::of(root, appended, bytes.len());
    let mut pieces = root.descendants().filter(|n| n.has_tag_name("Piece"));
    let piece = pieces.next().ok_or_else(|| VtuError::Structure("no Piece".into()))?;
    if pieces.next().is_some() {
        return Err(VtuError::Structure("more than one Piece; merge them first".into()));
    }
    Ok(UnstructuredGrid { space: space(root, &layout), ..read_piece(piece, &layout)? })
}

/// What the field array `SPACE` says, a text of `LPS` or `RAS` byte by byte. One that cannot be read says nothing.
fn space(root: Node<'_, '_>, layout: &Layout<'_>) -> Option<Space> {
    let mut fields = root.descendants().filter(|n| n.has_tag_name("FieldData")).flat_map(|f| f.children());
    let array = fields.find(|n| n.attribute("Name") == Some("SPACE"))?;
    let bytes = numbers(array, Kind::UInt8, Wanted::AtMost(SPACE_LETTERS), layout).ok()?;
    let text: String = bytes.iter().map(|&b| char::from(b as u8)).collect();
    Space::of_header(&format!("SPACE={text}"))
}

/// The XML, closed again if raw data was cut out of it, and the appended data.
type Split<'a> = (String, Option<(&'a [u8], bool)>);

fn split_appended(bytes: &[u8]) -> Result<Split<'_>, VtuError> {
    let tag = b"<AppendedData";
    let text = |b: &[u8]| {
        core::str::from_utf8(b).map(str::to_owned).map_err(|_| VtuError::Structure("the XML is not UTF-8".into()))
    };
    let Some(start) = bytes.windows(tag.len()).position(|w| w == tag) else {
        return Ok((text(bytes)?, None));
    };
    let rest = &bytes[start..];
    let missing = || VtuError::Structure("AppendedData without its underscore".into());
    let open = rest.iter().position(|&b| b == b'>').ok_or_else(missing)?;
    let base64 = text(&rest[..open])?.contains("base64");
    let underscore = rest[open..].iter().position(|&b| b == b'_').ok_or_else(missing)?;
    Ok((text(&bytes[..start])? + "</VTKFile>", Some((&rest[open + underscore + 1..], base64))))
}

fn read_piece(piece: Node<'_, '_>, layout: &Layout<'_>) -> Result<UnstructuredGrid, VtuError> {
    let first = arrays(piece, "Points").next().ok_or_else(|| VtuError::Structure("no point positions".into()))?;
    let positions = data_array(first, layout, Some(3), said(piece, "NumberOfPoints")?)?;
    let (triples, []) = positions.values.as_chunks::<3>() else {
        return Err(VtuError::Structure(format!("{} coordinates are no multiple of 3", positions.values.len())));
    };
    let tets = tetrahedra(piece, layout)?;
    let data = |name: &str, count: usize| -> Result<Vec<DataArray>, VtuError> {
        arrays(piece, name).map(|n| data_array(n, layout, None, Some(count))).collect()
    };
    let grid = UnstructuredGrid {
        points: triples.to_vec(),
        point_data: data("PointData", triples.len())?,
        cell_data: data("CellData", tets.len())?,
        tets,
        space: None,
    };
    check_indices(&grid)?;
    Ok(grid)
}

/// A count that the piece says; `None` where it says nothing.
fn said(piece: Node<'_, '_>, name: &str) -> Result<Option<usize>, VtuError> {
    let number = |text: &str| {
        text.trim().parse().map_err(|_| VtuError::Structure(format!("{name}=\"{text}\" of the Piece is no count")))
    };
    piece.attribute(name).map(number).transpose()
}

fn check_indices(grid: &UnstructuredGrid) -> Result<(), VtuError> {
    let n = grid.points.len();
    match grid.tets.as_flattened().iter().position(|&v| v as usize >= n) {
        Some(i) => {
            let vertex = grid.tets.as_flattened()[i];
            Err(monro_geometry::TetMeshError::Index { tet: i / 4, vertex, vertices: n }.into())
        }
        None => Ok(()),
    }
}

/// Reads types first: they tell what is no tetrahedron, and how long the other arrays are.
fn tetrahedra(piece: Node<'_, '_>, layout: &Layout<'_>) -> Result<Vec<[u32; 4]>, VtuError> {
    let read = |name: &str, components: usize, count: Option<usize>| {
        let node = arrays(piece, "Cells").find(|n| n.attribute("Name") == Some(name));
        let node = node.ok_or_else(|| VtuError::Structure(format!("no array \"{name}\" in Cells")))?;
        data_array(node, layout, Some(components), count)
    };
    let types = read("types", 1, said(piece, "NumberOfCells")?)?;
    if let Some((cell, &kind)) = types.values.iter().enumerate().find(|(_, t)| **t != 10.0) {
        return Err(VtuError::CellType { cell, kind: kind as u64 });
    }
    let count = Some(types.values.len());
    let offsets = read("offsets", 1, count)?;
    if let Some((i, o)) = offsets.values.iter().enumerate().find(|(i, o)| **o != (*i as f64 + 1.0) * 4.0) {
        let reason = format!("{o} stands for cell {i}, where tetrahedra alone make {}", (i + 1) * 4);
        return Err(VtuError::Array { name: "offsets".into(), reason });
    }
    let connectivity = read("connectivity", 4, count)?;
    let number = |v: f64| {
        let fits = v >= 0.0 && v <= f64::from(u32::MAX) && v.fract() == 0.0;
        fits.then_some(v as u32).ok_or_else(|| VtuError::Structure(format!("{v} is no node number")))
    };
    let cells = connectivity.values.as_chunks::<4>().0;
    cells.iter().map(|c| Ok([number(c[0])?, number(c[1])?, number(c[2])?, number(c[3])?])).collect()
}

/// The arrays of a section.
fn arrays<'a, 'input>(piece: Node<'a, 'input>, section: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    let sections = piece.children().filter(move |n| n.has_tag_name(section));
    sections.flat_map(|s| s.children()).filter(|n| n.has_tag_name("DataArray"))
}

/// Reads an array of `count` times as many components as it says, or as are known.
fn data_array(
    node: Node<'_, '_>,
    layout: &Layout<'_>,
    known: Option<usize>,
    count: Option<usize>,
) -> Result<DataArray, VtuError> {
    let name = node.attribute("Name").unwrap_or("").to_owned();
    let fail = |reason: String| VtuError::Array { name: name.clone(), reason };
    let kind_name = node.attribute("type").unwrap_or("");
    let kind = Kind::parse(kind_name).ok_or_else(|| fail(format!("type {kind_name} is unknown")))?;
    let components = node.attribute("NumberOfComponents").map_or(Ok(1), str::parse);
    let components = components.map_err(|_| fail("NumberOfComponents is no number".into()))?;
    let each = known.unwrap_or(components);
    let wanted = count.map_or(Wanted::Any, |count| Wanted::Exactly { components: each, count });
    Ok(DataArray { kind, components, values: numbers(node, kind, wanted, layout).map_err(fail)?, name })
}
