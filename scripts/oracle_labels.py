"""Foreign readers and writers (highdicom, pydicom, pynrrd, nibabel) against `monro labels convert`.

The labels of the built-in phantom are written as DICOM-SEG and .seg.nrrd and read by others: voxels, places, names,
colours and terms must agree. With images, each frame must belong to its image, also under a tilted gantry. A DICOM-SEG
made by highdicom is read by ours.

    python scripts/oracle_labels.py [--monro PATH]
"""

import pathlib
import subprocess
import sys
import tempfile

import highdicom as hd
import nibabel as nib
import nrrd
import numpy as np
import pydicom
from pydicom.sr.codedict import codes
from pydicom.uid import generate_uid

import oracle

NAMES = ["scalp", "skull", "csf", "brain", "left lateral ventricle", "right lateral ventricle", "third ventricle"]
LPS_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


def run(*words, fails=False):
    done = subprocess.run([MONRO, *map(str, words)], capture_output=True, text=True)
    if (done.returncode != 0) != fails:
        raise AssertionError(f"{words}: status {done.returncode}: {done.stderr}")
    return done.stderr


def require(ok, text):
    if not ok:
        raise AssertionError(text)


def truth(path):
    """Labels by voxel, and LPS from voxel."""
    image = nib.load(path)
    return np.asarray(image.dataobj).astype(int), LPS_RAS @ image.affine


def check_dicom(folder, labels, affine):
    file = folder / "labels.dcm"
    run("labels", "convert", folder / "phantom" / "labels.nii.gz", file)
    seg = hd.seg.segread(file)
    require(seg.segmentation_type == hd.seg.SegmentationTypeValues.BINARY, "not binary")
    described = [seg.get_segment_description(n) for n in seg.segment_numbers]
    require([d.segment_label for d in described] == NAMES, [d.segment_label for d in described])
    left = described[NAMES.index("left lateral ventricle")]
    require(left.segmented_property_type == codes.SCT.LateralVentricle, "type of the left ventricle")
    modifier = pydicom.dcmread(file).SegmentSequence[4].SegmentedPropertyTypeCodeSequence[0]
    modifier = modifier.SegmentedPropertyTypeModifierCodeSequence[0]
    require(modifier.CodeValue == codes.SCT.Left.value, "side of the left ventricle")
    volume = seg.get_volume(combine_segments=True)
    # highdicom's axes are slices, rows, columns; each of our voxels must have its label at its own place.
    found, place = np.asarray(volume.array), np.asarray(volume.affine)
    require(found.shape == labels.shape[::-1], f"{found.shape} instead of {labels.shape[::-1]}")
    index = np.stack(np.meshgrid(*[np.arange(n) for n in labels.shape], indexing="ij"), -1).reshape(-1, 3)
    ours = index @ affine[:3, :3].T + affine[:3, 3]
    theirs = (ours - place[:3, 3]) @ np.linalg.inv(place[:3, :3]).T
    require(np.abs(theirs - np.rint(theirs)).max() < 1e-3, "voxels are off their places")
    at = np.rint(theirs).astype(int)
    require((found[at[:, 0], at[:, 1], at[:, 2]] == labels.reshape(-1)).all(), "voxels differ")


def by_images(file, images):
    """Labels that highdicom finds for each of the images."""
    seg = hd.seg.segread(file)
    uids = [i.SOPInstanceUID for i in images]
    found = seg.get_pixels_by_source_instance(uids, combine_segments=True, assert_missing_frames_are_empty=True)
    first = images[0]
    for tag in ["StudyInstanceUID", "FrameOfReferenceUID", "PatientName", "PatientID", "StudyDate", "AccessionNumber"]:
        require(getattr(seg, tag) == getattr(first, tag), f"{tag}: {getattr(seg, tag)}, not {getattr(first, tag)}")
    [series] = seg.ReferencedSeriesSequence
    require(series.SeriesInstanceUID == first.SeriesInstanceUID, "another series")
    require({r.ReferencedSOPInstanceUID for r in series.ReferencedInstanceSequence} == set(uids), "other images")
    require(sorted(u for _, _, u in seg.get_source_image_uids()) == sorted(uids), "sources by highdicom")
    return found


def check_references(folder, labels):
    """Labels on images with a patient (in Latin-1), as an archive has them: each frame belongs to its image."""
    series = folder / "images"
    series.mkdir()
    images = []
    for n, file in enumerate(sorted((folder / "phantom" / "dicom").iterdir())):
        image = pydicom.dcmread(file)
        image.SpecificCharacterSet, image.PatientName, image.PatientID = "ISO_IR 100", "Müller^Änne", "4711"
        image.StudyDate, image.AccessionNumber = "20260102", "A17"
        image.save_as(series / f"{(n * 37) % 251:03}")
        images.append(image)
    file = folder / "with_images.dcm"
    run("labels", "convert", folder / "phantom" / "labels.nii.gz", file, "--images", series)
    by_place = sorted(range(len(images)), key=lambda n: images[n].ImagePositionPatient[2])
    found = by_images(file, [images[n] for n in by_place])
    require((found == np.stack([labels[:, :, k].T for k in range(labels.shape[2])])).all(), "labels by image differ")
    said = run("labels", "convert", file, folder / "back.nii.gz", "--like", series)
    back, _ = truth(folder / "back.nii.gz")
    require((back == labels).all(), f"with references it does not come back: {said}")


def check_tilted(folder, labels, affine):
    """A tilted gantry: frames lie on the images, not on the straightened grid that our labels have."""
    tilted = folder / "tilted"
    tilted.mkdir()
    images = []
    for n, file in enumerate(sorted((folder / "phantom" / "dicom").iterdir())[::4]):
        image = pydicom.dcmread(file)
        x, y, z = image.ImagePositionPatient
        image.ImagePositionPatient = [x, y + 0.3 * (5.0 * n - 100.0), z]
        image.save_as(tilted / f"{n}.dcm")
        images.append(image)
    file = folder / "tilted.dcm"
    run("labels", "convert", folder / "phantom" / "labels.nii.gz", file, "--images", tilted)
    found = by_images(file, images)
    for image, plane in zip(images, found):
        rows, columns = plane.shape
        dr, dc = map(float, image.PixelSpacing)
        place = np.array(image.ImagePositionPatient, float)
        points = place + np.stack(np.meshgrid(np.arange(columns) * dc, np.arange(rows) * dr, [0.0]), -1).reshape(-1, 3)
        exact = (points - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
        at = np.rint(exact).astype(int)
        ok = ((at >= 0) & (at < labels.shape)).all(axis=1)
        # Where a centre lies between two voxels, either is the nearest.
        clear = (np.abs(exact - np.floor(exact) - 0.5) > 1e-3).all(axis=1)
        at = np.clip(at, 0, np.array(labels.shape) - 1)
        wanted = np.where(ok, labels[at[:, 0], at[:, 1], at[:, 2]], 0)
        require((plane.reshape(-1) == wanted)[clear].all(), "labels on a tilted plane differ")
    # Our reader lays the planes side by side again, each at the nearest whole pixel of its place.
    run("labels", "convert", file, folder / "tilted.nii.gz")
    back, place = truth(folder / "tilted.nii.gz")
    for image, plane in zip(images, found):
        corner = np.linalg.inv(place) @ np.append(np.array(image.ImagePositionPatient, float), 1.0)
        i, j, k = np.rint(corner[:3]).astype(int)
        require(abs(corner[2] - k) < 1e-3 and np.abs(corner[:2] - [i, j]).max() <= 0.501, f"plane at {corner}")
        rows, columns = plane.shape
        require((back[i : i + columns, j : j + rows, k].T == plane).all(), "a tilted plane does not come back")


def check_uneven(folder, labels):
    """Two spacings in one series: each plane keeps its labels, in all files that are written and read."""
    uneven = folder / "uneven"
    uneven.mkdir()
    files = sorted((folder / "phantom" / "dicom").iterdir())
    kept = [*range(0, 80, 2), *range(80, len(files), 3)]
    for n in kept:
        (uneven / f"{n}.dcm").write_bytes(files[n].read_bytes())
    file = folder / "uneven.dcm"
    run("labels", "convert", folder / "phantom" / "labels.nii.gz", file, "--images", uneven)
    images = [pydicom.dcmread(files[n]) for n in kept]
    found = by_images(file, images)
    require((found == np.stack([labels[:, :, k].T for k in kept])).all(), "labels by image differ")
    run("labels", "convert", file, folder / "uneven.nii.gz")
    back, place = truth(folder / "uneven.nii.gz")
    for image, plane in zip(images, found):
        i, j, k = np.rint((np.linalg.inv(place) @ np.append(np.array(image.ImagePositionPatient, float), 1.0))[:3]).astype(int)
        require((i, j) == (0, 0) and (back[:, :, k].T == plane).all(), "an uneven plane does not come back")


def check_nrrd(folder, labels, affine):
    file = folder / "labels.seg.nrrd"
    run("labels", "convert", folder / "phantom" / "labels.nii.gz", file)
    data, head = nrrd.read(str(file))
    require((data == labels).all(), "voxels differ")
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = np.asarray(head["space directions"]).T, head["space origin"]
    require(np.abs(place - affine).max() < 1e-4, "placement differs")
    require([head[f"Segment{n}_Name"] for n in range(7)] == NAMES, "names")
    require(head["Segment4_LabelValue"] == "5" and "SCT^66720007" in head["Segment4_Tags"], "terms")
    require(abs(float(head["Segment4_Color"].split()[1]) - 158 / 255) < 1e-5, "colour")


def check_back(folder, labels):
    for name in ["labels.dcm", "labels.seg.nrrd"]:
        out = folder / f"{name}.nii.gz"
        said = run("labels", "convert", folder / name, out, "--like", folder / "phantom" / "dicom")
        require("outside the head" not in said, said)
        back, _ = truth(out)
        require((back == labels).all(), f"{name} does not come back: {said}")


def check_foreign(folder, labels):
    """A DICOM-SEG of highdicom, with two segments in another order and one that is a stranger."""
    images = sorted((pydicom.dcmread(f) for f in (folder / "phantom" / "dicom").iterdir()), key=lambda d: d.InstanceNumber)
    kinds = [("third ventricle", codes.SCT.ThirdVentricle, 7), ("brain", codes.SCT.Brain, 4), ("odd", codes.SCT.Skull, 1)]
    kinds[2] = ("my own thing", codes.SCT.FourthVentricle, 1)
    descriptions = [
        hd.seg.SegmentDescription(
            segment_number=n + 1, segment_label=name, segmented_property_category=codes.SCT.AnatomicalStructure,
            segmented_property_type=kind, algorithm_type=hd.seg.SegmentAlgorithmTypeValues.MANUAL,
        )
        for n, (name, kind, _) in enumerate(kinds)
    ]
    stack = np.stack([labels[:, :, k].T for k in range(labels.shape[2])])
    pixels = np.stack([stack == label for _, _, label in kinds], axis=-1).astype(np.uint8)
    seg = hd.seg.Segmentation(
        source_images=images, pixel_array=pixels, segmentation_type=hd.seg.SegmentationTypeValues.BINARY,
        segment_descriptions=descriptions, series_instance_uid=generate_uid(), series_number=2,
        sop_instance_uid=generate_uid(), instance_number=1, manufacturer="x", manufacturer_model_name="x",
        software_versions="1", device_serial_number="1",
    )
    seg.save_as(folder / "foreign.dcm")
    out = folder / "foreign.nii.gz"
    said = run("labels", "convert", folder / "foreign.dcm", out, "--like", folder / "phantom" / "dicom")
    require("my own thing" in said, f"no word of the stranger: {said}")
    back, _ = truth(out)
    wanted = np.where(np.isin(labels, [4, 7]), labels, 0)
    require((back == wanted).all(), "foreign voxels differ")


def check_remarks(folder, labels):
    """Labels that lost their origin are told structure by structure."""
    image = nib.load(folder / "phantom" / "labels.nii.gz")
    moved = image.affine.copy()
    moved[0, 3] += 30.0
    nib.save(nib.Nifti1Image(labels.astype(np.uint8), moved), folder / "moved.nii.gz")
    said = run("labels", "convert", folder / "moved.nii.gz", folder / "m.nii.gz", "--like", folder / "phantom" / "dicom")
    require("scalp lie outside the head" in said and "skull lie outside the head" in said, said)


def check_refusals(folder):
    elsewhere = nib.Nifti1Image(np.full((9, 9, 9), 4, np.uint8), np.diag([1.0, 1.0, 1.0, 1.0]) + 5000 * np.eye(4, k=3)[:, :])
    nib.save(elsewhere, folder / "far.nii.gz")
    said = run("labels", "convert", folder / "far.nii.gz", folder / "x.nii.gz", "--like", folder / "phantom" / "dicom", fails=True)
    require("[9, 9, 9]" in said and "cover" in said, said)
    said = run("labels", "convert", folder / "phantom" / "labels.nii.gz", folder / "x.tiff", fails=True)
    require(".seg.nrrd" in said, said)
    dicom = folder / "phantom" / "dicom"
    said = run("labels", "convert", folder / "far.nii.gz", folder / "x.dcm", "--images", dicom, fails=True)
    require("[9, 9, 9]" in said and "within the images" in said, said)
    said = run("labels", "convert", folder / "far.nii.gz", folder / "x.nii.gz", "--images", dicom, fails=True)
    require(".dcm" in said, said)


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run("phantom", "--out", folder / "phantom")
        labels, affine = truth(folder / "phantom" / "labels.nii.gz")
        check_dicom(folder, labels, affine)
        check_nrrd(folder, labels, affine)
        check_back(folder, labels)
        check_foreign(folder, labels)
        check_references(folder, labels)
        check_tilted(folder, labels, affine)
        check_uneven(folder, labels)
        check_remarks(folder, labels)
        check_refusals(folder)
    print("labels: highdicom, pynrrd and nibabel agree")


MONRO = oracle.binary(__doc__)
sys.exit(main())
