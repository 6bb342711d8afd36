"""meshio against our mesh formats: each reads what the other writes, with equal points, cells and labels.

    python scripts/oracle_mesh.py [--monro PATH_TO_BINARY]
"""

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


FAILED = 0
MONRO = oracle.binary(__doc__)
with tempfile.TemporaryDirectory() as temp:
    theirs_to_ours(pathlib.Path(temp))
    interfaces(pathlib.Path(temp))
    surfaces(pathlib.Path(temp))
    refusals(pathlib.Path(temp))
sys.exit(f"{FAILED} checks failed" if FAILED else 0)
