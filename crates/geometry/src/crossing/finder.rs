//! The search for triangles that cross: among all of a mesh, then among those alone that have moved.

use super::{Crossings, SHIFT, triangles_cross};
use crate::bvh::{Box3, of_triangle};
use crate::{Bvh, Patient, Point, TriangleMesh, Vector};
use core::ops::ControlFlow;

/// Pairs after which a search ends.
pub(super) const MOST: usize = 1_000_000;

/// Looks for triangles that cross in one mesh, again and again while some of its vertices move.
#[derive(Debug)]
pub struct CrossingFinder {
    all: Triangles,
}

impl CrossingFinder {
    /// Of a mesh as it is now. O(n log n), half of a search's time.
    ///
    /// # Panics
    /// When a triangle names a vertex that does not exist: see [`TriangleMesh::validate`].
    pub fn new(mesh: &TriangleMesh) -> Self {
        Self { all: Triangles::new((0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect()) }
    }

    /// All pairs that cross, as [`TriangleMesh::crossings`] has it.
    pub fn all(&self) -> Crossings {
        let number = |slot: usize| self.all.bvh.numbers()[slot];
        found(|pairs| self.all.crossing(&self.all, |[p, q]| push(pairs, [number(p), number(q)])))
    }

    /// All pairs that cross in `mesh` of which one triangle at least is among `moved` (in order, none twice); all others must be
    /// where they were when the finder was made.
    ///
    /// # Panics
    /// When the mesh has fewer triangles than that of the finder, or not the ones named.
    pub fn among(&self, mesh: &TriangleMesh, moved: &[u32]) -> Crossings {
        let here = Triangles::new(moved.iter().map(|&t| mesh.corners(t as usize)).collect());
        let mut stays = vec![true; self.all.bvh.numbers().len()];
        moved.iter().for_each(|&t| stays[t as usize] = false);
        let number = |slot: usize| moved[here.bvh.numbers()[slot] as usize];
        found(|pairs| {
            here.crossing(&here, |[p, q]| push(pairs, [number(p), number(q)]))?;
            here.crossing(&self.all, |[p, q]| match self.all.bvh.numbers()[q] {
                other if stays[other as usize] => push(pairs, [number(p), other]),
                _ => ControlFlow::Continue(()),
            })
        })
    }
}

/// The pairs of a search, in order.
fn found(search: impl FnOnce(&mut Vec<[u32; 2]>) -> ControlFlow<()>) -> Crossings {
    let mut pairs = Vec::new();
    let cut_short = search(&mut pairs).is_break();
    pairs.sort_unstable();
    Crossings { pairs, cut_short }
}

fn push(pairs: &mut Vec<[u32; 2]>, [s, t]: [u32; 2]) -> ControlFlow<()> {
    if pairs.len() == MOST {
        return ControlFlow::Break(());
    }
    pairs.push([s.min(t), s.max(t)]);
    ControlFlow::Continue(())
}

/// Triangles with what tells quickly that two do not cross, by slot of their hierarchy.
#[derive(Debug)]
struct Triangles {
    bvh: Bvh,
    boxes: Vec<Box3>,
    sides: Vec<Side>,
    /// Twice the depth that counts for no pair of these, mm.
    margin: f64,
}

impl Triangles {
    fn new(corners: Vec<[Point<Patient>; 3]>) -> Self {
        let bvh = Bvh::along_curve(&corners);
        let boxes: Vec<Box3> = bvh.slots().iter().map(of_triangle).collect();
        let extent = |[low, high]: &Box3| (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let far = |b: &Box3| b.as_flattened().iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        let most = |of: &dyn Fn(&Box3) -> f64| boxes.iter().map(of).fold(0.0, f64::max);
        let margin = 2.0 * (SHIFT * most(&extent) + 16.0 * f64::EPSILON * most(&far));
        let sides = bvh.slots().iter().map(Side::of).collect();
        Self { bvh, boxes, sides, margin }
    }

    /// Shows the slots of each pair of these and others that crosses.
    fn crossing(&self, other: &Self, mut visit: impl FnMut([usize; 2]) -> ControlFlow<()>) -> ControlFlow<()> {
        let margin = self.margin.max(other.margin);
        self.bvh.box_pairs(&other.bvh, [&self.boxes, &other.boxes], |[p, q]| {
            let (a, b) = (&self.bvh.slots()[p], &other.bvh.slots()[q]);
            let parted = self.sides[p].parts(b, margin) || other.sides[q].parts(a, margin);
            if !parted && triangles_cross(a, b) { visit([p, q]) } else { ControlFlow::Continue(()) }
        })
    }
}

/// The plane of a triangle, to part it from others at a glance: nine pairs of ten whose boxes meet are neighbours in a smooth
/// surface, of which one lies on one side of the other.
#[derive(Debug)]
struct Side {
    at: Point<Patient>,
    /// Twice the area long.
    normal: Vector<Patient>,
    /// Heights up to this, in lengths of the normal, are rounding of a shared corner; less than the depth that counts.
    touching: f64,
}

impl Side {
    fn of([a, b, c]: &[Point<Patient>; 3]) -> Self {
        let largest = |v: Vector<Patient>| v.to_array().iter().fold(0.0, |m: f64, c| m.max(c.abs()));
        let (e, f) = (*b - *a, *c - *a);
        let normal = e.cross(f);
        Self { at: *a, normal, touching: 0.5 * SHIFT * largest(e).max(largest(f)) * largest(normal) }
    }

    /// Whether a triangle lies on one side, and not in the plane: more than `margin` (mm) away with one corner at least. Then
    /// the full test finds them parted too.
    fn parts(&self, other: &[Point<Patient>; 3], margin: f64) -> bool {
        let [p, q, r] = other.map(|p| (p - self.at).dot(self.normal));
        let (low, high) = (p.min(q).min(r), p.max(q).max(r));
        let lying = margin * self.normal.to_array().iter().map(|c| c.abs()).sum::<f64>();
        low >= -self.touching && high > lying || high <= self.touching && low < -lying
    }
}
