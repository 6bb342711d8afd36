//! Which elements share which faces and points.

pub(super) use monro_geometry::{Incidence, NO_TET as OUT, tet_neighbours as neighbours};

/// Corners of the face opposite to each corner.
pub(super) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
