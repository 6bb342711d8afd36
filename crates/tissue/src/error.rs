//! Why a model was refused.

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
    /// Two elements have the same corners.
    #[error("tetrahedra {first} and {second} have the same four vertices; remove one")]
    DuplicateTet {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
    },
    /// Two vertices lie on the same spot.
    #[error("vertices {first} and {second} lie on the same spot; merge them")]
    DuplicateVertex {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
    },
    /// A vertex belongs to no element.
    #[error("vertex {0} belongs to no tetrahedron; remove it")]
    Isolated(usize),
    /// A face has more than two elements.
    #[error("the face {nodes:?} belongs to {tets} tetrahedra; at most two can share one")]
    CrowdedFace {
        /// Its vertices.
        nodes: [u32; 3],
        /// How many elements claim it.
        tets: usize,
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
    /// A material has a value outside its range.
    #[error(
        "the material of label {label} is unusable: E {young_kpa} kPa, nu {poisson}, density {density_kg_m3} kg/m3 \
         (wanted: E > 0, 0 <= nu < 0.4999, density > 0, coefficients in 0..=1, forces >= 0)"
    )]
    Material {
        /// The label.
        label: u16,
        /// Young's modulus, kPa.
        young_kpa: f64,
        /// Poisson's ratio.
        poisson: f64,
        /// Density, kg/m3.
        density_kg_m3: f64,
    },
    /// The thin membrane around a region has a value outside its range.
    #[error(
        "the thin membrane of label {label} is unusable: E {young_kpa} kPa, nu {poisson}, thickness {thickness_mm} mm \
         (wanted: E > 0, 0 <= nu <= 0.5, thickness > 0; leave it out for none)"
    )]
    ThinMembrane {
        /// The label.
        label: u16,
        /// Young's modulus, kPa.
        young_kpa: f64,
        /// Poisson's ratio.
        poisson: f64,
        /// Thickness, mm.
        thickness_mm: f64,
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
         or ask for the equilibrium or for paper mode"
    )]
    Guided {
        /// Index of the attachment.
        attachment: usize,
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
