"""SimpleITK, nibabel and pynrrd against the crate `scan` on NIfTI, MetaImage and NRRD.

Odd but legal files are made in a temporary folder and read by both; values must be equal and places must agree. Bad
files must be refused with a message that names the rule.

    python scripts/oracle_scan.py [--dump PATH_TO_EXAMPLE]
"""

import sys

import nibabel as nib
import nrrd
import numpy as np
import SimpleITK as sitk

from scan_checks import (
    LPS_RAS, MIRRORED, OBLIQUE, Ours, case, close_samples, from_itk, hu, itk, linear_points, linear_values, main, noise,
    refused, require, same,
)


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
    refused(changed("big.nii", 42, b"\xff\x03\xff\x00\xff\x00"), "is cut short")
    refused(changed("zero.nii", 42, b"\0\0"), "empty")
    (folder / "cut.nii").write_bytes(whole[:-10])
    refused(folder / "cut.nii", "is cut short", "420", "410")
    gz = nifti_file(folder, values, OBLIQUE, "a.nii.gz").read_bytes()
    (folder / "cut.nii.gz").write_bytes(gz[: len(gz) // 2])
    refused(folder / "cut.nii.gz", "is cut short")
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
        head + place + "encoding: raw\n": "is cut short",
        head.replace("7 6 5", "7 6") + place + "encoding: raw\n": "7 6",
    }
    for text, fragment in table.items():
        (folder / "x.nrrd").write_text(text + "\n")
        refused(folder / "x.nrrd", fragment)


# Our writers


if __name__ == "__main__":
    sys.exit(main())
