//! VTK XML unstructured grids (`.vtu`) of linear tetrahedra.
//!
//! Written as zlib-compressed inline base64 (ParaView, meshio and VTK read it); read in every encoding that VTK writes:
//! ASCII, inline base64, appended base64 and appended raw, compressed with zlib or not, 32- or 64-bit headers.
//! File format: VTK User's Guide, "XML File Formats".
//!
//! Coordinates of a case's mesh are LPS mm. A field array `SPACE` of 3D Slicer that says otherwise is honoured by
//! [`UnstructuredGrid::to_mesh`]. Ours have none: Slicer reads them as LPS without it, and meshio refuses a grid with
//! an array of text.

mod array;
mod numbers;
mod read;
mod write;

use crate::Space;
use monro_geometry::{Point, TetMesh, TetMeshError};
use thiserror::Error;

pub use array::{DataArray, Kind};
pub use read::decode;
pub use write::encode;

/// Why a VTU file was refused.
#[derive(Debug, Error)]
pub enum VtuError {
    /// The XML does not parse.
    #[error("VTU: {0}")]
    Xml(#[from] roxmltree::Error),
    /// Something that a VTU file must have is missing or of an unknown kind.
    #[error("VTU: {0}")]
    Structure(String),
    /// An array cannot be read.
    #[error("VTU array \"{name}\": {reason}")]
    Array {
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A cell that is no linear tetrahedron.
    #[error(
        "VTU cell {cell} is of VTK type {kind}{}; only linear tetrahedra (10) are read; write the file without its other cells (lines, triangles of surfaces) and their cell data", kind_name(*kind)
    )]
    CellType {
        /// The cell.
        cell: usize,
        /// Its VTK type.
        kind: u64,
    },
    /// The mesh itself is faulty.
    #[error("VTU mesh: {0}")]
    Mesh(#[from] TetMeshError),
}

/// The names of cells that fill space in other ways, in brackets.
const fn kind_name(kind: u64) -> &'static str {
    match kind {
        12 => " (hexahedron)",
        13 => " (wedge)",
        14 => " (pyramid)",
        24 => " (quadratic tetrahedron)",
        _ => "",
    }
}

/// An unstructured grid of tetrahedra with data on points and cells. The unit is the file's; this module does not convert.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct UnstructuredGrid {
    /// Node positions.
    pub points: Vec<[f64; 3]>,
    /// Node numbers of each tetrahedron.
    pub tets: Vec<[u32; 4]>,
    /// Arrays on nodes.
    pub point_data: Vec<DataArray>,
    /// Arrays on cells.
    pub cell_data: Vec<DataArray>,
    /// The axes that the file says `points` are in. Told, not applied, and not written.
    pub space: Option<Space>,
}

impl UnstructuredGrid {
    /// A grid of a labelled mesh in mm, with the cell array `label`.
    pub fn from_mesh(mesh: &TetMesh) -> Self {
        let label = DataArray::scalars("label", Kind::UInt16, mesh.labels.iter().map(|&l| f64::from(l)).collect());
        Self {
            points: mesh.vertices.iter().map(|p| p.to_array()).collect(),
            tets: mesh.tets.clone(),
            point_data: Vec::new(),
            cell_data: vec![label],
            space: None,
        }
    }

    /// Gives all cells the label 1 where there is no cell array `label`, and returns the names of the arrays that are there
    /// instead: other programs number their regions under other names, or not at all.
    pub fn labelled(&mut self) -> Option<Vec<String>> {
        if find(&self.cell_data, "label").is_some() {
            return None;
        }
        let others = self.cell_data.iter().map(|a| a.name.clone()).collect();
        self.cell_data.push(DataArray::scalars("label", Kind::UInt16, vec![1.0; self.tets.len()]));
        Some(others)
    }

    /// The labelled mesh of a grid in mm, in LPS whatever the file's axes; labels from the cell array `label`.
    ///
    /// # Errors
    /// A missing or fractional `label`, bad indices, inverted elements, elements that do not fit together
    /// ([`TetMesh::check_conforming`]).
    pub fn to_mesh(&self) -> Result<TetMesh, VtuError> {
        let array =
            find(&self.cell_data, "label").ok_or_else(|| VtuError::Structure("no cell array \"label\"".into()))?;
        let whole = |v: &f64| v.fract() == 0.0 && (0.0..=65535.0).contains(v);
        if let Some(bad) = array.values.iter().find(|v| !whole(v)) {
            return Err(VtuError::Array { name: "label".into(), reason: format!("{bad} is no label (0 to 65535)") });
        }
        let mut mesh = TetMesh {
            vertices: self.points.iter().map(|&p| Point::from_array(p)).collect(),
            tets: self.tets.clone(),
            labels: array.values.iter().map(|&v| v as u16).collect(),
        };
        self.space.unwrap_or(Space::Lps).to_lps(&mut mesh.vertices);
        mesh.validate()?;
        mesh.check_conforming()?;
        Ok(mesh)
    }
}

/// The array of a name.
pub fn find<'a>(arrays: &'a [DataArray], name: &str) -> Option<&'a DataArray> {
    arrays.iter().find(|a| a.name == name)
}

#[cfg(test)]
mod tests;
