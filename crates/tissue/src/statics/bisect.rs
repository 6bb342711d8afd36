//! Subdivision of a static problem: finer elements where a tool needs them, or everywhere.
//!
//! Local: longest-edge bisection (Rivara 1984) until every element is as small as a size field asks. An element is cut at
//! its longest edge only after all neighbours around that edge agree, so the mesh stays conforming and its angles do not
//! degenerate. Everywhere: each element into eight (Bey 1995), the octahedron inside along its shortest diagonal.
//!
//! Old vertices keep their numbers; new ones follow, each the midpoint of two earlier ones.

use super::edges::{self, Edges};
use monro_geometry::TET_EDGES;
use std::collections::BTreeMap;

/// Coordinates, mm.
pub(super) type P = [f64; 3];

/// A mesh under subdivision.
#[derive(Debug, Clone, Default)]
pub(super) struct Fine {
    pub(super) points: Vec<P>,
    pub(super) tets: Vec<[u32; 4]>,
    pub(super) labels: Vec<u16>,
    /// The element before any subdivision that each element is a part of.
    pub(super) part_of: Vec<u32>,
    /// The two vertices that each new vertex was put between, in order of creation.
    pub(super) parents: Vec<[u32; 2]>,
    /// Number of vertices before any subdivision.
    pub(super) first: usize,
}

/// Midpoint of each edge cut in one pass.
pub(super) type Cuts = BTreeMap<[u32; 2], u32>;

pub(super) fn key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Fine {
    pub(super) fn new(points: Vec<P>, tets: Vec<[u32; 4]>, labels: Vec<u16>) -> Self {
        let (first, part_of) = (points.len(), (0..tets.len() as u32).collect());
        Self { points, tets, labels, part_of, parents: Vec::new(), first }
    }

    pub(super) fn length2(&self, e: [u32; 2]) -> f64 {
        let (a, b) = (self.points[e[0] as usize], self.points[e[1] as usize]);
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum()
    }

    fn midpoint(&mut self, cuts: &mut Cuts, e: [u32; 2]) -> u32 {
        *cuts.entry(e).or_insert_with(|| {
            let (a, b) = (self.points[e[0] as usize], self.points[e[1] as usize]);
            self.points.push(core::array::from_fn(|k| 0.5 * (a[k] + b[k])));
            self.parents.push(e);
            self.points.len() as u32 - 1
        })
    }

    /// The longest of the edges that `keep` accepts; equal lengths go by vertex numbers, the same for every element.
    fn longest(&self, tet: [u32; 4], keep: impl Fn([u32; 2]) -> bool) -> Option<[u32; 2]> {
        self.longest_of(TET_EDGES.map(|[i, j]| key(tet[i], tet[j])).into_iter().filter(|&e| keep(e)))
    }

    pub(super) fn longest_of(&self, edges: impl Iterator<Item = [u32; 2]>) -> Option<[u32; 2]> {
        edges.map(|e| (self.length2(e), e)).max_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|l| l.1)
    }

    /// One pass of bisection where an element's longest edge exceeds the size wanted of it, mm. `None` when nothing is too
    /// long.
    pub(super) fn bisect(&mut self, size: &dyn Fn(&Self, usize) -> f64) -> Option<Cuts> {
        let edges = Edges::of(self);
        let too_long = |t: usize| {
            let wanted = size(self, t);
            self.length2(edges.ends[edges.longest[t] as usize]) > wanted * wanted
        };
        let mut marked = vec![false; edges.ends.len()];
        (0..self.tets.len()).filter(|&t| too_long(t)).for_each(|t| marked[edges.longest[t] as usize] = true);
        if !marked.contains(&true) {
            return None;
        }
        edges.close(&mut marked);
        let mut cuts = Cuts::new();
        for (&e, _) in edges.ends.iter().zip(&marked).filter(|(_, m)| **m) {
            self.midpoint(&mut cuts, e);
        }
        for ((tet, kept), around) in self.taken().into_iter().zip(&edges.around) {
            if edges::any(around, &marked) {
                self.cut(tet, kept, &cuts);
            } else {
                self.put(tet, kept);
            }
        }
        Some(cuts)
    }

    /// All elements, each with its label and what it is a part of, to be put back in pieces.
    fn taken(&mut self) -> Vec<([u32; 4], (u16, u32))> {
        let tets = core::mem::take(&mut self.tets);
        let kept = core::mem::take(&mut self.labels).into_iter().zip(core::mem::take(&mut self.part_of));
        tets.into_iter().zip(kept).collect()
    }

    pub(super) fn longest_edge(&self, t: usize) -> f64 {
        self.longest(self.tets[t], |_| true).map_or(0.0, |e| self.length2(e).sqrt())
    }

    pub(super) fn centroid(&self, t: usize) -> P {
        let corners = self.tets[t].map(|v| self.points[v as usize]);
        core::array::from_fn(|k| corners.iter().map(|p| p[k]).sum::<f64>() / 4.0)
    }

    /// Cuts an element along its cut edges, the longest first.
    fn cut(&mut self, tet: [u32; 4], kept: (u16, u32), cuts: &Cuts) {
        let Some(e) = self.longest(tet, |e| cuts.contains_key(&e)) else {
            self.put(tet, kept);
            return;
        };
        let middle = cuts[&e];
        for end in e {
            self.cut(tet.map(|v| if v == end { middle } else { v }), kept, cuts);
        }
    }

    fn put(&mut self, tet: [u32; 4], (label, whole): (u16, u32)) {
        self.tets.push(tet);
        self.labels.push(label);
        self.part_of.push(whole);
    }

    /// Every element into eight.
    pub(super) fn eight(&mut self) -> Cuts {
        let mut cuts = Cuts::new();
        for (t, (label, whole)) in self.taken() {
            let [ab, ac, ad, bc, bd, cd] = TET_EDGES.map(|[i, j]| self.midpoint(&mut cuts, key(t[i], t[j])));
            self.tets.extend([[t[0], ab, ac, ad], [ab, t[1], bc, bd], [ac, bc, t[2], cd], [ad, bd, cd, t[3]]]);
            // The octahedron around one of its three diagonals, with the four others in a ring.
            let rings = [([ab, cd], [ac, bc, bd, ad]), ([ac, bd], [ab, ad, cd, bc]), ([ad, bc], [ab, bd, cd, ac])];
            let shorter = |a: &([u32; 2], [u32; 4]), b: &([u32; 2], [u32; 4])| self.length2(b.0) < self.length2(a.0);
            let short = rings.into_iter().reduce(|a, b| if shorter(&a, &b) { b } else { a });
            if let Some(([p, q], ring)) = short {
                let around = (0..4).map(|k| [p, q, ring[k], ring[(k + 1) % 4]]).map(|t| self.turned(t));
                let inner: Vec<[u32; 4]> = around.collect();
                self.tets.extend(inner);
            }
            self.labels.extend([label; 8]);
            self.part_of.extend([whole; 8]);
        }
        cuts
    }

    /// The element with positive volume.
    fn turned(&self, [a, b, c, d]: [u32; 4]) -> [u32; 4] {
        if self.volume([a, b, c, d]) < 0.0 { [a, c, b, d] } else { [a, b, c, d] }
    }

    pub(super) fn volume(&self, tet: [u32; 4]) -> f64 {
        crate::physical::elastic::volume_gradient(tet.map(|v| self.points[v as usize])).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::membrane;
    use crate::model::tests::block;
    use monro_geometry::d3::{cross, norm, sub};

    fn fine() -> Fine {
        let mesh = block([2, 2, 2], 4.0);
        Fine::new(mesh.vertices.iter().map(|p| p.to_array()).collect(), mesh.tets, mesh.labels)
    }

    fn check(f: &Fine) {
        assert!(f.tets.iter().all(|&t| f.volume(t) > 0.0));
        let volume: f64 = f.tets.iter().map(|&t| f.volume(t)).sum();
        assert!((volume / 512.0 - 1.0).abs() < 1e-12, "{volume}");
        // Conforming: the outer surface is still the block's, so no face inside is open.
        let m = membrane::find(&f.tets, &vec![0; f.tets.len()]);
        let outside = |v: u32| f.points[v as usize].iter().any(|x| *x == 0.0 || *x == 8.0);
        assert!(m.faces.iter().all(|face| face.nodes.iter().all(|&v| outside(v))));
        let area: f64 = m.faces.iter().map(|face| half_cross(face.nodes.map(|v| f.points[v as usize]))).sum();
        assert!((area - 6.0 * 64.0).abs() < 1e-9, "{area}");
    }

    fn half_cross([a, b, c]: [P; 3]) -> f64 {
        0.5 * norm(cross(sub(b, a), sub(c, a)))
    }

    #[test]
    fn bisection_reaches_the_size_asked_for_and_stays_conforming() {
        let mut f = fine();
        let size = |p: P| 0.7 + 0.5 * p.iter().map(|v| (v - 3.0).powi(2)).sum::<f64>().sqrt();
        while f.bisect(&|f, t| size(f.centroid(t))).is_some() {
            check(&f);
        }
        for t in 0..f.tets.len() {
            let e = f.longest(f.tets[t], |_| true).expect("an edge");
            assert!(f.length2(e).sqrt() <= size(f.centroid(t)));
        }
        assert!(f.tets.len() > 300);
        let flat = |t: [u32; 4]| f.volume(t) / f.length2(f.longest(t, |_| true).expect("edge")).powf(1.5);
        let worst = f.tets.iter().map(|&t| flat(t)).fold(f64::INFINITY, f64::min);
        assert!(worst > 0.01, "thinnest element {worst}");
    }

    #[test]
    fn eight_for_one_is_conforming_and_keeps_the_old_vertices() {
        let mut f = fine();
        let before = f.clone();
        f.eight();
        check(&f);
        assert_eq!(f.tets.len(), 8 * before.tets.len());
        assert_eq!(f.points[..before.points.len()], before.points[..]);
    }
}
