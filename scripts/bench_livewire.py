#!/usr/bin/env python3
"""Livewire side by side with OpenCV's IntelligentScissorsMB, on the same slices, clicks and truths.

Runs `monro bench segment` (or takes the folder that it wrote with --input), then draws the same outlines
with OpenCV, and prints a table; --json prints the numbers. Needs `pip install numpy opencv-python-headless`.

OpenCV gets the brain window (0 to 80 HU) as 8 bits, as it is ("raw") and after a Gaussian of 1.5 pixels. Its wire
goes from click to click and back to the first; errors are the mean distances contour to truth and truth to contour,
averaged, in pixels; clicks are not snapped, for it has no snapping.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parent.parent


def run_ours(folder):
    """Runs the bench, which writes its input to `folder` and prints its result."""
    command = ["cargo", "run", "--release", "--quiet", "-p", "monro-cli", "--", "bench", "segment", "--seeds", "0", "--json"]
    done = subprocess.run([*command, "--dump", str(folder)], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)["livewire"]


def distances(points, polygon):
    """Distance of each point to a closed polygon, pixels."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    d = b - a
    square = np.maximum((d * d).sum(axis=1), 1e-12)
    v = points[:, None, :] - a[None]
    t = np.clip((v * d[None]).sum(axis=2) / square, 0.0, 1.0)
    return np.linalg.norm(v - t[..., None] * d[None], axis=2).min(axis=1)


def error(contour, truth):
    """Mean distance, both ways."""
    return 0.5 * (distances(contour, truth).mean() + distances(truth, contour).mean())


def scissors():
    """The tool with the parameters of OpenCV's own sample."""
    tool = cv2.segmentation_IntelligentScissorsMB() if hasattr(cv2, "segmentation_IntelligentScissorsMB") else (
        cv2.segmentation.IntelligentScissorsMB())
    tool.setEdgeFeatureCannyParameters(32, 100)
    tool.setGradientMagnitudeMaxLimit(200)
    return tool


def opencv(image, clicks, times):
    """The closed contour through the clicks."""
    tool = scissors()
    begin = time.perf_counter()
    tool.applyImage(image)
    times["features_ms"].append(1e3 * (time.perf_counter() - begin))
    parts = []
    for start, end in zip(clicks, clicks[1:] + clicks[:1]):
        begin = time.perf_counter()
        tool.buildMap(start)
        times["map_ms"].append(1e3 * (time.perf_counter() - begin))
        begin = time.perf_counter()
        parts.append(tool.getContour(end).reshape(-1, 2))
        times["path_ms"].append(1e3 * (time.perf_counter() - begin))
    return np.vstack(parts).astype(float)


def window(values, sigma):
    """0 to 80 HU as 8 bits, smoothed before."""
    smooth = cv2.GaussianBlur(values, (0, 0), sigma) if sigma > 0 else values
    return np.clip(smooth * (255.0 / 80.0), 0, 255).astype(np.uint8)


def run_opencv(folder, sigma):
    """Errors by number of clicks, and median times."""
    spec = json.loads((folder / "input.json").read_text())
    shape = (spec["height"], spec["width"])
    times = {"features_ms": [], "map_ms": [], "path_ms": []}
    errors = {}
    for outline in spec["outlines"]:
        values = np.fromfile(folder / f"slice{outline['slice']}.f32", "<f4").reshape(shape)
        image = window(values, sigma)
        truth = np.array(outline["truth"])
        for count, clicks in outline["clicks"].items():
            pixels = [tuple(int(round(v)) for v in click) for click in clicks]
            errors.setdefault(int(count), []).append(error(opencv(image, pixels, times), truth))
    rows = [
        {
            "clicks": count,
            "mean_px": float(np.mean(e)),
            "median_px": float(np.median(e)),
            "worst_px": float(np.max(e)),
            "within_half_px": int(np.sum(np.array(e) <= 0.5)),
        }
        for count, e in sorted(errors.items())
    ]
    return {"by_clicks": rows, **{name: float(np.median(t)) for name, t in times.items()}}


def table(results):
    """Prints errors and times side by side."""
    names = list(results)
    print("mean / median / worst contour error in pixels (outlines within half a pixel)")
    print("clicks  " + "".join(f"{name:>34}" for name in names))
    for row in range(len(results["Monro"]["by_clicks"])):
        cells = [results[name]["by_clicks"][row] for name in names]
        text = "".join(
            f"{c['mean_px']:>16.2f} /{c['median_px']:5.2f} /{c['worst_px']:5.1f} ({c['within_half_px']:2d})" for c in cells)
        print(f"{cells[0]['clicks']:>6}  {text}")
    ours = results["Monro"]
    print(f"\nMonro:  cost map {ours['livewire_map_ms']:.1f} ms; mouse movement {ours['path_median_ms']:.3f} ms median, "
          f"{ours['livewire_path_ms']:.3f} ms at 95 %, {ours['path_worst_ms']:.1f} ms worst; "
          f"all paths {ours['whole_slice_ms']:.1f} ms")
    for name in names[1:]:
        t = results[name]
        print(f"{name}:  features {t['features_ms']:.1f} ms; all paths, at every click, {t['map_ms']:.1f} ms; "
              f"path {t['path_ms']:.3f} ms")


def main():
    """Reads the arguments and runs the tools."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--input", type=Path, help="a folder written by the bench, with its output as result.json")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.input or Path(temporary)
        ours = json.loads((folder / "result.json").read_text())["livewire"] if arguments.input else run_ours(folder)
        results = {"Monro": ours, "OpenCV, raw": run_opencv(folder, 0.0), "OpenCV, Gaussian": run_opencv(folder, 1.5)}
    if arguments.json:
        json.dump({"opencv": cv2.__version__, **results}, sys.stdout, indent=2)
        print()
    else:
        table(results)


if __name__ == "__main__":
    main()
