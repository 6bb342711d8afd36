//! What to make of a scan.

use monro_anatomy::segment::Segmentation;
use monro_geometry::{Patient, Point, Volume};
use monro_guidance::Side;

/// Elements of the simulation mesh when nothing else is asked: the paper's brain model.
pub const DEFAULT_ELEMENTS: usize = 37_336;

/// Where the labels of a scan come from.
#[derive(Debug, Clone, Default)]
pub enum Labels {
    /// Found by the automatic segmentation.
    #[default]
    Automatic,
    /// Numbers of [`monro_geometry::Structure`], made elsewhere, on any grid over the scan.
    Given(Volume<u16>),
    /// Those of this scan, with all that is known of them.
    Known(Segmentation),
}

/// What to make of a scan.
#[derive(Debug, Clone)]
pub struct Request {
    /// Wanted number of tetrahedra.
    pub elements: usize,
    /// Side of the entry; `None`: that of the plan, or right.
    pub side: Option<Side>,
    /// Where its labels come from.
    pub labels: Labels,
    /// Entry and target, LPS mm, instead of the automatic plan.
    pub path: Option<[Point<Patient>; 2]>,
}

impl Default for Request {
    fn default() -> Self {
        Self { elements: DEFAULT_ELEMENTS, side: None, labels: Labels::Automatic, path: None }
    }
}
