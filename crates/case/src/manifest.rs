//! `case.toml`.

use serde::{Deserialize, Serialize};

/// Version of the case format; a newer one is refused.
pub const SCHEMA: u32 = 1;

/// The manifest of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Format version, [`SCHEMA`].
    pub schema: u32,
    /// The program and version that wrote the case.
    pub generator: String,
    /// Always the sentence that this is for research only.
    pub notice: String,
    /// Name of the patient in this case; never the real one.
    pub pseudonym: String,
    /// `left` or `right`: side of the plan.
    pub side: String,
    /// Angle between the planned path and the surface of the skull where it crosses it, degrees: 90 is perpendicular.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skull_angle_deg: Option<f64>,
    /// Where the images came from.
    pub source: Source,
    /// What a user of the case should know: doubts of the segmentation, cut scans, resampling.
    #[serde(default)]
    pub findings: Vec<String>,
    /// How many of them, the first ones, tell of the scan; a rebuild from corrected labels keeps those.
    #[serde(default)]
    pub scan_findings: usize,
    /// Tetrahedra that were asked for, if known; the mesh has nearly as many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elements: Option<usize>,
    /// How far the automatic segmentation could be trusted that the labels began with; a rebuild from corrected labels
    /// keeps it. Empty for labels made elsewhere.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub confidence: Vec<Confidence>,
    /// Where it had to guess the border of a ventricle, largest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<DoubtfulSpot>,
    /// The files and their hashes.
    pub files: Vec<FileEntry>,
}

/// Where the images of a case came from, without anything that names the patient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// `DICOM`, `NIfTI`, `NRRD`, `MetaImage` or `phantom`.
    pub format: String,
    /// A short description of the series.
    pub series: String,
    /// Columns, rows, slices of the volume in HU.
    pub dims: [usize; 3],
    /// Voxel spacing, mm.
    pub spacing_mm: [f64; 3],
}

/// How far the automatic segmentation of a structure could be trusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confidence {
    /// Name of the structure, as `left_lateral_ventricle`.
    pub structure: String,
    /// Expected Dice coefficient against a careful hand, 0 to 1.
    pub expected_dice: f64,
}

/// A part of a border that the scan does not show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DoubtfulSpot {
    /// Name of the structure that it bounds.
    pub structure: String,
    /// Its middle, LPS mm.
    pub at_mm: [f64; 3],
    /// Its area, mm2.
    pub area_mm2: f64,
}

/// One file of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileEntry {
    /// Its name inside the folder.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of its content, lower-case hexadecimal.
    pub sha256: String,
}
