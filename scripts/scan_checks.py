"""What the checks of the crate `scan` share: our answer, equality of values and places, volumes to write, and their run."""

import argparse
import json
import pathlib
import subprocess
import tempfile
import warnings

import numpy as np
import SimpleITK as sitk

from oracle import example

warnings.filterwarnings("ignore")
sitk.ProcessObject.SetGlobalWarningDisplay(False)
DUMP = ""
LPS_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


def dump_binary():
    """Path of the example, built if it is not given."""
    parser = argparse.ArgumentParser(description="Foreign readers and writers against the crate scan.")
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


def main():
    """Runs all cases; the exit status."""
    global DUMP
    DUMP = dump_binary()
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
