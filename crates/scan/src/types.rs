//! What reading and inspecting a scan give.

use monro_geometry::{Grid, Patient, Vector, Volume};

/// File format of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say all")]
pub enum Format {
    Dicom,
    Nifti,
    Nrrd,
    MetaImage,
}

impl Format {
    /// Name for reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dicom => "DICOM",
            Self::Nifti => "NIfTI-1",
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
        }
    }
}

/// Choices of the caller.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Take this series: its UID, or the short id that [`crate::inspect`] shows. `None`: the best head CT.
    pub series_uid: Option<String>,
    /// Take the volume as it is, without [`crate::head_extent_check`] and without looking for padding: for phantoms that are
    /// no heads, and for the CT of a case.
    pub any_size: bool,
}

/// A head CT, ready to be used.
#[derive(Debug, Clone)]
pub struct Scan {
    /// HU on an even rectangular grid, LPS mm.
    pub volume: Volume<i16>,
    /// Where it comes from, without the patient's identity.
    pub source: Source,
    /// A name for the case, from a hash of the voxels: the same scan always gets the same one, and no name, id or UID
    /// can be guessed from it.
    pub pseudonym: String,
    /// What was changed, assumed or looks odd.
    pub warnings: Vec<String>,
    /// A sentence with numbers when the scan was resampled onto an even grid.
    pub resampled: Option<String>,
}

/// Where a scan comes from; nothing here identifies the patient.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Source {
    /// File format.
    pub format: Format,
    /// Short hash of the series' UID (DICOM), empty for other formats.
    pub series: String,
    /// The series' description (DICOM), left out when it contains the patient's name or id.
    pub description: Option<String>,
    /// Modality, "CT"; other formats do not say.
    pub modality: Option<String>,
    /// Manufacturer and model.
    pub scanner: Option<String>,
    /// Convolution kernel.
    pub kernel: Option<String>,
    /// Tube voltage, kVp.
    pub kvp: Option<f64>,
    /// Slice thickness as the header says, mm.
    pub slice_thickness_mm: Option<f64>,
    /// Angle between the slices' normal and the direction in which they are stacked, degrees.
    pub tilt_deg: f64,
    /// Columns, rows, slices as stored.
    pub native_dims: [usize; 3],
    /// Spacing as stored, mm; along the stack, the mean along the normal.
    pub native_spacing_mm: [f64; 3],
    /// How the slices lie: "axial", "coronal", "sagittal" or "oblique".
    pub orientation: &'static str,
}

impl Source {
    /// A source of which only grid and format are known.
    pub(crate) fn of_grid(format: Format, grid: &Grid) -> Self {
        let column = |a| Vector::<Patient>::from_array(grid.patient_from_voxel().linear.column(a));
        let normal = column(0).cross(column(1));
        let tilt = normal.angle(column(2));
        Self {
            format,
            series: String::new(),
            description: None,
            modality: None,
            scanner: None,
            kernel: None,
            kvp: None,
            slice_thickness_mm: None,
            tilt_deg: tilt.min(core::f64::consts::PI - tilt).to_degrees(),
            native_dims: grid.dims(),
            native_spacing_mm: grid.spacing(),
            orientation: orientation(normal),
        }
    }
}

/// Names the plane of slices with this normal; within 35 degrees, since heads are scanned tilted.
pub(crate) fn orientation(normal: Vector<Patient>) -> &'static str {
    let Some(n) = normal.normalized() else { return "oblique" };
    let limit = 35f64.to_radians().cos();
    match n.to_array().map(|c| c.abs() >= limit) {
        [_, _, true] => "axial",
        [_, true, _] => "coronal",
        [true, _, _] => "sagittal",
        _ => "oblique",
    }
}

/// One series of a folder, or the one volume of a file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SeriesSummary {
    /// What is known of it.
    pub source: Source,
    /// Files, or slices of a multi-frame file.
    pub images: usize,
    /// Smallest and largest distance of neighbouring slices along their normal, mm.
    pub step_mm: [f64; 2],
    /// Why it cannot be taken; `None` when it can.
    pub refusal: Option<String>,
}

/// What [`crate::inspect`] found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Inspection {
    /// All series, in a fixed order.
    pub series: Vec<SeriesSummary>,
    /// Index of the series that [`crate::read`] would take.
    pub chosen: Option<usize>,
    /// Why that one, or why none.
    pub reason: String,
    /// What looks odd.
    pub warnings: Vec<String>,
}
