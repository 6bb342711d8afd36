//! Reading.

use super::{DataArray, Kind, UnstructuredGrid, VtuError};
use crate::Space;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use roxmltree::{Document, Node};
use std::io::Read;

/// How the file stores its arrays.
struct Layout<'a> {
    big_endian: bool,
    long_header: bool,
    compressed: bool,
    /// Appended data behind its underscore, and whether it is base64.
    appended: Option<(&'a [u8], bool)>,
}

/// Decodes a `.vtu` file.
///
/// # Errors
/// A named fault. Sizes in the file are checked against what the file really holds.
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
    let layout = Layout {
        big_endian: root.attribute("byte_order") == Some("BigEndian"),
        long_header: root.attribute("header_type") == Some("UInt64"),
        compressed: compressor.is_some(),
        appended,
    };
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
    let bytes = numbers(array, Kind::UInt8, layout).ok()?;
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
    let points = section(piece, "Points", layout)?;
    let cells = section(piece, "Cells", layout)?;
    let positions = points.first().ok_or_else(|| VtuError::Structure("no point positions".into()))?;
    let wanted = |name: &str| {
        super::find(&cells, name).ok_or_else(|| VtuError::Structure(format!("no array \"{name}\" in Cells")))
    };
    let tets = tetrahedra(wanted("connectivity")?, wanted("offsets")?, wanted("types")?)?;
    let (triples, []) = positions.values.as_chunks::<3>() else {
        return Err(VtuError::Structure(format!("{} coordinates are no multiple of 3", positions.values.len())));
    };
    let grid = UnstructuredGrid {
        points: triples.to_vec(),
        tets,
        point_data: section(piece, "PointData", layout)?,
        cell_data: section(piece, "CellData", layout)?,
        space: None,
    };
    check_lengths(&grid)?;
    Ok(grid)
}

fn check_lengths(grid: &UnstructuredGrid) -> Result<(), VtuError> {
    let each = |arrays: &[DataArray], count: usize| {
        for a in arrays {
            if a.components.checked_mul(count) != Some(a.values.len()) {
                let reason = format!("{} values, expected {} x {count}", a.values.len(), a.components);
                return Err(VtuError::Array { name: a.name.clone(), reason });
            }
        }
        Ok(())
    };
    each(&grid.point_data, grid.points.len())?;
    each(&grid.cell_data, grid.tets.len())?;
    let n = grid.points.len();
    match grid.tets.as_flattened().iter().position(|&v| v as usize >= n) {
        Some(i) => {
            let vertex = grid.tets.as_flattened()[i];
            Err(monro_geometry::TetMeshError::Index { tet: i / 4, vertex, vertices: n }.into())
        }
        None => Ok(()),
    }
}

fn tetrahedra(connectivity: &DataArray, offsets: &DataArray, types: &DataArray) -> Result<Vec<[u32; 4]>, VtuError> {
    if let Some((cell, &kind)) = types.values.iter().enumerate().find(|(_, t)| **t != 10.0) {
        return Err(VtuError::CellType { cell, kind: kind as u64 });
    }
    let regular = offsets.values.iter().enumerate().all(|(i, &o)| o == (i as f64 + 1.0) * 4.0);
    let (cells, rest) = connectivity.values.as_chunks::<4>();
    if !regular || !rest.is_empty() || cells.len() != types.values.len() || offsets.values.len() != cells.len() {
        return Err(VtuError::Structure("offsets, types and connectivity do not agree on tetrahedra".into()));
    }
    let number = |v: f64| {
        let fits = v >= 0.0 && v <= f64::from(u32::MAX) && v.fract() == 0.0;
        fits.then_some(v as u32).ok_or_else(|| VtuError::Structure(format!("{v} is no node number")))
    };
    cells.iter().map(|c| Ok([number(c[0])?, number(c[1])?, number(c[2])?, number(c[3])?])).collect()
}

fn section(piece: Node<'_, '_>, name: &str, layout: &Layout<'_>) -> Result<Vec<DataArray>, VtuError> {
    let arrays = piece.children().filter(|n| n.has_tag_name(name)).flat_map(|s| s.children());
    arrays.filter(|n| n.has_tag_name("DataArray")).map(|n| data_array(n, layout)).collect()
}

fn data_array(node: Node<'_, '_>, layout: &Layout<'_>) -> Result<DataArray, VtuError> {
    let name = node.attribute("Name").unwrap_or("").to_owned();
    let fail = |reason: String| VtuError::Array { name: name.clone(), reason };
    let kind_name = node.attribute("type").unwrap_or("");
    let kind = Kind::parse(kind_name).ok_or_else(|| fail(format!("type {kind_name} is unknown")))?;
    let components = node.attribute("NumberOfComponents").map_or(Ok(1), str::parse);
    let components = components.map_err(|_| fail("NumberOfComponents is no number".into()))?;
    Ok(DataArray { kind, components, values: numbers(node, kind, layout).map_err(fail)?, name })
}

/// The numbers of an array in any of its encodings.
fn numbers(node: Node<'_, '_>, kind: Kind, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    let text = node.text().unwrap_or("");
    match node.attribute("format") {
        Some("ascii") | None => ascii(text),
        Some("binary") => binary(text.trim().as_bytes(), true, kind, layout),
        Some("appended") => appended(node, kind, layout),
        Some(other) => Err(format!("format {other} is unknown")),
    }
}

fn ascii(text: &str) -> Result<Vec<f64>, String> {
    text.split_ascii_whitespace().map(|w| w.parse().map_err(|_| format!("\"{w}\" is not a number"))).collect()
}

fn appended(node: Node<'_, '_>, kind: Kind, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    let (data, base64) = layout.appended.ok_or("no AppendedData in the file")?;
    let offset: usize = node.attribute("offset").and_then(|o| o.parse().ok()).ok_or("no offset")?;
    let data =
        data.get(offset..).ok_or_else(|| format!("offset {offset} is beyond the {} appended bytes", data.len()))?;
    binary(data, base64, kind, layout)
}

/// Reads a header and its data; both may be base64, each compressed header being a base64 run of its own.
fn binary(data: &[u8], base64: bool, kind: Kind, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    let word = if layout.long_header { 8 } else { 4 };
    let raw = if layout.compressed {
        compressed(data, base64, word, layout.big_endian)?
    } else {
        let first = take(data, base64, 0, word)?;
        let n = length(&first, layout.big_endian)?;
        take(data, base64, word, n)?
    };
    let values = raw.chunks_exact(kind.size()).map(|c| {
        let mut b = [0u8; 8];
        b[..c.len()].copy_from_slice(c);
        if layout.big_endian {
            b[..c.len()].reverse();
        }
        kind.value(&b[..c.len()])
    });
    Ok(values.collect())
}

fn compressed(data: &[u8], base64: bool, word: usize, big_endian: bool) -> Result<Vec<u8>, String> {
    let at = |header: &[u8], i: usize| length(&header[i * word..(i + 1) * word], big_endian);
    let blocks = at(&take(data, base64, 0, word)?, 0)?;
    if blocks == 0 {
        return Ok(Vec::new());
    }
    let header_bytes = blocks.checked_add(3).and_then(|n| n.checked_mul(word)).ok_or("too many blocks")?;
    let header = take(data, base64, 0, header_bytes)?;
    let skip = if base64 { header_bytes.div_ceil(3) * 4 } else { header_bytes };
    let body = data.get(skip..).ok_or("the data end inside the header")?;
    let (full, last) = (at(&header, 1)?, at(&header, 2)?);
    let mut out = Vec::new();
    let mut start = 0usize;
    for b in 0..blocks {
        let size = at(&header, 3 + b)?;
        let packed = take(body, base64, start, size)?;
        let expected = if b + 1 == blocks && last != 0 { last } else { full };
        inflate(&packed, expected, &mut out)?;
        start += size;
    }
    Ok(out)
}

fn inflate(packed: &[u8], expected: usize, out: &mut Vec<u8>) -> Result<(), String> {
    let before = out.len();
    let mut limited = ZlibDecoder::new(packed).take(expected as u64 + 1);
    limited.read_to_end(out).map_err(|e| format!("zlib: {e}"))?;
    let found = out.len() - before;
    if found == expected { Ok(()) } else { Err(format!("a block holds {found} bytes, its header says {expected}")) }
}

/// Bytes `start..start + n` of the data, decoded from base64 if need be.
fn take(data: &[u8], base64: bool, start: usize, n: usize) -> Result<Vec<u8>, String> {
    let end = start.checked_add(n).ok_or("a size overflows")?;
    let short = || format!("{n} bytes expected, the data end before");
    if !base64 {
        return data.get(start..end).map(<[u8]>::to_vec).ok_or_else(short);
    }
    let (from, to) = (start / 3 * 4, end.div_ceil(3).checked_mul(4).ok_or("a size overflows")?);
    let decoded = STANDARD.decode(data.get(from..to).ok_or_else(short)?).map_err(|e| format!("base64: {e}"))?;
    let offset = start - start / 3 * 3;
    decoded.get(offset..offset + n).map(<[u8]>::to_vec).ok_or_else(short)
}

fn length(word: &[u8], big_endian: bool) -> Result<usize, String> {
    let fold = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
    let value = if big_endian { word.iter().fold(0, fold) } else { word.iter().rev().fold(0, fold) };
    usize::try_from(value).map_err(|_| format!("a size of {value} bytes"))
}

#[cfg(test)]
mod tests {
    use super::super::{DataArray, Kind, UnstructuredGrid, VtuError, encode, find};
    use super::*;
    use proptest::prelude::*;

    fn two() -> UnstructuredGrid {
        UnstructuredGrid {
            points: vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.5]],
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
            point_data: vec![DataArray::vectors("displacement", Kind::Float32, &[[0.5, 0., -2.]; 5])],
            cell_data: vec![DataArray::scalars("label", Kind::UInt16, vec![4., 5.])],
            space: None,
        }
    }

    #[test]
    fn what_is_written_is_read_back() {
        assert_eq!(decode(&encode(&two())).expect("own file"), two());
        assert_eq!(two().to_mesh().expect("mesh").labels, vec![4, 5]);
        assert_eq!(decode(&encode(&UnstructuredGrid::default())).expect("empty"), UnstructuredGrid::default());
    }

    /// A field array as 3D Slicer writes it, as text and compressed.
    #[test]
    fn a_mesh_in_ras_was_read_as_lps() {
        let text = String::from_utf8(encode(&two())).expect("text");
        let stated = |attributes: &str, content: &str| {
            let field = format!(
                "<UnstructuredGrid>\n<FieldData><Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" {attributes}>{content}</Array></FieldData>"
            );
            decode(text.replace("<UnstructuredGrid>", &field).as_bytes()).expect("readable")
        };
        let ras = stated("format=\"ascii\"", "82 65 83 0");
        assert_eq!((ras.space, ras.points[1]), (Some(Space::Ras), [1.0, 0.0, 0.0]));
        assert_eq!(ras.to_mesh().expect("mesh").vertices[1].to_array(), [-1.0, 0.0, 0.0]);
        let letters = DataArray::scalars("", Kind::UInt8, b"RAS\0".map(f64::from).to_vec());
        assert_eq!(stated("format=\"binary\"", &super::super::write::payload(&letters)).space, Some(Space::Ras));
        assert_eq!(stated("format=\"ascii\"", "76 80 83 0").space, Some(Space::Lps));
        assert_eq!(stated("format=\"ascii\"", "what").space, None);
    }

    fn raw_appended() -> Vec<u8> {
        let mut data = Vec::new();
        let mut offsets = Vec::new();
        let mut put = |bytes: Vec<u8>| {
            offsets.push(data.len());
            data.extend_from_slice(&(bytes.len() as u32).to_be_bytes());
            data.extend_from_slice(&bytes);
        };
        let points = [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        put(points.as_flattened().iter().flat_map(|v| v.to_be_bytes()).collect());
        put([0i64, 1, 2, 3].iter().flat_map(|v| v.to_be_bytes()).collect());
        put(4i64.to_be_bytes().to_vec());
        put(vec![10]);
        let array = |kind: &str, name: &str, n: usize, i: usize| {
            format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n}\" format=\"appended\" offset=\"{}\"/>",
                offsets[i]
            )
        };
        let mut file = format!(
            "<VTKFile type=\"UnstructuredGrid\" byte_order=\"BigEndian\" header_type=\"UInt32\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_",
            array("Float32", "Points", 3, 0), array("Int64", "connectivity", 1, 1), array("Int64", "offsets", 1, 2), array("UInt8", "types", 1, 3)
        ).into_bytes();
        file.extend_from_slice(&data);
        file.extend_from_slice(b"\n</AppendedData></VTKFile>");
        file
    }

    #[test]
    fn big_endian_raw_appended_data_are_read() {
        let grid = decode(&raw_appended()).expect("raw");
        assert_eq!(grid.tets, vec![[0, 1, 2, 3]]);
        assert_eq!(grid.points[1], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_hexahedron_a_wrong_count_and_a_bad_index_are_named() {
        let text = String::from_utf8(encode(&two())).expect("text");
        let ascii = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\">0 0 0 7</DataArray><DataArray type=\"Int32\" Name=\"offsets\">4</DataArray><DataArray type=\"UInt8\" Name=\"types\">KIND</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>";
        assert!(matches!(
            decode(ascii.replace("KIND", "12").as_bytes()),
            Err(VtuError::CellType { cell: 0, kind: 12 })
        ));
        assert!(matches!(decode(ascii.replace("KIND", "10").as_bytes()), Err(VtuError::Mesh(_))));
        assert!(matches!(
            decode(text.replace("Name=\"offsets\"", "Name=\"other\"").as_bytes()),
            Err(VtuError::Structure(_))
        ));
        let short = text.replace("Name=\"label\" NumberOfComponents=\"1\"", "Name=\"label\" NumberOfComponents=\"2\"");
        assert!(matches!(decode(short.as_bytes()), Err(VtuError::Array { .. })));
    }

    #[test]
    fn an_inverted_element_and_a_missing_label_are_named() {
        let mut grid = two();
        grid.tets[1].swap(0, 1);
        assert!(matches!(grid.to_mesh(), Err(VtuError::Mesh(_))));
        grid.cell_data.clear();
        assert!(matches!(grid.to_mesh(), Err(VtuError::Structure(_))));
        assert!(find(&grid.point_data, "displacement").is_some());
    }

    proptest! {
        #[test]
        fn cut_or_corrupted_files_never_panic(cut in 0usize..5000, at in 0usize..5000, value in 0u8.., raw in any::<bool>()) {
            let mut bytes = if raw { raw_appended() } else { encode(&two()) };
            let at = at % bytes.len();
            bytes[at] = value;
            bytes.truncate(cut.max(1));
            let _ = decode(&bytes);
        }
    }
}
