//! Why a model was refused.

use crate::MaterialFault;
use monro_geometry::TetMeshError;
use thiserror::Error;

/// Why a model was refused; each names the element or vertex and its numbers.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The mesh itself is broken.
    #[error("the mesh cannot be simulated: {0}")]
    Mesh(#[from] TetMeshError),
    /// There is nothing to simulate.
    #[error("the mesh has no tetrahedra: mesh the segmented region first")]
    Empty,
    /// An element has practically no volume for its size.
    #[error("tetrahedron {tet} is flat: volume {volume_mm3:e} mm3 with an edge of {edge_mm} mm; improve or remove it")]
    Flat {
        /// The element.
        tet: usize,
        /// Its volume, mm3.
        volume_mm3: f64,
        /// Its longest edge, mm.
        edge_mm: f64,
    },
    /// Two vertices lie on the same spot.
    #[error("vertices {first} and {second} lie on the same spot; merge them")]
    DuplicateVertex {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
    },
    /// Too many vertices side by side.
    #[error("{vertices} vertices lie so close together along edges that they cannot be cut in two; at most 65536 may")]
    Dense {
        /// Vertices that cannot be separated.
        vertices: usize,
    },
    /// A label has no material.
    #[error(
        "label {label} has no material, but {tets} tetrahedra have it (the first is {tet}); add one to the options"
    )]
    NoMaterial {
        /// The label.
        label: u16,
        /// How many elements have it.
        tets: usize,
        /// The first element that has it.
        tet: usize,
    },
    /// A material, or the thin membrane around its region, has a value outside its range.
    #[error("the material of label {label} is unusable: {fault}")]
    Material {
        /// The label.
        label: u16,
        /// The value and its range.
        fault: MaterialFault,
    },
    /// An option of the mode is out of range.
    #[error("{name} is {value}, wanted {wanted}")]
    Option {
        /// Which option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range.
        wanted: &'static str,
    },
    /// An attachment guides a node in physical mode.
    #[error(
        "attachment {attachment} holds only some components of a node, which stepping in physical mode cannot; hold all, \
         or take paper mode, or the function `equilibrium` instead of a model"
    )]
    Guided {
        /// Index of the attachment.
        attachment: usize,
    },
    /// A node lies against more planes than count.
    #[error("node {node} lies against {planes} planes, at most {most} count; leave out those that say the same")]
    Planes {
        /// Vertex of the mesh.
        node: u32,
        /// Planes that it is to lie against.
        planes: usize,
        /// How many count.
        most: usize,
    },
    /// An attachment names a vertex that does not exist.
    #[error("attachment {attachment} holds vertex {node}, but there are only {vertices}")]
    Attachment {
        /// Index of the attachment.
        attachment: usize,
        /// The vertex.
        node: u32,
        /// Vertices in the mesh.
        vertices: usize,
    },
}
