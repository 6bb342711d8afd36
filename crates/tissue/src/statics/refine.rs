//! Carries a static problem over to a finer mesh, and its answer back.

use super::bisect::{Cuts, Fine, P, key};
use super::held::{self, Before};
use super::overlap::apart;
use super::{Coarse, EmbeddedRod, SphereContact, StaticProblem};
use crate::membrane;
use monro_geometry::d3::{axpy, norm, sub};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use std::collections::{BTreeMap, BTreeSet};

/// Elements at the surface of a rod over its radius.
const ROD_SIZE: f64 = 0.6;

/// Elements under a sphere over the radius of the contact that Hertz expects at this depth.
const CONTACT_SIZE: f64 = 0.2;

/// The given edges around a tool over the smallest that they are refined to: seven times halved.
const HALVED: f64 = 128.0;

/// Growth of the elements with the distance from a tool, mm per mm.
const GROWTH: f64 = 0.7;

/// What counts as half of an edge: bisections meet it sooner than the exact half.
const HALF: f64 = 0.6;

/// No mesh is refined beyond this.
const MOST_TETS: usize = 400_000;

/// Vertices as near to the surface of a rod as this share of their shortest edge are put on it.
const SNAP: f64 = 0.4;

/// A capsule around which elements must be small.
#[derive(Debug, Clone, Copy)]
struct Zone {
    ends: [P; 2],
    radius: f64,
    size: f64,
    /// Only the surface needs small elements, or all that is inside as well.
    surface: bool,
    /// The longest edge of the smallest given element around it, mm.
    given_mm: f64,
    /// What it is for: "rod" or "sphere", and which.
    tool: (&'static str, usize),
}

/// A problem on a mesh that has been refined for it.
#[derive(Debug, Clone)]
pub(super) struct Refined {
    pub(super) mesh: TetMesh,
    pub(super) problem: StaticProblem,
    /// Tools whose elements are not as small as they should be.
    pub(super) coarse: Vec<Coarse>,
    fine: Fine,
}

impl Refined {
    pub(super) fn new(mesh: &TetMesh, problem: &StaticProblem) -> Self {
        let points = mesh.vertices.iter().map(|p| p.to_array()).collect();
        let fine = Fine::new(points, mesh.tets.clone(), mesh.labels.clone());
        Self { mesh: mesh.clone(), problem: problem.clone(), coarse: Vec::new(), fine }
    }

    /// Makes the elements around tools small enough to tell their radius, as long as `keep_going` says so. Spheres meet the body
    /// where `moved` takes it (displacements of its vertices).
    pub(super) fn around_tools(
        mut self,
        moved: Option<&[Vector<Patient>]>,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Self {
        let mut zones = zones(&self.problem, &self.fine, moved);
        self.coarse = zones.iter_mut().filter_map(|z| z.limit(&self.fine)).collect();
        if zones.is_empty() {
            return self;
        }
        let size = |x: P| zones.iter().map(|z| z.size_at(x)).fold(f64::INFINITY, f64::min);
        while self.fine.tets.len() < MOST_TETS && keep_going() {
            let before = outer_faces(&self.fine);
            let old = (self.fine.tets.clone(), self.fine.labels.clone());
            let Some(cuts) = self.fine.bisect(&|fine, t| size(fine.centroid(t))) else { break };
            self.inherit(&cuts, &old, &before, false);
        }
        if self.fine.tets.len() >= MOST_TETS {
            let limited: Vec<_> = self.coarse.iter().map(|c| (c.what, c.index)).collect();
            let others = zones.iter().filter(|z| !limited.contains(&z.tool));
            self.coarse.extend(others.filter_map(|z| z.left(&self.fine)));
        }
        for rod in self.problem.rods.iter().filter(|_| keep_going()) {
            snap(&mut self.fine, rod);
        }
        self.finished()
    }

    /// Each element into eight.
    pub(super) fn halved(mut self) -> Self {
        let before = outer_faces(&self.fine);
        let old = (self.fine.tets.clone(), self.fine.labels.clone());
        let cuts = self.fine.eight();
        self.inherit(&cuts, &old, &before, true);
        self.finished()
    }

    /// The marked elements, and what must follow them, with edges about half as long.
    pub(super) fn halved_where(mut self, marked: &[bool]) -> Self {
        let tets = self.fine.tets.len();
        let longest: Vec<f64> = (0..tets).map(|t| self.fine.longest_edge(t)).collect();
        // While it goes on, elements are parts of those that are marked.
        let parts = core::mem::replace(&mut self.fine.part_of, (0..tets as u32).collect());
        loop {
            let before = outer_faces(&self.fine);
            let old = (self.fine.tets.clone(), self.fine.labels.clone());
            let wanted = |part: usize| if marked[part] { HALF * longest[part] } else { f64::INFINITY };
            let Some(cuts) = self.fine.bisect(&|fine, t| wanted(fine.part_of[t] as usize)) else { break };
            self.inherit(&cuts, &old, &before, false);
        }
        self.fine.part_of.iter_mut().for_each(|part| *part = parts[*part as usize]);
        self.finished()
    }

    fn finished(mut self) -> Self {
        let vertices = self.fine.points.iter().map(|&p| Point::from_array(p)).collect();
        self.mesh = TetMesh { vertices, tets: self.fine.tets.clone(), labels: self.fine.labels.clone() };
        self
    }

    /// Vertices that are held by themselves: no finer mesh can tell what is meant around them.
    pub(super) fn points(&self) -> Vec<(u32, [bool; 3])> {
        let Fine { points, tets, labels, .. } = &self.fine;
        held::points(&self.problem.supports, &Before { points, tets, labels, outer: &outer_faces(&self.fine) })
    }

    /// Supports and pressures of the new vertices.
    fn inherit(&mut self, cuts: &Cuts, (tets, labels): &(Vec<[u32; 4]>, Vec<u16>), outer: &[[u32; 3]], eight: bool) {
        // The points of the old mesh are the first of the new one.
        let before = Before { points: &self.fine.points, tets, labels, outer };
        let new = held::inherited(&self.problem.supports, &before, cuts);
        self.problem.supports.extend(new);
        for p in &mut self.problem.pressures {
            let old = core::mem::take(&mut p.faces);
            old.into_iter().for_each(|f| self.fine.cut_face(f, cuts, eight, &mut p.faces));
        }
    }

    /// Prolongs displacements of the vertices before the last refinement to all.
    pub(super) fn prolonged(&self, coarse: &[Vector<Patient>]) -> Vec<Vector<Patient>> {
        let mut out = coarse.to_vec();
        for &[a, b] in &self.fine.parents[coarse.len() - self.fine.first..] {
            out.push((out[a as usize] + out[b as usize]) * 0.5);
        }
        out
    }

    /// Forces on the vertices of the given mesh: those of a new vertex go to the two it lies between.
    pub(super) fn gathered(&self, mut force: Vec<Vector<Patient>>) -> Vec<Vector<Patient>> {
        for (i, &[a, b]) in self.fine.parents.iter().enumerate().rev() {
            let half = force[self.fine.first + i] * 0.5;
            force[a as usize] += half;
            force[b as usize] += half;
        }
        force.truncate(self.fine.first);
        force
    }

    /// The element of the given mesh that an element is a part of.
    pub(super) fn part_of(&self, tet: usize) -> usize {
        self.fine.part_of[tet] as usize
    }

    /// Vertices of the mesh as given.
    pub(super) const fn given(&self) -> usize {
        self.fine.first
    }
}

fn outer_faces(fine: &Fine) -> Vec<[u32; 3]> {
    // A mesh with crowded faces is refused when its model is made.
    let found = membrane::find(&fine.tets, &vec![0; fine.tets.len()]);
    found.faces.iter().map(|m| m.nodes).collect()
}

impl Fine {
    /// A face of the old mesh in the new one.
    fn cut_face(&self, face: [u32; 3], cuts: &Cuts, eight: bool, out: &mut Vec<[u32; 3]>) {
        let [a, b, c] = face;
        let middle = |a: u32, b: u32| cuts.get(&key(a, b)).copied();
        if let (true, Some(ab), Some(bc), Some(ca)) = (eight, middle(a, b), middle(b, c), middle(c, a)) {
            out.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            return;
        }
        let edges = [key(a, b), key(b, c), key(c, a)].into_iter().filter(|e| cuts.contains_key(e));
        let Some(e) = self.longest_of(edges) else {
            out.push(face);
            return;
        };
        for end in e {
            self.cut_face(face.map(|v| if v == end { cuts[&e] } else { v }), cuts, eight, out);
        }
    }
}

impl Zone {
    /// Keeps the size within reach of the elements that are there; what it should be if it cannot.
    fn limit(&mut self, fine: &Fine) -> Option<Coarse> {
        let around = (0..fine.tets.len()).filter_map(|t| self.edge_around(fine, t));
        self.given_mm = around.min_by(f64::total_cmp)?;
        let (wanted_mm, least_mm) = (self.size, self.given_mm / HALVED);
        self.size = self.size.max(least_mm);
        let (what, index) = self.tool;
        (wanted_mm < least_mm).then_some(Coarse { what, index, wanted_mm, least_mm, given_mm: self.given_mm })
    }

    /// What it should be, if an element around is still larger.
    fn left(&self, fine: &Fine) -> Option<Coarse> {
        let too_long = |t: usize| self.edge_around(fine, t).filter(|edge| *edge > self.size_at(fine.centroid(t)));
        let least_mm = (0..fine.tets.len()).filter_map(too_long).max_by(f64::total_cmp)?;
        let (what, index) = self.tool;
        Some(Coarse { what, index, wanted_mm: self.size, least_mm, given_mm: self.given_mm })
    }

    /// The longest edge of an element that the tool may lie in or touch.
    fn edge_around(&self, fine: &Fine, t: usize) -> Option<f64> {
        let edge = fine.longest_edge(t);
        (distance(self.ends, fine.centroid(t)) <= self.radius + edge).then_some(edge)
    }

    fn size_at(&self, x: P) -> f64 {
        let apart = distance(self.ends, x) - self.radius;
        self.size + GROWTH * if self.surface { apart.abs() } else { apart.max(0.0) }
    }
}

fn zones(problem: &StaticProblem, fine: &Fine, moved: Option<&[Vector<Patient>]>) -> Vec<Zone> {
    let rods = problem.rods.iter().enumerate().map(|(i, r)| Zone {
        ends: r.ends.map(Point::to_array),
        radius: r.radius_mm,
        size: ROD_SIZE * r.radius_mm,
        surface: true,
        given_mm: 0.0,
        tool: ("rod", i),
    });
    let outer = outer_faces(fine);
    let there: Vec<P> = match moved {
        Some(moved) => fine.points.iter().zip(moved).map(|(&p, d)| axpy(p, 1.0, d.to_array())).collect(),
        None => fine.points.clone(),
    };
    let contacts = problem.contacts.iter().enumerate().filter_map(|(i, c)| {
        let Met { depth, way } = met(c, (fine, &outer), &there)?;
        let size = (CONTACT_SIZE * (c.radius_mm * depth).sqrt()).clamp(c.radius_mm / 40.0, c.radius_mm / 5.0);
        Some(Zone { ends: way, radius: c.radius_mm, size, surface: false, given_mm: 0.0, tool: ("sphere", i) })
    });
    rods.chain(contacts).collect()
}

/// How a sphere meets the tissue.
struct Met {
    /// How deep it ends up in the tissue where that would be without it, mm.
    depth: f64,
    /// Its way, as the tissue that it meets sees it from where that is at rest.
    way: [P; 2],
}

/// `None` when the sphere stays outside of the body, whose points are `there` when it comes.
fn met(c: &SphereContact, (fine, outer): (&Fine, &[[u32; 3]]), there: &[P]) -> Option<Met> {
    let centre = c.to.to_array();
    let far = |f: &[u32; 3]| apart(centre, f.map(|v| there[v as usize]));
    let (near, face) = outer.iter().map(|f| (far(f), f)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let inside = holder(there, &fine.tets, centre).is_some();
    if !inside && near >= c.radius_mm {
        return None;
    }
    let depth = if inside { c.radius_mm + near } else { c.radius_mm - near };
    let carried = |v: u32| sub(there[v as usize], fine.points[v as usize]);
    let end = face.iter().fold(centre, |end, &v| axpy(end, -1.0 / 3.0, carried(v)));
    Some(Met { depth, way: [c.from.to_array(), end] })
}

/// The first element that `x` lies in, if one does; a vertex that does not exist is in none.
pub(super) fn holder(points: &[P], tets: &[[u32; 4]], x: P) -> Option<usize> {
    let inside = |t: &[u32; 4]| {
        let corners = t.map(|v| points.get(v as usize).copied().unwrap_or([f64::NAN; 3]));
        let part = |i: usize| {
            let mut c = corners;
            c[i] = x;
            crate::physical::elastic::volume_gradient(c).0
        };
        (0..4).all(|i| part(i) >= 0.0)
    };
    tets.iter().position(inside)
}

/// Distance of `x` from the segment.
pub(super) fn distance(ends: [P; 2], x: P) -> f64 {
    norm(sub(x, foot(ends, x)))
}

/// The point of the segment that is nearest to `x`.
fn foot(ends: [P; 2], x: P) -> P {
    let [a, b] = ends.map(Point::<Patient>::from_array);
    Point::from_array(x).nearest_on_segment(a, b).to_array()
}

/// Puts new inner vertices near the surface of the rod on it, so that the vertices inside fill its true radius.
fn snap(fine: &mut Fine, rod: &EmbeddedRod) {
    let ends = rod.ends.map(Point::to_array);
    let outer: BTreeSet<u32> = outer_faces(fine).into_iter().flatten().collect();
    let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (t, tet) in fine.tets.iter().enumerate() {
        tet.iter().for_each(|&v| around.entry(v).or_default().push(t as u32));
    }
    for v in fine.first as u32..fine.points.len() as u32 {
        let x = fine.points[v as usize];
        let off = distance(ends, x) - rod.radius_mm;
        if outer.contains(&v) || off == 0.0 || off.abs() > 0.5 * rod.radius_mm {
            continue;
        }
        let near = &around[&v];
        let edges = near.iter().flat_map(|&t| fine.tets[t as usize]).filter(|&w| w != v);
        let short = edges.map(|w| distance([fine.points[w as usize]; 2], x)).fold(f64::INFINITY, f64::min);
        if off.abs() > SNAP * short {
            continue;
        }
        let before: Vec<f64> = near.iter().map(|&t| fine.volume(fine.tets[t as usize])).collect();
        fine.points[v as usize] = on_surface(ends, rod.radius_mm, x);
        let thin = |(&t, v): (&u32, &f64)| fine.volume(fine.tets[t as usize]) < 0.3 * v;
        if near.iter().zip(&before).any(thin) {
            fine.points[v as usize] = x;
        }
    }
}

/// The point of a capsule's surface on the way from its axis through `x`.
fn on_surface(ends: [P; 2], radius: f64, x: P) -> P {
    let foot = foot(ends, x);
    let (way, far) = (sub(x, foot), distance(ends, x));
    if far == 0.0 { x } else { axpy(foot, radius / far, way) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn a_sphere_whose_centre_sinks_in_is_deeper_than_its_radius() {
        let mesh = block([2, 2, 2], 10.0);
        let fine = Refined::new(&mesh, &StaticProblem::default()).fine;
        let at = |z: f64| {
            let (from, to) = (Point::new(10.0, 9.0, 40.0), Point::new(10.0, 9.0, z));
            let sphere = SphereContact { radius_mm: 5.0, friction: 0.0, from, to };
            met(&sphere, (&fine, &outer_faces(&fine)), &fine.points).map(|m| m.depth)
        };
        for (z, expected) in [(26.0, None), (22.0, Some(3.0)), (17.0, Some(8.0))] {
            match (at(z), expected) {
                (Some(d), Some(e)) => assert!((d - e).abs() < 1e-5, "{d} instead of {e}"),
                (got, expected) => assert_eq!(got, expected),
            }
        }
    }
}
