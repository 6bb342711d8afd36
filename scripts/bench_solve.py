"""`monro solve` against quadratic finite elements (Newton's method, scipy) on scenes that no constant was set on: an ellipsoid of
two materials that sags, one with a cavity under pressure, a block under a flat punch. Takes some minutes, most of them theirs.

    pip install numpy scipy meshio
    python scripts/bench_solve.py [--monro PATH_TO_BINARY]
"""

import json
import pathlib
import subprocess
import tempfile

import meshio
import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

import oracle

# Corners of a tetrahedron's six edges, in the order of its middle nodes.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
# Of a triangle's three.
SIDES = np.array([[0, 1], [1, 2], [0, 2]])
PERMUTATION = np.zeros((3, 3, 3))
for i, j, k in [(0, 1, 2), (1, 2, 0), (2, 0, 1)]:
    PERMUTATION[i, j, k], PERMUTATION[i, k, j] = 1, -1


def quadrature():
    """Fourteen points of degree five in a tetrahedron (barycentric), weights that sum to one."""
    points, weights = [], []
    for a, w in [(0.3108859192633006, 0.1126879257180158), (0.0927352503108912, 0.0734930431163619)]:
        for corner in range(4):
            points.append([1 - 3 * a if k == corner else a for k in range(4)])
            weights.append(w)
    a = 0.0455037041256496
    for pair in EDGES:
        points.append([a if k in pair else 0.5 - a for k in range(4)])
        weights.append(0.0425460207770814)
    return np.array(points), np.array(weights) / np.sum(weights)


def derivatives(points):
    """Of the ten shape functions by the four barycentric coordinates, at each point."""
    out = np.zeros((len(points), 10, 4))
    for corner in range(4):
        out[:, corner, corner] = 4 * points[:, corner] - 1
    for middle, (a, b) in enumerate(EDGES):
        out[:, 4 + middle, a], out[:, 4 + middle, b] = 4 * points[:, b], 4 * points[:, a]
    return out


def shapes(points, pairs):
    """Quadratic shape functions of a simplex at barycentric points."""
    corners = points * (2 * points - 1)
    middles = 4 * points[:, pairs[:, 0]] * points[:, pairs[:, 1]]
    return np.concatenate([corners, middles], axis=1)


class Solid:
    """A mesh of straight quadratic elements with its material, held nodes and loads, in SI."""

    def __init__(self, points, tets, young, poisson):
        keys = np.sort(tets[:, EDGES].reshape(-1, 2), axis=1)
        edges, number = np.unique(keys, axis=0, return_inverse=True)
        self.middle_of = {tuple(e): len(points) + i for i, e in enumerate(edges)}
        self.nodes = np.concatenate([points, points[edges].mean(axis=1)])
        self.elements = np.concatenate([tets, len(points) + number.reshape(-1, 6)], axis=1)
        self.mu = young / (2 * (1 + poisson))
        self.bulk = young * poisson / ((1 + poisson) * (1 - 2 * poisson)) + self.mu
        bary, self.weights = quadrature()
        frame = points[tets[:, 1:]] - points[tets[:, :1]]
        self.volumes = np.linalg.det(frame) / 6
        slope = np.concatenate([-np.linalg.inv(frame).sum(axis=2, keepdims=True), np.linalg.inv(frame)], axis=2)
        self.gradients = np.einsum("qab,eib->qeai", derivatives(bary), slope)
        self.values = shapes(bary, EDGES)
        self.force = np.zeros(3)
        self.pressed = np.zeros((0, 6), int)
        self.pressure = 0.0

    def press(self, faces, pressure):
        """A follower pressure on triangles, against their normals as listed."""
        middle = [[self.middle_of[tuple(sorted((f[a], f[b])))] for a, b in SIDES] for f in faces]
        self.pressed, self.pressure = np.concatenate([faces, middle], axis=1), pressure

    def assemble(self, u, share):
        """Force out of balance and tangent at displacement `u`, `share` of the loads acting."""
        forces, blocks = np.zeros((len(self.elements), 10, 3)), np.zeros((len(self.elements), 10, 3, 10, 3))
        for g, n, w in zip(self.gradients, self.values, self.weights):
            f = np.eye(3) + np.einsum("eak,eai->eki", u[self.elements], g)
            cof = np.cross(np.roll(f, -1, axis=1), np.roll(f, -2, axis=1), axis=2)
            stretch = np.linalg.det(f)
            slope = self.bulk * (stretch - 1) - self.mu
            stress = self.mu[:, None, None] * f + slope[:, None, None] * cof
            tangent = np.einsum("e,ik,jl->eijkl", self.mu, np.eye(3), np.eye(3))
            tangent += np.einsum("e,eij,ekl->eijkl", self.bulk, cof, cof)
            tangent += np.einsum("e,ikm,jln,emn->eijkl", slope, PERMUTATION, PERMUTATION, f)
            dv = w * self.volumes
            forces += np.einsum("e,eij,eaj->eai", dv, stress, g) - share * np.einsum("e,a,i->eai", dv, n, self.force)
            blocks += np.einsum("e,eaj,eijkl,ebl->eaibk", dv, g, tangent, g, optimize=True)
        groups = [(self.elements, forces, blocks)]
        if len(self.pressed):
            groups.append((self.pressed, *self.push(u, share)))
        return self.gather(groups)

    def push(self, u, share):
        """Forces of the follower pressure and their derivative: the pressure times the shape, over the current area."""
        points = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6.0
        values = shapes(points, SIDES)
        x = (self.nodes + u)[self.pressed]
        forces, blocks = np.zeros((len(x), 6, 3)), np.zeros((len(x), 6, 3, 6, 3))
        for point, n in zip(points, values):
            by = np.zeros((6, 3))
            by[:3] = np.diag(4 * point - 1)
            for middle, (a, b) in enumerate(SIDES):
                by[3 + middle, a], by[3 + middle, b] = 4 * point[b], 4 * point[a]
            d1, d2 = by[:, 1] - by[:, 0], by[:, 2] - by[:, 0]
            t1, t2 = np.einsum("a,eai->ei", d1, x), np.einsum("a,eai->ei", d2, x)
            factor = share * self.pressure / 6.0
            forces += factor * np.einsum("a,ei->eai", n, np.cross(t1, t2))
            turned = np.einsum("b,ijk,ek->eijb", d1, PERMUTATION, t2) + np.einsum("b,ikj,ek->eijb", d2, PERMUTATION, t1)
            blocks += factor * np.einsum("a,eijb->eaibj", n, turned)
        return forces, blocks

    def gather(self, groups):
        """Sums forces and tangents of cells into a vector and a sparse matrix."""
        size = 3 * len(self.nodes)
        total, matrix = np.zeros(size), sparse.csr_matrix((size, size))
        for cells, forces, blocks in groups:
            dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), -1)
            n = dofs.shape[1]
            rows, columns = np.repeat(dofs, n, axis=1).ravel(), np.tile(dofs, (1, n)).ravel()
            np.add.at(total, dofs.ravel(), forces.ravel())
            matrix = matrix + sparse.csr_matrix((blocks.ravel(), (rows, columns)), shape=(size, size))
        return total, matrix

    def equilibrium(self, held, steps=2):
        """Displacement with the nodes of `held` (number: displacement) moved, loads and motion grown in steps; and the
        forces that hold them."""
        u, out = np.zeros_like(self.nodes), None
        fixed = np.array(sorted(held))
        free = np.setdiff1d(np.arange(u.size), (3 * fixed[:, None] + np.arange(3)).ravel())
        to = np.array([held[n] for n in fixed])
        for step in range(1, steps + 1):
            lift = step / steps * to - u[fixed]
            for _ in range(25):
                out, matrix = self.assemble(u, step / steps)
                moved = np.zeros(u.size)
                moved[(3 * fixed[:, None] + np.arange(3)).ravel()] = lift.ravel()
                right = -(out + matrix @ moved)[free]
                if np.linalg.norm(right) < 1e-9 * max(np.linalg.norm(out), 1e-12):
                    break
                factors = splu(matrix[free][:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
                moved[free] = factors.solve(right)
                u, lift = u + moved.reshape(u.shape), np.zeros_like(lift)
        return u, out.reshape(u.shape)


def grid(cells):
    """Corners of a cube of cubes from -1 to 1, and six tetrahedra for each cube."""
    n = cells + 1
    axis = np.linspace(-1, 1, n)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    tets = []
    for cube in np.ndindex(cells, cells, cells):
        for path, turned in [((0, 1, 2), 0), ((1, 2, 0), 0), ((2, 0, 1), 0), ((0, 2, 1), 1), ((2, 1, 0), 1), ((1, 0, 2), 1)]:
            at, corners = np.array(cube), [np.array(cube)]
            for a in path:
                at = at + np.eye(3, dtype=int)[a]
                corners.append(at)
            tet = [int(c @ [n * n, n, 1]) for c in corners]
            tets.append([tet[0], tet[2], tet[1], tet[3]] if turned else tet)
    return points, np.array(tets)


def boundary(tets):
    """Outer triangles, seen from outside."""
    faces = tets[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def finer(points, tets):
    """Every tetrahedron cut into eight; the given points come first."""
    keys = np.sort(tets[:, EDGES].reshape(-1, 2), axis=1)
    edges, number = np.unique(keys, axis=0, return_inverse=True)
    m = len(points) + number.reshape(-1, 6)
    c = np.concatenate([tets, m], axis=1)
    eight = [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3], [4, 5, 6, 8], [4, 6, 7, 8], [6, 5, 9, 8], [6, 9, 7, 8]]
    middle = {tuple(e): int(len(points) + i) for i, e in enumerate(edges)}
    return np.concatenate([points, points[edges].mean(axis=1)]), c[:, eight].reshape(-1, 4), middle


def quarters(faces, middle):
    """The triangles that these are cut into."""
    cut = []
    for a, b, c in faces:
        ab, bc, ac = (middle[tuple(sorted(e))] for e in ((a, b), (b, c), (a, c)))
        cut += [[a, ab, ac], [ab, b, bc], [ac, bc, c], [ab, bc, ac]]
    return np.array(cut)


def used(points, tets):
    """Only the points that elements have."""
    kept, number = np.unique(tets, return_inverse=True)
    return points[kept], number.reshape(tets.shape)


def ellipsoid(cells):
    """A ball by squeezing a cube, as an ellipsoid of a brain's size (m); the radius of each point over the surface's."""
    points, tets = grid(cells)
    radius = np.abs(points).max(axis=1)
    norm = np.linalg.norm(points, axis=1)
    ball = points * (radius / np.where(norm > 0, norm, 1))[:, None]
    return ball * [0.065, 0.080, 0.060], tets, radius


def sagging():
    points, tets, radius = ellipsoid(4)
    inner = radius[tets].max(axis=1) <= 0.501
    bottom = np.flatnonzero((radius > 0.999) & (points[:, 2] < -0.02))
    materials = {1: (3000.0, 0.49), 2: (500.0, 0.3)}
    return dict(points=points, tets=tets, region=np.where(inner, 2, 1), materials=materials,
                held={"skull": (bottom, [0, 0, 0])}, force=[400.0, 0.0, -600.0])


def filled():
    points, tets, radius = ellipsoid(4)
    tets = tets[radius[tets].max(axis=1) > 0.501]
    kept = np.unique(tets)
    radius = radius[kept]
    points, tets = used(points, tets)
    skull = np.flatnonzero((radius > 0.999) & (points[:, 2] < 0.01))
    inner = boundary(tets)
    inner = inner[(radius[inner] < 0.6).all(axis=1)]
    return dict(points=points, tets=tets, region=np.ones(len(tets), int), materials={1: (3000.0, 0.49)},
                held={"skull": (skull, [0, 0, 0])}, faces=inner, pressure=400.0)


def punched():
    points, tets = grid(4)
    points = points * [0.03, 0.03, 0.02]
    bottom = np.flatnonzero(points[:, 2] < -0.0199)
    punch = np.flatnonzero((points[:, 2] > 0.0199) & (np.abs(points[:, :2]).max(axis=1) < 0.0151))
    return dict(points=points, tets=tets, region=np.ones(len(tets), int), materials={1: (3000.0, 0.45)},
                held={"bottom": (bottom, [0, 0, 0]), "punch": (punch, [0, 0, -0.004])})


def foreign(s):
    """The scene by quadratic elements, each given one cut into eight: displacement at the given points, force of each set."""
    points, tets, middle = finer(s["points"], s["tets"])
    young, poisson = (np.array([s["materials"][r][i] for r in s["region"]]).repeat(8) for i in (0, 1))
    solid = Solid(points, tets, young, poisson)
    solid.force = np.array(s.get("force", [0.0, 0.0, 0.0]))
    if "faces" in s:
        solid.press(quarters(s["faces"], middle), s["pressure"])
    outer, held, sets = boundary(s["tets"]), {}, {}
    for name, (nodes, to) in s["held"].items():
        # A patch is the triangles that are held at all corners.
        patch = quarters(outer[np.isin(outer, nodes).all(axis=1)], middle)
        middles = {solid.middle_of[tuple(sorted(e))] for f in patch for e in (f[[0, 1]], f[[1, 2]], f[[0, 2]])}
        sets[name] = np.array(sorted({*nodes.tolist(), *patch.ravel().tolist(), *middles}))
        held.update({n: to for n in sets[name]})
    u, force = solid.equilibrium(held)
    return u[: len(s["points"])], {name: force[nodes].sum(axis=0) for name, nodes in sets.items()}


def ours(monro, s, folder, options):
    """The same by `monro solve`: displacement and what it told."""
    points = {f"set_{name}": np.isin(np.arange(len(s["points"])), nodes).astype(float) for name, (nodes, _) in s["held"].items()}
    mesh = meshio.Mesh(s["points"], [("tetra", s["tets"])], point_data=points, cell_data={"region": [s["region"].astype(np.int32)]})
    meshio.write(folder / "mesh.vtu", mesh)
    case = {"materials": {str(r): {"E": e, "nu": nu} for r, (e, nu) in s["materials"].items()},
            "dirichlet": [{"set": name, "components": "xyz", "value": to} for name, (_, to) in s["held"].items()],
            "body_force": s.get("force", [0, 0, 0]), "imposed_mm": 1.0}
    sets = {name: len(nodes) for name, (nodes, _) in s["held"].items()}
    described = {"file": "mesh.vtu", "nodes": len(s["points"]), "tets": len(s["tets"]), "sets": sets}
    if "faces" in s:
        case["pressure"] = [{"faces": "wall", "pressure": s["pressure"]}]
        described["face_sets"] = {"wall": s["faces"].tolist()}
    (folder / "scene.json").write_text(json.dumps({"cases": {"it": case}, "meshes": {"mesh": described}}))
    command = [monro, "solve", str(folder / "scene.json"), "--mesh", "mesh", "--case", "it", "--out", str(folder / "out.vtu"), "--force", "--json", *options]
    run = subprocess.run(command, capture_output=True, text=True)
    if run.returncode:
        raise SystemExit(run.stderr)
    return meshio.read(folder / "out.vtu").point_data["displacement"], json.loads(run.stdout)


def main():
    monro = oracle.binary(__doc__)
    for scene in (sagging, filled, punched):
        s = scene()
        expected, forces = foreign(s)
        print(f"{scene.__name__}: {len(s['tets'])} elements, quadratic ones 8 times as many, largest {1e3 * np.abs(expected).max():.2f} mm")
        print("  quadratic forces, N:", {name: f.round(4).tolist() for name, f in forces.items()})
        for options in (["--refine", "0"], [], ["--refine", "3"]):
            with tempfile.TemporaryDirectory() as folder:
                found, told = ours(monro, s, pathlib.Path(folder), options)
            error = np.linalg.norm(found - expected) / np.linalg.norm(expected)
            forces_n = {name: np.round(f, 4).tolist() for name, f in told["reactions_N"].items()}
            print(f"  ours on {told['tets_solved']}: relative L2 {100 * error:.1f} %, forces {forces_n}, {told['seconds']:.1f} s", flush=True)


if __name__ == "__main__":
    main()
