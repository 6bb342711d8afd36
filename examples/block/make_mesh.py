#!/usr/bin/env python3
"""Writes block.vtu, the mesh of scene.json: a block of 60 x 20 x 20 mm, six tetrahedra for each cell of 5 mm.

Python 3 alone. Run in this folder: python3 make_mesh.py
"""

from itertools import permutations, product
from pathlib import Path

CELLS, EDGE = (12, 4, 4), 0.005  # all lengths in metres


def number(i, j, k):
    return (i * (CELLS[1] + 1) + j) * (CELLS[2] + 1) + k


def right_handed(t, nodes):
    a, b, c, d = (nodes[v] for v in t)
    u, v, w = ([q[n] - a[n] for n in range(3)] for q in (b, c, d))
    triple = sum(u[n] * (v[n - 2] * w[n - 1] - v[n - 1] * w[n - 2]) for n in range(3))
    return t if triple > 0 else [t[0], t[1], t[3], t[2]]


nodes = list(product(*(range(n + 1) for n in CELLS)))  # in the order of number()
tets = []
for cell in product(*(range(n) for n in CELLS)):
    # From one corner of the cell to the opposite one, along the axes in each of the six orders.
    for order in permutations(range(3)):
        at, walk = list(cell), [number(*cell)]
        for axis in order:
            at[axis] += 1
            walk.append(number(*at))
        tets.append(right_handed(walk, nodes))

# One point array "set_NAME" for each set of nodes: 1 in the set, 0 outside.
sets = {f"set_{axis}{side}": [int(p[n] == (CELLS[n] if side else 0)) for p in nodes]
        for n, axis in enumerate("xyz") for side in (0, 1)}


def array(kind, name, components, values):
    text = " ".join(str(v) for v in values)
    return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="ascii">\n{text}\n</DataArray>'


parts = [
    '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">',
    f'<UnstructuredGrid><Piece NumberOfPoints="{len(nodes)}" NumberOfCells="{len(tets)}">',
    "<Points>", array("Float64", "Points", 3, (round(v * EDGE, 6) for p in nodes for v in p)), "</Points>",
    "<Cells>",
    array("Int32", "connectivity", 1, (v for t in tets for v in t)),
    array("Int32", "offsets", 1, range(4, 4 * len(tets) + 1, 4)),
    array("UInt8", "types", 1, [10] * len(tets)),  # 10: linear tetrahedron
    "</Cells>",
    "<PointData>", *(array("UInt8", name, 1, flags) for name, flags in sets.items()), "</PointData>",
    "<CellData>", array("Int32", "region", 1, [1] * len(tets)), "</CellData>",
    "</Piece></UnstructuredGrid></VTKFile>",
]
Path(__file__).with_name("block.vtu").write_text("\n".join(parts) + "\n")

# Triangles of the outer surface for a pressure: here the cells of the top (z = 20 mm) from x = 25 to 35 mm.
inside = [v for v, (i, j, k) in enumerate(nodes) if k == CELLS[2] and 5 <= i <= 7]
faces = {tuple(sorted(f)) for t in tets for f in ([t[a] for a in range(4) if a != b] for b in range(4))
         if all(v in inside for v in f)}
print(f"block.vtu: {len(nodes)} nodes, {len(tets)} tetrahedra; faces of the patch:")
print([list(f) for f in sorted(faces)])
