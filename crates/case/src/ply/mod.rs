//! PLY surfaces: binary little-endian out; ASCII and binary of either byte order in.
//!
//! Coordinates are LPS mm; the header says so in a comment (`SPACE=LPS`), which 3D Slicer honours. A file that says
//! `SPACE=RAS` is turned to LPS when it is read.

mod header;
mod polygon;
mod read;

use crate::Rounding;
use monro_geometry::{TriangleMesh, TriangleMeshError};
use thiserror::Error;

pub use read::{decode, decode_stated};

/// Why a PLY file was refused.
#[derive(Debug, Error)]
pub enum PlyError {
    /// The header is not that of a PLY file, or is cut off.
    #[error("PLY header: {0}")]
    Header(String),
    /// The body ends early or holds something that is not a number.
    #[error("PLY {element} {index}: {reason}")]
    Body {
        /// `vertex` or `face`.
        element: String,
        /// Its number.
        index: usize,
        /// What is wrong.
        reason: String,
    },
    /// There is more than the header counts.
    #[error("PLY: {0} bytes follow the last element that the header counts; it counts too few")]
    Surplus(usize),
    /// The mesh itself is faulty.
    #[error("PLY mesh: {0}")]
    Mesh(#[from] TriangleMeshError),
}

/// Encodes a surface, with an optional scalar per vertex (`name`, values) such as a displacement in mm. Positions are
/// `float`, as all programs read them, or `double` where that would not do ([`Rounding::is_fine`]).
pub fn encode(mesh: &TriangleMesh, scalar: Option<(&str, &[f32])>) -> Vec<u8> {
    let single = Rounding::of(mesh).is_fine();
    let real = if single { "float" } else { "double" };
    let property = scalar.map(|(name, _)| format!("property float {name}\n")).unwrap_or_default();
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\ncomment SPACE=LPS unit mm\nelement vertex {}\nproperty {real} x\nproperty {real} y\nproperty {real} z\n{property}element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    out.reserve(mesh.vertices.len() * 16 + mesh.triangles.len() * 13);
    for (i, p) in mesh.vertices.iter().enumerate() {
        for c in p.to_array() {
            if single {
                out.extend_from_slice(&(c as f32).to_le_bytes());
            } else {
                out.extend_from_slice(&c.to_le_bytes());
            }
        }
        if let Some((_, values)) = scalar {
            out.extend_from_slice(&values.get(i).copied().unwrap_or(0.0).to_le_bytes());
        }
    }
    for t in &mesh.triangles {
        out.push(3);
        for v in t {
            out.extend_from_slice(&v.to_le_bytes());
        }
    }
    out
}

#[cfg(test)]
mod tests;
