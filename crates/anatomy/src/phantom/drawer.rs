//! The paper's phantom (its Figure 5): a printed head with its own skin, and in it a drawer of gelatin with a container
//! of fluid.
//!
//! Ours differs where a program must do what a hand did in the paper: the drawer's wall is as dense as bone, so that it
//! is found as a skull; the container has no wall of its own; it has two chambers with a channel below them, so that
//! there is a left and a right and a place for the target (the chamber's opening into the channel).

use super::head::HeadModel;
use super::paint::{Model, Painter, scan};
use super::shapes::{At, at, folded, rounded_box};
use super::{Head, HeadOptions, Phantom, grid_around, landmarks};
use monro_geometry::{Affine, GridError, Patient, Structure};

/// What a drawer phantom shall be like.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawerOptions {
    /// Chooses the head's skin, its posture and the noise.
    pub seed: u64,
    /// Voxel spacing, mm.
    pub spacing_mm: [f64; 3],
    /// Standard deviation of the noise, HU.
    pub noise_hu: f64,
    /// Turns about the patient's x, y and z axes, degrees. `None` leaves it to the seed (up to 8 each).
    pub turn_deg: Option<[f64; 3]>,
}

impl Default for DrawerOptions {
    fn default() -> Self {
        Self { seed: 1, spacing_mm: [0.9, 0.9, 1.25], noise_hu: 6.0, turn_deg: None }
    }
}

/// Thickness of the printed head's closed shell, mm.
const SHELL: f64 = 3.0;
/// Thickness of the drawer's wall, mm.
const WALL: f64 = 4.0;
/// Middle of the left chamber's opening into the channel.
const OPENING: At = at(5.0, -6.0, -4.0);

struct Drawer {
    head: HeadModel,
}

/// Makes a drawer phantom. The gelatin is labelled brain, the chambers left and right lateral ventricle, the channel
/// third ventricle, the wall skull, the printed head scalp.
///
/// # Errors
/// A spacing that is not positive and finite, or so small that the grid overflows.
pub fn drawer(options: &DrawerOptions) -> Result<Phantom, GridError> {
    let head = HeadModel::new(&HeadOptions {
        seed: options.seed,
        turn_deg: options.turn_deg,
        head_rest: false,
        ..HeadOptions::default()
    });
    let grid = grid_around(head.patient(at(0.0, 6.0, 0.0)), [200.0, 236.0, 206.0], options.spacing_mm)?;
    let model = Drawer { head };
    let (ct, labels) = scan(&model, grid, (options.seed, options.noise_hu))?;
    let landmarks = landmarks::find(&model.head, OPENING);
    Ok(Phantom { name: format!("drawer-{}", options.seed), ct, labels, landmarks })
}

impl Model for Drawer {
    fn to_model(&self) -> &Affine<Head, Patient> {
        self.head.to_model()
    }

    fn blur_scale(&self) -> f64 {
        self.head.blur_scale()
    }

    fn sample(&self, p: At, blur: f64) -> (Painter, f64) {
        let mut paint = Painter::new(blur);
        let skin = self.head.skin_at(p);
        if skin > blur {
            return (paint, skin);
        }
        let q = folded(p);
        let gelatin = rounded_box(q, at(0.0, 12.0, 10.0), [50.0, 61.0, 45.0], 22.0);
        paint.layer(skin, 60.0, Structure::Scalp);
        // A printer fills a solid body sparsely under a closed shell.
        paint.tint(skin + SHELL, -150.0);
        paint.layer(gelatin - WALL, 900.0, Structure::Skull);
        paint.layer(gelatin, 28.0, Structure::Brain);
        let side = if p.x > 0.0 { Structure::LeftLateralVentricle } else { Structure::RightLateralVentricle };
        paint.layer(rounded_box(q, at(13.0, 0.0, 6.0), [10.0, 24.0, 12.0], 4.0), 5.0, side);
        let channel = rounded_box(q, at(0.0, 2.0, -9.0), [7.0, 14.0, 5.0], 2.0);
        paint.layer(channel, 5.0, Structure::ThirdVentricle);
        (paint, 0.0)
    }
}
