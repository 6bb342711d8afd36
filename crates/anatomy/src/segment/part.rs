//! The parts of the way, for a clock outside.

use monro_geometry::Structure;

/// A part of the segmentation, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The scan on the working raster, its thresholds.
    Resampling,
    /// The space inside the skull.
    Cavity,
    /// The head against air.
    Head,
    /// Midplane, pose of the model and the ventricles.
    Ventricles,
    /// Fluid around the brain.
    Fluid,
    /// All labels on the scan's own grid.
    Painting,
}

impl Part {
    /// Whether a structure cannot be found without this part. The brain is what the others leave of the cavity.
    pub const fn leads_to(self, structure: Structure) -> bool {
        match (self, structure) {
            (_, Structure::Outside) => false,
            (Self::Resampling | Self::Cavity | Self::Painting, _) => true,
            (Self::Head, s) => matches!(s, Structure::Scalp | Structure::Skull),
            (Self::Ventricles, s) => !matches!(s, Structure::Scalp | Structure::Skull),
            (Self::Fluid, s) => matches!(s, Structure::Csf | Structure::Brain),
        }
    }
}
