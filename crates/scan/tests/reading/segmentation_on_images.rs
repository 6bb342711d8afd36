//! A DICOM segmentation that refers to its images. `scripts/oracle_labels.py` reads the same with highdicom.

use crate::common;
use dicom_core::value::{DataSetSequence, PrimitiveValue};
use dicom_core::{DataElement, VR};
use dicom_dictionary_std::tags;
use dicom_object::{InMemDicomObject, open_file};
use monro_geometry::{Grid, Structure, Volume};
use monro_scan::dicom::seg::{Images, SegError, encode, encode_on};
use monro_scan::dicom::{SeriesMeta, write_series};
use monro_scan::{ReadOptions, labels};
use std::path::Path;

const BRAIN: u8 = Structure::Brain.label();
const THIRD: u8 = Structure::ThirdVentricle.label();

/// A turned series of 7 slices; labels on the same grid.
fn series(folder: &Path) -> (Images, Grid) {
    let grid = common::grid([9, 8, 7], [0.7, 0.9, 2.5], [0.1, -0.2, 0.3], [-4.0, 12.0, 33.0], false);
    write_series(&common::sampled(grid), folder, &SeriesMeta::default()).expect("series");
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    (Images::of(folder, &options).expect("images"), grid)
}

/// Brain with a third ventricle in the middle slices.
fn drawn(grid: Grid) -> Volume<u8> {
    let label = |n: usize| match grid.voxel(n) {
        [3..6, 3..6, 2..5] => THIRD,
        [1..8, 1..7, 1..6] => BRAIN,
        _ => 0,
    };
    Volume::new(grid, (0..grid.len()).map(label).collect()).expect("labels")
}

fn items(o: &InMemDicomObject, tag: dicom_core::Tag) -> Vec<InMemDicomObject> {
    o.get(tag).and_then(|e| e.items()).unwrap_or_default().to_vec()
}

fn text(o: &InMemDicomObject, tag: dicom_core::Tag) -> String {
    let value = o.get(tag).unwrap_or_else(|| panic!("{tag} is missing")).to_str().expect("text");
    value.trim_end_matches(['\0', ' ']).to_owned()
}

#[test]
fn every_frame_names_the_image_at_its_place() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, grid) = series(&dir.path().join("series"));
    let (bytes, remark) = encode_on(&drawn(grid), &images).expect("encoded");
    assert_eq!(remark, None);
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, bytes).expect("write");
    let seg = open_file(&file).expect("DICOM").into_inner();
    let slice = |n: usize| open_file(dir.path().join(format!("series/{n:04}.dcm"))).expect("slice").into_inner();
    for tag in [tags::STUDY_INSTANCE_UID, tags::FRAME_OF_REFERENCE_UID, tags::PATIENT_NAME, tags::PATIENT_ID] {
        assert_eq!(text(&seg, tag), text(&slice(1), tag));
    }
    let referenced = items(&seg, tags::REFERENCED_SERIES_SEQUENCE);
    assert_eq!(text(&referenced[0], tags::SERIES_INSTANCE_UID), text(&slice(1), tags::SERIES_INSTANCE_UID));
    assert_eq!(items(&referenced[0], tags::REFERENCED_INSTANCE_SEQUENCE).len(), 7);
    let frames = items(&seg, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
    // Brain in five slices and, so that a reader finds the whole grid, in the first and last; the ventricle in three.
    assert_eq!(frames.len(), 10);
    for frame in frames {
        let source = &items(&items(&frame, tags::DERIVATION_IMAGE_SEQUENCE)[0], tags::SOURCE_IMAGE_SEQUENCE)[0];
        let uid = text(source, tags::REFERENCED_SOP_INSTANCE_UID);
        let image = (1..=7).map(slice).find(|s| text(s, tags::SOP_INSTANCE_UID) == uid).expect("a slice of the series");
        let place = text(&items(&frame, tags::PLANE_POSITION_SEQUENCE)[0], tags::IMAGE_POSITION_PATIENT);
        assert_eq!(place, text(&image, tags::IMAGE_POSITION_PATIENT));
    }
}

#[test]
fn labels_on_another_grid_come_onto_the_images_and_what_lies_beyond_is_told() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, grid) = series(&dir.path().join("series"));
    // Twice the slices, beginning 3.75 mm below the first image: each image lies half way between the centres of two.
    let mut place = *grid.patient_from_voxel();
    let up = place.linear.column(2).map(|c| c / 2.0);
    place.linear = monro_geometry::Matrix3::from_columns(
        monro_geometry::Vector::<monro_geometry::Patient>::from_array(place.linear.column(0)),
        monro_geometry::Vector::from_array(place.linear.column(1)),
        monro_geometry::Vector::from_array(up),
    );
    for (offset, c) in place.offset.iter_mut().zip(up) {
        *offset -= 3.2 * c;
    }
    let fine = Grid::new([9, 8, 17], place).expect("grid");
    let labels = Volume::new(fine, (0..fine.len()).map(|n| if fine.voxel(n)[0] < 4 { BRAIN } else { THIRD }).collect());
    let (bytes, remark) = encode_on(&labels.expect("labels"), &images).expect("encoded");
    // Slices lie at -3.2, -2.2, .. 12.8 half steps; the images reach from -1 to 13: the first three are beyond.
    assert_eq!(remark.as_deref(), Some("17.6 % of the labelled voxels lie beyond the images and were left out"));
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, bytes).expect("write");
    let back = labels::read(&file).expect("labels").volume;
    assert!(common::corner_distance(back.grid(), &grid) < 1e-4);
    for n in 0..grid.len() {
        let wanted = if grid.voxel(n)[0] < 4 { BRAIN } else { THIRD };
        assert_eq!(back.data()[n], u16::from(wanted), "{:?}", grid.voxel(n));
    }
}

#[test]
fn labels_on_a_tilted_series_of_two_spacings_could_be_written_but_not_read() {
    let Some(folder) = common::data("head-ct-dicom-tilt") else { return };
    let folder = folder.join("dicom");
    let scan = monro_scan::read(&folder, &ReadOptions::default()).expect("scan").volume;
    // A ball of 50 mm in the middle of the scan.
    let grid = *scan.grid();
    let [i, j, k] = grid.dims().map(|d| d / 2);
    let middle = grid.centre(i, j, k);
    let ball = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        if grid.centre(i, j, k).distance(middle) < 50.0 { BRAIN } else { 0 }
    };
    let labels = Volume::new(grid, (0..grid.len()).map(ball).collect()).expect("labels");
    let (bytes, remark) =
        encode_on(&labels, &Images::of(&folder, &ReadOptions::default()).expect("images")).expect("on");
    assert_eq!(remark, None);
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, bytes).expect("write");
    let back = labels::read(&file).expect("labels").volume;
    // On the planes, up to 7 mm apart, the ball is right to half a pixel; between them the nearest plane holds, whose
    // ball is at most 3.5 mm off along the normal: together at most 4 mm from the ball's surface.
    for n in (0..back.grid().len()).step_by(7) {
        let [i, j, k] = back.grid().voxel(n);
        let off = back.grid().centre(i, j, k).distance(middle) - 50.0;
        assert!(off.abs() < 4.0 || (off < 0.0) == (back.data()[n] == u16::from(BRAIN)), "{off} mm: {}", back.data()[n]);
    }
}

#[test]
fn where_a_slice_of_the_series_is_missing_its_labels_came_back_with_an_empty_plane() {
    let dir = tempfile::tempdir().expect("temp");
    let (_, grid) = series(&dir.path().join("series"));
    std::fs::remove_file(dir.path().join("series/0004.dcm")).expect("there");
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    let images = Images::of(&dir.path().join("series"), &options).expect("images");
    let (bytes, _) = encode_on(&drawn(grid), &images).expect("encoded");
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, bytes).expect("write");
    let back = labels::read(&file).expect("labels").volume;
    assert!(common::corner_distance(back.grid(), &grid) < 1e-4);
    // Slice 3 has no image. Its neighbours are alike.
    for n in 0..grid.len() {
        assert_eq!(back.data()[n], u16::from(drawn(grid).data()[n]), "{:?}", grid.voxel(n));
    }
}

#[test]
fn labels_of_one_patient_went_onto_the_images_of_another_without_a_word() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, grid) = series(&dir.path().join("series"));
    let other =
        SeriesMeta { patient_id: "X1".into(), patient_name: "Doe^Jane".into(), seed: 7, ..SeriesMeta::default() };
    write_series(&common::sampled(grid), &dir.path().join("other"), &other).expect("series");
    let options = ReadOptions { any_size: true, ..ReadOptions::default() };
    let others = Images::of(&dir.path().join("other"), &options).expect("images");
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, encode_on(&drawn(grid), &images).expect("encoded").0).expect("write");
    let drawn_on = labels::read(&file).expect("labels").drawn_on.expect("it says so");
    assert!(others.is_another_patient(&drawn_on) && !images.is_another_patient(&drawn_on));
    let source = |folder: &str| monro_scan::read(&dir.path().join(folder), &options).expect("scan").source;
    assert_eq!(drawn_on.unlike(&source("series")), None);
    assert!(drawn_on.unlike(&source("other")).expect("told").contains("another patient"));
    // Labels that nobody's images are named in say nothing.
    std::fs::write(&file, encode(&drawn(grid), "anonymous").expect("encoded")).expect("write");
    let drawn_on = labels::read(&file).expect("labels").drawn_on.expect("a segmentation");
    assert_eq!(drawn_on.unlike(&source("other")), None);
    assert!(!images.is_another_patient(&drawn_on) && !format!("{drawn_on:?}").contains("anonymous"));
}

#[test]
fn labels_of_another_head_are_refused_with_both_geometries() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, _) = series(&dir.path().join("series"));
    let far = Grid::axis_aligned([5, 6, 4], [1.0; 3], [900.0, 0.0, 0.0]).expect("grid");
    let said = encode_on(&Volume::filled(far, BRAIN), &images).expect_err("far away").to_string();
    for part in ["[5, 6, 4]", "[900.0, 0.0, 0.0]", "[9, 8, 7]", "[-4.0, 12.0, 33.0]"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(encode_on(&Volume::filled(far, 0), &images), Err(SegError::Empty));
}

#[test]
fn without_images_nobody_and_nothing_is_named() {
    let grid = Grid::axis_aligned([5, 6, 4], [1.0; 3], [0.0; 3]).expect("grid");
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, encode(&Volume::filled(grid, BRAIN), "anonymous").expect("encoded")).expect("write");
    let seg = open_file(&file).expect("DICOM").into_inner();
    assert_eq!(text(&seg, tags::PATIENT_NAME), "anonymous");
    assert!(seg.get(tags::REFERENCED_SERIES_SEQUENCE).is_none());
}

/// Rewrites a stored segmentation.
fn rewritten(file: &Path, change: impl Fn(&mut InMemDicomObject)) {
    let mut seg = open_file(file).expect("DICOM");
    change(&mut seg);
    seg.write_to_file(file).expect("written");
}

/// Of two that claimed a voxel the one that came last in the file had it; with an unknown one last there was a hole.
#[test]
fn where_segments_overlap_the_last_one_cut_the_others() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, grid) = series(&dir.path().join("series"));
    let file = dir.path().join("labels.dcm");
    let (bytes, _) = encode_on(&drawn(grid), &images).expect("encoded");
    std::fs::write(&file, bytes).expect("write");
    assert!(labels::read(&file).expect("labels").warnings.is_empty());
    // All of every frame: brain in seven slices, and in the middle three the ventricle, too. Frames in reverse: brain comes last.
    rewritten(&file, |seg| {
        let frames = items(seg, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).into_iter().rev().collect::<Vec<_>>();
        let sequence = DataSetSequence::from(frames);
        seg.put(DataElement::new(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, VR::SQ, sequence));
        let bits = seg.element(tags::PIXEL_DATA).expect("pixels").to_bytes().expect("bytes").len();
        seg.put(DataElement::new(tags::PIXEL_DATA, VR::OB, PrimitiveValue::from(vec![0xff_u8; bits])));
    });
    let read = labels::read(&file).expect("labels");
    let label = |n: usize, inner: u8| u16::from(if (2..5).contains(&grid.voxel(n)[2]) { inner } else { BRAIN });
    assert!((0..grid.len()).all(|n| read.volume.data()[n] == label(n, THIRD)));
    assert!(read.warnings.len() == 1 && read.warnings[0].contains("overlap in 216 voxels"), "{:?}", read.warnings);
    // What is no structure of a case takes nothing from what is one.
    rewritten(&file, |seg| {
        let mut segments = items(seg, tags::SEGMENT_SEQUENCE);
        for third in segments.iter_mut().filter(|s| text(s, tags::SEGMENT_LABEL).contains("third")) {
            third.put(DataElement::new(tags::SEGMENT_LABEL, VR::LO, "haematoma"));
            third.remove_element(tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE);
        }
        seg.put(DataElement::new(tags::SEGMENT_SEQUENCE, VR::SQ, DataSetSequence::from(segments)));
    });
    let read = labels::read(&file).expect("labels");
    assert!((0..grid.len()).all(|n| read.volume.data()[n] == label(n, BRAIN)));
    assert!(read.warnings.len() == 1 && read.warnings[0].contains("haematoma"), "{:?}", read.warnings);
}

#[test]
fn frames_turned_against_each_other_were_read_as_if_they_were_not() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, grid) = series(&dir.path().join("series"));
    let file = dir.path().join("labels.dcm");
    std::fs::write(&file, encode_on(&drawn(grid), &images).expect("encoded").0).expect("write");
    rewritten(&file, |seg| {
        let mut frames = items(seg, tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
        let mut own = InMemDicomObject::new_empty();
        own.put(DataElement::new(tags::IMAGE_ORIENTATION_PATIENT, VR::DS, PrimitiveValue::from("1\\0\\0\\0\\0\\-1")));
        let turned = DataSetSequence::from(vec![own]);
        frames[4].put(DataElement::new(tags::PLANE_ORIENTATION_SEQUENCE, VR::SQ, turned));
        let sequence = DataSetSequence::from(frames);
        seg.put(DataElement::new(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, VR::SQ, sequence));
    });
    let said = labels::read(&file).expect_err("refused").to_string();
    assert!(said.contains("frame 5 lies otherwise"), "{said}");
}

/// 16 MB of sequences within sequences ended the program: nothing bounded their depth.
#[test]
fn a_segmentation_of_endless_sequences_is_refused() {
    let dir = tempfile::tempdir().expect("temp");
    let (images, grid) = series(&dir.path().join("series"));
    let file = dir.path().join("labels.dcm");
    let bytes = encode_on(&drawn(grid), &images).expect("encoded").0;
    let pixels = bytes.windows(6).position(|w| w == [0xe0, 0x7f, 0x10, 0x00, b'O', b'B']).expect("pixel data");
    // Sequences and items of undefined length, within each other.
    let begun =
        [0xdf, 0x7f, 0x01, 0x10, b'S', b'Q', 0, 0, 0xff, 0xff, 0xff, 0xff, 0xfe, 0xff, 0, 0xe0, 0xff, 0xff, 0xff, 0xff];
    std::fs::write(&file, [&bytes[..pixels], &begun.repeat(800_000), &bytes[pixels..]].concat()).expect("write");
    let said = labels::read(&file).map(|_| ()).expect_err("refused").to_string();
    assert!(said.contains("labels.dcm"), "{said}");
}
