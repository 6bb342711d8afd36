//! Labels as a binary DICOM segmentation.

use super::super::write::{decimal, text};
use super::images::Images;
use super::references;
use crate::hash;
use crate::labels::{Term, terms};
use crate::resample::Stack;
use dicom_core::value::{DataSetSequence, PrimitiveValue};
use dicom_core::{DataElement, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use monro_geometry::{Patient, Structure, Vector, Volume};
use std::borrow::Cow;
use thiserror::Error;

/// Columns and rows may miss the right angle by this much, as a cosine.
const SKEW: f64 = 1e-6;
/// Steps between planes that differ by more than this part are uneven.
const UNEVEN: f64 = 0.01;

/// Why labels are no DICOM segmentation.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SegError {
    /// No voxel has a label.
    #[error("the labels have no voxel of any structure; there is nothing to write")]
    Empty,
    /// DICOM planes are perpendicular stacks of at most 65535 pixels a side.
    #[error(
        "a grid of {dims:?} voxels with axes that miss the right angle by a cosine of {cosine} is no stack of DICOM planes"
    )]
    Grid {
        /// Columns, rows, slices.
        dims: [usize; 3],
        /// Largest cosine between two axes.
        cosine: f64,
    },
    /// The labels lie beyond the images that they should refer to.
    #[error(
        "none of the labels lie within the images: labels of {label_dims:?} voxels from {label_origin:.1?}, images of {image_dims:?} pixels from {image_origin:.1?} (LPS mm); were they drawn on this series?"
    )]
    Elsewhere {
        /// Columns, rows, slices of the labels.
        label_dims: [usize; 3],
        /// Centre of their first voxel, LPS mm.
        label_origin: [f64; 3],
        /// Columns, rows, images of the series.
        image_dims: [usize; 3],
        /// Centre of its first pixel, LPS mm.
        image_origin: [f64; 3],
    },
    /// The encoder refused.
    #[error("the segmentation cannot be encoded: {0}")]
    Encode(String),
}

/// Labels as a file of Segmentation Storage (explicit VR little endian), each structure that has voxels as a segment with
/// name, colour and terms. It stands by itself: it names `subject` as its patient and refers to no images, since a case
/// keeps no identifiers of the series that it came from. Equal labels give equal bytes.
///
/// # Errors
/// No structure has a voxel; a grid that is no stack of planes.
pub fn encode(labels: &Volume<u8>, subject: &str) -> Result<Vec<u8>, SegError> {
    let grid = labels.grid();
    let axes = [0, 1, 2].map(|a| Vector::<Patient>::from_array(grid.patient_from_voxel().linear.column(a)));
    let cosine = |a: usize, b: usize| (axes[a].dot(axes[b]) / (axes[a].norm() * axes[b].norm())).abs();
    let (dims, worst) = (grid.dims(), cosine(0, 1).max(cosine(0, 2)).max(cosine(1, 2)));
    if worst > SKEW || dims[0] > 65535 || dims[1] > 65535 {
        return Err(SegError::Grid { dims, cosine: worst });
    }
    let planes =
        Planes { stack: Stack::of_grid(grid), step: axes[2].norm(), uneven: false, data: Cow::Borrowed(labels.data()) };
    Writer::new(planes, Subject::Named(subject))?.bytes()
}

/// The same on the planes of the images that the labels belong to, whatever their own grid (nearest voxel): patient,
/// study and frame of reference are the images', and every frame names its image. Besides, a remark when labels lie
/// beyond the images and are left out.
///
/// # Errors
/// No structure has a voxel; none of them lies within the images.
pub fn encode_on(labels: &Volume<u8>, images: &Images) -> Result<(Vec<u8>, Option<String>), SegError> {
    if labels.data().iter().all(|&l| l == 0) {
        return Err(SegError::Empty);
    }
    let (data, held) = images.sample(labels);
    if data.iter().all(|&l| l == 0) {
        return Err(images.elsewhere(labels));
    }
    let mut steps = images.stack.steps();
    steps.sort_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
    let uneven = steps.iter().any(|s| (s - step).abs() > UNEVEN * step);
    let planes = Planes { stack: images.stack.clone(), step, uneven, data: Cow::Owned(data) };
    let lost = 100.0 * (1.0 - held);
    let remark = format!("{lost:.1} % of the labelled voxels lie beyond the images and were left out");
    Ok((Writer::new(planes, Subject::Shown(images))?.bytes()?, (lost >= 0.05).then_some(remark)))
}

/// Labels plane by plane.
struct Planes<'a> {
    stack: Stack,
    /// Distance of neighbouring planes, mm; of uneven ones the commonest.
    step: f64,
    uneven: bool,
    data: Cow<'a, [u8]>,
}

impl Planes<'_> {
    fn count(&self) -> usize {
        self.stack.origins.len()
    }

    fn plane(&self, k: usize) -> &[u8] {
        let size = self.stack.size[0] * self.stack.size[1];
        &self.data[k * size..(k + 1) * size]
    }

    /// Index of a plane along `u x v`, which may run against the order of the planes.
    fn place(&self, k: usize) -> usize {
        let along = self.stack.u.cross(self.stack.v).dot(self.stack.normal()) > 0.0;
        if along { k } else { self.count() - 1 - k }
    }
}

/// Whose labels they are.
#[derive(Clone, Copy)]
enum Subject<'a> {
    /// Somebody, by a name; no images.
    Named(&'a str),
    /// Whom these images show.
    Shown(&'a Images),
}

/// A frame: which segment (from 1) on which plane.
type Frame = (usize, usize);

struct Writer<'a> {
    planes: Planes<'a>,
    subject: Subject<'a>,
    segments: Vec<Structure>,
    frames: Vec<Frame>,
    content: String,
}

impl<'a> Writer<'a> {
    fn new(planes: Planes<'a>, subject: Subject<'a>) -> Result<Self, SegError> {
        let has = |s: &Structure| planes.data.contains(&s.label());
        let segments: Vec<Structure> = Structure::ALL.into_iter().skip(1).filter(has).collect();
        if segments.is_empty() {
            return Err(SegError::Empty);
        }
        let Stack { size, u, v, origins } = &planes.stack;
        let series = if let Subject::Shown(images) = subject { &images.series_uid } else { "" };
        let content = format!("{} {size:?} {u:?} {v:?} {origins:?} {series}", hash::of_bytes(&planes.data));
        let mut out = Self { planes, subject, segments, frames: Vec::new(), content };
        out.frames = out.frames();
        Ok(out)
    }

    fn bytes(&self) -> Result<Vec<u8>, SegError> {
        let table = FileMetaTableBuilder::new()
            .media_storage_sop_class_uid(uids::SEGMENTATION_STORAGE)
            .media_storage_sop_instance_uid(self.uid("instance"))
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN);
        let failed = |e: &dyn std::error::Error| SegError::Encode(crate::dicom::image::chain(e));
        let object = self.object().with_meta(table).map_err(|e| failed(&e))?;
        let mut out = Vec::new();
        object.write_all(&mut out).map_err(|e| failed(&e))?;
        Ok(out)
    }

    /// Frames with voxels, and the first and last plane in any case, so that a reader finds the whole grid; all planes
    /// where nothing else tells how far each one reaches.
    fn frames(&self) -> Vec<Frame> {
        let planes = self.planes.count();
        let mut out = Vec::new();
        for (n, s) in self.segments.iter().enumerate() {
            let shown = |&k: &usize| {
                n == 0 && (self.planes.uneven || k == 0 || k + 1 == planes) || self.planes.plane(k).contains(&s.label())
            };
            out.extend((0..planes).filter(shown).map(|k| (n + 1, k)));
        }
        out
    }

    /// A UID under 2.25, always the same for the same labels and role.
    fn uid(&self, role: &str) -> String {
        hash::uid(&format!("monro segmentation {role} {}", self.content))
    }

    fn object(&self) -> InMemDicomObject {
        let mut o = InMemDicomObject::new_empty();
        self.identity(&mut o);
        self.image(&mut o);
        self.dimensions(&mut o);
        sequence(
            &mut o,
            tags::SEGMENT_SEQUENCE,
            self.segments.iter().enumerate().map(|(n, s)| segment(n + 1, *s)).collect(),
        );
        sequence(&mut o, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, vec![self.shared()]);
        sequence(
            &mut o,
            tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
            self.frames.iter().map(|f| self.frame(*f)).collect(),
        );
        if let Subject::Shown(images) = self.subject {
            sequence(&mut o, tags::REFERENCED_SERIES_SEQUENCE, vec![references::series(images)]);
        }
        o.put(DataElement::new(tags::PIXEL_DATA, VR::OB, PrimitiveValue::U8(self.bits().into())));
        o
    }

    fn identity(&self, o: &mut InMemDicomObject) {
        text(o, tags::SPECIFIC_CHARACTER_SET, VR::CS, "ISO_IR 192");
        let uid = |role: &str| self.uid(role);
        for (tag, vr, value) in [
            (tags::SOP_CLASS_UID, VR::UI, uids::SEGMENTATION_STORAGE),
            (tags::SOP_INSTANCE_UID, VR::UI, &uid("instance")),
            (tags::SERIES_INSTANCE_UID, VR::UI, &uid("series")),
            (tags::MODALITY, VR::CS, "SEG"),
            (tags::SERIES_NUMBER, VR::IS, "1"),
            (tags::INSTANCE_NUMBER, VR::IS, "1"),
            (tags::SERIES_DESCRIPTION, VR::LO, "Labels of a case"),
            (tags::MANUFACTURER, VR::LO, "Monro"),
            (tags::MANUFACTURER_MODEL_NAME, VR::LO, "Monro"),
            (tags::DEVICE_SERIAL_NUMBER, VR::LO, "0"),
            (tags::SOFTWARE_VERSIONS, VR::LO, env!("CARGO_PKG_VERSION")),
            (tags::CONTENT_LABEL, VR::CS, "SEGMENTATION"),
            (tags::CONTENT_DESCRIPTION, VR::LO, "Research software. Not for clinical use."),
            // There is no clock here, and equal labels give equal files.
            (tags::CONTENT_DATE, VR::DA, "19700101"),
            (tags::CONTENT_TIME, VR::TM, "000000"),
        ] {
            text(o, tag, vr, value);
        }
        text(o, tags::CONTENT_CREATOR_NAME, VR::PN, "");
        match self.subject {
            Subject::Named(name) => self.stand_alone(name, o),
            Subject::Shown(images) => references::identity(images, o),
        }
    }

    fn stand_alone(&self, name: &str, o: &mut InMemDicomObject) {
        references::shared(o, |tag| if [tags::PATIENT_NAME, tags::PATIENT_ID].contains(&tag) { name } else { "" });
        text(o, tags::STUDY_INSTANCE_UID, VR::UI, &self.uid("study"));
        text(o, tags::FRAME_OF_REFERENCE_UID, VR::UI, &self.uid("frame"));
    }

    fn image(&self, o: &mut InMemDicomObject) {
        let [columns, rows] = self.planes.stack.size;
        for (tag, value) in [
            (tags::SAMPLES_PER_PIXEL, 1),
            (tags::ROWS, rows),
            (tags::COLUMNS, columns),
            (tags::BITS_ALLOCATED, 1),
            (tags::BITS_STORED, 1),
            (tags::HIGH_BIT, 0),
            (tags::PIXEL_REPRESENTATION, 0),
        ] {
            short(o, tag, value);
        }
        for (tag, vr, value) in [
            (tags::IMAGE_TYPE, VR::CS, "DERIVED\\PRIMARY"),
            (tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "MONOCHROME2"),
            (tags::LOSSY_IMAGE_COMPRESSION, VR::CS, "00"),
            (tags::SEGMENTATION_TYPE, VR::CS, "BINARY"),
            (tags::SEGMENTS_OVERLAP, VR::CS, "NO"),
            (tags::NUMBER_OF_FRAMES, VR::IS, &self.frames.len().to_string()),
        ] {
            text(o, tag, vr, value);
        }
    }

    /// Frames are ordered by segment, then by place (PS3.3 C.7.6.17).
    fn dimensions(&self, o: &mut InMemDicomObject) {
        let organization = self.uid("dimensions");
        let mut item = InMemDicomObject::new_empty();
        text(&mut item, tags::DIMENSION_ORGANIZATION_UID, VR::UI, &organization);
        sequence(o, tags::DIMENSION_ORGANIZATION_SEQUENCE, vec![item]);
        let index = |pointer: Tag, group: Tag, label: &str| {
            let mut item = InMemDicomObject::new_empty();
            text(&mut item, tags::DIMENSION_ORGANIZATION_UID, VR::UI, &organization);
            item.put(DataElement::new(tags::DIMENSION_INDEX_POINTER, VR::AT, PrimitiveValue::from(pointer)));
            item.put(DataElement::new(tags::FUNCTIONAL_GROUP_POINTER, VR::AT, PrimitiveValue::from(group)));
            text(&mut item, tags::DIMENSION_DESCRIPTION_LABEL, VR::LO, label);
            item
        };
        let indices = vec![
            index(tags::REFERENCED_SEGMENT_NUMBER, tags::SEGMENT_IDENTIFICATION_SEQUENCE, "Segment"),
            index(tags::IMAGE_POSITION_PATIENT, tags::PLANE_POSITION_SEQUENCE, "Position"),
        ];
        sequence(o, tags::DIMENSION_INDEX_SEQUENCE, indices);
    }

    fn shared(&self) -> InMemDicomObject {
        let Stack { u, v, .. } = self.planes.stack;
        let direction = |a: Vector<Patient>| (a / a.norm()).to_array();
        let mut orientation = InMemDicomObject::new_empty();
        let both = [direction(u), direction(v)].concat();
        text(&mut orientation, tags::IMAGE_ORIENTATION_PATIENT, VR::DS, &list(&both));
        let mut measures = InMemDicomObject::new_empty();
        // Distance between rows first.
        text(&mut measures, tags::PIXEL_SPACING, VR::DS, &list(&[v.norm(), u.norm()]));
        text(&mut measures, tags::SLICE_THICKNESS, VR::DS, &decimal(self.planes.step));
        if !self.planes.uneven {
            text(&mut measures, tags::SPACING_BETWEEN_SLICES, VR::DS, &decimal(self.planes.step));
        }
        let mut out = InMemDicomObject::new_empty();
        sequence(&mut out, tags::PLANE_ORIENTATION_SEQUENCE, vec![orientation]);
        sequence(&mut out, tags::PIXEL_MEASURES_SEQUENCE, vec![measures]);
        out
    }

    fn frame(&self, (segment, k): Frame) -> InMemDicomObject {
        let mut content = InMemDicomObject::new_empty();
        let values = PrimitiveValue::U32([segment as u32, self.planes.place(k) as u32 + 1].as_slice().into());
        content.put(DataElement::new(tags::DIMENSION_INDEX_VALUES, VR::UL, values));
        let mut position = InMemDicomObject::new_empty();
        let corner = self.planes.stack.origins[k].to_array();
        text(&mut position, tags::IMAGE_POSITION_PATIENT, VR::DS, &list(&corner));
        let mut which = InMemDicomObject::new_empty();
        short(&mut which, tags::REFERENCED_SEGMENT_NUMBER, segment);
        let mut out = InMemDicomObject::new_empty();
        sequence(&mut out, tags::FRAME_CONTENT_SEQUENCE, vec![content]);
        sequence(&mut out, tags::PLANE_POSITION_SEQUENCE, vec![position]);
        sequence(&mut out, tags::SEGMENT_IDENTIFICATION_SEQUENCE, vec![which]);
        if let Subject::Shown(images) = self.subject {
            sequence(&mut out, tags::DERIVATION_IMAGE_SEQUENCE, vec![references::derivation(&images.instances[k])]);
        }
        out
    }

    /// One bit per pixel, lowest bit first, frames without gaps between them (PS3.5 8.1.1), an even number of bytes.
    fn bits(&self) -> Vec<u8> {
        let [w, h] = self.planes.stack.size;
        let mut out = vec![0u8; (self.frames.len() * w * h).div_ceil(8).next_multiple_of(2)];
        for (n, &(segment, k)) in self.frames.iter().enumerate() {
            let label = self.segments[segment - 1].label();
            for (m, _) in self.planes.plane(k).iter().enumerate().filter(|(_, l)| **l == label) {
                let bit = n * w * h + m;
                out[bit / 8] |= 1 << (bit % 8);
            }
        }
        out
    }
}

fn segment(number: usize, s: Structure) -> InMemDicomObject {
    let mut o = InMemDicomObject::new_empty();
    short(&mut o, tags::SEGMENT_NUMBER, number);
    text(&mut o, tags::SEGMENT_LABEL, VR::LO, &s.words());
    text(&mut o, tags::SEGMENT_ALGORITHM_TYPE, VR::CS, "SEMIAUTOMATIC");
    text(&mut o, tags::SEGMENT_ALGORITHM_NAME, VR::LO, "Monro");
    let lab = PrimitiveValue::U16(cie_lab(s.colour()).as_slice().into());
    o.put(DataElement::new(tags::RECOMMENDED_DISPLAY_CIE_LAB_VALUE, VR::US, lab));
    if let Some(t) = terms(s) {
        sequence(&mut o, tags::SEGMENTED_PROPERTY_CATEGORY_CODE_SEQUENCE, vec![coded(t.category)]);
        let mut kind = coded(t.kind);
        if let Some(side) = t.modifier {
            sequence(&mut kind, tags::SEGMENTED_PROPERTY_TYPE_MODIFIER_CODE_SEQUENCE, vec![coded(side)]);
        }
        sequence(&mut o, tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE, vec![kind]);
    }
    o
}

fn coded(t: Term) -> InMemDicomObject {
    code("SCT", t.code, t.meaning)
}

/// A coded term of any scheme.
pub(super) fn code(scheme: &str, value: &str, meaning: &str) -> InMemDicomObject {
    let mut o = InMemDicomObject::new_empty();
    text(&mut o, tags::CODE_VALUE, VR::SH, value);
    text(&mut o, tags::CODING_SCHEME_DESIGNATOR, VR::SH, scheme);
    text(&mut o, tags::CODE_MEANING, VR::LO, meaning);
    o
}

/// sRGB to CIE L\*a\*b\* (D65), as 16-bit numbers of PS3.3 C.10.7.1.1: L of 0 to 100, a and b of -128 to 127.
fn cie_lab(colour: [u8; 3]) -> [u16; 3] {
    let linear = colour.map(|c| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    let dot = |m: [f64; 3]| m[0] * linear[0] + m[1] * linear[1] + m[2] * linear[2];
    let xyz = [
        dot([0.4124564, 0.3575761, 0.1804375]) / 0.95047,
        dot([0.2126729, 0.7151522, 0.0721750]),
        dot([0.0193339, 0.1191920, 0.9503041]) / 1.08883,
    ];
    let [x, y, z] = xyz.map(|t| if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 });
    let [l, a, b] = [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)];
    [l / 100.0, (a + 128.0) / 255.0, (b + 128.0) / 255.0].map(|v| (v.clamp(0.0, 1.0) * 65535.0).round() as u16)
}

pub(super) fn sequence(o: &mut InMemDicomObject, tag: Tag, items: Vec<InMemDicomObject>) {
    o.put(DataElement::new(tag, VR::SQ, DataSetSequence::from(items)));
}

fn short(o: &mut InMemDicomObject, tag: Tag, value: usize) {
    o.put(DataElement::new(tag, VR::US, PrimitiveValue::from(value as u16)));
}

fn list(values: &[f64]) -> String {
    values.iter().map(|&v| decimal(v)).collect::<Vec<_>>().join("\\")
}
