//! The digital phantoms: made-up heads with known truth.
//!
//! [`head`] makes a CT of an adult head from implicit shapes: scalp with its layers, face, skull with two tables and
//! diploe, brain with sulci, curved lateral ventricles, foramina of Monro and third ventricle. A seed varies size,
//! ventricles, posture and noise. Labels and landmarks come from the same shapes, and [`HeadModel`] gives the shapes
//! themselves, for tests against an exact truth. [`drawer`] makes the simple phantom of the paper.
//!
//! Simplifications: no vessels, no teeth, no pathology; no beam hardening or metal artefacts. Air inside the head counts
//! as [`Structure::Scalp`](monro_geometry::Structure::Scalp) (soft tissue and what it encloses), and the spinal canal
//! below the foramen magnum too.

mod brain;
mod cranium;
mod drawer;
mod head;
mod landmarks;
mod paint;
mod random;
mod shapes;
mod skin;
mod ventricles;

#[cfg(test)]
mod tests;

pub use drawer::{DrawerOptions, drawer};
pub use head::HeadModel;

use ventricles::Ventricles;

use monro_geometry::{Frame, Grid, GridError, Patient, Point, Volume};

/// The phantom's own frame: origin between the foramina of Monro, x left, y back, z up; about millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head;

impl Frame for Head {
    const NAME: &'static str = "phantom head";
}

/// A made-up scan with its truth.
#[derive(Debug, Clone)]
pub struct Phantom {
    /// A name that says kind and seed.
    pub name: String,
    /// The scan, HU.
    pub ct: Volume<i16>,
    /// The true [`Structure`](monro_geometry::Structure) number at each voxel centre.
    pub labels: Volume<u8>,
    /// True landmarks.
    pub landmarks: PhantomLandmarks,
}

/// True landmarks of a phantom, patient frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhantomLandmarks {
    /// Deepest point of the midline skin profile between glabella and nose.
    pub nasion: Point<Patient>,
    /// 110 mm from the nasion along the midsagittal skin.
    pub midline_110mm: Point<Patient>,
    /// Kocher's point on the patient's left: 30 mm along the skin from [`Self::midline_110mm`].
    pub kocher_left: Point<Patient>,
    /// Kocher's point on the patient's right.
    pub kocher_right: Point<Patient>,
    /// Middle of the left foramen of Monro.
    pub monro_left: Point<Patient>,
    /// Middle of the right foramen of Monro.
    pub monro_right: Point<Patient>,
}

/// What a head phantom shall be like. `None` leaves it to the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadOptions {
    /// Chooses the head.
    pub seed: u64,
    /// Voxel spacing, mm.
    pub spacing_mm: [f64; 3],
    /// Standard deviation of the noise, HU (seed: 6 to 10).
    pub noise_hu: Option<f64>,
    /// Width of the lateral ventricles relative to a young adult's (seed: 0.85 to 1.45).
    pub ventricle_width: Option<f64>,
    /// Thickness of the septum between the lateral ventricles, mm (seed: 1.6 to 2.6).
    pub septum_mm: Option<f64>,
    /// Width of the sulci in mm, 0 for a smooth brain (seed: 0.8 to 1.8).
    pub sulcus_width_mm: Option<f64>,
    /// Turns of the head about the patient's x, y and z axes, degrees (seed: up to 8 each).
    pub turn_deg: Option<[f64; 3]>,
    /// Whether the scanner's head rest is in the picture.
    pub head_rest: bool,
}

impl Default for HeadOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            spacing_mm: [0.9, 0.9, 1.25],
            noise_hu: None,
            ventricle_width: None,
            septum_mm: None,
            sulcus_width_mm: None,
            turn_deg: None,
            head_rest: true,
        }
    }
}

/// Makes a head.
///
/// # Errors
/// A spacing that is not positive and finite, or so small that the grid overflows.
pub fn head(options: &HeadOptions) -> Result<Phantom, GridError> {
    let model = HeadModel::new(options);
    let centre = model.patient(shapes::at(0.0, 6.0, 0.0));
    let grid = grid_around(centre, [214.0, 248.0, 206.0], options.spacing_mm)?;
    let (ct, labels) = paint::scan(&model, grid, (options.seed, model.noise_hu))?;
    Ok(Phantom {
        name: format!("head-{}", options.seed),
        ct,
        labels,
        landmarks: landmarks::find(&model, Ventricles::left_foramen()),
    })
}

/// An axis-aligned grid over a box of the given size (mm) around a point.
fn grid_around(centre: Point<Patient>, size: [f64; 3], spacing: [f64; 3]) -> Result<Grid, GridError> {
    let placed = spacing.iter().all(|s| s.is_finite() && *s > 0.0);
    let dims = core::array::from_fn(|a| if placed { (size[a] / spacing[a]).ceil() as usize } else { 0 });
    let centre = centre.to_array();
    let origin = core::array::from_fn(|a| centre[a] - 0.5 * (dims[a] as f64 - 1.0) * spacing[a]);
    Grid::axis_aligned(dims, spacing, origin)
}
