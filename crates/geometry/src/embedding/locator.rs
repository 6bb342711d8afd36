//! Which tetrahedron holds a point.

use crate::{
    Bvh, NO_TET, Nearest, Patient, Point, TET_FACES, TetMesh, TetMeshError, TriangleMesh, bounds, tet_neighbours,
};

/// Marks, instead of a neighbour behind a face, the number of that face on the boundary.
const BOUNDARY: u32 = 1 << 31;
/// Weights this far below zero still count as inside: rounding must not open gaps between elements.
const SLACK: f64 = -1e-9;

/// A point inside an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Located {
    /// The element.
    pub tet: usize,
    /// Barycentric weights of its corners; they sum to 1.
    pub weights: [f64; 4],
}

/// The nearest point of the mesh's boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestFace {
    /// The element behind the face.
    pub tet: usize,
    /// Its corner that does not belong to the face.
    pub opposite: usize,
    /// Number of the face on the boundary.
    pub face: usize,
    /// The nearest point.
    pub point: Point<Patient>,
    /// Its distance, mm.
    pub distance: f64,
}

/// How a walk ends.
enum Walk {
    Found(Located),
    /// Through this face of the boundary.
    Left(usize),
    Lost,
}

/// Finds elements by point: a walk from a neighbour's element where the caller has one, else a voxel hash.
#[derive(Debug, Clone)]
pub struct TetLocator {
    pub(super) vertices: Vec<Point<Patient>>,
    pub(super) tets: Vec<[u32; 4]>,
    /// The element behind the face opposite to each corner, or its number on the boundary with [`BOUNDARY`].
    neighbours: Vec<[u32; 4]>,
    pub(super) cells: Cells,
    boundary: Bvh,
    /// Element and corner opposite to each triangle of `boundary`.
    pub(super) behind: Vec<(u32, u8)>,
}

impl TetLocator {
    /// Copies the mesh and indexes it; O(n log n).
    ///
    /// # Errors
    /// A broken mesh, with the element and the reason.
    pub fn new(mesh: &TetMesh) -> Result<Self, TetMeshError> {
        mesh.validate()?;
        let (neighbours, behind) = adjacency(&mesh.tets, mesh.vertices.len());
        let triangles = behind.iter().map(|&(t, c)| TET_FACES[c as usize].map(|i| mesh.tets[t as usize][i])).collect();
        let boundary = Bvh::new(&TriangleMesh { vertices: mesh.vertices.clone(), triangles });
        let cells = Cells::new(mesh);
        Ok(Self { vertices: mesh.vertices.clone(), tets: mesh.tets.clone(), neighbours, cells, boundary, behind })
    }

    /// The corners' numbers of an element.
    pub fn nodes(&self, tet: usize) -> [u32; 4] {
        self.tets[tet]
    }

    /// The element that holds `p`; `None` outside the mesh.
    pub fn locate(&self, p: Point<Patient>) -> Option<Located> {
        self.cells.candidates(p).iter().find_map(|&t| {
            let weights = self.weights(t as usize, p);
            weights.iter().all(|&w| w >= SLACK).then_some(Located { tet: t as usize, weights })
        })
    }

    /// As [`TetLocator::locate`], but walks there from `start`, an element thought to be near: some tens of nanoseconds
    /// for points in a coherent order. Where several elements share the point the walk may end in another one of them.
    ///
    /// # Panics
    /// When there is no element `start`.
    pub fn locate_from(&self, start: usize, p: Point<Patient>) -> Option<Located> {
        match self.walk(start, p) {
            Walk::Found(found) => Some(found),
            Walk::Left(_) | Walk::Lost => self.locate(p),
        }
    }

    /// The element that holds `p`, else the nearest face: walks from the element `start`, and where the walk leaves the mesh
    /// looks at the face it left through first. `None` for a non-finite point.
    pub(super) fn locate_or_nearest(&self, start: usize, p: Point<Patient>) -> Option<Result<Located, NearestFace>> {
        let face = match self.walk(start, p) {
            Walk::Found(found) => return Some(Ok(found)),
            Walk::Left(face) => face,
            Walk::Lost => 0,
        };
        let near = self.nearest_face_from(face, p)?;
        if self.is_outside(&near, p) {
            return Some(Err(near));
        }
        Some(self.locate(p).ok_or(near))
    }

    /// Whether the nearest face alone shows that `p` is outside: on its outer side, with the nearest point not at its rim.
    fn is_outside(&self, near: &NearestFace, p: Point<Patient>) -> bool {
        const RIM: f64 = 1e-6;
        let at = self.weights(near.tet, near.point);
        (0..4).all(|c| c == near.opposite || at[c] > RIM) && self.weights(near.tet, p)[near.opposite] < SLACK
    }

    /// Towards `p` through the face that it lies furthest behind. A visibility walk may go in circles, and leaves a mesh with
    /// hollows although the point is inside.
    fn walk(&self, start: usize, p: Point<Patient>) -> Walk {
        let mut tet = start;
        for _ in 0..64 {
            let weights = self.weights(tet, p);
            let lowest = (1..4).fold(0, |low, i| if weights[i] < weights[low] { i } else { low });
            if weights[lowest] >= SLACK {
                return Walk::Found(Located { tet, weights });
            }
            match self.neighbours[tet][lowest] {
                face if face & BOUNDARY != 0 => return Walk::Left((face ^ BOUNDARY) as usize),
                next => tet = next as usize,
            }
        }
        Walk::Lost
    }

    /// The nearest point of the boundary; `None` for an empty mesh or a non-finite point.
    pub fn nearest_face(&self, p: Point<Patient>) -> Option<NearestFace> {
        self.boundary.nearest(p).map(|n| self.face(&n))
    }

    /// As [`TetLocator::nearest_face`], faster where `near` is a face thought to be near.
    fn nearest_face_from(&self, near: usize, p: Point<Patient>) -> Option<NearestFace> {
        self.boundary.nearest_from(near, p).map(|n| self.face(&n))
    }

    fn face(&self, n: &Nearest) -> NearestFace {
        let (tet, opposite) = self.behind[n.triangle];
        let (tet, opposite) = (tet as usize, opposite as usize);
        NearestFace { tet, opposite, face: n.triangle, point: n.point, distance: n.distance }
    }

    /// The numbers of points in an order in which neighbours follow each other: row by row through the cells of the mesh,
    /// there and back.
    pub(super) fn coherent_order(&self, points: &[Point<Patient>]) -> Vec<u32> {
        let rows: Vec<u32> = points.iter().map(|&p| self.cells.row(p)).collect();
        let mut first = vec![0u32; self.cells.first.len()];
        rows.iter().for_each(|&r| first[r as usize + 1] += 1);
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut order = vec![0; points.len()];
        for (i, &r) in rows.iter().enumerate() {
            let slot = &mut first[r as usize];
            order[*slot as usize] = i as u32;
            *slot += 1;
        }
        order
    }

    /// Barycentric weights of any point in an element (negative outside of it).
    pub fn weights(&self, tet: usize, p: Point<Patient>) -> [f64; 4] {
        let [a, b, c, d] = self.tets[tet].map(|v| self.vertices[v as usize]);
        let (ab, ac, ad, ap) = (b - a, c - a, d - a, p - a);
        let cross = ac.cross(ad);
        let volume = ab.dot(cross);
        let turned = ab.cross(ap);
        let (w1, w2, w3) = (ap.dot(cross) / volume, turned.dot(ad) / volume, -turned.dot(ac) / volume);
        [1.0 - w1 - w2 - w3, w1, w2, w3]
    }
}

/// The element behind each face of each element, and the boundary's faces as (element, opposite corner).
fn adjacency(tets: &[[u32; 4]], vertices: usize) -> (Vec<[u32; 4]>, Vec<(u32, u8)>) {
    let mut neighbours = tet_neighbours(tets, vertices);
    let mut boundary = Vec::new();
    for (t, behind) in neighbours.iter_mut().enumerate() {
        for (c, n) in behind.iter_mut().enumerate().filter(|(_, n)| **n == NO_TET) {
            *n = BOUNDARY | boundary.len() as u32;
            boundary.push((t as u32, c as u8));
        }
    }
    (neighbours, boundary)
}

/// A voxel hash: for each cell of a box the elements whose bounds touch it.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    origin: [f64; 3],
    inverse_step: f64,
    dims: [usize; 3],
    first: Vec<u32>,
    list: Vec<u32>,
}

impl Cells {
    fn new(mesh: &TetMesh) -> Self {
        let [low, high] = bounds(mesh.vertices.iter().map(|p| p.to_array())).unwrap_or_default();
        let size: [f64; 3] = core::array::from_fn(|a| (high[a] - low[a]).max(1e-9));
        // About two cells per element.
        let step = (size.iter().product::<f64>() / (2 * mesh.tets.len().max(1)) as f64).cbrt();
        let dims = size.map(|s| ((s / step) as usize + 1).min(1024));
        let step = (0..3).fold(step, |s, a| s.max(size[a] / dims[a] as f64)) * (1.0 + 1e-9);
        let mut cells = Self { origin: low, inverse_step: 1.0 / step, dims, first: Vec::new(), list: Vec::new() };
        cells.fill(mesh);
        cells
    }

    fn fill(&mut self, mesh: &TetMesh) {
        let count = self.dims.iter().product::<usize>();
        let mut first = vec![0u32; count + 1];
        for t in 0..mesh.tets.len() {
            self.touched(mesh, t, |c| first[c + 1] += 1);
        }
        for c in 0..count {
            first[c + 1] += first[c];
        }
        let mut at = first.clone();
        let mut list = vec![0; first[count] as usize];
        for t in 0..mesh.tets.len() {
            self.touched(mesh, t, |c| {
                list[at[c] as usize] = t as u32;
                at[c] += 1;
            });
        }
        (self.first, self.list) = (first, list);
    }

    fn touched(&self, mesh: &TetMesh, t: usize, mut each: impl FnMut(usize)) {
        let [low, high] = bounds(mesh.corners(t).map(Point::to_array)).unwrap_or_default();
        let index = |x: f64, a: usize| (((x - self.origin[a]) * self.inverse_step) as usize).min(self.dims[a] - 1);
        for k in index(low[2], 2)..=index(high[2], 2) {
            for j in index(low[1], 1)..=index(high[1], 1) {
                for i in index(low[0], 0)..=index(high[0], 0) {
                    each((k * self.dims[1] + j) * self.dims[0] + i);
                }
            }
        }
    }

    /// Place of a point's cell on a way through all cells; points outside take the nearest cell.
    fn row(&self, p: Point<Patient>) -> u32 {
        let at: [usize; 3] = core::array::from_fn(|a| {
            let c = (p.to_array()[a] - self.origin[a]) * self.inverse_step;
            (c.max(0.0) as usize).min(self.dims[a] - 1)
        });
        // Every second row and plane runs backwards.
        let turned = |x: usize, n: usize, turn: usize| if turn.is_multiple_of(2) { x } else { n - 1 - x };
        let j = turned(at[1], self.dims[1], at[2]);
        let i = turned(at[0], self.dims[0], at[2] * self.dims[1] + j);
        ((at[2] * self.dims[1] + j) * self.dims[0] + i) as u32
    }

    pub(super) fn candidates(&self, p: Point<Patient>) -> &[u32] {
        let mut at = [0; 3];
        for (a, x) in p.to_array().into_iter().enumerate() {
            let c = ((x - self.origin[a]) * self.inverse_step).floor();
            // The far faces of the box belong to the last cells; NaN fails both comparisons.
            if !(c >= 0.0 && c <= self.dims[a] as f64) {
                return &[];
            }
            at[a] = (c as usize).min(self.dims[a] - 1);
        }
        let c = (at[2] * self.dims[1] + at[1]) * self.dims[0] + at[0];
        &self.list[self.first[c] as usize..self.first[c + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::block;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_weights_rebuild_the_point(p in proptest::array::uniform3(0.0..4.0f64), start in 0..384usize) {
            let mesh = block(4);
            let locator = TetLocator::new(&mesh).expect("valid");
            let p = Point::from_array(p);
            for found in [locator.locate(p), locator.locate_from(start, p)] {
                let found = found.expect("inside");
                let mut q = [0.0; 3];
                for (c, w) in mesh.corners(found.tet).into_iter().zip(found.weights) {
                    prop_assert!(w >= SLACK);
                    q = core::array::from_fn(|a| q[a] + w * c.to_array()[a]);
                }
                prop_assert!(p.distance(Point::from_array(q)) < 1e-12);
            }
        }

        #[test]
        fn outside_is_none_and_the_nearest_face_is_nearest(p in proptest::array::uniform3(-3.0..7.0f64)) {
            let locator = TetLocator::new(&block(4)).expect("valid");
            let clamped = Point::from_array(p.map(|x| x.clamp(0.0, 4.0)));
            let p = Point::from_array(p);
            prop_assume!(p.distance(clamped) > 1e-6);
            prop_assert!(locator.locate(p).is_none() && locator.locate_from(7, p).is_none());
            let near = locator.nearest_face(p).expect("not empty");
            prop_assert!((near.distance - p.distance(clamped)).abs() < 1e-12);
            let weights = locator.weights(near.tet, near.point);
            prop_assert!(weights[near.opposite].abs() < 1e-12, "{:?}", weights);
        }
    }

    #[test]
    fn a_broken_mesh_is_refused_and_a_bad_point_is_nowhere() {
        let mut mesh = block(1);
        mesh.tets[2].swap(0, 1);
        assert!(matches!(TetLocator::new(&mesh), Err(TetMeshError::Inverted { tet: 2, .. })));
        let locator = TetLocator::new(&block(2)).expect("valid");
        assert!(locator.locate(Point::new(f64::NAN, 0.0, 0.0)).is_none());
    }
}
