//! Closed surfaces from voxel fields: extraction, smoothing, decimation.

mod cases;
mod decimate;
pub(crate) mod distance;
pub(crate) mod even;
mod isosurface;
mod outline;
pub(crate) mod runs;
mod slices;
mod smooth;
mod untangle;

pub use decimate::{decimate, thin, weld};
pub use isosurface::isosurface;
pub use smooth::{Smoothing, smooth};

use monro_geometry::{Topology, TriangleMesh, Volume};
use thiserror::Error;

/// Most cells of the even grid a surface is taken from; larger structures get a coarser step (about 0.9 mm for a head).
const MOST_CELLS: usize = 12_000_000;

/// Volume errors up to this fraction are made good by a shift along the normals.
const TRUSTED: f64 = 0.1;

/// An error of this part of the volume is let pass where restoring it might bring walls together again.
const VOLUME_TOLERANCE: f64 = 2e-4;

/// How a surface is made from labels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceOptions {
    /// Smoothing of the voxel steps; keeps the enclosed volume.
    pub smoothing: Smoothing,
    /// Decimate to about this many triangles.
    pub target_triangles: Option<usize>,
}

/// A closed surface around some labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// The surface in patient mm, normals outward.
    pub mesh: TriangleMesh,
    /// What was counted on it.
    pub topology: Topology,
    /// The structure reaches the border of the scan: it was cut there and closed by a cap.
    pub open_at_border: bool,
    /// Edge of the even grid it was taken from, mm.
    pub step: f64,
    /// Enclosed volume against that of the voxels, as a fraction (0.01 is 1 % too large).
    pub volume_error: f64,
    /// Pairs of triangles that pass through each other: none, as far as is known, but where decimation brings some.
    pub crossings: usize,
}

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SurfaceError {
    /// No voxel was selected.
    #[error("none of the {voxels} voxels carries a label of the wanted structure; check the labels given")]
    Empty {
        /// Voxels looked at.
        voxels: usize,
    },
    /// All selected voxels lie in parts thinner than the even grid can show.
    #[error("the structure ({volume_mm3:.1} mm3) is thinner than half a cell of {step_mm:.2} mm everywhere")]
    TooThin {
        /// Volume of the selected voxels, mm3.
        volume_mm3: f64,
        /// The cell edge, mm.
        step_mm: f64,
    },
}

/// The surface around all voxels whose label `keep` accepts: closed, two-manifold, oriented outward, for any placement
/// of the volume.
///
/// Uneven voxels are first brought to an even grid. A structure that reaches the border of the volume is closed there
/// by a cap, and `open_at_border` says so. Where smoothing moves the walls of a furrow through each other, it is taken back
/// as far as it takes to part them.
///
/// # Errors
/// No voxel is kept, or nothing of it survives on the even grid.
pub fn label_surface<T: Copy + Eq + Sync>(
    labels: &Volume<T>,
    keep: impl Fn(T) -> bool + Sync,
    options: &SurfaceOptions,
) -> Result<Surface, SurfaceError> {
    let empty = SurfaceError::Empty { voxels: labels.grid().len() };
    let extent = even::extent(labels, &keep).ok_or(empty.clone())?;
    let step = even::even_step(labels.grid(), &extent, MOST_CELLS);
    let even = even::even(labels, &keep, &extent, step, 2).ok_or(empty)?;
    let mut mesh = isosurface(&even.field, 0.5);
    if mesh.triangles.is_empty() {
        return Err(SurfaceError::TooThin { volume_mm3: even.volume, step_mm: step });
    }
    let mut crossings = smooth_apart(&mut mesh, options.smoothing, even.volume);
    if let Some(target) = options.target_triangles {
        mesh = decimate(&mesh, target);
        crossings = mesh.crossings().pairs.len();
    }
    let topology = mesh.topology();
    let volume_error = mesh.signed_volume() / even.volume - 1.0;
    Ok(Surface { mesh, topology, open_at_border: even.at_border, step, volume_error, crossings })
}

/// Smooths the surface of voxels with this volume (mm3) without moving walls through each other; the number of pairs of triangles
/// that cross all the same.
fn smooth_apart(mesh: &mut TriangleMesh, smoothing: Smoothing, volume: f64) -> usize {
    let voxels = mesh.vertices.clone();
    smooth(mesh, smoothing);
    let error = |mesh: &TriangleMesh| (mesh.signed_volume() / volume - 1.0).abs();
    // The voxels' volume has no bias; what averaging took from thin parts is given back.
    let trusted = error(mesh) < TRUSTED;
    let mut crossings = 0;
    for _ in 0..3 {
        if trusted {
            smooth::restore_volume(mesh, volume);
        }
        crossings = untangle::untangle(mesh, &voxels);
        if !trusted || error(mesh) < VOLUME_TOLERANCE {
            break;
        }
    }
    crossings
}

#[cfg(test)]
mod tests;
