"""pydicom, SimpleITK, nibabel and pynrrd against the crate `scan` on DICOM.

Odd but legal series are made in a temporary folder and read by both; values must be equal and places must agree. Bad
ones must be refused with a message that names the rule. Series that our writer makes are read by the others.

    python scripts/oracle_dicom.py [--dump PATH_TO_EXAMPLE]
"""

import json
import shutil
import sys
import tempfile

import nibabel as nib
import nrrd
import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import UID

from scan_checks import (
    GRADIENT, LPS_RAS, MIRRORED, OBLIQUE, OFFSET, Ours, affine, case, close_samples, from_itk, hu, itk, main, noise,
    refused, require, same,
)

CT = "1.2.840.10008.5.1.4.1.1.2"
ENHANCED_CT = "1.2.840.10008.5.1.4.1.1.2.1"
EXPLICIT, IMPLICIT = "1.2.840.10008.1.2.1", "1.2.840.10008.1.2"
DEFLATED, BIG = "1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.2"
RLE, JPEG_LS = "1.2.840.10008.1.2.5", "1.2.840.10008.1.2.4.80"


def decimals(values):
    """Decimal strings of at most 16 characters."""
    return [f"{x:.11f}"[:16] for x in values]


def dataset(seed, k, rows, columns, iop, ipp, spacing, series=1, syntax=EXPLICIT, patient="P1", **more):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.TransferSyntaxUID = UID(CT), UID(syntax)
    meta.MediaStorageSOPInstanceUID = UID(f"1.2.826.0.1.3680043.10.99.{seed}.{series}.{k + 1}")
    ds = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    ds.SOPClassUID, ds.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
    ds.PatientName, ds.PatientID, ds.Modality = f"Secret^{patient}", patient, "CT"
    ds.StudyInstanceUID = f"1.2.826.0.1.3680043.10.99.{seed}"
    ds.SeriesInstanceUID = f"1.2.826.0.1.3680043.10.99.{seed}.{series}"
    ds.FrameOfReferenceUID = f"1.2.826.0.1.3680043.10.99.{seed}.0"
    ds.ImageType, ds.InstanceNumber, ds.SeriesNumber = ["ORIGINAL", "PRIMARY", "AXIAL"], k + 1, series
    ds.Rows, ds.Columns = rows, columns
    ds.ImageOrientationPatient = decimals(iop)
    ds.ImagePositionPatient = decimals(ipp)
    ds.PixelSpacing = decimals(spacing)
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 16, 15, 1
    ds.RescaleSlope, ds.RescaleIntercept = 1, 0
    for key, value in more.items():
        setattr(ds, key, value)
    return ds


def save(ds, path):
    syntax = ds.file_meta.TransferSyntaxUID
    path.parent.mkdir(parents=True, exist_ok=True)
    implicit, little = syntax == IMPLICIT, syntax != BIG
    pydicom.dcmwrite(str(path), ds, implicit_vr=implicit, little_endian=little, enforce_file_format=True)


def series(folder, values, lps, names=None, edit=None, origins=None, only=None, **more):
    """Writes `values` (i, j, k) as slices placed by `lps`, or at `origins`."""
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    iop = np.concatenate([lps[:3, 0] / spacing[0], lps[:3, 1] / spacing[1]])
    for k in only if only is not None else range(values.shape[2]):
        ipp = origins[k] if origins is not None else (lps @ [0, 0, k, 1])[:3]
        ds = dataset(7, k, values.shape[1], values.shape[0], iop, ipp, [spacing[1], spacing[0]], **more)
        plane = np.ascontiguousarray(values[:, :, k].T)
        order = ">" if more.get("syntax") == BIG else "<"
        ds.PixelData = plane.astype(plane.dtype.newbyteorder(order)).tobytes()
        ds["PixelData"].VR = "OW"
        if edit:
            edit(ds, k, plane)
        save(ds, folder / (names(k) if names else f"{k:03}.dcm"))
    return folder


def right_handed(values, lps):
    """Our order: slices along the normal of columns and rows."""
    if np.linalg.det(lps[:3, :3]) > 0:
        return values, lps
    flipped = lps.copy()
    flipped[:3, 3] = (lps @ [0, 0, values.shape[2] - 1, 1])[:3]
    flipped[:3, 2] = -lps[:3, 2]
    return values[:, :, ::-1], flipped


def same_as_simpleitk(folder, lps_tolerance=1e-3):
    names = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder))
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(names)
    same(Ours(folder, "--any-size"), *from_itk(reader.Execute()), tolerance=lps_tolerance)


PLANES = {
    "axial": affine([0.5, 0.5, 2.0], [0, 0, 0], [-100.0, -120.5, 33.25]),
    "oblique": OBLIQUE,
    "coronal": affine([0.5, 0.6, 2.0], [-np.pi / 2, 0, 0], [-100.0, -120.5, 33.25]),
    "sagittal": affine([0.5, 0.6, 2.0], [-np.pi / 2, 0, np.pi / 2], [10.0, -120.5, 33.25]),
    "feet first": affine([0.5, 0.5, 2.0], [np.pi, 0, 0], [-100.0, -120.5, 33.25]),
}


@case
def dicom_any_orientation_order_and_name(folder):
    values = noise((9, 8, 7))
    for n, lps in enumerate(PLANES.values()):
        shuffled = np.random.default_rng(n).permutation(7)
        names = lambda k: f"sub {shuffled[k] % 2}/ {chr(97 + shuffled[k])} slice"
        where = series(folder / str(n), values, lps, names)
        same(Ours(where, "--any-size"), hu(values), lps)
        flat = series(folder / f"flat{n}", values, lps)
        same_as_simpleitk(flat)
        lps = lps.copy()
        lps[:3, 2] *= -1
        same(Ours(series(folder / f"m{n}", values, lps), "--any-size"), *map_hu(right_handed(values, lps)))


def map_hu(pair):
    return hu(pair[0]), pair[1]


@case
def dicom_encodings(folder):
    lps = PLANES["axial"]
    values = noise((16, 12, 5))
    for n, syntax in enumerate([EXPLICIT, IMPLICIT, DEFLATED, BIG]):
        same(Ours(series(folder / str(n), values, lps, syntax=syntax), "--any-size"), hu(values), lps)
    compress = lambda ds, k, plane: ds.compress(RLE, plane)
    same(Ours(series(folder / "rle", values, lps, edit=compress), "--any-size"), hu(values), lps)


@case
def dicom_without_preamble(folder):
    lps = PLANES["axial"]
    values = noise((16, 12, 5))
    for n, syntax in enumerate([EXPLICIT, IMPLICIT]):
        where = series(folder / str(n), values, lps, syntax=syntax)
        for file in where.iterdir():
            data = file.read_bytes()
            meta = 132 + 12 + int.from_bytes(data[140:144], "little")
            file.write_bytes(data[meta:])
        (where / "notes.txt").write_text("\b\0not DICOM" * 40)
        answer = Ours(where, "--any-size")
        same(answer, hu(values), lps)
        require(any("1 of 6 files are not DICOM" in w for w in answer.json["warnings"]), answer.json["warnings"])
    # GDCM reads data sets of implicit types without a preamble, too.
    (where / "notes.txt").unlink()
    same_as_simpleitk(where)


def through_itk(compressor):
    """Compresses a slice with GDCM and takes over its codestream."""

    def edit(ds, k, plane):
        with tempfile.TemporaryDirectory() as t:
            writer = sitk.ImageFileWriter()
            writer.SetFileName(f"{t}/x.dcm")
            writer.SetUseCompression(True)
            writer.SetCompressor(compressor)
            writer.Execute(sitk.GetImageFromArray(plane[np.newaxis]))
            other = pydicom.dcmread(f"{t}/x.dcm")
        ds.file_meta.TransferSyntaxUID = other.file_meta.TransferSyntaxUID
        for key in ["BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation"]:
            setattr(ds, key, getattr(other, key))
        ds.PixelData = other.PixelData
        ds["PixelData"].VR, ds["PixelData"].is_undefined_length = "OB", True

    return edit


@case
def dicom_jpeg_lossless_and_jpeg_2000(folder):
    lps = PLANES["axial"]
    for n, (compressor, low) in enumerate([("JPEG", 0), ("JPEG2000", 0), ("JPEG2000", -1024)]):
        values = noise((24, 20, 4), n, low, 3000).astype("u2" if low == 0 else "i2")
        where = series(folder / str(n), values, lps, edit=through_itk(compressor))
        syntax = pydicom.dcmread(where / "000.dcm").file_meta.TransferSyntaxUID.name
        require(syntax.startswith("JPEG Lossless" if compressor == "JPEG" else "JPEG 2000"), f"made {syntax}")
        same(Ours(where, "--any-size"), hu(values), lps)


@case
def dicom_refuses_jpeg_2000_of_other_signedness(folder):
    compress = through_itk("JPEG2000")

    def edit(ds, k, plane):
        compress(ds, k, plane)
        ds.PixelRepresentation = 1

    where = series(folder / "d", noise((24, 20, 4), 1, 0, 3000).astype("u2"), PLANES["axial"], edit=edit)
    refused(where, "PixelRepresentation", "unsigned", "signed")


@case
def dicom_refuses_jpeg_of_other_size(folder):
    compress = through_itk("JPEG")

    def edit(ds, k, plane):
        compress(ds, k, plane)
        ds.Rows = 40

    where = series(folder / "d", noise((24, 20, 4), 1, 0, 3000).astype("u2"), PLANES["axial"], edit=edit)
    refused(where, "24 x 20", "24 x 40")


@case
def dicom_stored_bits_slopes_and_padding(folder):
    lps, shape = PLANES["axial"], (9, 8, 7)
    stored = noise(shape, 1, 0, 4096).astype("u2")
    twelve = dict(BitsStored=12, HighBit=11, PixelRepresentation=0)
    scaled = dict(twelve, RescaleSlope="0.75", RescaleIntercept="-1024.5")
    same(Ours(series(folder / "a", stored, lps, **scaled), "--any-size"), hu(stored * 0.75 - 1024.5), lps)
    # Bits above the stored ones may hold an overlay.
    overlay = stored | (noise(shape, 2, 0, 2).astype("u2") << 13)
    same(Ours(series(folder / "b", overlay, lps, **dict(twelve, RescaleIntercept=-1024)), "--any-size"), hu(stored.astype(int) - 1024), lps)
    # Signed 12 bits in 16, upper bits zero.
    signed = noise(shape, 3, -1000, 2000)
    packed = (signed & 0x0FFF).astype("u2")
    same(Ours(series(folder / "c", packed, lps, BitsStored=12, HighBit=11), "--any-size"), hu(signed), lps)
    # Bits not at the bottom.
    same(Ours(series(folder / "d", stored << 4, lps, BitsStored=12, HighBit=15, PixelRepresentation=0), "--any-size"), hu(stored), lps)
    slopes = [0.5 + 0.25 * k for k in range(7)]

    def each(ds, k, plane):
        ds.RescaleSlope, ds.RescaleIntercept = str(slopes[k]), str(-100 * k)

    expected = np.stack([stored[:, :, k] * slopes[k] - 100 * k for k in range(7)], 2)
    same(Ours(series(folder / "e", stored, lps, edit=each, **twelve), "--any-size"), hu(expected), lps)
    values = noise(shape, 4, -1000, 2000)
    values[0, :, :] = -1500
    values[1, :, :] = -3000
    answer = Ours(series(folder / "f", values, lps, edit=lambda d, k, p: d.add_new(0x00280120, "SS", -1500)), "--any-size")
    same(answer, hu(values), lps)
    require(any("padding" in w for w in answer.json["warnings"]), answer.json["warnings"])
    require(any("below -1024" in w and "-3000" in w for w in answer.json["warnings"]), answer.json["warnings"])
    # Padding as unsigned bits of a negative number; and a padding value that is tissue.
    answer = Ours(series(folder / "g", values, lps, edit=lambda d, k, p: d.add_new(0x00280120, "US", 65536 - 1500)), "--any-size")
    same(answer, hu(values), lps)
    answer = Ours(series(folder / "h", values, lps, edit=lambda d, k, p: d.add_new(0x00280120, "SS", 40)), "--any-size")
    same(answer, hu(values), lps)
    require(any("tissue" in w for w in answer.json["warnings"]), answer.json["warnings"])
    # 8 bits.
    eight = noise(shape, 5, 0, 256).astype("u1")
    small = dict(BitsAllocated=8, BitsStored=8, HighBit=7, PixelRepresentation=0, RescaleSlope=10, RescaleIntercept=-1000)
    same(Ours(series(folder / "i", eight, lps, **small), "--any-size"), hu(eight.astype(int) * 10 - 1000), lps)


# Uneven stacks: a linear field, for which linear interpolation is exact.


def uneven(folder, places, shift=(0.0, 0.0), lps=None, **more):
    """Slices at `places` along the normal, each moved within its plane by `shift` per mm."""
    lps = PLANES["axial"].copy() if lps is None else lps.copy()
    u, v = lps[:3, 0], lps[:3, 1]
    n = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    step = n + shift[0] * u / np.linalg.norm(u) + shift[1] * v / np.linalg.norm(v)
    origins = [lps[:3, 3] + s * step for s in places]
    shape = (40, 44, len(places))
    ij = np.stack(np.meshgrid(np.arange(40), np.arange(44), indexing="ij"), -1)
    planes = [np.round((ij @ np.stack([u, v]) + o) @ GRADIENT + OFFSET).astype(np.int16) for o in origins]
    series(folder, np.stack(planes, 2), lps, origins=origins, **more)
    rng = np.random.default_rng(3)
    inner = [places[0] + (places[-1] - places[0]) * t for t in rng.uniform(0.02, 0.98, 40)]
    points = np.array([lps[:3, 3] + s * step + rng.uniform(12, 26) * u + rng.uniform(12, 30) * v for s in inner])
    return points, points @ GRADIENT + OFFSET


@case
def dicom_tilt_gaps_and_two_spacings(folder):
    stacks = {
        "tilt": (np.arange(12) * 4.0, (0.0, -np.tan(np.radians(18.5)))),
        "both ways": (np.arange(12) * 2.0, (0.1, 0.2)),
        "missing": (np.delete(np.arange(30) * 1.25, [7, 20, 21]), (0.0, 0.0)),
        "two spacings": (np.r_[np.arange(8) * 2.5, 18.6 + np.arange(6) * 5.0], (0.0, 0.0)),
        "tilt and gap": (np.delete(np.arange(14) * 4.0, [5]), (0.0, 0.3)),
        "jitter": (np.arange(12) * 3.0 + np.random.default_rng(1).uniform(-0.6, 0.6, 12), (0.0, 0.0)),
    }
    for n, (name, (places, shift)) in enumerate(stacks.items()):
        for m, lps in enumerate([PLANES["axial"], OBLIQUE, PLANES["feet first"]]):
            where = folder / f"{n}{m}"
            points, expected = uneven(where, places, shift, lps)
            answer = Ours(where, "--any-size", points=points)
            close_samples(answer, expected, name=name)
            require("resampled:" in answer.json["resampled"], f"{name}: {answer.json['resampled']!r}")
            columns = np.array(answer.json["linear"])
            unit = columns / np.linalg.norm(columns, axis=0)
            require(np.abs(unit.T @ unit - np.eye(3)).max() < 1e-6, f"{name}: not rectangular")


@case
def dicom_gap_is_named(folder):
    places = np.delete(np.arange(60) * 0.625, [41, 42, 43, 44, 45, 46, 47])
    points, expected = uneven(folder / "a", places)
    answer = Ours(folder / "a", "--any-size", points=points)
    close_samples(answer, expected)
    require(any("slices 41 and 42 are 5.000 mm apart, expected 0.625" in w for w in answer.json["warnings"]), answer.json["warnings"])
    uneven(folder / "b", np.r_[np.arange(10) * 2.0, 40.0 + np.arange(10) * 2.0])
    refused(folder / "b", "slices 10 and 11 are 22.0 mm apart", "2.000", "10.0")


@case
def dicom_rounded_positions_are_even(folder):
    values, lps = noise((9, 8, 12)), affine([0.5, 0.5, 0.6257], [0, 0, 0], [-100, -120, 33])
    origins = [np.round((lps @ [0, 0, k, 1])[:3], 1) for k in range(12)]
    answer = Ours(series(folder / "a", values, lps, origins=origins), "--any-size")
    require(answer.json["resampled"] == "", answer.json["resampled"])
    same(answer, hu(values), lps, tolerance=0.11)


@case
def dicom_copies_are_dropped_and_conflicts_refused(folder):
    values, lps = noise((9, 8, 7)), PLANES["axial"]
    where = series(folder / "a", values, lps)
    shutil.copy(where / "003.dcm", where / "again.dcm")
    answer = Ours(where, "--any-size")
    same(answer, hu(values), lps)
    require(any("1 copy of a slice" in w for w in answer.json["warnings"]), answer.json["warnings"])
    series(where, noise((9, 8, 7), 9), lps, names=lambda k: f"other{k}", only=[4])
    refused(where, "004.dcm", "other4", "same position")


@case
def dicom_two_acquisitions_of_one_series(folder):
    values, lps = noise((9, 8, 7)), PLANES["axial"]
    more = noise((9, 8, 7), 9)
    series(folder / "a", values, lps, AcquisitionNumber=1)
    series(folder / "a", more, lps, names=lambda k: f"second{k}", AcquisitionNumber=2)
    listed = Ours(folder / "a", "--inspect").json
    require([s["images"] for s in listed["series"]] == [7, 7], listed)
    same(Ours(folder / "a", "--any-size"), hu(values), lps)
    same(Ours(folder / "a", "--any-size", "--series", listed["series"][1]["id"]), hu(more), lps)


@case
def dicom_two_image_types_and_a_screen_save_in_one_series(folder):
    values, lps = noise((9, 8, 7)), PLANES["axial"]
    more = noise((9, 8, 7), 9)
    number = lambda ds, k, plane: setattr(ds, "AcquisitionNumber", k)
    series(folder, values, lps, edit=number)
    series(folder, more, lps, edit=number, names=lambda k: f"second{k}", ImageType=["DERIVED", "SECONDARY", "AXIAL"])

    def colour(ds, k, plane):
        ds.SamplesPerPixel, ds.PhotometricInterpretation, ds.PlanarConfiguration = 3, "RGB", 0
        ds.PixelData = ds.PixelData * 3
        del ds.ImagePositionPatient

    series(folder, values, lps, names=lambda k: "zz screen", only=[0], edit=colour)
    listed = Ours(folder, "--inspect").json
    require([s["images"] for s in listed["series"]] == [7, 7, 1], listed)
    require("RGB" in listed["series"][2]["refusal"], listed)
    same(Ours(folder, "--any-size"), hu(values), lps)
    same(Ours(folder, "--any-size", "--series", listed["series"][1]["id"]), hu(more), lps)
    # One slice scanned again, each slice an acquisition of its own: named, not scattered.
    shutil.rmtree(folder)
    series(folder, values, lps, edit=number)
    series(folder, more, lps, names=lambda k: "again", only=[4], AcquisitionNumber=30)
    refused(folder, "004.dcm", "again", "same position")


@case
def dicom_mixed_folder_and_choice(folder):
    values, lps = noise((9, 8, 7)), PLANES["axial"]
    soft = dict(series=2, ConvolutionKernel="H31s", SeriesDescription="Kopf 2.0")
    series(folder / "all", values, lps, names=lambda k: f"IM {k}", **soft)
    series(folder / "all", noise((9, 8, 7), 2), lps, names=lambda k: f"b{k}", series=3, ConvolutionKernel="H70h")
    series(folder / "all", noise((30, 8, 1), 3), PLANES["sagittal"], names=lambda k: "scout", series=1, ImageType=["ORIGINAL", "PRIMARY", "LOCALIZER"])
    series(folder / "all", noise((9, 8, 9), 4), PLANES["coronal"], names=lambda k: f"c{k}", series=4, SeriesDescription="for SECRET P1")
    series(folder / "all", noise((9, 8, 9), 5), lps, names=lambda k: f"mr{k}", series=5, Modality="MR")
    (folder / "all" / "notes.txt").write_text("not DICOM")
    (folder / "all" / "text.dcm").write_text("not DICOM either")
    report = dataset(7, 0, 1, 1, [1, 0, 0, 0, 1, 0], [0, 0, 0], [1, 1], series=9, Modality="SR")
    for key in ["Rows", "Columns"]:
        delattr(report, key)
    save(report, folder / "all" / "report")
    answer = Ours(folder / "all", "--any-size")
    same(answer, hu(values), lps)
    require(answer.json["description"] == "Kopf 2.0", answer.json["description"])
    require(any("2 of" in w and "not DICOM" in w for w in answer.json["warnings"]), answer.json["warnings"])
    require(any("without an image" in w for w in answer.json["warnings"]), answer.json["warnings"])
    listed = Ours(folder / "all", "--inspect").json
    require(len(listed["series"]) == 5 and "bone kernel" in listed["reason"], listed)
    require("SECRET" not in json.dumps(listed).upper(), listed)
    uid = "1.2.826.0.1.3680043.10.99.7.3"
    same(Ours(folder / "all", "--any-size", "--series", uid), hu(noise((9, 8, 7), 2)), lps)
    refused(folder / "all", "no series", flags=("--any-size", "--series", "nope"))
    refused(folder / "all", "localizer", flags=("--any-size", "--series", "1.2.826.0.1.3680043.10.99.7.1"))
    refused(folder / "all", "MR", flags=("--any-size", "--series", "1.2.826.0.1.3680043.10.99.7.5"))


@case
def dicom_enhanced_multi_frame(folder):
    values, lps = noise((9, 8, 7)), OBLIQUE
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    ds = dataset(7, 0, 8, 9, [1, 0, 0, 0, 1, 0], [0, 0, 0], [1, 1])
    for key in ["ImageOrientationPatient", "ImagePositionPatient", "PixelSpacing", "RescaleSlope", "RescaleIntercept"]:
        delattr(ds, key)
    ds.file_meta.MediaStorageSOPClassUID = ds.SOPClassUID = ENHANCED_CT
    ds.NumberOfFrames = 7

    def item(**values):
        d = Dataset()
        for key, value in values.items():
            setattr(d, key, value)
        return d

    order = [3, 0, 6, 1, 5, 2, 4]
    text = decimals
    shared = item(
        PixelMeasuresSequence=Sequence([item(PixelSpacing=text([spacing[1], spacing[0]]), SliceThickness="2.5")]),
        PlaneOrientationSequence=Sequence([item(ImageOrientationPatient=text(np.r_[lps[:3, 0] / spacing[0], lps[:3, 1] / spacing[1]]))]),
    )
    ds.SharedFunctionalGroupsSequence = Sequence([shared])
    frames = []
    for k in order:
        position = Sequence([item(ImagePositionPatient=text((lps @ [0, 0, k, 1])[:3]))])
        scale = Sequence([item(RescaleSlope=str(1 + k), RescaleIntercept=str(-k), RescaleType="HU")])
        frames.append(item(PlanePositionSequence=position, PixelValueTransformationSequence=scale))
    ds.PerFrameFunctionalGroupsSequence = Sequence(frames)
    ds.PixelData = b"".join(np.ascontiguousarray(values[:, :, k].T).tobytes() for k in order)
    save(ds, folder / "enhanced.dcm")
    expected = np.stack([values[:, :, k].astype(int) * (1 + k) - k for k in range(7)], 2)
    same(Ours(folder / "enhanced.dcm", "--any-size"), hu(expected), lps)
    same(Ours(folder, "--any-size"), hu(expected), lps)
    del ds.PerFrameFunctionalGroupsSequence
    save(ds, folder / "enhanced.dcm")
    refused(folder / "enhanced.dcm", "7 frames without functional groups")


@case
def dicom_refusals(folder):
    values, lps = noise((9, 8, 7)), PLANES["axial"]
    (folder / "empty").mkdir()
    refused(folder / "empty", "holds no file")
    (folder / "text").mkdir()
    (folder / "text" / "a.dcm").write_text("This is a letter.")
    refused(folder / "text", "no DICOM image", "not DICOM", "a.dcm")
    refused(folder / "text" / "a.dcm", "not a CT in a known format", "54 68 69 73")
    refused(folder / "nowhere", "nowhere", "cannot be read")
    where = series(folder / "two", values, lps)
    series(where, values, lps, names=lambda k: f"b{k}", only=range(3), series=2, patient="P2")
    refused(where, "2 patients", "patient 1: 7", "patient 2: 3")
    require("P2" not in Ours(where, "--any-size").error, "names a patient")
    where = series(folder / "cut", values, lps)
    whole = (where / "004.dcm").read_bytes()
    (where / "004.dcm").write_bytes(whole[:-40])
    refused(where, "004.dcm", "is cut short", "144", "104")
    (where / "004.dcm").write_bytes(whole[:700])
    refused(where, "004.dcm", "truncated")
    refused(series(folder / "one", values, lps, only=[0]), "1 slices make no volume")
    refused(series(folder / "m1", values, lps, PhotometricInterpretation="MONOCHROME1"), "MONOCHROME1")
    refused(series(folder / "mr", values, lps, Modality="MR"), '"MR" is not CT')
    refused(series(folder / "b32", values, lps, BitsAllocated=32, BitsStored=32, HighBit=31), "32 bits")

    def jpeg_ls(ds, k, plane):
        ds.file_meta.TransferSyntaxUID = UID(JPEG_LS)
        ds.PixelData = pydicom.encaps.encapsulate([b"\xff\xd8\xff\xf7"])
        ds["PixelData"].VR = "OB"

    refused(series(folder / "ls", values, lps, edit=jpeg_ls), "JPEG-LS")
    refused(series(folder / "ipp", values, lps, edit=lambda d, k, p: k == 3 and d.pop("ImagePositionPatient")), "003.dcm", "ImagePositionPatient")
    refused(series(folder / "iop", values, lps, edit=lambda d, k, p: setattr(d, "ImageOrientationPatient", [1, 0, 0, 1, 0, 0])), "ImageOrientationPatient")
    refused(series(folder / "ps", values, lps, PixelSpacing=["0", "0.5"]), "PixelSpacing")
    refused(series(folder / "slope", values, lps, RescaleSlope="0"), "RescaleSlope")


@case
def too_small_for_a_head(folder):
    shape = (60, 60, 50)
    knee = np.full(shape, -1000, np.int16)
    knee[5:55, 5:55, :] = 60
    refused(series(folder / "knee", knee, affine([2, 2, 2], [0, 0, 0], [0, 0, 0])), "not a head", "120 x 120 x 100 mm", flags=())
    # A large field of view does not make a knee a head.
    knee = np.full((100, 100, 50), -1000, np.int16)
    i, j = np.mgrid[:100, :100]
    knee[(i - 50) ** 2 + (j - 50) ** 2 < 29**2] = 60
    refused(series(folder / "wide", knee, affine([2, 2, 3.5], [0, 0, 0], [0, 0, 0])), "not a head", flags=())
    head = np.full((100, 100, 50), -1000, np.int16)
    head[((i - 50) / 37.0) ** 2 + ((j - 50) / 46.0) ** 2 < 1] = 60
    answer = Ours(series(folder / "head", head, affine([2, 2, 3], [0, 0, 0], [0, 0, 0])))
    require(answer.error is None, answer.error)


@case
def our_files_are_read_by_others(folder):
    for n, lps in enumerate([OBLIQUE, MIRRORED, *PLANES.values()]):
        values = noise((9, 8, 7), n)
        sitk.WriteImage(itk(values, lps), str(folder / "in.mha"))
        out = folder / f"d{n}"
        flags = ["--any-size", "--write-dicom", out, "--write-nifti", folder / "o.nii.gz", "--write-nrrd", folder / "o.nrrd"]
        require(Ours(folder / "in.mha", *map(str, flags)).error is None, "not written")
        image = nib.load(folder / "o.nii.gz")
        require(np.array_equal(np.asarray(image.dataobj), values), "NIfTI values by nibabel")
        for name in ["get_sform", "get_qform"]:
            require(np.abs(LPS_RAS @ getattr(image, name)() - lps).max() < 1e-3, f"NIfTI {name}")
        back, header = nrrd.read(str(folder / "o.nrrd"))
        require(np.array_equal(back, values) and np.allclose(header["space directions"].T, lps[:3, :3], atol=1e-12), "NRRD")
        for name in ["o.nii.gz", "o.nrrd"]:
            v, a = from_itk(sitk.ReadImage(str(folder / name)))
            require(np.array_equal(v, values) and np.abs(a - lps).max() < 1e-3, f"{name} by SimpleITK")
        dicom_by_others(out, values, lps)


def dicom_by_others(out, values, lps):
    files = sorted(out.iterdir())
    uids = set()
    for k, path in enumerate(files):
        ds = pydicom.dcmread(path)
        uids.add(ds.SOPInstanceUID)
        require(UID(ds.SOPInstanceUID).is_valid and ds.SOPInstanceUID == ds.file_meta.MediaStorageSOPInstanceUID, "UID")
        stored = ds.pixel_array.astype(int) * ds.RescaleSlope + ds.RescaleIntercept
        require(np.array_equal(stored.T, values[:, :, k]), f"DICOM values of slice {k} by pydicom")
        require(np.allclose([float(x) for x in ds.ImagePositionPatient], (lps @ [0, 0, k, 1])[:3], atol=1e-9), "position")
    require(len(uids) == len(files) == values.shape[2], "one UID for each slice")
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(out)))
    v, a = from_itk(reader.Execute())
    expected, place = right_handed(values, lps)
    require(np.array_equal(v, expected) and np.abs(a - place).max() < 1e-3, "DICOM by SimpleITK")


if __name__ == "__main__":
    sys.exit(main())
