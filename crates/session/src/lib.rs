//! A case and time to snapshots: the scripted insertion of a catheter, the live session ([`live`]), and what deforms.
//!
//! No clock, no files, no sockets: the caller measures time and writes results. Given the same case and settings, every
//! frame is the same bit for bit, whatever the number of threads.

mod deformation;
mod insertion;
pub mod live;
mod loads;
mod schedule;
mod septa;
mod sound;
mod tissue_model;
mod volumes;

pub use deformation::{DeformedSampler, Follower};
pub use insertion::{CATHETER_MM, Csf, Frame, FrameSettings, Insertion, InsertionSettings, Mode};
pub use loads::{KPA_PER_MMHG, LoadError, Loads};
pub use sound::SOUND;
pub use tissue_model::{BURR_HOLE_RADIUS_MM, HELD_BASE_MM, Materials, ModelSettings, Skull};
pub use volumes::StructureVolumes;

use monro_geometry::EmbeddingError;
use monro_guidance::NeedleError;
use monro_tissue::ModelError;
use thiserror::Error;

/// Why a session could not be started.
#[derive(Debug, Error)]
pub enum SessionError {
    /// The speed is not usable.
    #[error("a speed of {0} mm/s cannot be simulated; give one between {min} and {max} mm/s", min = insertion::SPEED_MM_S.start(), max = insertion::SPEED_MM_S.end())]
    Speed(f64),
    /// The catheter is not usable.
    #[error("a catheter of {0} mm cannot be simulated; give one of {min} to {max} mm", min = insertion::DIAMETER_MM.start(), max = insertion::DIAMETER_MM.end())]
    Diameter(f64),
    /// The mesh cannot be simulated.
    #[error("the tetrahedra of the case cannot be simulated: {0}")]
    Model(#[from] ModelError),
    /// A surface cannot be bound to the mesh.
    #[error("a surface of the case cannot be bound to its tetrahedra: {0}")]
    Embedding(#[from] EmbeddingError),
    /// The plan gives no needle pose.
    #[error(transparent)]
    Needle(#[from] NeedleError),
    /// What is to be done to the fluid, or gravity, cannot be.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The path begins in the tissue, so there is no place where it goes in.
    #[error(
        "the entry lies in the brain, {deep_mm:.1} mm along the path under its surface; move it out, best to the skin"
    )]
    EntryInside {
        /// From the surface along the path to the entry, mm.
        deep_mm: f64,
    },
    /// The path of another catheter is not usable.
    #[error("catheter {number} beside the planned one: {source}")]
    Beside {
        /// Its number, from 1.
        number: usize,
        /// Why.
        source: Box<Self>,
    },
    /// Two catheters would lie in each other.
    #[error(
        "the paths of two catheters of {diameter_mm} mm come within {apart_mm:.1} mm of each other, axis to axis; move one by a diameter"
    )]
    Meet {
        /// Of both.
        diameter_mm: f64,
        /// Between their axes.
        apart_mm: f64,
    },
    /// The path never meets the tissue.
    #[error("the path of {length_mm:.1} mm does not meet the brain; is it of this patient?")]
    PathMisses {
        /// Length of the path.
        length_mm: f64,
    },
}
