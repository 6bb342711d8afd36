//! How a segmentation refers to its images: patient and study, series (PS3.3 C.12.4) and the source of each frame
//! (C.7.6.16.2.6).

use super::super::write::text;
use super::images::{Images, Instance, SHARED};
use super::write::{code, sequence};
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, Tag, VR};
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use std::collections::BTreeSet;

/// Patient and study, with the values that `value` gives.
pub(super) fn shared<'a>(o: &mut InMemDicomObject, value: impl Fn(Tag) -> &'a str) {
    for (tag, vr) in SHARED {
        text(o, tag, vr, value(tag));
    }
}

/// Patient, study and frame of reference of the images.
pub(super) fn identity(images: &Images, o: &mut InMemDicomObject) {
    let value = |tag: Tag| images.shared.iter().find(|(t, _)| *t == tag).map_or("", |(_, v)| v.as_str());
    shared(o, value);
    text(o, tags::STUDY_INSTANCE_UID, VR::UI, &images.study_uid);
    text(o, tags::FRAME_OF_REFERENCE_UID, VR::UI, &images.frame_of_reference);
}

/// The series with each of its files once.
pub(super) fn series(images: &Images) -> InMemDicomObject {
    let mut seen = BTreeSet::new();
    let files = images.instances.iter().filter(|i| seen.insert(&i.uid));
    let mut o = InMemDicomObject::new_empty();
    text(&mut o, tags::SERIES_INSTANCE_UID, VR::UI, &images.series_uid);
    sequence(&mut o, tags::REFERENCED_INSTANCE_SEQUENCE, files.map(instance).collect());
    o
}

/// What a frame was drawn on.
pub(super) fn derivation(image: &Instance) -> InMemDicomObject {
    let mut source = instance(image);
    if let Some(frame) = image.frame {
        text(&mut source, tags::REFERENCED_FRAME_NUMBER, VR::IS, &frame.to_string());
    }
    let purpose = code("DCM", "121322", "Source image for image processing operation");
    sequence(&mut source, tags::PURPOSE_OF_REFERENCE_CODE_SEQUENCE, vec![purpose]);
    // Each frame has the pixels of its image, one for one.
    source.put(DataElement::new(tags::SPATIAL_LOCATIONS_PRESERVED, VR::CS, PrimitiveValue::from("YES")));
    let mut o = InMemDicomObject::new_empty();
    sequence(&mut o, tags::SOURCE_IMAGE_SEQUENCE, vec![source]);
    sequence(&mut o, tags::DERIVATION_CODE_SEQUENCE, vec![code("DCM", "113076", "Segmentation")]);
    o
}

fn instance(image: &Instance) -> InMemDicomObject {
    let mut o = InMemDicomObject::new_empty();
    text(&mut o, tags::REFERENCED_SOP_CLASS_UID, VR::UI, &image.class);
    text(&mut o, tags::REFERENCED_SOP_INSTANCE_UID, VR::UI, &image.uid);
    o
}
