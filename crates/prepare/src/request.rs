//! What to make of a scan.

use monro_geometry::{Patient, Point, Volume};
use monro_guidance::Side;

/// Elements of the simulation mesh when nothing else is asked: the paper's brain model.
pub const DEFAULT_ELEMENTS: usize = 37_336;

/// What to make of a scan.
#[derive(Debug, Clone)]
pub struct Request {
    /// Wanted number of tetrahedra.
    pub elements: usize,
    /// Side of the entry; `None`: that of the plan, or right.
    pub side: Option<Side>,
    /// Labels (numbers of [`monro_geometry::Structure`]) instead of the automatic segmentation, on any grid over the scan.
    pub labels: Option<Volume<u16>>,
    /// Entry and target, LPS mm, instead of the automatic plan.
    pub path: Option<[Point<Patient>; 2]>,
}

impl Default for Request {
    fn default() -> Self {
        Self { elements: DEFAULT_ELEMENTS, side: None, labels: None, path: None }
    }
}
