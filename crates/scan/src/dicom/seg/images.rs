//! The images that labels were drawn on: their identifiers, and the labels on their planes.

use super::super::attributes::Attributes;
use super::super::image::{Image, parse_header};
use super::super::{folder, select};
use super::SegError;
use crate::error::{Problem, ScanError, header};
use crate::hash;
use crate::labels::DrawnOn;
use crate::resample::Stack;
use crate::types::ReadOptions;
use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use monro_geometry::{Patient, Point, Vector, Volume};

use std::path::Path;

/// What a segmentation shares with its images, beside the identifiers that it cannot do without: patient and study.
pub(super) const SHARED: [(Tag, VR); 10] = [
    (tags::PATIENT_NAME, VR::PN),
    (tags::PATIENT_ID, VR::LO),
    (tags::PATIENT_BIRTH_DATE, VR::DA),
    (tags::PATIENT_SEX, VR::CS),
    (tags::STUDY_DATE, VR::DA),
    (tags::STUDY_TIME, VR::TM),
    (tags::STUDY_ID, VR::SH),
    (tags::ACCESSION_NUMBER, VR::SH),
    (tags::REFERRING_PHYSICIAN_NAME, VR::PN),
    (tags::POSITION_REFERENCE_INDICATOR, VR::LO),
];

/// A series of images, without its pixels, for a segmentation that refers to it. Holds the patient's identity, which
/// the segmentation gets too: a viewer or archive would not find them together otherwise.
#[derive(Debug, Clone)]
pub struct Images {
    pub(super) stack: Stack,
    pub(super) series_uid: String,
    pub(super) study_uid: String,
    pub(super) frame_of_reference: String,
    /// Patient and study, as the first image has them; empty where it has none.
    pub(super) shared: Vec<(Tag, String)>,
    /// Class, instance, and in a file of several frames the frame from 1, of each plane of the stack.
    pub(super) instances: Vec<Instance>,
}

/// One image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Instance {
    pub(super) class: String,
    pub(super) uid: String,
    pub(super) frame: Option<usize>,
}

impl Images {
    /// The series that [`crate::read`] would take from a folder or file.
    ///
    /// # Errors
    /// Any [`ScanError`] of choosing a series; images without the identifiers that a reference needs.
    pub fn of(path: &Path, options: &ReadOptions) -> Result<Self, ScanError> {
        let (series, _) = select(path, options)?;
        let first = &series.images[0];
        let at = |problem| ScanError::file(&first.file, problem);
        let stack = series.stack.clone().ok_or_else(|| ScanError::EmptyFolder(path.to_path_buf()))?;
        let bytes = folder::load(&first.file).map_err(at)?.unwrap_or_default();
        let object = parse_header(&bytes).map_err(at)?;
        let root = Attributes::new(&object);
        let need = |tag, field| root.text(tag).ok_or_else(|| at(header(field, "is missing: nothing can refer to it")));
        let class = need(tags::SOP_CLASS_UID, "SOPClassUID")?;
        Ok(Self {
            study_uid: need(tags::STUDY_INSTANCE_UID, "StudyInstanceUID")?,
            series_uid: need(tags::SERIES_INSTANCE_UID, "SeriesInstanceUID")?,
            frame_of_reference: need(tags::FRAME_OF_REFERENCE_UID, "FrameOfReferenceUID")?,
            shared: SHARED.map(|(tag, _)| (tag, root.text(tag).unwrap_or_default())).to_vec(),
            instances: series.images.iter().map(|i| instance(i, &class)).collect::<Result<_, _>>()?,
            stack,
        })
    }

    /// Whether labels say that they were drawn on images of another patient; an id that is missing says nothing.
    pub fn is_another_patient(&self, drawn_on: &DrawnOn) -> bool {
        let id = self.shared.iter().find(|(tag, _)| *tag == tags::PATIENT_ID).map_or("", |(_, id)| id);
        let own = hash::patient_id(id);
        !own.is_empty() && !drawn_on.patient.is_empty() && own != drawn_on.patient
    }

    /// The labels at the centres of the images' pixels (nearest voxel, 0 where there is none), and the part of the
    /// labelled voxels that lies within the images, 0 to 1.
    pub(super) fn sample(&self, labels: &Volume<u8>) -> (Vec<u8>, f64) {
        let [columns, rows] = self.stack.size;
        let (u, v) = (self.stack.u, self.stack.v);
        let mut data = vec![0u8; columns * rows * self.stack.origins.len()];
        data.chunks_mut(columns * rows).zip(&self.stack.origins).for_each(|(plane, &origin)| {
            for (n, out) in plane.iter_mut().enumerate() {
                let p = origin + u * (n % columns) as f64 + v * (n / columns) as f64;
                *out = labels.nearest(p).unwrap_or(0);
            }
        });
        let grid = labels.grid();
        let set: Vec<usize> = (0..grid.len()).filter(|&n| labels.data()[n] > 0).collect();
        let centre = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            grid.centre(i, j, k)
        };
        let normal = self.stack.normal();
        let places: Vec<f64> = self.stack.origins.iter().map(|&o| (o - self.stack.origins[0]).dot(normal)).collect();
        let held = set.iter().filter(|&&n| self.hold(&places, centre(n))).count();
        (data, held as f64 / (set.len().max(1)) as f64)
    }

    /// Whether a point lies within half a step and half a pixel of a plane; `places` are those of the planes along the
    /// normal.
    fn hold(&self, places: &[f64], p: Point<Patient>) -> bool {
        let at = (p - self.stack.origins[0]).dot(self.stack.normal());
        let above = places.partition_point(|&s| s < at).clamp(1, places.len() - 1);
        let (low, high) = (places[above - 1], places[above]);
        let (step, nearest) = (high - low, if at - low < high - at { above - 1 } else { above });
        let d = p - self.stack.origins[nearest];
        let within = |axis: Vector<Patient>, count: usize| {
            let at = d.dot(axis) / axis.norm_squared();
            at >= -0.5 && at <= count as f64 - 0.5
        };
        let [columns, rows] = self.stack.size;
        (low - 0.5 * step..=high + 0.5 * step).contains(&at)
            && within(self.stack.u, columns)
            && within(self.stack.v, rows)
    }

    /// Refuses labels of which nothing lies within the images.
    pub(super) fn elsewhere(&self, labels: &Volume<u8>) -> SegError {
        SegError::Elsewhere {
            label_dims: labels.grid().dims(),
            label_origin: labels.grid().centre(0, 0, 0).to_array(),
            image_dims: [self.stack.size[0], self.stack.size[1], self.stack.origins.len()],
            image_origin: self.stack.origins[0].to_array(),
        }
    }
}

fn instance(image: &Image, class: &str) -> Result<Instance, ScanError> {
    if image.instance_uid.is_empty() {
        let missing: Problem = header("SOPInstanceUID", "is missing: nothing can refer to it");
        return Err(ScanError::file(&image.file, missing));
    }
    let frame = (image.frames > 1).then_some(image.frame + 1);
    Ok(Instance { class: class.to_owned(), uid: image.instance_uid.clone(), frame })
}
