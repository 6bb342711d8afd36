//! Why there is no mesh.

use super::improve::MOST_LABELS;
use super::report::{
    BadShapes, Boundary, ClosedGaps, InterfaceDistance, LARGEST_DIHEDRAL, LEAST_DIHEDRAL, LEAST_RADIUS_RATIO,
    MOST_VOLUME_ERROR, SurfaceReport,
};
use super::torn::Torn;
use monro_geometry::{Overlap, SelfCrossing};
use std::fmt;
use thiserror::Error;

/// What helps parts that the fields do not keep.
const FINER: &str = "resample the labels to voxels of half the size, or thicken them by a voxel";
/// What helps labels thinner than their elements.
pub(super) const COARSE: &str =
    "a label thinner than the elements there needs to be among those to be fine around, or more elements";
/// What helps surfaces that are not like the labels'.
const WAY_OUT: &str = "a part thinner than two voxels is lost at any number of elements: thicken it, or resample the labels to voxels of half the size; join or part voxels that share only an edge or a corner; elsewhere be fine around the label, ask for more elements or smooth the labels";

/// A place in words.
pub(super) fn place([x, y, z]: [f64; 3]) -> String {
    format!("({x:.1}, {y:.1}, {z:.1}) mm")
}

/// Labels in words.
pub(super) fn listed(labels: &[u16]) -> String {
    match labels {
        [] => "nothing but the label 0".into(),
        [label] => format!("the label {label}"),
        _ => format!("the labels {}", labels.iter().map(u16::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Why there is no mesh.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeshError {
    /// None of the labels to keep occurs.
    #[error(
        "none of the labels {keep:?} occurs in the volume of {voxels} voxels, which holds {}; check the labels to keep",
        listed(present)
    )]
    Empty {
        /// Labels asked for.
        keep: Vec<u16>,
        /// Voxels looked at.
        voxels: usize,
        /// Labels that occur, but 0.
        present: Vec<u16>,
    },
    /// Everything to mesh is thinner than the fields' cells.
    #[error("the {voxels} voxel(s) to mesh, one at {}, are too thin or too small: nothing is left of them on cells of {step:.2} mm; {FINER}", place(*at))]
    TooThin {
        /// Voxels to mesh.
        voxels: usize,
        /// One of them, LPS mm.
        at: [f64; 3],
        /// Edge of the cells, mm.
        step: f64,
    },
    /// Everything to mesh is thinner than the cells that so few elements have.
    #[error("{wanted} elements are too few: nothing is left of the {voxels} voxel(s) to mesh, one at {}, in cells from {cell:.1} mm on; ask for more", place(*at))]
    TooFew {
        /// Elements asked for.
        wanted: usize,
        /// Voxels to mesh.
        voxels: usize,
        /// One of them, LPS mm.
        at: [f64; 3],
        /// Edge of the finest cells, mm.
        cell: f64,
    },
    /// A label has no element.
    #[error("label {label} has no element: its {voxels} voxel(s), one at {}, are too thin or too small for this mesh; {FINER}, ask for more elements around it, or leave it out", place(*at))]
    Lost {
        /// The label.
        label: u16,
        /// Its voxels.
        voxels: usize,
        /// One of them, LPS mm.
        at: [f64; 3],
    },
    /// A surface is farther from that of the labels than elements are coarse there.
    #[error("label {label}: {interface}")]
    Far {
        /// The label.
        label: u16,
        /// How far, and where.
        interface: InterfaceDistance,
    },
    /// Holes, tunnels or slits in what is meshed are too thin for smooth surfaces.
    #[error("{0}")]
    ClosedGaps(ClosedGaps),
    /// Thin parts of a label are lost.
    #[error("label {label}: {torn}")]
    Torn {
        /// The label.
        label: u16,
        /// What is lost.
        torn: Torn,
    },
    /// Elements lie in others.
    #[error("{}", overlap_words(.0))]
    Overlap(Overlap),
    /// The outer surface passes through itself.
    #[error("{}", crossing_words(.0))]
    SelfCrossing(SelfCrossing),
    /// More labels than the mesher tells apart.
    #[error("{0} labels to mesh, but at most {MOST_LABELS} are told apart; name those to mesh, or merge some")]
    TooManyLabels(usize),
    /// An option makes no sense.
    #[error("{name} is {value}; it must be {rule}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        rule: &'static str,
    },
    /// A surface is open or meets itself in a point or an edge.
    #[error("the surface of {surface} is not two-manifold at {}; {WAY_OUT}", place(*at))]
    Topology {
        /// Whose.
        surface: Boundary,
        /// Where, LPS mm.
        at: [f64; 3],
    },
    /// A surface has another topology than the labels.
    #[error("the surface of {surface} has Euler number {} in {} piece(s), that of the smoothed voxels {} in {}; look near {}; {WAY_OUT}", report.euler, report.surfaces, report.euler_labels, report.surfaces_labels, place(*at))]
    Euler {
        /// Whose.
        surface: Boundary,
        /// Both topologies.
        report: Box<SurfaceReport>,
        /// Where the two surfaces differ most in kind: [`SurfaceReport::differs_at`].
        at: [f64; 3],
    },
    /// Elements are of bad shape.
    #[error("{} element(s) miss the bounds of shape (dihedral angles {:.1} to {:.1} degrees, bad is below {LEAST_DIHEDRAL:.0} or above {LARGEST_DIHEDRAL:.0}; radius ratio {:.3}, bad is below {LEAST_RADIUS_RATIO}), the worst at {}; smooth the labels there, merge thin ones with what lies around them, or ask for more elements", bad.count, dihedral[0], dihedral[1], radius_ratio, place(bad.worst_at))]
    Shape {
        /// How many, and where the worst is.
        bad: BadShapes,
        /// Smallest and largest dihedral angle, degrees.
        dihedral: [f64; 2],
        /// Smallest radius ratio.
        radius_ratio: f64,
    },
    /// Elements without a volume are left.
    #[error("{count} element(s) without a volume or turned inside out are left, one at {}; ask for another number of elements, or smooth the labels there", place(*at))]
    Inverted {
        /// How many.
        count: usize,
        /// A corner of one, LPS mm.
        at: [f64; 3],
    },
    /// The volume of a label is off.
    #[error("label {label} has {:+.1} % of its volume ({:.0} % allowed); {COARSE}", error * 100.0, MOST_VOLUME_ERROR * 100.0)]
    Volume {
        /// The label.
        label: u16,
        /// Volume of its elements over that of its voxels, less 1.
        error: f64,
    },
    /// The count cannot be met.
    #[error(
        "{wanted} elements were asked for, and of the sizes that were tried none came nearer than {found}: thin labels take more than their share, and counts between may not be met either; change the grading or the labels to be fine around, leave out thin ones, or ask for more"
    )]
    Count {
        /// Elements wanted.
        wanted: usize,
        /// Elements of the nearest mesh found.
        found: usize,
    },
}

/// Of the outer surface of a mesh, and what that comes from.
pub(super) fn crossing_words(crossing: &SelfCrossing) -> String {
    overlap_words(&format!("the outer {crossing}"))
}

/// Says what elements in others, or a surface through itself, come from.
pub(super) fn overlap_words(overlap: &impl fmt::Display) -> String {
    format!(
        "{overlap}; walls that face each other across a narrow gap pass through each other there, labels meet along an edge of voxels \
         alone, or more labels meet than elements of this size can keep apart: ask for more elements, widen or close the gap in \
         the labels, and join or part voxels that share only an edge or a corner"
    )
}
