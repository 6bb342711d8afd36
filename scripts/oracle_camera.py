"""OpenCV against the camera calibration of the crate `guidance`: same corners, same least squares, same camera.

    python scripts/oracle_camera.py
"""

import subprocess

import cv2
import numpy as np

from oracle import check, example, finish

SIZE = (1920, 1080)


def ours(points, pixels):
    lines = "\n".join(" ".join(repr(float(v)) for v in [*p, *u]) for p, u in zip(points, pixels))
    done = subprocess.run([BINARY, *map(str, SIZE)], input=lines, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return np.array([float(v) for v in done.stdout.split()])


def scene(rng, noise):
    """Corners of 14 tilted boards, in a world that is turned against the camera, and the pixels where OpenCV sees them."""
    camera = np.array([[1400.0, 0, 980], [0, 1380, 530], [0, 0, 1]])
    distortion = np.array([-0.21, 0.07, 0.0012, -0.0008, 0])
    turn, shift = np.array([1.7, 0.3, -0.2]), np.array([40.0, -30.0, 20.0])
    rotation = cv2.Rodrigues(turn)[0]
    grid = np.array([[30.0 * i - 90, 30.0 * j - 60, 0] for i in range(7) for j in range(5)])
    points, pixels = [], []
    for _ in range(14):
        depth = rng.uniform(400, 1000)
        at = np.array([rng.uniform(-0.45, 0.45) * depth, rng.uniform(-0.25, 0.25) * depth, depth])
        board = cv2.Rodrigues(rng.normal(size=3) * 0.3)[0]
        world = (grid @ board.T + at - shift) @ rotation
        seen = cv2.projectPoints(world, turn, shift, camera, distortion)[0][:, 0]
        inside = ((seen > 0) & (seen < SIZE)).all(axis=1)
        points.append(world[inside])
        pixels.append(seen[inside] + noise * rng.normal(size=(inside.sum(), 2)))
    return np.concatenate(points), np.concatenate(pixels)


def opencv(points, pixels):
    start = np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]])
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_K3
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-15)
    p, u = points.astype(np.float32), pixels.astype(np.float32)
    rms, k, d, r, t = cv2.calibrateCamera([p], [u], SIZE, start, None, flags=flags, criteria=stop)
    return rms, k, d.ravel(), cv2.Rodrigues(r[0])[0], t[0].ravel()


BINARY = example("calibrate_camera")
for seed, noise in [(1, 0.0), (2, 0.3), (3, 0.3), (4, 1.0)]:
    points, pixels = scene(np.random.default_rng(seed), noise)
    found = ours(points, pixels)
    rms, k, d, r, t = opencv(points, pixels)
    pose = found[9:].reshape(3, 4)
    # OpenCV takes its corners in single precision: 6e-5 pixels, 3e-5 mm.
    check(f"residual {seed}", abs(found[8] - rms) < 1e-3, f"{found[8]} {rms}")
    check(f"focal lengths {seed}", np.allclose(found[:2], [k[0, 0], k[1, 1]], atol=0.02), f"{found[:2]} {k}")
    check(f"principal point {seed}", np.allclose(found[2:4], [k[0, 2], k[1, 2]], atol=0.02), f"{found[2:4]} {k}")
    check(f"distortion {seed}", np.allclose(found[4:8], d[:4], atol=2e-4), f"{found[4:8]} {d}")
    check(f"rotation {seed}", np.allclose(pose[:, :3], r, atol=2e-5))
    check(f"translation {seed}", np.allclose(pose[:, 3], t, atol=0.02), f"{pose[:, 3]} {t}")
finish()
