#!/usr/bin/env python3
"""Runs other tetrahedral meshers and ours in turn on the same case, and prints seconds and quality.

    pip install tetgen pytetwild meshio
    scripts/bench_mesh.py CASE [--elements 37336,65691] [--peers tetgen,pytetwild] [--repeat 1]

CASE is a folder made by `monro prepare`: ours starts from its labels. The others, which know no labels, start from the outer
surface and the ventricles' surface of our mesh: clean, even, graded triangles whose making is not counted for them. The
packages from pip offer no size field beyond those triangles; the count they end with is printed. Each runs in a process of its own; processor time counts, the least of
all repeats. Ours must be built (`cargo build --release -p monro-cli`). Not part of CI: it needs the peers and minutes.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
KEYS = ["elements", "dihedral_min_deg", "dihedral_max_deg", "dihedral_p1_deg", "radius_ratio_min", "radius_ratio_median"]


def quality(points, tets):
    """Dihedral angles (degrees) and radius ratios, as `monro mesh` counts them."""
    import numpy as np

    p = points[tets]
    normals = {}
    for i in range(4):
        a, b, c = (p[:, j] for j in range(4) if j != i)
        n = np.cross(b - a, c - a)
        outward = np.einsum("ij,ij->i", n, a - p[:, i])
        normals[i] = n * np.where(outward < 0, -1, 1)[:, None]
    area = {i: np.linalg.norm(n, axis=1) for i, n in normals.items()}
    angles = []
    for i in range(4):
        for j in range(i + 1, 4):
            cosine = -np.einsum("ij,ij->i", normals[i], normals[j]) / np.maximum(area[i] * area[j], 1e-300)
            angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    angles = np.array(angles)
    u, v, w = (p[:, k] - p[:, 0] for k in (1, 2, 3))
    volume6 = np.abs(np.einsum("ij,ij->i", np.cross(u, v), w))
    square = lambda x: np.einsum("ij,ij->i", x, x)[:, None]
    r = square(u) * np.cross(v, w) + square(v) * np.cross(w, u) + square(w) * np.cross(u, v)
    ratio = 6 * volume6**2 / np.maximum(sum(area.values()) * np.linalg.norm(r, axis=1), 1e-300)
    low = np.sort(angles.min(axis=0))
    return dict(zip(KEYS, [len(tets), low[0], angles.max(), low[len(low) // 100], ratio.min(), np.median(ratio)]))


def surfaces(file):
    """Outer surface and surface of all inner labels of a mesh that ours wrote: clean, even, graded triangles."""
    import meshio
    import numpy as np

    mesh = meshio.read(file)
    tets, labels = mesh.cells_dict["tetra"], mesh.cell_data_dict["label"]["tetra"].ravel()
    outer = labels == np.bincount(labels.astype(int)).argmax()
    corners = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    faces = tets[:, corners].reshape(-1, 3)
    sides = np.repeat(outer, 4)
    order = np.lexsort(np.sort(faces, axis=1).T)
    keys = np.sort(faces, axis=1)[order]
    same = (keys[1:] == keys[:-1]).all(axis=1)
    first, second = np.append(same, False), np.insert(same, 0, False)
    differ = np.append(sides[order][1:] != sides[order][:-1], False)
    wanted = order[(~first & ~second) | (first & differ)]
    used, faces = np.unique(faces[wanted], return_inverse=True)
    return np.asarray(mesh.points, float)[used], faces.reshape(-1, 3)


def run_peer(peer, file, elements):
    """One peer in this process; prints its numbers as JSON."""
    points, faces = surfaces(file)
    begin, wall = time.process_time(), time.time()
    if peer == "tetgen":
        import tetgen

        mesher = tetgen.TetGen(points, faces)
        mesher.tetrahedralize(plc=True, quality=True, minratio=1.4, mindihedral=12.0, nobisect=False, verbose=0)
        out, tets = mesher.node, mesher.elem
    else:
        import numpy as np
        import pytetwild

        low, high = points.min(axis=0), points.max(axis=0)
        # An even mesh: edges from the volume of an ellipsoid in the box, as a part of the box's diagonal.
        edge = (6 * 2**0.5 * 0.52 * np.prod(high - low) / elements) ** (1 / 3)
        out, tets = pytetwild.tetrahedralize(points, faces.astype(np.int32), edge_length_fac=edge / np.linalg.norm(high - low))[:2]
    cpu, wall = time.process_time() - begin, time.time() - wall
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    row = {k: float(v) for k, v in quality(out, tets[:, :4]).items()}
    print(json.dumps({**row, "cpu_s": cpu, "wall_s": wall, "memory_mib": memory}))


def call(command):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))} failed:\n{done.stderr}")
    return json.loads(done.stdout)


def ours(monro, case, elements, repeat):
    common = ["--elements", elements, "--json", "--repeat", repeat]
    row = call([monro, "bench", "mesh", case, "--seeds", 0, *common])["meshes"][0]
    if "error" in row:
        sys.exit(row["error"])
    times = {"cpu_s": row["cpu_seconds"]["without_report"], "wall_s": row["seconds"]["without_report"]}
    return {**{k: row[k] for k in KEYS}, **times, "memory_mib": row["peak_memory_mib"]}


def theirs(peer, file, elements):
    script = pathlib.Path(__file__).resolve()
    command = [sys.executable, script, str(file), "--one", peer, "--elements", str(elements)]
    # tetgen leaves files where it runs.
    done = subprocess.run(command, capture_output=True, text=True, cwd=file.parent)
    lines = [line for line in done.stdout.splitlines() if line.startswith('{"elements"')]
    if not lines:
        reason = (done.stderr.strip().splitlines() or [f"ended with {done.returncode}"])[-1]
        print(f"  {peer:12} failed: {reason}")
        return None
    return json.loads(lines[-1])


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("case", type=pathlib.Path)
    a.add_argument("--elements", default="37336,65691")
    a.add_argument("--peers", default="tetgen,pytetwild")
    a.add_argument("--repeat", type=int, default=1)
    a.add_argument("--one", help=argparse.SUPPRESS)
    target = os.environ.get("CARGO_TARGET_DIR", ROOT / "target")
    a.add_argument("--monro", default=pathlib.Path(target) / "release" / "monro")
    args = a.parse_args()
    case = args.case.resolve()
    if args.one:
        return run_peer(args.one, case, int(args.elements))
    for elements in map(int, args.elements.split(",")):
        print(f"{elements} wanted: CPU s (wall), elements, dihedral min-max, p1, radius ratio min / median, MiB")
        rows = {"ours": ours(args.monro, case, elements, args.repeat)}
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "ours.vtu"
            call([args.monro, "mesh", case, "--elements", elements, "--out", file, "--json"])
            for peer in args.peers.split(","):
                tries = [r for r in (theirs(peer, file, elements) for _ in range(args.repeat)) if r]
                if tries:
                    rows[peer] = min(tries, key=lambda r: r["cpu_s"])
        for name, r in rows.items():
            e, low, high, p1, least, median = (r[k] for k in KEYS)
            print(
                f"  {name:12} {r['cpu_s']:7.2f} ({r['wall_s']:.2f}) {int(e):8d} "
                f"{low:5.1f}-{high:5.1f} {p1:5.1f} {least:.3f} / {median:.2f} {r['memory_mib']:6.0f}"
            )


if __name__ == "__main__":
    main()
