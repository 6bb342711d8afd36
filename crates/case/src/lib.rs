//! The folder of a prepared patient, and the mesh and markup formats in it.
//!
//! A case is plain files that ParaView and 3D Slicer open: `case.toml` (manifest with SHA-256 of every file),
//! `ct.nii.gz`, `labels.nii.gz`, `skin.ply`, `brain.ply`, `ventricles.ply`, `tets.vtu`, `plan.mrk.json`,
//! `landmarks.mrk.json`. Image files pass through here as bytes: this crate does not decode them.
//!
//! The codecs ([`vtu`], [`msh`], [`ply`], [`stl`], [`obj`], [`glb`], [`markups`]) work on bytes and know no files; [`Case`] and [`Staging`] do.

mod case;
pub mod glb;
mod manifest;
pub mod markups;
pub mod msh;
pub mod obj;
mod output;
pub mod ply;
mod precision;
mod space;
mod staging;
pub mod stl;
pub mod vtu;

pub use case::{CASE, Case, CaseError, CaseFiles, sha256};
pub use manifest::{Confidence, DoubtfulSpot, FileEntry, Manifest, SCHEMA, Source};
pub use output::{OutputError, OutputKind, check_output, check_output_file, nothing_known};
pub use precision::Rounding;
pub use space::Space;
pub use staging::{Staging, StagingError};
