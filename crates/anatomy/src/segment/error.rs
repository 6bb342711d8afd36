//! What can keep a scan from being segmented, and the way out.

use super::regrid::Geometry;
use monro_geometry::GridError;
use thiserror::Error;

/// Why no segmentation was made. Every message names what is missing; labels made by hand always remain possible.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SegmentError {
    /// Hardly any bone: not a head, or not in HU.
    #[error(
        "no skull: only {bone_ml:.0} mL above {threshold:.0} HU (at least {needed_ml:.0} mL expected); \
         check that the scan is a head CT in HU, or give labels with --labels FILE or the editor"
    )]
    NoSkull {
        /// Volume above the threshold, mL.
        bone_ml: f64,
        /// The threshold, HU.
        threshold: f64,
        /// Volume that a skull has at least, mL.
        needed_ml: f64,
    },
    /// No space inside the skull that could hold a brain.
    #[error(
        "no intracranial space: the largest enclosed soft-tissue region has {found_ml:.0} mL (at least {needed_ml:.0} mL \
         expected); is the head cut off? Give labels with --labels FILE or the editor"
    )]
    NoCavity {
        /// Volume found, mL.
        found_ml: f64,
        /// Volume needed, mL.
        needed_ml: f64,
    },
    /// More space inside the skull than any head has.
    #[error(
        "the space inside the skull has {ml:.0} ml and measures {:.0} x {:.0} x {:.0} mm (width, length, height), at most \
         {most_ml:.0} ml are possible: is the spacing in the header right? Correct it, or convert the scan again",
        extent_mm[0], extent_mm[1], extent_mm[2]
    )]
    TooLarge {
        /// Volume found, mL.
        ml: f64,
        /// The most that a head has, mL.
        most_ml: f64,
        /// Width, length and height, mm.
        extent_mm: [f64; 3],
    },
    /// A side of the head is missing.
    #[error(
        "the head is cut at the patient's {side}: the brain reaches that end of the scan over {area_cm2:.0} cm2 (at most \
         {most_cm2:.0} cm2 are taken), so midline, landmarks and the sides of the ventricles cannot be known. Take a scan of \
         the whole head, or give labels and path with --labels FILE and --plan FILE.mrk.json"
    )]
    SideCut {
        /// "left" or "right" (the patient's).
        side: &'static str,
        /// Area of brain at the end of the scan, cm2.
        area_cm2: f64,
        /// The most that is taken, cm2.
        most_cm2: f64,
    },
    /// The ventricles lie as in a head that is turned about.
    #[error(
        "the head seems to lie {way} in the scan's own axes: so the ventricles fit their usual course by {score:.2} of 1, as \
         the header says only by {as_told:.2}. Is the orientation in the header wrong? Convert the scan again; labels of your \
         own are taken as they are with --labels FILE"
    )]
    Turned {
        /// How it lies.
        way: String,
        /// Fit of the ventricles so, 1 is perfect.
        score: f64,
        /// Their fit as the header says.
        as_told: f64,
    },
    /// Brain and cerebrospinal fluid cannot be told apart.
    #[error(
        "no contrast between brain ({brain:.1} HU) and the darkest fluid near the ventricles ({csf:.1} HU); contrast \
         agent, blood or a wrong window? Give labels with --labels FILE or the editor"
    )]
    NoContrast {
        /// Mode of the brain, HU.
        brain: f64,
        /// Dark mode, HU.
        csf: f64,
    },
    /// A lateral ventricle was not found.
    #[error(
        "no {side} lateral ventricle: {found_ml:.2} mL of fluid where it should lie (at least {needed_ml:.1} mL \
         expected); slit or displaced ventricles, and those of a head turned by more than 45 degrees, must be given with --labels \
         FILE or the editor"
    )]
    NoVentricle {
        /// "left" or "right" (the patient's).
        side: &'static str,
        /// Volume found, mL.
        found_ml: f64,
        /// Volume needed, mL.
        needed_ml: f64,
    },
    /// A given label volume does not lie over the scan.
    #[error(
        "the labels cover {covered:.0} % of the scan's grid, and {labelled:.0} % of what is labelled lie in it. Scan: {scan}. \
         Labels: {labels} (LPS). Export them again in the scan's own space"
    )]
    LabelsElsewhere {
        /// Part of the scan's grid under the label volume, percent.
        covered: f64,
        /// Part of what is labelled that lies in the scan, percent.
        labelled: f64,
        /// The scan's geometry.
        scan: Box<Geometry>,
        /// The label volume's geometry.
        labels: Box<Geometry>,
    },
    /// A given label volume has a number that no structure has.
    #[error("label {label} ({voxels} voxels) names no structure; known are 0 outside to 7 third_ventricle")]
    UnknownLabel {
        /// The number.
        label: u8,
        /// How many voxels carry it.
        voxels: usize,
    },
    /// A given label volume lacks a structure that a case needs.
    #[error("the labels have no voxel of {name} (label {label}); draw it in the editor or export it too")]
    EmptyStructure {
        /// Name of the structure.
        name: &'static str,
        /// Its number.
        label: u8,
    },
    /// A given label volume lacks planes in the middle of the head.
    #[error(
        "the labels have nothing within the skull on the planes {axis} = {first} to {last}, with brain on both sides of them (around \
         {:.0} {:.0} {:.0} mm LPS): a series that lacks slices, or labels drawn on some slices only? Fill the planes between, in the \
         editor or where they come from",
        place_mm[0], place_mm[1], place_mm[2]
    )]
    EmptyPlanes {
        /// Axis of the scan's grid across the planes.
        axis: char,
        /// The first of them, from 0.
        first: usize,
        /// The last of them.
        last: usize,
        /// The middle of the first, LPS mm.
        place_mm: [f64; 3],
    },
    /// A grid could not be made.
    #[error(transparent)]
    Grid(#[from] GridError),
}
