//! From the tracker to the patient: landmarks, surface, and how wrong the result is expected to be.

mod agreement;
mod ambiguity;
mod contradiction;
mod landmarks;
mod naming;
mod normal;
mod recheck;
mod surface;
#[cfg(test)]
mod tests;
mod tre;

pub use agreement::Agreement;
pub use ambiguity::Ambiguity;
pub use contradiction::{Contradiction, Suspicion};
pub use landmarks::{
    Landmark, LandmarkRegistration, LandmarkResidual, Pair, RegistrationError, register_landmarks, rigid_from_pairs,
};
pub use recheck::{Recheck, recheck};
pub use surface::{RefineOptions, Refined, Surface, SurfaceError, SurfaceResidual, SurfaceSample, refine_on_surface};
pub use tre::PoseUncertainty;
