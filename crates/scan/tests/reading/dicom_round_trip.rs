//! A volume written as a DICOM series is read back to the same values at the same places.

use crate::common::{grid, sampled};
use monro_geometry::Volume;
use monro_scan::dicom::{SeriesMeta, write_series};
use monro_scan::{ReadOptions, read};
use proptest::prelude::*;

fn options() -> ReadOptions {
    ReadOptions { any_size: true, ..ReadOptions::default() }
}

/// Largest distance between a voxel of `a` and the voxel of `b` with its value and index (or mirrored slice index).
fn misplaced(a: &Volume<i16>, b: &Volume<i16>) -> f64 {
    let [x, y, z] = a.grid().dims();
    let mirrored = a.grid().centre(0, 0, 0).distance(b.grid().centre(0, 0, 0)) > 1e-3;
    let mut worst: f64 = 0.0;
    for k in 0..z {
        let l = if mirrored { z - 1 - k } else { k };
        for (i, j) in [(0, 0), (x - 1, 0), (0, y - 1), (x - 1, y - 1)] {
            worst = worst.max(a.grid().centre(i, j, k).distance(b.grid().centre(i, j, l)));
        }
        let plane = |v: &Volume<i16>, k: usize| v.data()[k * x * y..(k + 1) * x * y].to_vec();
        let expected: Vec<i16> = plane(a, k).into_iter().map(|v| v.max(-1024)).collect();
        assert_eq!(expected, plane(b, l), "slice {k}");
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn values_and_placement_come_back(
        dims in proptest::array::uniform3(3usize..9),
        spacing in proptest::array::uniform3(0.2..6.0f64),
        angles in proptest::array::uniform3(-3.2..3.2f64),
        offset in proptest::array::uniform3(-700.0..700.0f64),
        mirrored in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let volume = sampled(grid(dims, spacing, angles, offset, mirrored));
        let folder = tempfile::tempdir().expect("a temporary folder");
        let meta = SeriesMeta { seed, ..SeriesMeta::default() };
        let files = write_series(&volume, folder.path(), &meta).expect("written");
        prop_assert_eq!(files.len(), dims[2]);
        let scan = read(folder.path(), &options()).expect("read back");
        prop_assert_eq!(&scan.resampled, &None);
        // Positions have at least 11 decimals, directions 12: far below the error of any scanner.
        prop_assert!(misplaced(&volume, &scan.volume) < 1e-8);
    }
}

#[test]
fn extreme_values_come_back_and_equal_input_gives_equal_files() {
    let grid = grid([2, 2, 3], [1.0; 3], [0.0; 3], [0.0; 3], false);
    let data = vec![i16::MIN, -1025, -1024, -1, 0, 1, 40, 3071, 5449, 20000, 32766, i16::MAX];
    let volume = Volume::new(grid, data).expect("twelve values");
    let [a, b] = [(); 2].map(|()| tempfile::tempdir().expect("a temporary folder"));
    let written = [&a, &b].map(|d| write_series(&volume, d.path(), &SeriesMeta::default()).expect("written"));
    for (p, q) in written[0].iter().zip(&written[1]) {
        assert_eq!(std::fs::read(p).expect("there"), std::fs::read(q).expect("there"));
    }
    let scan = read(a.path(), &options()).expect("read back");
    assert!(misplaced(&volume, &scan.volume) < 1e-12);
    assert!(scan.warnings.iter().any(|w| w.contains("2 voxels") && w.contains("-32768")), "{:?}", scan.warnings);
    assert!(!scan.pseudonym.to_uppercase().contains("NOBODY"));
    assert_eq!(scan.source.description.as_deref(), Some("Digital phantom"));
}

/// What stands before a data set: preamble and mark, or the file meta information as well (as old archives and captures of a network
/// leave it out).
#[test]
fn files_without_preamble_or_meta_information_are_read_like_those_with() {
    let volume = sampled(grid([7, 5, 4], [0.6, 0.7, 2.0], [0.1, -0.2, 0.3], [5.0; 3], false));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = write_series(&volume, folder.path(), &SeriesMeta::default()).expect("written");
    let whole = read(folder.path(), &options()).expect("read back");
    for cut in [
        |_: &[u8]| 132,
        |bytes: &[u8]| 132 + 12 + u32::from_le_bytes(bytes[140..144].try_into().expect("four")) as usize,
    ] {
        let bare = tempfile::tempdir().expect("a temporary folder");
        for file in &files {
            let bytes = std::fs::read(file).expect("there");
            let name = file.file_name().expect("a name");
            std::fs::write(bare.path().join(name), &bytes[cut(&bytes)..]).expect("written");
        }
        let scan = read(bare.path(), &options()).expect("read without preamble");
        assert_eq!(scan.volume.data(), whole.volume.data());
        assert_eq!(scan.volume.grid(), whole.volume.grid());
        assert_eq!(scan.warnings, whole.warnings);
    }
}
