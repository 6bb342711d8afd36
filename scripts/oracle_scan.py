"""Foreign readers and writers (pydicom, SimpleITK, nibabel, pynrrd) against the crate `scan`.

Odd but legal files are made in a temporary folder and read by both; values must be equal and places must agree. Bad
files must be refused with a message that names the rule. Files that our writers make are read by the others.

    python scripts/oracle_scan.py [--dump PATH_TO_EXAMPLE]
"""

import argparse
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import warnings

import nibabel as nib
import nrrd
import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import UID

from oracle import example

warnings.filterwarnings("ignore")
sitk.ProcessObject.SetGlobalWarningDisplay(False)
CT = "1.2.840.10008.5.1.4.1.1.2"
ENHANCED_CT = "1.2.840.10008.5.1.4.1.1.2.1"
EXPLICIT, IMPLICIT = "1.2.840.10008.1.2.1", "1.2.840.10008.1.2"
DEFLATED, BIG = "1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.2"
RLE, JPEG_LS = "1.2.840.10008.1.2.5", "1.2.840.10008.1.2.4.80"
LPS_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


def dump_binary():
    """Path of the example, built if it is not given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dump")
    given = parser.parse_args().dump
    if given:
        return given
    return example("dump_scan")


class Ours:
    """The example's answer."""

    def __init__(self, path, *flags, points=()):
        words = [",".join(repr(float(x)) for x in p) for p in points]
        run = subprocess.run([DUMP, *flags, str(path), *words], capture_output=True, text=True)
        self.error = run.stderr.strip() if run.returncode else None
        self.json = None if run.returncode else json.loads(run.stdout)

    def affine(self):
        a = np.eye(4)
        a[:3, :3], a[:3, 3] = self.json["linear"], self.json["offset"]
        return a


def fnv(values):
    """FNV-1a of 16-bit values."""
    h = 0xCBF29CE484222325
    for b in values.tobytes():
        h = ((h ^ b) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return h


def require(ok, text):
    if not ok:
        raise AssertionError(text)


def hu(values):
    """The crate's rule: half away from zero, within -1024..32767, not a number is air."""
    v = np.nan_to_num(np.asarray(values, dtype=np.float64), nan=-1024, posinf=-1024, neginf=-1024)
    return np.clip(np.trunc(v + np.copysign(0.5, v)), -1024, 32767).astype("<i2")


def same(ours, values_ijk, affine, tolerance=1e-4):
    """Equal values in storage order (first index fastest), corners within `tolerance` mm."""
    require(ours.error is None, f"refused: {ours.error}")
    require(list(values_ijk.shape) == ours.json["dims"], f"dims {ours.json['dims']} for {values_ijk.shape}")
    corners = np.array([[i, j, k, 1] for i in (0, 1) for j in (0, 1) for k in (0, 1)], float)
    corners[:, :3] *= np.array(values_ijk.shape) - 1
    worst = np.abs(corners @ (ours.affine() - affine).T).max()
    require(worst < tolerance, f"corners differ by {worst} mm:\n{ours.affine()}\n{affine}")
    flat = np.ascontiguousarray(values_ijk.ravel(order="F"))
    require(int(flat.sum(dtype=np.int64)) == ours.json["sum"], f"sum {ours.json['sum']} for {flat.sum(dtype=np.int64)}")
    require(fnv(flat) == ours.json["checksum"], "values differ")


def refused(path, *fragments, flags=("--any-size",)):
    answer = Ours(path, *flags)
    require(answer.error is not None, "was read")
    for f in fragments:
        require(f in answer.error, f"{f!r} is not in {answer.error!r}")


CASES = []


def case(f):
    CASES.append(f)
    return f


# Values and places


def noise(shape, seed=1, low=-1024, high=3000):
    return np.random.default_rng(seed).integers(low, high, shape).astype(np.int16)


def rotation(a, b, c):
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return z @ y @ x


def affine(spacing, angles, origin, mirrored=False):
    a = np.eye(4)
    a[:3, :3] = rotation(*angles) @ np.diag(spacing) @ np.diag([1, 1, -1 if mirrored else 1])
    a[:3, 3] = origin
    return a


OBLIQUE = affine([0.7, 0.9, 2.5], [0.3, -0.2, 0.4], [-31.5, 12.25, -400.0])
MIRRORED = affine([0.7, 0.9, 2.5], [0.1, 0.2, -2.4], [31.5, -12.25, 40.0], mirrored=True)


# NIfTI


def nifti_file(folder, values, ras, name="a.nii.gz", dtype=None, endian="<", slope=None, codes=(1, 1), edit=None):
    header = nib.Nifti1Header(endianness=endian)
    image = nib.Nifti1Image(values.astype(dtype or values.dtype), ras, header)
    image.header.set_data_dtype(np.dtype(dtype or values.dtype).newbyteorder(endian))
    image.set_sform(ras, codes[0])
    image.set_qform(ras, codes[1])
    if slope:
        image.header.set_slope_inter(*slope)
    image.header.set_xyzt_units("mm")
    path = folder / name
    nib.save(image, path)
    if edit:
        raw = bytearray(path.read_bytes())
        edit(raw)
        path.write_bytes(raw)
    return path


@case
def nifti_all_types_and_byte_orders(folder):
    for n, kind in enumerate(["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]):
        for endian in "<>":
            values = noise((7, 6, 5), n, 0 if kind[0] == "u" else -100, 120)
            path = nifti_file(folder, values, OBLIQUE, f"{kind}{n}{'l' if endian == '<' else 'b'}.nii", kind, endian)
            loaded = nib.load(path)
            require(loaded.header.endianness == endian, "nibabel wrote another byte order")
            same(Ours(path, "--any-size"), hu(loaded.get_fdata()), LPS_RAS @ loaded.affine)


@case
def nifti_placements(folder):
    values = noise((7, 6, 5))
    for n, ras in enumerate([OBLIQUE, MIRRORED, np.diag([-2.0, 2.0, 2.0, 1.0]), np.diag([1.0, -2.0, -2.0, 1.0])]):
        for codes in [(1, 1), (1, 0), (0, 1), (2, 4)]:
            path = nifti_file(folder, values, ras, f"p{n}{codes[0]}{codes[1]}.nii.gz", codes=codes)
            same(Ours(path, "--any-size"), hu(values), LPS_RAS @ nib.load(path).affine)


@case
def nifti_scale(folder):
    values = noise((7, 6, 5), 3, 0, 4000)
    for slope in [(0.5, -1024.0), (1.0, -1000.0), (2.5, 3.25)]:
        path = nifti_file(folder, values, OBLIQUE, slope=slope)
        image = nib.load(path)
        same(Ours(path, "--any-size"), hu(np.asarray(image.dataobj)), LPS_RAS @ image.affine)


@case
def nifti_from_simpleitk(folder):
    image = itk(noise((7, 6, 5)), OBLIQUE)
    for name in ["a.nii", "a.nii.gz"]:
        sitk.WriteImage(image, str(folder / name))
        same(Ours(folder / name, "--any-size"), *from_itk(image))


@case
def nifti_sheared_is_resampled(folder):
    ras = OBLIQUE.copy()
    ras[:3, 2] += 0.4 * ras[:3, 1]
    points, expected = linear_points(LPS_RAS @ ras, (20, 24, 16), np.random.default_rng(5))
    values = linear_values(LPS_RAS @ ras, (20, 24, 16))
    answer = Ours(nifti_file(folder, values, ras, codes=(1, 0)), "--any-size", points=points)
    require(answer.json and answer.json["resampled"], f"not resampled: {answer.error}")
    close_samples(answer, expected)


# MetaImage and NRRD


def itk(values_ijk, lps):
    image = sitk.GetImageFromArray(np.ascontiguousarray(values_ijk.transpose(2, 1, 0)))
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetDirection((lps[:3, :3] / spacing).ravel().tolist())
    image.SetOrigin(lps[:3, 3].tolist())
    return image


def from_itk(image):
    a = np.eye(4)
    a[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) @ np.diag(image.GetSpacing())
    a[:3, 3] = image.GetOrigin()
    return hu(sitk.GetArrayFromImage(image).transpose(2, 1, 0)), a


@case
def metaimage_and_nrrd_from_simpleitk(folder):
    kinds = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]
    for n, kind in enumerate(kinds):
        image = itk(noise((9, 6, 5), n, 0 if kind[0] == "u" else -100, 120).astype(kind), MIRRORED if n % 2 else OBLIQUE)
        for suffix in ["mha", "mhd", "nrrd", "nhdr"]:
            path = folder / f"{kind}.{suffix}"
            sitk.WriteImage(image, str(path), useCompression=n % 3 == 0)
            same(Ours(path, "--any-size"), *from_itk(sitk.ReadImage(str(path))))


@case
def nrrd_spaces_encodings_and_byte_orders(folder):
    values = noise((9, 6, 5))
    signs = {"left-posterior-superior": [1, 1, 1], "RAS": [-1, -1, 1], "left-anterior-superior": [1, -1, 1]}
    for n, (space, sign) in enumerate(signs.items()):
        for encoding in ["raw", "gzip"]:
            for endian in "<>":
                header = {
                    "space": space,
                    "space directions": (np.diag(sign) @ OBLIQUE[:3, :3]).T,
                    "space origin": np.array(sign) * OBLIQUE[:3, 3],
                    "encoding": encoding,
                    "endian": "little" if endian == "<" else "big",
                    "comment": "a remark",
                }
                path = folder / f"n{n}.nrrd"
                nrrd.write(str(path), values.astype(endian + "i2"), header)
                same(Ours(path, "--any-size"), hu(nrrd.read(str(path))[0]), OBLIQUE)


@case
def labels_of_any_type(folder):
    values = np.random.default_rng(2).integers(0, 8, (7, 6, 5))
    for kind in ["u1", "i2", "f4", "f8", "u4"]:
        path = nifti_file(folder, values.astype(kind), OBLIQUE, f"l{kind}.nii.gz")
        same(Ours(path, "--labels"), values.astype("<i2"), LPS_RAS @ nib.load(path).affine)
    image = itk(values.astype("u1"), OBLIQUE)
    for name in ["l.mha", "l.nrrd"]:
        sitk.WriteImage(image, str(folder / name), useCompression=True)
        same(Ours(folder / name, "--labels"), values.astype("<i2"), OBLIQUE)
    values = values.astype("f4")
    values[3, 2, 1] = 2.5
    refused(nifti_file(folder, values, OBLIQUE), "2.5", "[3, 2, 1]", flags=("--labels",))
    values[3, 2, 1] = -1
    refused(nifti_file(folder, values, OBLIQUE), "-1", "[3, 2, 1]", flags=("--labels",))


# DICOM


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

GRADIENT, OFFSET = np.array([3.0, -2.0, 1.5]), 40.0


def linear_values(lps, shape):
    ijk = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1)
    return np.round((ijk @ lps[:3, :3].T + lps[:3, 3]) @ GRADIENT + OFFSET).astype(np.int16)


def linear_points(lps, shape, rng, count=40):
    middle = np.array(shape) * 0.5 + rng.uniform(-0.15, 0.15, (count, 3)) * shape
    points = middle @ lps[:3, :3].T + lps[:3, 3]
    return points, points @ GRADIENT + OFFSET


def close_samples(answer, expected, tolerance=1.01, name=""):
    """Stored and resampled values are each rounded to a whole HU, by at most one half."""
    require(answer.error is None, f"refused: {answer.error}")
    samples = answer.json["samples"]
    require(None not in samples, f"outside: {samples}")
    worst = np.abs(np.array(samples) - expected).max()
    require(worst <= tolerance, f"{name} off by {worst} HU")


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
    refused(where, "004.dcm", "truncated", "144", "104")
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
def file_refusals(folder):
    values = noise((7, 6, 5))
    plain = nifti_file(folder, values, OBLIQUE, "a.nii")
    whole = plain.read_bytes()

    def changed(name, offset, raw):
        path = folder / name
        path.write_bytes(whole[:offset] + raw + whole[offset + len(raw):])
        return path

    refused(changed("pair.nii", 344, b"ni1\0"), "second file")
    refused(changed("analyze.nii", 344, b"\0\0\0\0"), "Analyze")
    refused(changed("rgb.nii", 70, b"\x80\0"), "128", "colour")
    refused(changed("complex.nii", 70, b"\x20\0"), "complex")
    refused(changed("codes.nii", 252, b"\0\0\0\0"), "left and right")
    refused(changed("huge.nii", 42, b"\xff\x7f\xff\x7f\xff\x7f"), "limit")
    refused(changed("big.nii", 42, b"\xff\x03\xff\x00\xff\x00"), "truncated")
    refused(changed("zero.nii", 42, b"\0\0"), "empty")
    (folder / "cut.nii").write_bytes(whole[:-10])
    refused(folder / "cut.nii", "truncated", "420", "410")
    gz = nifti_file(folder, values, OBLIQUE, "a.nii.gz").read_bytes()
    (folder / "cut.nii.gz").write_bytes(gz[: len(gz) // 2])
    refused(folder / "cut.nii.gz", "truncated")
    (folder / "crc.nii.gz").write_bytes(gz[:-8] + bytes(8))
    refused(folder / "crc.nii.gz", "damaged")
    (folder / "a.img").write_bytes(bytes(420))
    refused(folder / "a.img", ".hdr/.img")
    nib.save(nib.Nifti2Image(values, OBLIQUE), folder / "two.nii")
    refused(folder / "two.nii", "NIfTI-2")
    nib.save(nib.Nifti1Image(np.zeros((4, 4, 4, 3), np.int16), OBLIQUE), folder / "four.nii")
    refused(folder / "four.nii", "[4, 4, 4, 3]")
    nib.save(nib.Nifti1Image(np.full((4, 4, 4), np.nan, np.float32), OBLIQUE), folder / "nan.nii")
    refused(folder / "nan.nii", "64", "finite")
    mhd = "ObjectType = Image\nNDims = 3\nDimSize = 7 6 5\nElementType = MET_SHORT\nElementSpacing = 1 1 1\nOffset = 0 0 0\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n"
    for name in ["../a.raw", "/etc/hostname", "sub/a.raw", "LIST", "a%03d.raw 1 5 1"]:
        (folder / "x.mhd").write_text(mhd + f"ElementDataFile = {name}\n")
        refused(folder / "x.mhd", "not a plain name" if "/" in name else "not supported")
    (folder / "x.mhd").write_text(mhd + "ElementDataFile = gone.raw\n")
    refused(folder / "x.mhd", "gone.raw", "cannot be read")
    head = "NRRD0004\ntype: short\ndimension: 3\nsizes: 7 6 5\nendian: little\n"
    place = "space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n"
    table = {
        head + "encoding: raw\n": "left and right",
        head + place + "encoding: bzip2\n": "bzip2",
        head + place + "encoding: raw\ndata file: ../a.raw\n": "not a plain name",
        head + place + "encoding: raw\ndata file: LIST\n": "LIST",
        head + place.replace("LPS", "scanner-xyz") + "encoding: raw\n": "scanner-xyz",
        head + place + "encoding: raw\n": "truncated",
        head.replace("7 6 5", "7 6") + place + "encoding: raw\n": "7 6",
    }
    for text, fragment in table.items():
        (folder / "x.nrrd").write_text(text + "\n")
        refused(folder / "x.nrrd", fragment)


# Our writers


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


def main():
    failed = []
    for f in CASES:
        with tempfile.TemporaryDirectory() as t:
            try:
                f(pathlib.Path(t))
            except Exception as e:  # every kind of failure is a failed case
                failed.append(f.__name__)
                print(f"FAILED {f.__name__}: {type(e).__name__}: {e}")
    print(f"{len(CASES) - len(failed)} passed, {len(failed)} failed")
    return bool(failed)


if __name__ == "__main__":
    DUMP = dump_binary()
    sys.exit(main())
