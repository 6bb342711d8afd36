//! Frames as types, rigid transforms, voxel volumes, meshes and spatial queries.
//!
//! Everything here is in millimetres and, in the patient frame, in DICOM LPS axes (x to the patient's left, y to the
//! back, z to the head). Scalars are `f64`; a solver that wants `f32` converts at its own door.
//!
//! This crate knows no files, sockets, clocks, threads or organs' materials. It does know the *names* of the structures
//! of a case ([`Structure`]), because labels, meshes and reports must agree on them.

mod affine;
mod buckets;
mod bvh;
mod crossing;
pub mod d3;
mod deformation;
mod disjoint_sets;
mod embedding;
mod frame;
mod grid;
mod hanging;
mod incidence;
mod matrix;
mod neighbours;
mod normals;
mod plane;
mod rigid;
mod soundness;
mod structure;
mod tetrahedra;
mod triangles;
mod vector;
mod volume;
mod walls;

pub use affine::Affine;
pub use buckets::by_point;
pub use bvh::{Bvh, Hit, Nearest, nearest_on_triangle};
pub use crossing::{CrossingFinder, Crossings, SelfCrossing, triangles_cross};
pub use deformation::{deformation_gradient, volume_ratio};
pub use disjoint_sets::DisjointSets;
pub use embedding::{Binder, BoundChunk, Embedding, EmbeddingError, Located, NearestFace, Overlap, TetLocator};
pub use frame::{Display, Frame, Patient, Tool, Tracker, Voxel};
pub use grid::{Grid, GridError};
pub use hanging::{HangingNode, LooseFaces};
pub use incidence::Incidence;
pub use matrix::Matrix3;
pub use neighbours::{NO_TET, tet_neighbours};
pub use normals::SurfaceNormals;
pub use plane::Plane;
pub use rigid::Rigid;
pub use structure::Structure;
pub use tetrahedra::{TET_EDGES, TET_FACES, TetMesh, TetMeshError, TetQuality, tet_signed_volume};
pub use triangles::{Topology, TriangleMesh, TriangleMeshError};
pub use vector::{Point, Vector, bounds};
pub use volume::Volume;
pub use walls::{PassedThrough, Wall, Walls};
