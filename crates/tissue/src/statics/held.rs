//! Which new vertices of a finer mesh are held, component by component.
//!
//! A new vertex lies in the middle of an edge. It is held where one set holds the edge (`patches` tells which edges these
//! are), at the mean of what its ends are held at. Where two sets adjoin, an outer face between them is held by both
//! together if it continues a face that one of them holds alone, without a bend: otherwise the side of a body would be
//! held between its held ends.

use super::Support;
use super::bisect::{Cuts, P};
use super::loads::area;
use super::patches::{Held, all, edges, held_edges};
use monro_geometry::d3::dot;
use std::collections::{BTreeMap, BTreeSet};

/// Cosine of the largest angle between two neighbouring faces of one patch of the surface (45 degrees).
const SMOOTH: f64 = 0.707;

/// A mesh before its edges are cut.
pub(super) struct Before<'a> {
    pub(super) points: &'a [P],
    pub(super) tets: &'a [[u32; 4]],
    /// Region of each element.
    pub(super) labels: &'a [u16],
    /// Its outer faces.
    pub(super) outer: &'a [[u32; 3]],
}

/// Supports of the new vertices, in the order of the sets.
pub(super) fn inherited(supports: &[Support], before: &Before<'_>, cuts: &Cuts) -> Vec<Support> {
    let mut new = BTreeMap::<(u32, u32), [Option<f64>; 3]>::new();
    for axis in 0..3 {
        for (e, set, value) in before.held_edges(&before.sets(supports, axis)) {
            if let Some(&node) = cuts.get(&e) {
                new.entry((set, node)).or_default()[axis] = Some(value);
            }
        }
    }
    let support = |((set, node), displacement_mm)| Support { node, set, displacement_mm };
    new.into_iter().map(support).collect()
}

/// Vertices that are held by themselves in some component, with no held edge around them, and these components.
pub(super) fn points(supports: &[Support], before: &Before<'_>) -> Vec<(u32, [bool; 3])> {
    let mut out = BTreeMap::<u32, [bool; 3]>::new();
    for axis in 0..3 {
        let held = before.held_edges(&before.sets(supports, axis));
        let joined: BTreeSet<u32> = held.into_iter().flat_map(|(e, _, _)| e).collect();
        let alone = supports.iter().filter(|s| s.displacement_mm[axis].is_some() && !joined.contains(&s.node));
        alone.for_each(|s| out.entry(s.node).or_default()[axis] = true);
    }
    out.into_iter().collect()
}

fn middle(held: &Held, [a, b]: [u32; 2]) -> Option<f64> {
    Some(0.5 * (held[a as usize]? + held[b as usize]?))
}

impl Before<'_> {
    /// What each set holds in a component.
    fn sets(&self, supports: &[Support], axis: usize) -> BTreeMap<u32, Held> {
        let mut sets = BTreeMap::<u32, Held>::new();
        for s in supports.iter().filter(|s| s.displacement_mm[axis].is_some()) {
            let held = sets.entry(s.set).or_insert_with(|| vec![None; self.points.len()]);
            held[s.node as usize] = s.displacement_mm[axis];
        }
        sets
    }

    /// Edges held in a component, the set that holds each, and the displacement of its middle, mm.
    fn held_edges(&self, sets: &BTreeMap<u32, Held>) -> Vec<([u32; 2], u32, f64)> {
        let mut out = Vec::new();
        let mut own = BTreeSet::new();
        for (&set, held) in sets {
            let of_set = held_edges(self.tets, self.labels, held);
            out.extend(of_set.iter().filter_map(|&e| Some((e, set, middle(held, e)?))));
            own.extend(of_set);
        }
        // As where sets overlap, the later one counts.
        let mut last: Vec<Option<(u32, f64)>> = vec![None; self.points.len()];
        for (&set, held) in sets {
            last.iter_mut().zip(held).for_each(|(l, h)| *l = h.map(|v| (set, v)).or(*l));
        }
        for [a, b] in self.seams(sets, &last).into_iter().filter(|e| !own.contains(e)) {
            if let (Some((s, u)), Some((t, v))) = (last[a as usize], last[b as usize]) {
                out.push(([a, b], s.max(t), 0.5 * (u + v)));
            }
        }
        out
    }

    /// Edges of the outer faces that only several sets together hold, and that continue a face of one set smoothly.
    fn seams(&self, sets: &BTreeMap<u32, Held>, last: &[Option<(u32, f64)>]) -> BTreeSet<[u32; 2]> {
        let held: Vec<[u32; 3]> =
            self.outer.iter().filter(|f| f.iter().all(|&v| last[v as usize].is_some())).copied().collect();
        let owned: Vec<bool> = held.iter().map(|f| sets.values().any(|h| all(h, &f[..]))).collect();
        let mut out = BTreeSet::new();
        if owned.iter().all(|&o| o) {
            return out;
        }
        let mut around = BTreeMap::<[u32; 2], Vec<usize>>::new();
        for (i, f) in held.iter().enumerate() {
            edges(f).for_each(|e| around.entry(e).or_default().push(i));
        }
        let mut reached = owned.clone();
        let mut open: Vec<usize> = (0..held.len()).filter(|&i| owned[i]).collect();
        while let Some(i) = open.pop() {
            for &j in edges(&held[i]).flat_map(|e| &around[&e]) {
                if !reached[j] && self.smooth(held[i], held[j]) {
                    reached[j] = true;
                    open.push(j);
                    out.extend(edges(&held[j]));
                }
            }
        }
        out
    }

    fn smooth(&self, f: [u32; 3], g: [u32; 3]) -> bool {
        let [a, b] = [f, g].map(|f| area(f.map(|v| self.points[v as usize])));
        dot(a, b) > SMOOTH * (dot(a, a) * dot(b, b)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use crate::model::tests::block;
    use crate::statics::refine::Refined;
    use crate::statics::{StaticProblem, Support};
    use monro_geometry::{Patient, Point};

    type Way = [Option<f64>; 3];

    /// A block of 20 mm cut into eight for one, held as `hold` says of each vertex; what its new vertices are held at.
    fn held(cells: usize, hold: impl Fn(Point<Patient>) -> Option<(u32, Way)>) -> Vec<(Point<Patient>, Way)> {
        let mesh = block([cells; 3], 20.0 / cells as f64);
        let one = |(n, &p): (usize, &Point<Patient>)| {
            hold(p).map(|(set, displacement_mm)| Support { node: n as u32, set, displacement_mm })
        };
        let supports = mesh.vertices.iter().enumerate().filter_map(one).collect();
        let fine = Refined::new(&mesh, &StaticProblem { supports, ..StaticProblem::default() }).halved();
        let mut way = vec![[None; 3]; fine.mesh.vertices.len()];
        for s in &fine.problem.supports {
            let node: &mut Way = &mut way[s.node as usize];
            (0..3).for_each(|a| node[a] = s.displacement_mm[a].or(node[a]));
        }
        fine.mesh.vertices.iter().copied().zip(way).skip(mesh.vertices.len()).collect()
    }

    #[test]
    fn the_seam_between_two_sets_of_one_side_is_held_in_what_both_hold() {
        // The bottom in two sets that share no vertex: one moves 1 mm along x and is free along y.
        let found = held(3, |p| {
            let (left, right) = ((0, [Some(0.0), Some(0.0), Some(0.0)]), (1, [Some(1.0), None, Some(0.0)]));
            (p.z == 0.0).then_some(if p.x < 10.0 { left } else { right })
        });
        for (p, way) in found {
            let across = p.x > 7.0 && p.x < 13.0;
            let expected = match (p.z == 0.0, across, p.x < 10.0) {
                (false, _, _) => [None; 3],
                (true, true, _) => [Some(0.5), None, Some(0.0)],
                (true, false, true) => [Some(0.0); 3],
                (true, false, false) => [Some(1.0), None, Some(0.0)],
            };
            assert_eq!(way, expected, "at {p:?}");
        }
    }

    #[test]
    fn a_body_of_one_element_between_two_held_ends_is_free_between_them() {
        let found = held(1, |p| Some(if p.z == 0.0 { (0, [Some(0.0); 3]) } else { (1, [Some(2.0); 3]) }));
        for (p, way) in found {
            assert_eq!(way.map(|w| w.is_some()), [p.z != 10.0; 3], "at {p:?}");
        }
    }

    #[test]
    fn sets_that_meet_at_an_edge_hold_both_their_sides_up_to_it() {
        // The vertices of the common edge belong to the first set only.
        let found = held(2, |p| match (p.z == 0.0, p.x == 0.0) {
            (true, _) => Some((0, [Some(0.0); 3])),
            (false, true) => Some((1, [Some(0.0); 3])),
            _ => None,
        });
        for (p, way) in found {
            assert_eq!(way.map(|w| w.is_some()), [p.z == 0.0 || p.x == 0.0; 3], "at {p:?}");
        }
    }

    fn named(hold: impl Fn(Point<Patient>) -> bool) -> impl Fn(Point<Patient>) -> Option<(u32, Way)> {
        move |p| hold(p).then_some((0, [Some(1.0); 3]))
    }

    #[test]
    fn a_held_sheet_inside_is_not_perforated_by_a_finer_mesh() {
        for (p, way) in held(4, named(|p| p.x == 10.0)) {
            assert_eq!(way, if p.x == 10.0 { [Some(1.0); 3] } else { [None; 3] }, "at {p:?}");
        }
    }

    #[test]
    fn a_held_line_is_not_perforated_by_a_finer_mesh() {
        // On the outside, and through the middle of the body.
        for y in [0.0, 10.0] {
            let line = |p: Point<Patient>| p.x == 10.0 && p.y == y;
            for (p, way) in held(4, named(line)) {
                assert_eq!(way, if line(p) { [Some(1.0); 3] } else { [None; 3] }, "at {p:?}");
            }
        }
    }

    /// What the bottom bears was taken for load on the points that only keep the body from sliding.
    #[test]
    fn points_on_a_held_face_are_points_only_along_it() {
        let mesh = block([2; 3], 10.0);
        let bottom = |(n, p): (usize, &Point<Patient>)| {
            (p.z == 0.0).then_some(Support { node: n as u32, set: 0, displacement_mm: [None, None, Some(0.0)] })
        };
        let mut supports: Vec<Support> = mesh.vertices.iter().enumerate().filter_map(bottom).collect();
        supports.push(Support { node: 0, set: 1, displacement_mm: [Some(0.0), Some(0.0), None] });
        supports.push(Support { node: 2, set: 2, displacement_mm: [None, Some(0.0), None] });
        let refined = Refined::new(&mesh, &StaticProblem { supports, ..StaticProblem::default() });
        assert_eq!(refined.points(), [(0, [true, true, false]), (2, [false, true, false])]);
    }
}
