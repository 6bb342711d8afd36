//! Which images of a folder make one volume, and which of several is taken.

use crate::common::{any_size, edit, folder, sampled};
use dicom_core::VR;
use dicom_dictionary_std::tags;
use monro_geometry::Grid;
use monro_scan::dicom::{SeriesMeta, write_series};
use monro_scan::{Inspection, inspect, read};
use std::path::{Path, PathBuf};

/// An acquisition of one series: slices from a height on, all of a step, mm. Gives its files.
fn acquire(dir: &Path, number: usize, from: f64, step: f64, slices: usize) -> Vec<PathBuf> {
    let upright = Grid::axis_aligned([5, 4, slices], [1.0, 1.0, step], [0.0, 0.0, from]).expect("a grid");
    let mut volume = sampled(upright);
    // Other values at each place than those of any other acquisition.
    volume.data_mut().iter_mut().for_each(|v| *v += number as i16);
    let files = write_series(&volume, &dir.join(number.to_string()), &SeriesMeta::default()).expect("written");
    files.iter().for_each(|file| edit(file, tags::ACQUISITION_NUMBER, VR::IS, &number.to_string()));
    files
}

fn listed(dir: &Path) -> Inspection {
    inspect(dir).expect("a listing")
}

/// Slices of each series, and what is told of acquisitions of the one that is taken.
fn found(dir: &Path) -> (Vec<usize>, Option<String>) {
    let listed = listed(dir);
    let told = listed.warnings.into_iter().find(|w| w.contains("AcquisitionNumber"));
    (listed.series.iter().map(|s| s.images).collect(), told)
}

#[test]
fn a_scan_repeated_half_a_step_off_made_one_volume_of_two_heads() {
    let f = folder();
    acquire(f.path(), 1, 0.0, 2.0, 20);
    acquire(f.path(), 2, 1.0, 2.0, 20);
    let (slices, told) = found(f.path());
    assert_eq!(slices, [20, 20]);
    let told = told.expect("a remark");
    assert!(told.contains("AcquisitionNumber 1 (20 slices) lie between others"), "{told}");
    assert!(told.contains("(AcquisitionNumber 2 (20 slices))"), "{told}");
    let scan = read(f.path(), &any_size()).expect("a scan");
    assert!(scan.warnings.contains(&told) && scan.volume.grid().dims() == [5, 4, 20], "{:?}", scan.warnings);
}

#[test]
fn blocks_that_overlap_by_ten_slices_were_interleaved() {
    let f = folder();
    acquire(f.path(), 1, 0.0, 2.0, 25);
    acquire(f.path(), 2, 31.0, 2.0, 18);
    let (slices, told) = found(f.path());
    assert_eq!(slices, [25, 18]);
    assert!(told.is_some_and(|t| t.contains("what only the others show is missing")));
}

#[test]
fn halves_of_a_head_that_were_both_repeated_are_joined_to_two_heads() {
    let f = folder();
    for (number, from) in [(1, 0.0), (2, 24.0), (3, 1.0), (4, 25.0)] {
        acquire(f.path(), number, from, 2.0, 12);
    }
    let (slices, told) = found(f.path());
    assert_eq!(slices, [24, 24]);
    assert!(told.is_some_and(|t| t.contains("AcquisitionNumber 1, 2 (24 slices)")));
}

#[test]
fn acquisitions_that_go_on_in_each_other_stay_one_series() {
    type Block = (usize, f64, f64, usize);
    let positions: Vec<Block> = (0..10).map(|n| (n + 1, 2.0 * n as f64, 2.0, 1)).collect();
    let rounds: Vec<Block> =
        (0..10).map(|n| (n % 5 * 2 + n / 5 + 1, 4.0 * (n % 5) as f64 + 2.0 * (n / 5) as f64, 2.0, 1)).collect();
    for (blocks, what) in [
        (vec![(1, 0.0, 2.0, 12), (2, 24.0, 2.0, 12)], "blocks that abut"),
        (vec![(1, 0.0, 4.0, 8), (2, 32.0, 7.0, 8)], "blocks of two spacings"),
        (vec![(1, 0.0, 2.0, 12), (2, 21.0, 2.0, 12)], "blocks that overlap by a slice"),
        (positions, "a slice at each position of the table"),
        (rounds, "two rounds of single slices"),
        ((0..4).map(|n| (n + 1, 7.5 * n as f64, 0.6, 16)).collect(), "positions that overlap by three slices"),
    ] {
        let f = folder();
        let slices: usize = blocks.iter().map(|b| b.3).sum();
        for (number, from, step, slices) in blocks {
            acquire(f.path(), number, from, step, slices);
        }
        assert_eq!(found(f.path()), (vec![slices], None), "{what}");
    }
}

#[test]
fn acquisitions_that_are_not_whole_without_each_other_stay_one_series_with_a_remark() {
    let f = folder();
    // Every second slice in a first round, the others in a second.
    for (number, from) in [(1, 0.0), (2, 2.0)] {
        for file in acquire(f.path(), number, from, 4.0, 12) {
            edit(&file, tags::SLICE_THICKNESS, VR::DS, "2");
        }
    }
    let (slices, told) = found(f.path());
    assert!(slices == [24] && told.is_some_and(|t| t.contains("taken as one scan")));
    // Of these, the odd and the even would leave gaps.
    let f = folder();
    for number in 1..=5 {
        acquire(f.path(), number, 10.3 * number as f64, 1.0, 17);
    }
    let (slices, told) = found(f.path());
    assert!(slices == [85] && told.is_some_and(|t| t.contains("taken as one scan")));
}

#[test]
fn copies_under_another_acquisition_number_are_left_out() {
    let f = folder();
    acquire(f.path(), 1, 0.0, 2.0, 12);
    for file in write_copy(f.path()) {
        edit(&file, tags::ACQUISITION_NUMBER, VR::IS, "2");
    }
    assert_eq!(found(f.path()), (vec![12], None));
}

/// The files of the first acquisition once more.
fn write_copy(dir: &Path) -> Vec<PathBuf> {
    let copy = dir.join("copy");
    std::fs::create_dir(&copy).expect("made");
    let name = |n: usize| format!("{n:04}.dcm");
    let files: Vec<PathBuf> = (1..=12).map(|n| copy.join(name(n))).collect();
    for (n, file) in files.iter().enumerate() {
        std::fs::copy(dir.join("1").join(name(n + 1)), file).expect("copied");
    }
    files
}

/// A series of its own, with values of a type.
fn of_type(dir: &Path, seed: u64, slices: usize, kind: &str) {
    let upright = Grid::axis_aligned([5, 4, slices], [1.0, 1.0, 2.0], [0.0; 3]).expect("a grid");
    let meta = SeriesMeta { seed, ..SeriesMeta::default() };
    let files = write_series(&sampled(upright), &dir.join(seed.to_string()), &meta).expect("written");
    files.iter().for_each(|file| edit(file, tags::RESCALE_TYPE, VR::LO, kind));
}

#[test]
fn a_spectral_map_was_taken_for_the_head_ct() {
    for map in ["%EDW", "MGML", "Z_EFF", "ED", "OD", "PCT"] {
        let f = folder();
        of_type(f.path(), 1, 30, map);
        let refusal = read(f.path(), &any_size()).expect_err("a refusal").to_string();
        assert!(refusal.contains(&format!("RescaleType {map:?}, not HU")), "{refusal}");
        assert!(refusal.contains("export the conventional images"), "{refusal}");
        assert!(listed(f.path()).series[0].refusal.as_ref().is_some_and(|r| refusal.contains(r)));
        of_type(f.path(), 2, 10, "HU");
        let listed = listed(f.path());
        assert_eq!(listed.chosen.map(|n| listed.series[n].images), Some(10), "{listed:?}");
    }
}

#[test]
fn values_that_may_be_no_hu_come_after_those_that_are() {
    let f = folder();
    of_type(f.path(), 1, 30, "HU_MOD");
    let scan = read(f.path(), &any_size()).expect("a scan");
    assert!(scan.warnings.iter().any(|w| w.contains("RescaleType is \"HU_MOD\"")), "{:?}", scan.warnings);
    of_type(f.path(), 2, 10, "US");
    let listed = listed(f.path());
    assert_eq!(listed.chosen.map(|n| listed.series[n].images), Some(10), "{listed:?}");
    assert!(listed.reason.contains("its values are in HU"), "{}", listed.reason);
    assert!(!listed.warnings.iter().any(|w| w.contains("RescaleType")), "{:?}", listed.warnings);
}

#[cfg(unix)]
#[test]
fn a_folder_of_links_to_folders_was_said_to_hold_no_file() {
    use std::os::unix::fs::symlink;
    let (f, elsewhere) = (folder(), folder());
    of_type(elsewhere.path(), 1, 10, "HU");
    symlink(elsewhere.path(), f.path().join("series")).expect("linked");
    // In a circle, and the same once more.
    symlink(f.path(), elsewhere.path().join("back")).expect("linked");
    symlink(elsewhere.path().join("1"), f.path().join("again")).expect("linked");
    let scan = read(f.path(), &any_size()).expect("a scan");
    assert_eq!(scan.volume.grid().dims(), [5, 4, 10]);
    assert!(!scan.warnings.iter().any(|w| w.contains("left out")), "{:?}", scan.warnings);
}

#[test]
fn half_of_a_head_was_taken_and_the_other_half_not_named() {
    let f = folder();
    acquire(f.path(), 1, 0.0, 2.0, 25);
    for file in acquire(f.path(), 2, 50.0, 2.0, 24) {
        edit(&file, tags::SERIES_INSTANCE_UID, VR::UI, "1.2.3.4");
    }
    let told =
        |dir: &Path| read(dir, &any_size()).expect("a scan").warnings.into_iter().find(|w| w.contains("goes on"));
    let said = told(f.path()).expect("a remark");
    assert!(said.contains("is 48 mm high") && said.contains("for 48 mm beyond"), "{said}");
    // A thicker copy of the same place goes on for nothing.
    let f = folder();
    acquire(f.path(), 1, 0.0, 2.0, 25);
    for file in acquire(f.path(), 2, 0.0, 4.0, 13) {
        edit(&file, tags::SERIES_INSTANCE_UID, VR::UI, "1.2.3.4");
    }
    assert_eq!(told(f.path()), None);
}

#[test]
fn a_second_number_of_the_kernel_split_a_head_in_two() {
    let f = folder();
    for (n, file) in acquire(f.path(), 1, 0.0, 2.0, 24).iter().enumerate() {
        edit(file, tags::CONVOLUTION_KERNEL, VR::SH, if n < 11 { "H31s\\3" } else { "H31s\\2" });
    }
    assert_eq!(found(f.path()).0, [24]);
}

#[test]
fn a_picture_of_a_screen_refused_the_series_that_it_was_filed_with() {
    let f = folder();
    let files = acquire(f.path(), 1, 0.0, 2.0, 24);
    edit(&files[7], tags::SOP_CLASS_UID, VR::UI, "1.2.840.10008.5.1.4.1.1.7");
    edit(&files[7], tags::IMAGE_POSITION_PATIENT, VR::DS, "");
    assert_eq!(found(f.path()).0, [23, 1]);
    assert_eq!(read(f.path(), &any_size()).expect("a scan").volume.grid().dims()[2], 24);
}

#[test]
fn a_slice_astray_refused_a_head_and_was_not_named() {
    let f = folder();
    let files = acquire(f.path(), 1, 0.0, 2.0, 40);
    edit(&files[39], tags::IMAGE_POSITION_PATIENT, VR::DS, "0\\0\\150");
    let error = read(f.path(), &any_size()).expect_err("a gap").to_string();
    assert!(error.contains("72.0 mm apart") || error.contains("74.0 mm apart"), "{error}");
    assert!(error.contains("1 slice(s) beyond it") && error.contains("move 0040.dcm away"), "{error}");
}
