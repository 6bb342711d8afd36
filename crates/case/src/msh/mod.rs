//! Gmsh meshes (`.msh`) of labelled linear tetrahedra.
//!
//! Written as MSH 4.1 binary: one volume entity for each label and one surface entity for each interface between two
//! labels or to the outside, each a physical group of its own. Read as MSH 4.1 (ASCII or binary) and 2.2 (ASCII): the
//! tetrahedra, with their physical group as label, or where there is none the data of elements called "label", or their
//! entity, or 1 where no element has any of these.
//! Parts of a partitioned mesh have the groups of the volumes they are parts of. Of several groups of a volume the one
//! that holds the fewest volumes counts.
//! File format: Gmsh reference manual, "MSH file format". Coordinates are LPS mm by convention.

mod data;
mod entities;
mod labels;
mod read;
mod source;
mod write;

use monro_geometry::TetMeshError;
use thiserror::Error;

pub use read::{Imported, decode};
pub use write::encode;

/// Why a `.msh` file was refused.
#[derive(Debug, Error)]
pub enum MshError {
    /// A version that is not read.
    #[error("MSH: version {0} is not read; save it as version 4.1, or as 2.2 ASCII")]
    Version(String),
    /// Something that an MSH file must have is missing or faulty.
    #[error("MSH {section}: {reason}")]
    Section {
        /// The section, as `$Nodes`.
        section: String,
        /// What is wrong.
        reason: String,
    },
    /// A tetrahedron names a node that no section holds.
    #[error("MSH element {element} uses node {node}, which does not exist")]
    Node {
        /// Tag of the element.
        element: u64,
        /// Tag of the node.
        node: u64,
    },
    /// A tetrahedron lies in a volume that the file does not list, though it lists entities.
    #[error(
        "MSH element {element}: its volume {volume} is not among the entities of the file, so that its group is unknown; save the file anew with its entities"
    )]
    Unlisted {
        /// Tag of the element.
        element: u64,
        /// Tag of the entity.
        volume: i32,
    },
    /// A volume lies in several physical groups, and it is not plain which one is meant.
    #[error(
        "MSH: volume {volume} is in the physical groups {groups}, and none of them holds fewer volumes than each other; leave the volume in one of them and save again"
    )]
    Several {
        /// Tag of the volume.
        volume: i32,
        /// Its groups.
        groups: String,
    },
    /// Some tetrahedra are in physical groups and others are not.
    #[error(
        "MSH: the tetrahedra of volume(s) {without} are in no physical group ({count}, the first is element {element}), while those of volume(s) {with} are; put each volume into a group, or save only those that are in one (Gmsh: Mesh.SaveAll = 0)"
    )]
    PartlyGrouped {
        /// How many are in none.
        count: usize,
        /// Tag of the first of them.
        element: u64,
        /// Their volumes.
        without: String,
        /// Volumes of those that are in a group.
        with: String,
    },
    /// A tetrahedron stands in the file once for each of its physical groups.
    #[error(
        "MSH elements {first} and {second} are the same tetrahedron in the physical groups {} and {}; leave each volume in one group, or save the file as version 4.1, where the group of fewest volumes is taken",
        groups[0], groups[1]
    )]
    Repeated {
        /// Tag of one of the elements.
        first: u64,
        /// Tag of the other.
        second: u64,
        /// Their groups.
        groups: [i32; 2],
    },
    /// A physical group or entity that is no label.
    #[error("MSH element {element}: its group {group} is no label (0 to 65535)")]
    Group {
        /// Tag of the element.
        element: u64,
        /// Its physical group or entity.
        group: i64,
    },
    /// The mesh itself is faulty.
    #[error("MSH mesh: {0}")]
    Mesh(#[from] TetMeshError),
}

/// Gmsh's numbers of the linear triangle and tetrahedron.
const TRIANGLE: i32 = 2;
const TETRAHEDRON: i32 = 4;

/// Nodes of an element of a Gmsh type; `None` for types that are not known here.
const fn nodes_of(kind: i32) -> Option<usize> {
    Some(match kind {
        1 | 8 => kind as usize / 8 + 2,
        2 => 3,
        3 | 4 => 4,
        5 => 8,
        6 | 9 => 6,
        7 => 5,
        10 => 9,
        11 => 10,
        12 => 27,
        13 => 18,
        14 => 14,
        15 => 1,
        16 => 8,
        17 => 20,
        18 => 15,
        19 => 13,
        _ => return None,
    })
}

/// What the elements of a Gmsh type are called, of those that fill space besides linear tetrahedra.
const fn solid_name(kind: i32) -> Option<&'static str> {
    Some(match kind {
        5 => "hexahedra",
        6 => "prisms",
        7 => "pyramids",
        11 => "quadratic tetrahedra",
        12 | 17 => "quadratic hexahedra",
        13 | 18 => "quadratic prisms",
        14 | 19 => "quadratic pyramids",
        _ => return None,
    })
}

#[cfg(test)]
mod group_tests;
#[cfg(test)]
mod section_tests;
#[cfg(test)]
mod tests;
