//! A volume as a series of CT Image Storage files.

use crate::hash;
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use monro_geometry::{Patient, Vector, Volume};
use std::fs;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Columns and rows may miss the right angle by this much, as a cosine.
const SKEW: f64 = 1e-6;

/// What a written series says about itself. Equal contents give equal files, byte by byte.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesMeta {
    /// All UIDs are made from this.
    pub seed: u64,
    /// Patient's name, "Family^Given". Texts are cut to what DICOM allows: 64 characters, the kernel 16.
    pub patient_name: String,
    /// Patient's id.
    pub patient_id: String,
    /// What the series is called.
    pub description: String,
    /// Who made it.
    pub manufacturer: String,
    /// Convolution kernel.
    pub kernel: String,
    /// Tube voltage, kVp.
    pub kvp: f64,
    /// Series number.
    pub number: u16,
}

impl Default for SeriesMeta {
    fn default() -> Self {
        Self {
            seed: 0,
            patient_name: "Nobody^Synthetic".into(),
            patient_id: "NOBODY".into(),
            description: "Digital phantom".into(),
            manufacturer: "Monro".into(),
            kernel: "SOFT".into(),
            kvp: 120.0,
            number: 1,
        }
    }
}

/// Why a series could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// A file or folder could not be made.
    #[error("{}: cannot be written: {reason}", file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// What the system or the encoder said.
        reason: String,
    },
    /// DICOM slices are stacks of perpendicular columns and rows of at most 65535 pixels.
    #[error("a grid of {dims:?} voxels with axes that miss the right angle by a cosine of {cosine} is no DICOM series")]
    Grid {
        /// Columns, rows, slices.
        dims: [usize; 3],
        /// Largest cosine between two index axes.
        cosine: f64,
    },
}

/// Writes one file per slice (`0001.dcm` and on), explicit VR little endian, into a folder that is made if it is
/// missing; gives the files. Values are exact; positions are exact to the 16 characters of a DICOM decimal.
///
/// # Errors
/// A grid that is not rectangular or too large; a file that cannot be written.
pub fn write_series(volume: &Volume<i16>, dir: &Path, meta: &SeriesMeta) -> Result<Vec<PathBuf>, WriteError> {
    let writer = Writer::new(volume, meta)?;
    let failed = |file: &Path, reason: String| WriteError::Unwritable { file: file.to_path_buf(), reason };
    fs::create_dir_all(dir).map_err(|e| failed(dir, e.to_string()))?;
    let mut files = Vec::new();
    for k in 0..volume.grid().dims()[2] {
        let path = dir.join(format!("{:04}.dcm", k + 1));
        let table = FileMetaTableBuilder::new()
            .media_storage_sop_class_uid(uids::CT_IMAGE_STORAGE)
            .media_storage_sop_instance_uid(writer.uid("instance", k + 1))
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN);
        let object = writer.slice(k).with_meta(table).map_err(|e| failed(&path, super::image::chain(&e)))?;
        object.write_to_file(&path).map_err(|e| failed(&path, super::image::chain(&e)))?;
        files.push(path);
    }
    Ok(files)
}

struct Writer<'a> {
    volume: &'a Volume<i16>,
    meta: &'a SeriesMeta,
    axes: [Vector<Patient>; 3],
    intercept: i32,
}

impl<'a> Writer<'a> {
    fn new(volume: &'a Volume<i16>, meta: &'a SeriesMeta) -> Result<Self, WriteError> {
        let grid = volume.grid();
        let axes = [0, 1, 2].map(|a| Vector::from_array(grid.patient_from_voxel().linear.column(a)));
        let cosine = |a: usize, b: usize| (axes[a].dot(axes[b]) / (axes[a].norm() * axes[b].norm())).abs();
        let worst = cosine(0, 1).max(cosine(0, 2)).max(cosine(1, 2));
        let dims = grid.dims();
        if worst > SKEW || dims[0] > 65535 || dims[1] > 65535 {
            return Err(WriteError::Grid { dims, cosine: worst });
        }
        // Stored values are unsigned, as scanners write them: the lowest HU becomes 0.
        let lowest = volume.data().iter().copied().min().unwrap_or(0);
        Ok(Self { volume, meta, axes, intercept: i32::from(lowest).min(-1024) })
    }

    /// A UID, always the same for the same seed, series and its name, role and number.
    fn uid(&self, role: &str, number: usize) -> String {
        let m = self.meta;
        hash::uid(&format!("monro {} {} {} {role} {number}", m.seed, m.number, m.description))
    }

    fn slice(&self, k: usize) -> InMemDicomObject {
        let mut o = InMemDicomObject::new_empty();
        self.patient_and_study(&mut o);
        self.series(&mut o);
        self.plane(&mut o, k);
        self.pixels(&mut o, k);
        o
    }

    fn patient_and_study(&self, o: &mut InMemDicomObject) {
        let m = self.meta;
        text(o, tags::SPECIFIC_CHARACTER_SET, VR::CS, "ISO_IR 192");
        text(o, tags::PATIENT_NAME, VR::PN, &plain(&m.patient_name, 64));
        text(o, tags::PATIENT_ID, VR::LO, &plain(&m.patient_id, 64));
        for (tag, vr) in [
            (tags::PATIENT_BIRTH_DATE, VR::DA),
            (tags::PATIENT_SEX, VR::CS),
            (tags::STUDY_DATE, VR::DA),
            (tags::STUDY_TIME, VR::TM),
            (tags::REFERRING_PHYSICIAN_NAME, VR::PN),
            (tags::STUDY_ID, VR::SH),
            (tags::ACCESSION_NUMBER, VR::SH),
            (tags::POSITION_REFERENCE_INDICATOR, VR::LO),
        ] {
            text(o, tag, vr, "");
        }
        text(o, tags::STUDY_INSTANCE_UID, VR::UI, &self.uid("study", 0));
        text(o, tags::BODY_PART_EXAMINED, VR::CS, "HEAD");
    }

    fn series(&self, o: &mut InMemDicomObject) {
        let m = self.meta;
        text(o, tags::MODALITY, VR::CS, "CT");
        text(o, tags::SERIES_INSTANCE_UID, VR::UI, &self.uid("series", 0));
        text(o, tags::SERIES_NUMBER, VR::IS, &m.number.to_string());
        text(o, tags::SERIES_DESCRIPTION, VR::LO, &plain(&m.description, 64));
        text(o, tags::PATIENT_POSITION, VR::CS, "HFS");
        text(o, tags::FRAME_OF_REFERENCE_UID, VR::UI, &self.uid("frame", 0));
        text(o, tags::MANUFACTURER, VR::LO, &plain(&m.manufacturer, 64));
        text(o, tags::CONVOLUTION_KERNEL, VR::SH, &plain(&m.kernel, 16));
        text(o, tags::KVP, VR::DS, &decimal(m.kvp));
        text(o, tags::ACQUISITION_NUMBER, VR::IS, "1");
    }

    fn plane(&self, o: &mut InMemDicomObject, k: usize) {
        let [u, v, w] = self.axes;
        let list = |values: &[f64]| values.iter().map(|&v| decimal(v)).collect::<Vec<_>>().join("\\");
        let direction = |a: Vector<Patient>| (a / a.norm()).to_array();
        let orientation = [direction(u), direction(v)].concat();
        let step = decimal(w.norm());
        text(o, tags::SOP_CLASS_UID, VR::UI, uids::CT_IMAGE_STORAGE);
        text(o, tags::SOP_INSTANCE_UID, VR::UI, &self.uid("instance", k + 1));
        text(o, tags::IMAGE_TYPE, VR::CS, "DERIVED\\SECONDARY\\AXIAL");
        text(o, tags::INSTANCE_NUMBER, VR::IS, &(k + 1).to_string());
        text(o, tags::IMAGE_POSITION_PATIENT, VR::DS, &list(&self.volume.grid().centre(0, 0, k).to_array()));
        text(o, tags::IMAGE_ORIENTATION_PATIENT, VR::DS, &list(&orientation));
        // Row spacing, the distance between rows, comes first.
        text(o, tags::PIXEL_SPACING, VR::DS, &list(&[v.norm(), u.norm()]));
        text(o, tags::SLICE_THICKNESS, VR::DS, &step);
        text(o, tags::SPACING_BETWEEN_SLICES, VR::DS, &step);
    }

    fn pixels(&self, o: &mut InMemDicomObject, k: usize) {
        let [columns, rows, _] = self.volume.grid().dims();
        let short = |o: &mut InMemDicomObject, tag, value: usize| {
            o.put(DataElement::new(tag, VR::US, PrimitiveValue::from(value as u16)));
        };
        short(o, tags::SAMPLES_PER_PIXEL, 1);
        text(o, tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "MONOCHROME2");
        short(o, tags::ROWS, rows);
        short(o, tags::COLUMNS, columns);
        short(o, tags::BITS_ALLOCATED, 16);
        short(o, tags::BITS_STORED, 16);
        short(o, tags::HIGH_BIT, 15);
        short(o, tags::PIXEL_REPRESENTATION, 0);
        text(o, tags::RESCALE_INTERCEPT, VR::DS, &self.intercept.to_string());
        text(o, tags::RESCALE_SLOPE, VR::DS, "1");
        text(o, tags::RESCALE_TYPE, VR::LO, "HU");
        text(o, tags::WINDOW_CENTER, VR::DS, "40");
        text(o, tags::WINDOW_WIDTH, VR::DS, "80");
        let plane = columns * rows;
        let hu = &self.volume.data()[k * plane..(k + 1) * plane];
        let stored: Vec<u16> = hu.iter().map(|&v| (i32::from(v) - self.intercept) as u16).collect();
        o.put(DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U16(stored.into())));
    }
}

pub(super) fn text(o: &mut InMemDicomObject, tag: Tag, vr: VR, value: &str) {
    o.put(DataElement::new(tag, vr, PrimitiveValue::from(value)));
}

/// A text as one value of at most `longest` characters: a backslash would separate two.
fn plain(value: &str, longest: usize) -> String {
    value.chars().map(|c| if c == '\\' || c.is_control() { '/' } else { c }).take(longest).collect()
}

/// A decimal string: the most digits that fit its 16 characters.
pub(super) fn decimal(value: f64) -> String {
    let shortest = format!("{value}");
    if shortest.len() <= 16 {
        return shortest;
    }
    // A value below 1e-14 has no digit that fits.
    (0..=14)
        .rev()
        .map(|digits| format!("{value:.digits$}"))
        .find(|s| s.len() <= 16)
        .unwrap_or_else(|| format!("{value:.8e}"))
}
