//! Labels of a case in the formats of other programs, with names, colours and terminology: 3D Slicer's `.seg.nrrd` and
//! DICOM segmentations, besides the plain volumes that [`crate::read_labels`] reads.
//!
//! Segments are recognised by their terms (SNOMED CT), else by their names; then they get the numbers of
//! [`Structure`], whatever their own were. Segments of a DICOM segmentation may overlap
//! (told). Not read: overlapping layers of a `.seg.nrrd` (four-dimensional NRRD), fractional DICOM segmentations.

mod seg_nrrd;
mod terms;

pub use seg_nrrd::encode as encode_seg_nrrd;
pub use terms::{Term, Terms, terms};

use crate::dicom::{is_dicom_file, seg};
use crate::error::{Problem, ScanError};
use crate::{Source, file};
use monro_geometry::{Structure, Volume};
use std::path::Path;

/// So many values without a segment are told.
const NAMED: usize = 8;

/// Labels of a file with what should be known about them.
#[derive(Debug, Clone)]
pub struct CaseLabels {
    /// The labels; numbers of [`Structure`] where the file names its segments, else as stored.
    pub volume: Volume<u16>,
    /// Segments that were left out or guessed, and what is doubtful in the file's header.
    pub warnings: Vec<String>,
    /// The images that a DICOM segmentation says it was drawn on.
    pub drawn_on: Option<DrawnOn>,
}

/// The images that labels were drawn on, by hashes that name nobody.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DrawnOn {
    /// Hash of the patient's id; empty where there is none, or no series.
    pub(crate) patient: String,
    /// As [`crate::Source::series`] of each series; none where the file refers to none.
    pub(crate) series: Vec<String>,
}

impl DrawnOn {
    /// A sentence where a scan is of another series than all of these: of another patient, or of the same at another time.
    pub fn unlike(&self, scan: &Source) -> Option<String> {
        let read = scan.series.split('-').next().filter(|id| !id.is_empty())?;
        (!self.series.is_empty() && !self.series.iter().any(|id| id == read)).then(|| {
            "the labels were drawn on another series than the one that is read: of another patient, of this one at another time, or with \
             other slices; they go by their places in it, so look whether they fit"
                .into()
        })
    }
}

/// A segment of a file before it is recognised.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Segment {
    /// Its number in the file.
    pub(crate) number: u16,
    /// Its name.
    pub(crate) name: String,
    /// Codes (SNOMED CT) of its type and of the type's modifier; empty where there are none.
    pub(crate) codes: [String; 2],
}

/// Reads labels of any kind: DICOM segmentation, `.seg.nrrd`, NIfTI, NRRD, MetaImage.
///
/// # Errors
/// Any [`ScanError`]; a file whose segments are all unknown, with their names.
pub fn read(path: &Path) -> Result<CaseLabels, ScanError> {
    let (CaseLabels { volume, mut warnings, drawn_on }, segments) = if path.is_file() && is_dicom_file(path) {
        let seg::Stored { volume, segments, drawn_on, contested } = seg::read(path)?;
        let warnings = overlapping(contested).into_iter().collect();
        (CaseLabels { volume, warnings, drawn_on: Some(drawn_on) }, segments)
    } else {
        (file::read_labels(path)?, seg_nrrd::segments(path))
    };
    if segments.is_empty() {
        return Ok(CaseLabels { volume, warnings, drawn_on });
    }
    let found = renumbered(volume, &segments).map_err(|problem| ScanError::file(path, problem))?;
    warnings.extend(found.warnings);
    Ok(CaseLabels { warnings, drawn_on, ..found })
}

/// Gives known segments the numbers of their structures; all others become 0 (outside) with a warning.
fn renumbered(volume: Volume<u16>, segments: &[Segment]) -> Result<CaseLabels, Problem> {
    let mut table = vec![0u16; 1 << 16];
    let mut warnings = Vec::new();
    for segment in segments {
        match structure(segment) {
            Some(_) if segment.number == 0 => {
                let name = &segment.name;
                warnings.push(format!("the segment {name:?} has the value of the background, 0, and was left out"));
            }
            Some(s) => table[usize::from(segment.number)] = u16::from(s.label()),
            None => warnings.push(format!("the segment {:?} is no structure of a case and was left out", segment.name)),
        }
    }
    if warnings.len() == segments.len() {
        let names: Vec<&str> = segments.iter().map(|s| s.name.as_str()).collect();
        let known: Vec<&str> = Structure::ALL[1..].iter().map(|s| s.name()).collect();
        return Err(Problem::NoSegment { found: names.join(", "), known: known.join(", ") });
    }
    warnings.extend(nameless(&volume, segments));
    Ok(CaseLabels { volume: volume.map(|l| table[usize::from(l)]), warnings, drawn_on: None })
}

/// A remark on voxels that several segments claim.
fn overlapping(voxels: usize) -> Option<String> {
    (voxels > 0).then(|| {
        format!(
            "segments of the file overlap in {voxels} voxels, which went to the inner structure of each two (ventricles before brain,              brain before CSF, the third ventricle before the others): look whether that is right"
        )
    })
}

/// Which of the segments that claim a voxel gets it: the one of the highest rank. 0 for what is no structure of a case.
pub(crate) fn rank(segments: &[Segment], number: u16) -> u8 {
    segments.iter().find(|s| s.number == number).and_then(structure).map_or(0, Structure::label)
}

/// A remark on voxels whose number is that of no segment: with the others they become 0.
fn nameless(volume: &Volume<u16>, segments: &[Segment]) -> Option<String> {
    let mut counts = vec![0usize; 1 << 16];
    volume.data().iter().for_each(|&label| counts[usize::from(label)] += 1);
    counts[0] = 0;
    segments.iter().for_each(|s| counts[usize::from(s.number)] = 0);
    let voxels: usize = counts.iter().sum();
    let values: Vec<String> = (0..counts.len()).filter(|&n| counts[n] > 0).map(|n| n.to_string()).collect();
    let more = if values.len() > NAMED { ", ..." } else { "" };
    (voxels > 0).then(|| {
        format!(
            "{voxels} voxels have values that no segment of the file names ({}{more}): they were left out; name their segment",
            values[..values.len().min(NAMED)].join(", ")
        )
    })
}

/// The structure that a segment names.
fn structure(segment: &Segment) -> Option<Structure> {
    let [kind, modifier] = &segment.codes;
    let by_code = Structure::ALL.into_iter().skip(1).find(|&s| {
        let t = terms(s);
        t.is_some_and(|t| t.kind.code == kind && t.modifier.map_or("", |m| m.code) == modifier)
    });
    let plain = |c: char| if c.is_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let name: String = segment.name.trim().chars().map(plain).collect();
    by_code.or_else(|| Structure::ALL.into_iter().skip(1).find(|s| s.name() == name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(number: u16, name: &str, codes: [&str; 2]) -> Segment {
        Segment { number, name: name.into(), codes: codes.map(String::from) }
    }

    #[test]
    fn segments_are_known_by_their_terms_or_else_by_their_names() {
        let left = segment(1, "whatever", ["66720007", "7771000"]);
        assert_eq!(structure(&left), Some(Structure::LeftLateralVentricle));
        // Without a side the term says too little; the name may still.
        assert_eq!(structure(&segment(1, "x", ["66720007", ""])), None);
        assert_eq!(
            structure(&segment(1, "Right lateral ventricle", ["66720007", ""])),
            Some(Structure::RightLateralVentricle)
        );
        assert_eq!(structure(&segment(2, "Third-Ventricle", ["", ""])), Some(Structure::ThirdVentricle));
        assert_eq!(structure(&segment(2, "tumour", ["", ""])), None);
    }

    #[test]
    fn a_dicom_segmentation_is_read_as_it_was_written() {
        // Slices that run downwards: against the planes' normal.
        let linear = monro_geometry::Matrix3 { rows: [[0.5, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, -2.0]] };
        let place = monro_geometry::Affine::new(linear, [-10.0, 20.0, 3.5]);
        let grid = monro_geometry::Grid::new([5, 3, 6], place).expect("grid");
        let label = |n: usize| if (30..60).contains(&n) { [0u8, 5, 6, 7, 4][n % 5] } else { 0 };
        let labels = Volume::new(grid, (0..90).map(label).collect()).expect("labels");
        let dir = tempfile::tempdir().expect("temp");
        let file = dir.path().join("labels.dcm");
        std::fs::write(&file, seg::encode(&labels, "nobody").expect("encoded")).expect("write");
        let found = read(&file).expect("labels");
        assert_eq!(found.volume.grid().dims(), [5, 3, 6]);
        for n in 0..grid.len() {
            let [i, j, k] = grid.voxel(n);
            assert_eq!(found.volume.nearest(grid.centre(i, j, k)), Some(u16::from(label(n))), "{i} {j} {k}");
        }
        let empty = labels.map(|_| 0u8);
        assert_eq!(seg::encode(&empty, "nobody"), Err(seg::SegError::Empty));
    }

    #[test]
    fn numbers_follow_the_structures_and_strangers_are_told() {
        let grid = monro_geometry::Grid::axis_aligned([4, 1, 1], [1.0; 3], [0.0; 3]).expect("grid");
        let volume = Volume::new(grid, vec![0, 9, 300, 2]).expect("volume");
        let known = [segment(9, "brain", ["", ""]), segment(300, "skull", ["", ""]), segment(2, "tumour", ["", ""])];
        let found = renumbered(volume.clone(), &known).expect("labels");
        assert_eq!(found.volume.data(), [0, 4, 2, 0]);
        assert!(found.warnings.len() == 1 && found.warnings[0].contains("tumour"));
        let said = renumbered(volume, &known[2..]).expect_err("nothing known").to_string();
        assert!(said.contains("tumour") && said.contains("third_ventricle"), "{said}");
    }

    #[test]
    fn a_segment_with_the_value_of_the_background_took_all_of_it() {
        let grid = monro_geometry::Grid::axis_aligned([3, 1, 1], [1.0; 3], [0.0; 3]).expect("grid");
        let volume = Volume::new(grid, vec![0, 0, 2]).expect("volume");
        let found =
            renumbered(volume, &[segment(0, "brain", ["", ""]), segment(2, "skull", ["", ""])]).expect("labels");
        assert_eq!(found.volume.data(), [0, 0, 2]);
        assert!(found.warnings.len() == 1 && found.warnings[0].contains("background"), "{:?}", found.warnings);
    }

    #[test]
    fn voxels_whose_number_no_segment_names_were_left_out_without_a_word() {
        let grid = monro_geometry::Grid::axis_aligned([6, 1, 1], [1.0; 3], [0.0; 3]).expect("grid");
        let volume = Volume::new(grid, vec![0, 9, 7, 7, 300, 2]).expect("volume");
        let found =
            renumbered(volume, &[segment(9, "brain", ["", ""]), segment(2, "skull", ["", ""])]).expect("labels");
        assert_eq!(found.volume.data(), [0, 4, 0, 0, 0, 2]);
        let said = "3 voxels have values that no segment of the file names (7, 300)";
        assert!(found.warnings.len() == 1 && found.warnings[0].contains(said), "{:?}", found.warnings);
    }
}
