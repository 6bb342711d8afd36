//! DICOM data without the preamble and the mark "DICM" of PS3.10, section 7.1, as older archives and network captures keep them:
//! they are completed before anything else reads them.

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, uids};

/// Bytes that [`Begin::of`] needs.
pub(super) const NEEDED: usize = 132;
const PREAMBLE: usize = 128;
/// The first values of a data set are short: times, identifiers, kinds of image.
const LONGEST_FIRST: u32 = 128;

/// How a DICOM file begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    /// With preamble and mark.
    Marked,
    /// With the file meta information (group 2), which names the transfer syntax.
    Meta,
    /// With the data set, explicit types or not: little endian, for nothing says otherwise.
    Data { explicit: bool },
}

impl Begin {
    /// `None` for what is not DICOM. A data set is one whose first element is of group 8 and in the dictionary, with the type
    /// that the dictionary gives, or a length as short as first values are.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.get(PREAMBLE..NEEDED) == Some(b"DICM") {
            return Some(Self::Marked);
        }
        let &[group, 0, low, high, a, b, c, d] = bytes.get(..8)? else { return None };
        if [group, low, high, a, b] == [2, 0, 0, b'U', b'L'] || [group, low, high, a, b] == [2, 1, 0, b'O', b'B'] {
            return Some(Self::Meta);
        }
        let known = StandardDataDictionary.by_tag(Tag(group.into(), u16::from_le_bytes([low, high])))?.vr().relaxed();
        let first =
            group == 8 && high == 0 && matches!(known, VR::UL | VR::CS | VR::DA | VR::TM | VR::UI | VR::SH | VR::DT);
        if first && VR::from_binary([a, b]) == Some(known) {
            return Some(Self::Data { explicit: true });
        }
        let length = u32::from_le_bytes([a, b, c, d]);
        (first && length % 2 == 0 && length <= LONGEST_FIRST).then_some(Self::Data { explicit: false })
    }

    /// What is to stand before the bytes of such a file.
    pub(super) fn before(self) -> Vec<u8> {
        let mut out = if self == Self::Marked { Vec::new() } else { vec![0; PREAMBLE] };
        let syntax = match self {
            Self::Marked => return out,
            Self::Meta => None,
            Self::Data { explicit: true } => Some(uids::EXPLICIT_VR_LITTLE_ENDIAN),
            Self::Data { explicit: false } => Some(uids::IMPLICIT_VR_LITTLE_ENDIAN),
        };
        out.extend_from_slice(b"DICM");
        if let Some(uid) = syntax {
            let value = uid.len().next_multiple_of(2);
            out.extend_from_slice(&[2, 0, 0, 0, b'U', b'L', 4, 0]);
            out.extend_from_slice(&(8 + value as u32).to_le_bytes());
            out.extend_from_slice(&[2, 0, 0x10, 0, b'U', b'I', value as u8, 0]);
            out.extend_from_slice(uid.as_bytes());
            out.resize(PREAMBLE + 4 + 12 + 8 + value, 0);
        }
        out
    }
}
