//! Attributes of an image: in the root of a classic object, or in the functional groups of an enhanced one.

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::InMemDicomObject;
use dicom_object::mem::InMemElement;

/// Where to look for the attributes of one frame.
pub(crate) struct Attributes<'a> {
    root: &'a InMemDicomObject,
    shared: Option<&'a InMemDicomObject>,
    frame: Option<&'a InMemDicomObject>,
}

fn first_item(object: &InMemDicomObject, sequence: Tag) -> Option<&InMemDicomObject> {
    object.get(sequence)?.items()?.first()
}

impl<'a> Attributes<'a> {
    /// Of a whole object.
    pub(crate) fn new(root: &'a InMemDicomObject) -> Self {
        Self { root, shared: first_item(root, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE), frame: None }
    }

    /// Number of per-frame functional groups; `None` for a classic object.
    pub(crate) fn per_frame_groups(&self) -> Option<usize> {
        Some(self.root.get(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE)?.items()?.len())
    }

    /// Of one frame.
    pub(crate) fn frame(&self, index: usize) -> Self {
        let groups = self.root.get(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).and_then(|e| e.items());
        Self { root: self.root, shared: self.shared, frame: groups.and_then(|g| g.get(index)) }
    }

    /// An attribute of the root or, in enhanced objects, of this group of the frame or of all frames.
    fn find(&self, group: Tag, tag: Tag) -> Option<&'a InMemElement> {
        let within = |o: Option<&'a InMemDicomObject>| first_item(o?, group)?.get(tag);
        within(self.frame).or_else(|| within(self.shared)).or_else(|| self.root.get(tag))
    }

    /// A text of the root without padding; `None` when missing or empty.
    pub(crate) fn text(&self, tag: Tag) -> Option<String> {
        clean(self.root.get(tag)?)
    }

    /// A text of the first item of a sequence of the root.
    pub(crate) fn in_sequence(&self, sequence: Tag, tag: Tag) -> Option<String> {
        clean(first_item(self.root, sequence)?.get(tag)?)
    }

    /// A text of a functional group or of the root.
    pub(crate) fn in_group(&self, group: Tag, tag: Tag) -> Option<String> {
        clean(self.find(group, tag)?)
    }

    /// A whole number of the root.
    pub(crate) fn whole(&self, tag: Tag) -> Option<i64> {
        self.root.get(tag)?.to_int().ok()
    }

    /// Numbers of a functional group or of the root.
    pub(crate) fn numbers(&self, group: Tag, tag: Tag) -> Option<Vec<f64>> {
        self.find(group, tag)?.to_multi_float64().ok()
    }

    /// The text of an attribute that should hold numbers and does not, as with decimal commas; `None` where it does or is missing.
    pub(crate) fn not_numbers(&self, group: Tag, tag: Tag) -> Option<String> {
        if self.numbers(group, tag).is_some() { None } else { self.in_group(group, tag) }
    }

    /// A number of a functional group or of the root.
    pub(crate) fn number(&self, group: Tag, tag: Tag) -> Option<f64> {
        self.numbers(group, tag)?.first().copied()
    }

    /// Words of the image type, or of the frame type of an enhanced object.
    pub(crate) fn image_type(&self) -> Vec<String> {
        let words = |e: &InMemElement| e.to_multi_str().map(|w| w.to_vec()).unwrap_or_default();
        let group = tags::CT_IMAGE_FRAME_TYPE_SEQUENCE;
        let frame = self.find(group, tags::FRAME_TYPE).or_else(|| self.root.get(tags::IMAGE_TYPE));
        frame.map(words).unwrap_or_default().iter().map(|w| w.trim().to_owned()).collect()
    }
}

fn clean(element: &InMemElement) -> Option<String> {
    let text = element.to_str().ok()?;
    let text = text.trim_matches(['\0', ' ']).to_owned();
    (!text.is_empty()).then_some(text)
}
