//! Which elements share which faces and points.

pub(super) use monro_geometry::{
    Incidence, NO_TET as OUT, TET_EDGES as EDGES, TET_FACES as FACES, tet_neighbours as neighbours,
};
