//! From voxels to a patient model: labels, landmarks, closed surfaces, graded tetrahedra; and the digital phantoms.
//!
//! Works on volumes in memory and knows no files. Fields are in HU, positions in LPS mm.

pub mod compare;
pub mod desk;
pub mod edit;
mod image;
pub mod landmarks;
pub mod livewire;
pub mod phantom;
pub mod segment;
pub mod shapes;
pub mod surface;
pub mod tetra;
