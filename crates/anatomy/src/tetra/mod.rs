//! Graded tetrahedra from a label volume.
