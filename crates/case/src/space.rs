//! The patient axes that a mesh file names.
//!
//! 3D Slicer writes `SPACE=LPS` or `SPACE=RAS` into the comments of PLY and OBJ files, into the header of STL files and,
//! as a field array `SPACE`, into VTU files, and reads them there (`vtkMRMLModelStorageNode`). Files without these words
//! are LPS by convention, there as here.

use monro_geometry::{Patient, Point};

/// Axes of the coordinates in a file, both in mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// x to the patient's left, y to the back, z to the head: what everything in memory is in.
    Lps,
    /// x to the right, y to the front, z to the head.
    Ras,
}

impl Space {
    /// What `SPACE=...` in a header or comment says, if it is there.
    pub(crate) fn of_header(text: &str) -> Option<Self> {
        if text.contains("SPACE=RAS") {
            return Some(Self::Ras);
        }
        text.contains("SPACE=LPS").then_some(Self::Lps)
    }

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lps => "LPS",
            Self::Ras => "RAS",
        }
    }

    /// Brings points from these axes to LPS. It is a half turn about z, so that the inside of a mesh stays the inside.
    pub fn to_lps(self, points: &mut [Point<Patient>]) {
        if self == Self::Ras {
            for p in points {
                (p.x, p.y) = (-p.x, -p.y);
            }
        }
    }
}
