//! What is written comes back: values exactly, placement to the precision of the format.

use crate::common::{corner_distance, grid, sampled};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use monro_scan::{metaimage, nifti, nrrd};
use proptest::prelude::*;
use std::io::{Read, Write};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn nifti_and_nrrd_give_back_values_and_placement(
        dims in proptest::array::uniform3(1usize..9),
        spacing in proptest::array::uniform3(0.2..6.0f64),
        angles in proptest::array::uniform3(-3.2..3.2f64),
        offset in proptest::array::uniform3(-700.0..700.0f64),
        mirrored in any::<bool>(),
    ) {
        let volume = sampled(grid(dims, spacing, angles, offset, mirrored));
        let bytes = nifti::encode_i16(&volume);
        let raster = nifti::decode(&bytes).expect("own file");
        // The qform was written too, and agrees with the sform: no warning.
        prop_assert_eq!(&raster.warnings, &Vec::<String>::new());
        let (back, notes) = raster.into_hu().expect("own file");
        let expected: Vec<i16> = volume.data().iter().map(|&v| v.max(-1024)).collect();
        prop_assert_eq!(back.data(), &expected[..]);
        prop_assert_eq!(notes.below as usize, volume.data().iter().filter(|&&v| v < -1024).count());
        // 32-bit floats of up to 752 mm: half a unit in the last place is 3e-5 mm, of three terms and the offset.
        prop_assert!(corner_distance(back.grid(), volume.grid()) < 4e-4);

        let bytes = nrrd::encode_i16(&volume);
        let (back, _) = nrrd::decode_header(&bytes).and_then(|h| h.with_data(&bytes)).and_then(|r| r.into_hu()).expect("own file");
        prop_assert_eq!(back.data(), &expected[..]);
        prop_assert_eq!(back.grid(), volume.grid());
    }

    #[test]
    fn labels_come_back(dims in proptest::array::uniform3(1usize..9), seed in any::<u64>()) {
        let grid = grid(dims, [1.0, 0.5, 2.0], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0], false);
        let labels = sampled(grid).map(|v| (v as u64).wrapping_mul(seed | 1) as u16);
        let bytes = nifti::encode_u16(&labels);
        prop_assert_eq!(nifti::decode(&bytes).and_then(|r| r.into_labels()).expect("own file").into_data(), labels.clone().into_data());
        let small = labels.map(|v| v as u8);
        let bytes = nifti::encode_u8(&small);
        prop_assert_eq!(nifti::decode(&bytes).and_then(|r| r.into_labels()).expect("own file").into_data(), small.map(u16::from).into_data());
        let bytes = nrrd::encode_u8(&small, "Segment0_Name:=ventricle\n");
        let back = nrrd::decode_header(&bytes).and_then(|h| h.with_data(&bytes)).and_then(|r| r.into_labels());
        prop_assert_eq!(back.expect("own file").into_data(), small.map(u16::from).into_data());
    }
}

/// Turned by nearly half a turn against RAS, a head's qform has its scalar part from the rounding of the other three.
#[test]
fn a_file_of_our_own_was_said_to_have_an_sform_and_a_qform_that_disagree() {
    let mut warnings = Vec::new();
    for n in 0..200 {
        let angle = f64::from(n) * 2e-5;
        let grid = grid([512, 2, 256], [0.45, 200.0, 0.9], [angle, 0.3 * angle, 0.7], [-120.0, -110.0, 30.0], false);
        let bytes = nifti::encode_i16(&sampled(grid));
        warnings.extend(nifti::decode(&bytes).expect("own file").warnings.clone());
    }
    assert_eq!(warnings, Vec::<String>::new());
}

fn unpacked(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    GzDecoder::new(bytes).read_to_end(&mut out).expect("gzip");
    out
}

#[test]
fn a_head_stretched_to_a_template_was_measured_in_the_templates_millimetres() {
    let placed = grid([9, 8, 7], [1.0, 1.0, 2.0], [0.1, 0.2, 0.3], [4.0, 5.0, 6.0], false);
    let mut bytes = unpacked(&nifti::encode_i16(&sampled(placed)));
    // The sform 1.2 times as large, and said to be that of the MNI.
    for at in (280..328).step_by(4).filter(|at| (at - 280) % 16 != 12) {
        let v = f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four"));
        bytes[at..at + 4].copy_from_slice(&(1.2 * v).to_le_bytes());
    }
    bytes[254..256].copy_from_slice(&4i16.to_le_bytes());
    let raster = nifti::decode(&bytes).expect("placed");
    assert!(raster.warnings[0].contains("template") && raster.warnings[0].contains("the qform is used"));
    assert!(corner_distance(raster.into_hu().expect("values").0.grid(), &placed) < 4e-4);
    // By the sform alone it is at least told.
    bytes[252..254].copy_from_slice(&0i16.to_le_bytes());
    let raster = nifti::decode(&bytes).expect("placed");
    assert!(raster.warnings[0].contains("distances are the template's"), "{:?}", raster.warnings);
    assert!(corner_distance(raster.into_hu().expect("values").0.grid(), &placed) > 1.0);
}

#[test]
fn bytes_to_skip_of_compressed_nrrd_were_skipped_before_decompression() {
    let volume = sampled(grid([9, 8, 7], [1.0, 1.0, 2.0], [0.0; 3], [0.0; 3], false));
    let own = nrrd::encode_i16(&volume);
    let end = own.windows(2).position(|w| w == b"\n\n").expect("an empty line") + 1;
    let head = [&own[..end], b"byte skip: 5\n\n"].concat();
    let mut packed = GzEncoder::new(head, Compression::default());
    packed.write_all(&[b"12345", &unpacked(&own[end + 1..])[..]].concat()).expect("packed");
    let bytes = packed.finish().expect("packed");
    let back = nrrd::decode_header(&bytes).and_then(|h| h.with_data(&bytes)).and_then(|r| r.into_hu()).expect("read").0;
    let expected: Vec<i16> = volume.data().iter().map(|&v| v.max(-1024)).collect();
    assert_eq!(back.data(), &expected[..]);
}

/// The sform of a file times a factor, and its code.
fn with_sform(bytes: &[u8], times: [f32; 3], code: i16) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for at in (280..328).step_by(4).filter(|at| (at - 280) % 16 != 12) {
        let v = f32::from_le_bytes(out[at..at + 4].try_into().expect("four"));
        out[at..at + 4].copy_from_slice(&(times[(at - 280) % 16 / 4] * v).to_le_bytes());
    }
    out[254..256].copy_from_slice(&code.to_le_bytes());
    out
}

#[test]
fn an_sform_that_stretches_a_head_or_is_empty_was_taken_before_a_good_qform() {
    let placed = grid([9, 8, 7], [1.0, 1.0, 2.0], [0.1, 0.2, 0.3], [4.0, 5.0, 6.0], false);
    let own = unpacked(&nifti::encode_i16(&sampled(placed)));
    for (times, words) in
        [([1.15, 1.1, 1.2], "stretches voxels of 1.000 x 1.000 x 2.000 mm"), ([0.0; 3], "sform is empty")]
    {
        let mut bytes = with_sform(&own, times, 2);
        let raster = nifti::decode(&bytes).expect("placed");
        let said = raster.warnings.concat();
        assert!(said.contains(words) && said.contains("the qform is used"), "{said}");
        assert!(corner_distance(raster.into_hu().expect("values").0.grid(), &placed) < 4e-4);
        // Without a qform it is used and told, or refused.
        bytes[252..254].copy_from_slice(&0i16.to_le_bytes());
        let alone = nifti::decode(&bytes).map(|r| r.warnings.concat());
        assert!(alone.as_ref().map_or(times[0] == 0.0, |w| w.contains("distances may be wrong")), "{alone:?}");
    }
    // A tilted gantry makes one column longer.
    let tilted = with_sform(&own, [1.0, 1.0, 1.03], 1);
    let said = nifti::decode(&tilted).expect("placed").warnings.concat();
    assert!(said.contains("the sform is used"), "{said}");
}

#[test]
fn bytes_before_the_voxels_of_a_metaimage_were_read_as_voxels_and_those_behind_not_told() {
    let head = |more: &str| {
        format!(
            "ObjectType = Image\nNDims = 3\nDimSize = 3 2 2\nElementSpacing = 1 1 1\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n{more}ElementType = MET_SHORT\n\
             ElementDataFile = LOCAL\n"
        )
    };
    let voxels: Vec<u8> = (0..12i16).flat_map(i16::to_le_bytes).collect();
    let read = |bytes: &[u8]| {
        let raster = metaimage::decode_header(bytes).and_then(|h| h.with_data(bytes)).expect("read");
        let said = raster.warnings.concat();
        (raster.into_hu().expect("values").0.into_data(), said)
    };
    let wanted: Vec<i16> = (0..12).collect();
    let last = read(&[head("HeaderSize = -1\n").as_bytes(), &[7; 40], &voxels].concat());
    assert_eq!(last.0, wanted);
    let size = |n: usize| head(&format!("HeaderSize = {n:04}\n"));
    let begin = size(0).len() + 40;
    assert_eq!(read(&[size(begin).as_bytes(), &[7; 40], &voxels].concat()).0, wanted);
    let (values, said) = read(&[head("").as_bytes(), &voxels, &[1; 10]].concat());
    assert_eq!(values, wanted);
    assert!(said.contains("10 bytes lie behind the voxels"), "{said}");
}
