//! Damaged files: truncations and corruptions all along small files (with a stride; stride 1 has been run by hand) end in a volume or a named
//! refusal, never in a panic, and never take memory beyond the scale of the file.

use crate::common::{grid, sampled};
use monro_geometry::Volume;
use monro_scan::dicom::{SeriesMeta, write_series};
use monro_scan::{ReadOptions, inspect, nifti, nrrd, read, read_labels};
use std::fs;
use std::path::{Path, PathBuf};

/// Replacements for one byte: other signs, other sizes, other characters.
const VALUES: [u8; 4] = [0x00, 0x7f, 0xff, b'9'];
/// The largest resident set that this test may ever reach, MiB: the test itself, and the few MiB that a damaged header
/// may make a reader ask for.
const MOST_MIB: u64 = 192;

fn options() -> ReadOptions {
    ReadOptions { any_size: true, ..ReadOptions::default() }
}

/// Peak resident set of this process, MiB; 0 where the system does not say.
fn peak_mib() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) / 1024
}

/// Reads `scan` once for every damage to `file`, which is `scan` itself or one file in it.
fn attack(scan: &Path, file: &Path, stride: usize) {
    let whole = fs::read(file).expect("a sound file");
    assert!(read(scan, &options()).is_ok(), "{:?}", read(scan, &options()).err());
    let (mut read_anyway, mut refused) = (0, 0);
    let mut once = |bytes: &[u8]| {
        fs::write(file, bytes).expect("a writable file");
        match read(scan, &options()) {
            Ok(_) => read_anyway += 1,
            Err(e) => {
                refused += 1;
                assert!(!e.to_string().is_empty());
            }
        }
    };
    for length in (0..whole.len()).step_by(stride) {
        once(&whole[..length]);
    }
    for at in (0..whole.len()).step_by(stride) {
        for value in VALUES {
            let mut bytes = whole.clone();
            bytes[at] = value;
            once(&bytes);
        }
    }
    // Lengths and sizes are wider than a byte.
    for at in (0..whole.len().saturating_sub(4)).step_by(stride) {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&0xffff_fff0_u32.to_le_bytes());
        once(&bytes);
    }
    fs::write(file, &whole).expect("a writable file");
    println!("{}: {read_anyway} read, {refused} refused, peak {} MiB", file.display(), peak_mib());
    assert!(refused > 0);
    assert!(peak_mib() < MOST_MIB, "{} MiB", peak_mib());
}

fn small_volume() -> Volume<i16> {
    sampled(grid([5, 4, 3], [1.0, 1.5, 2.0], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0], false))
}

#[test]
fn damaged_single_files_are_read_or_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let volume = small_volume();
    let put = |name: &str, bytes: &[u8]| -> PathBuf {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("written");
        path
    };
    let header = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
                  TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = 1 1 1\nDimSize = 5 4 3\n\
                  ElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    let voxels: Vec<u8> = volume.data().iter().flat_map(|v| v.to_le_bytes()).collect();
    let gz = nifti::encode_i16(&volume);
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&gz[..]), &mut plain).expect("gzip");
    for path in [
        put("a.nii", &plain),
        put("a.nii.gz", &gz),
        put("a.nrrd", &nrrd::encode_i16(&volume)),
        put("a.mha", &[header.as_bytes(), &voxels].concat()),
    ] {
        attack(&path, &path, 3);
    }
}

#[test]
fn damaged_dicom_files_are_read_or_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = write_series(&small_volume(), folder.path(), &SeriesMeta::default()).expect("written");
    attack(folder.path(), &files[1], 11);
}

#[test]
fn damaged_compressed_dicom_files_are_read_or_refused() {
    for codec in ["jpeg-lossless", "jpeg-2000", "rle"] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let source = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data")).join(codec);
        for name in ["0.dcm", "1.dcm", "2.dcm"] {
            fs::copy(source.join(name), folder.path().join(name)).expect("copied");
        }
        attack(folder.path(), &folder.path().join("1.dcm"), 13);
    }
}

#[test]
fn random_bytes_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("noise");
    let mut state = 1u64;
    let mut byte = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) as u8
    };
    let magics: [&[u8]; 5] = [b"", b"NRRD0004\n", b"NDims = 3\n", &[0x1f, 0x8b, 8, 0], &[0x5c, 1, 0, 0]];
    for round in 0..400 {
        let mut bytes: Vec<u8> = (0..round * 5).map(|_| byte()).collect();
        if round % 6 == 5 {
            bytes.resize(bytes.len().max(140), 0);
            bytes[128..132].copy_from_slice(b"DICM");
        } else {
            bytes.splice(0..0, magics[round % 6].iter().copied());
        }
        fs::write(&path, &bytes).expect("written");
        assert!(read(&path, &options()).is_err() && inspect(&path).is_err() && read_labels(&path).is_err());
        assert!(read(folder.path(), &options()).is_err());
    }
}

#[test]
fn a_flipped_bit_in_a_compressed_file_changed_labels_in_silence() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("labels.nii.gz");
    let grid = monro_geometry::Grid::axis_aligned([24, 20, 16], [1.0; 3], [0.0; 3]).expect("grid");
    // Runs and noise: a damaged stream decodes to more bytes than there are voxels, or to fewer.
    let label = |at: usize| if at % 97 < 60 { 1 } else { (at * at / 7 % 5) as u8 };
    let labels = Volume::new(grid, (0..grid.len()).map(label).collect()).expect("count");
    let whole = nifti::encode_u8(&labels);
    let (mut refused, wanted) = (0, labels.map(u16::from));
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&file, &bytes).expect("a writable file");
        match read_labels(&file) {
            Ok(found) => assert!(found.data() == wanted.data(), "bit {bit}"),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 7 * whole.len(), "{refused} of {}", 8 * whole.len());
}
