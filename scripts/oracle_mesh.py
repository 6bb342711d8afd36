"""meshio against our mesh formats: each reads what the other writes, with equal points, cells and labels.
NumPy against our search for triangles that cross.

    python scripts/oracle_mesh.py [--monro PATH_TO_BINARY]
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import meshio
import numpy as np

import oracle

POINTS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10], [0.5, 0.25, -15]], float)
TETS = np.array([[0, 1, 2, 3], [0, 2, 1, 4]])
LABELS = np.array([4, 6], np.int32)
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def convert(source, target):
    """Runs `monro mesh SOURCE --out TARGET`; what it said when it refused."""
    run = subprocess.run([MONRO, "mesh", str(source), "--out", str(target), "--force"], capture_output=True, text=True)
    return run.stderr.strip() if run.returncode else None


def check(ok, text):
    global FAILED
    FAILED += not ok
    print("ok  " if ok else "FAIL", text)


def tetrahedra(mesh):
    """Points, tetrahedra and their labels, whatever the format calls them."""
    cells, labels = [], []
    data = mesh.cell_data.get("label") or mesh.cell_data.get("gmsh:physical")
    for i, block in enumerate(mesh.cells):
        if block.type == "tetra":
            cells.append(block.data)
            labels.append(np.ravel(data[i]))
    return mesh.points, np.concatenate(cells), np.concatenate(labels)


def theirs_to_ours(folder):
    """Files by meshio, converted by us to each format, read again by meshio."""
    tags = {"gmsh:physical": [LABELS], "gmsh:geometrical": [LABELS]}
    grid = meshio.Mesh(POINTS, [("tetra", TETS)], cell_data={"label": [LABELS]})
    tagged = meshio.Mesh(POINTS, [("tetra", TETS)], cell_data=tags)
    sources = []
    for compression in ("zlib", None):
        sources.append(folder / f"vtu_{compression}.vtu")
        meshio.vtu.write(sources[-1], grid, binary=True, compression=compression)
    sources.append(folder / "msh2_ascii.msh")
    meshio.gmsh.write(sources[-1], tagged, fmt_version="2.2", binary=False)
    for source in sources:
        for extension in ("vtu", "msh"):
            target = folder / f"out_{source.stem}.{extension}"
            said = convert(source, target)
            if said:
                check(False, f"{source.name} to {extension}: {said}")
                continue
            points, tets, labels = tetrahedra(meshio.read(target))
            same = np.array_equal(points, POINTS) and np.array_equal(tets, TETS) and np.array_equal(labels, LABELS)
            check(same, f"{source.name} to .{extension} and back to meshio")


def interfaces(folder):
    mesh = meshio.read(folder / "out_vtu_zlib.msh")
    triangles = sum(len(b.data) for b in mesh.cells if b.type == "triangle")
    check(triangles == 7, f"{triangles} triangles on the interfaces, 7 expected")
    names = set(mesh.field_data)
    wanted = {"label_4", "label_6", "label_4-label_6", "label_4-outside", "label_6-outside"}
    check(names == wanted, f"physical groups {sorted(names)}")


def surfaces(folder):
    surface = meshio.Mesh(POINTS[:4], [("triangle", TRIANGLES)])
    for name, options in [("a.stl", {"binary": True}), ("b.stl", {"binary": False}), ("c.ply", {"binary": True}), ("d.ply", {"binary": False})]:
        meshio.write(folder / name, surface, **options)
        for extension in ("stl", "ply", "obj"):
            target = folder / f"out_{name[0]}.{extension}"
            said = convert(folder / name, target)
            found = None if said else meshio.read(target)
            corners = sorted(map(tuple, found.points[found.cells_dict["triangle"]].reshape(-1, 9))) if found else []
            # STL orders vertices its own way: compare the triangles by their corners.
            wanted = sorted(map(tuple, POINTS[TRIANGLES].reshape(-1, 9)))
            check(np.array_equal(corners, wanted), f"{name} to .{extension} and back {said or ''}")


def refusals(folder):
    inverted = meshio.Mesh(POINTS, [("tetra", TETS[:, [1, 0, 2, 3]])], cell_data={"label": [LABELS]})
    meshio.write(folder / "inverted.vtu", inverted)
    said = convert(folder / "inverted.vtu", folder / "no.msh")
    check(bool(said) and "tetrahedron 0" in said, f"an inverted element is named: {said}")


def ball(n, centre):
    """Points and triangles of a unit sphere of n by 2 n patches."""
    u, v = np.meshgrid(np.arange(1, n) * np.pi / n, np.arange(2 * n) * np.pi / n, indexing="ij")
    ring = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1).reshape(-1, 3)
    points = np.vstack([ring, [[0, 0, 1], [0, 0, -1]]]) + centre
    at = lambda i, j: i * 2 * n + j % (2 * n)
    j, top, bottom = np.arange(2 * n), len(ring), len(ring) + 1
    caps = [np.stack([0 * j + top, at(0, j), at(0, j + 1)], 1), np.stack([0 * j + bottom, at(n - 2, j + 1), at(n - 2, j)], 1)]
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 2), j, indexing="ij"))
    sides = [np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], 1), np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], 1)]
    return points, np.vstack(caps + sides)


def pierced(a, b):
    """For each triangle of a and of b (n, 3, 3), whether an edge of that of a passes through that of b."""
    i, j = (x.ravel() for x in np.meshgrid(np.arange(len(a)), np.arange(len(b)), indexing="ij"))
    side = lambda p, q, r, s: np.einsum("ij,ij->i", np.cross(q - p, r - p), s - p)
    found = np.zeros(len(i), bool)
    for k in range(3):
        p, q, (r, s, t) = a[i, k], a[i, (k + 1) % 3], b[j].transpose(1, 0, 2)
        around = np.stack([side(p, q, r, s), side(p, q, s, t), side(p, q, t, r)])
        found |= (side(r, s, t, p) * side(r, s, t, q) < 0) & ((around > 0).all(0) | (around < 0).all(0))
    return found.reshape(len(a), len(b))


def crossings(folder):
    """Two balls in each other: every edge against every triangle."""
    (points, triangles), (others, _) = ball(12, np.zeros(3)), ball(12, np.array([0.83, 0.21, 0.37]))
    both = meshio.Mesh(np.vstack([points, others]), [("triangle", np.vstack([triangles, triangles + len(points)]))])
    meshio.write(folder / "balls.ply", both)
    command = [MONRO, "mesh", str(folder / "balls.ply"), "--out", str(folder / "balls.stl"), "--json"]
    told = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)["self_crossing"]
    a, b = points[triangles], others[triangles]
    wanted = int((pierced(a, b) | pierced(b, a).T).sum())
    off = [abs(np.linalg.norm(np.array(told["at_lps_mm"]) - c) - 1) for c in (np.zeros(3), [0.83, 0.21, 0.37])]
    check(told["pairs"] == wanted, f"{told['pairs']} pairs of triangles cross, {wanted} expected")
    check(max(off) < 0.05, f"the place lies {max(off):.3f} off both balls")


FAILED = 0
MONRO = oracle.binary(__doc__)
with tempfile.TemporaryDirectory() as temp:
    theirs_to_ours(pathlib.Path(temp))
    interfaces(pathlib.Path(temp))
    surfaces(pathlib.Path(temp))
    refusals(pathlib.Path(temp))
    crossings(pathlib.Path(temp))
sys.exit(f"{FAILED} checks failed" if FAILED else 0)
