//! Supports and loads in the model's numbering.

use super::refine::distance;
use super::{EmbeddedRod, StaticError, StaticProblem};
use crate::Model;
use crate::membrane::OUTSIDE;
use crate::physical::elastic::{Elastic, scatter};
use monro_geometry::d3::{D3, cross, norm, sub};
use std::collections::{BTreeMap, BTreeSet};

/// What is unsymmetric in a pressure's derivative is nothing below this share of the tissue's stiffness.
const SYMMETRIC: f64 = 1e-6;

pub(crate) struct Loads {
    /// Prescribed displacement of each component; `None` is free.
    pub(crate) support: Vec<[Option<f64>; 3]>,
    /// Dead force on each node, mN.
    dead: Vec<D3>,
    /// Triangles that a pressure (kPa) pushes along their normal.
    pushed: Vec<([u32; 3], f64)>,
    /// Nodes that each rod holds, and in which components: what a support holds of them stays with it.
    pub(super) rods: Vec<Vec<(u32, [bool; 3])>>,
    /// Nodes inside each rod that a support, or a rod before it, moves otherwise.
    pub(super) contested: Vec<usize>,
}

/// Numbers between -1/2 and 1/2, spread evenly, the same every time.
pub(super) fn spread(i: usize) -> f64 {
    (i as f64 * 0.618_033_988_749_895).fract() - 0.5
}

impl Loads {
    pub(crate) fn new(model: &Model, elastic: &Elastic, problem: &StaticProblem) -> Result<Self, StaticError> {
        let vertices = model.number.len();
        let number =
            |vertex: u32| model.number.get(vertex as usize).copied().ok_or(StaticError::Vertex { vertex, vertices });
        let mut support = vec![[None; 3]; vertices];
        for (i, p) in model.rest.iter().enumerate() {
            if p[3] == 0.0 {
                support[i] = [Some(0.0); 3];
            }
        }
        for s in &problem.supports {
            if s.displacement_mm.iter().flatten().any(|v| !v.is_finite()) {
                return Err(StaticError::NotFinite { what: "a prescribed displacement" });
            }
            let node = &mut support[number(s.node)? as usize];
            (0..3).for_each(|a| node[a] = s.displacement_mm[a].or(node[a]));
        }
        if problem.body_force_mn_mm3.iter().any(|v| !v.is_finite()) {
            return Err(StaticError::NotFinite { what: "the body force" });
        }
        let mut dead = vec![[0.0; 3]; vertices];
        for (tet, volume) in elastic.tets.iter().zip(&elastic.volume) {
            for &n in tet {
                (0..3).for_each(|a| dead[n as usize][a] += problem.body_force_mn_mm3[a] * volume / 4.0);
            }
        }
        let (mut rods, mut contested) = (Vec::new(), Vec::new());
        for (rod, r) in problem.rods.iter().enumerate() {
            let (held, others) = hold(model, (rod, r), &mut support)?;
            rods.push(held);
            contested.push(others);
        }
        let pushed = oriented(model, problem, number)?;
        Ok(Self { support, dead, pushed, rods, contested })
    }

    /// Adds minus a share of the loads to the gradient of the energy.
    pub(crate) fn add(&self, share: f64, x: &[D3], gradient: &mut [D3]) {
        for (g, f) in gradient.iter_mut().zip(&self.dead) {
            (0..3).for_each(|a| g[a] -= share * f[a]);
        }
        for (t, kpa) in &self.pushed {
            let third = area(t.map(|n| x[n as usize])).map(|v| share * kpa * v / 3.0);
            for &n in t {
                (0..3).for_each(|a| gradient[n as usize][a] -= third[a]);
            }
        }
    }

    /// Work of a share of the loads on the straight way of all nodes from `x` to `y`, mN mm. A pressure that follows an
    /// open surface has no potential in general: the volume it sweeps depends on where the surface is thought closed.
    pub(crate) fn work(&self, share: f64, x: &[D3], y: &[D3]) -> f64 {
        let mut work = 0.0;
        for ((f, x), y) in self.dead.iter().zip(x).zip(y) {
            work += (0..3).map(|a| f[a] * (y[a] - x[a])).sum::<f64>();
        }
        for (t, kpa) in &self.pushed {
            let (p, q) = (t.map(|n| x[n as usize]), t.map(|n| y[n as usize]));
            let middle: [D3; 3] = core::array::from_fn(|i| core::array::from_fn(|a| 0.5 * (p[i][a] + q[i][a])));
            // The area is quadratic along the way, so Simpson's rule is exact.
            let [first, between, last] = [area(p), area(middle), area(q)];
            for a in 0..3 {
                let way: f64 = (0..3).map(|i| q[i][a] - p[i][a]).sum();
                work += kpa * (first[a] + 4.0 * between[a] + last[a]) / 18.0 * way;
            }
        }
        share * work
    }

    /// Forces of all loads on the nodes at rest, mN.
    pub(super) fn at_rest(&self, rest: &[D3]) -> Vec<D3> {
        let mut gradient = vec![[0.0; 3]; rest.len()];
        self.add(1.0, rest, &mut gradient);
        gradient.iter().map(|g| g.map(|v| -v)).collect()
    }

    /// Whether the loads are the derivatives of something, up to what is nothing to the tissue: pressures are where the pressed
    /// surface is closed, or its border held or guided in a plane, since their own derivative is then symmetric. Looked at are rest
    /// and where the supports take it.
    pub(crate) fn have_potential(&self, elastic: &Elastic) -> bool {
        let moved = |(x, s): (&D3, &[Option<f64>; 3])| core::array::from_fn(|a| x[a] + s[a].unwrap_or(0.0));
        let there: Vec<D3> = elastic.rest.iter().zip(&self.support).map(moved).collect();
        self.pushed.is_empty() || [&elastic.rest, &there].into_iter().all(|x| self.is_symmetric(elastic, x))
    }

    /// Whether the derivative of the pressures is symmetric at `rest`, in the components that are free.
    fn is_symmetric(&self, elastic: &Elastic, rest: &[D3]) -> bool {
        let free = |i: usize, a: usize| if self.support[i][a].is_none() { spread(3 * i + a) } else { 0.0 };
        let d: Vec<D3> = (0..rest.len()).map(|i| core::array::from_fn(|a| free(i, a))).collect();
        let (mut whole, mut symmetric) = (vec![[0.0; 3]; rest.len()], vec![[0.0; 3]; rest.len()]);
        self.add_derivative(1.0, rest, &d, &mut whole);
        self.add_hessian(1.0, rest, &d, &mut symmetric);
        let components = || (0..rest.len()).flat_map(|i| (0..3).map(move |a| (i, a)));
        let own = components().filter(|&(i, a)| self.support[i][a].is_none());
        let (skew, all) = own.fold((0.0, 0.0), |(skew, all), (i, a)| {
            let tissue = elastic.near.diagonal(i) * d[i][a];
            (skew + (whole[i][a] - symmetric[i][a]).powi(2), all + tissue.powi(2))
        });
        skew <= (SYMMETRIC * SYMMETRIC) * all
    }

    /// Adds the product of the loads' derivative with `d`, all of it.
    pub(crate) fn add_derivative(&self, share: f64, x: &[D3], d: &[D3], out: &mut [D3]) {
        for (t, kpa) in &self.pushed {
            let ([a, b, c], [da, db, dc]) = (t.map(|n| x[n as usize]), t.map(|n| d[n as usize]));
            let (one, two) = (cross(sub(db, da), sub(c, a)), cross(sub(b, a), sub(dc, da)));
            for &n in t {
                (0..3).for_each(|k| out[n as usize][k] -= share * kpa * (one[k] + two[k]) / 6.0);
            }
        }
    }

    /// The same of its symmetric part alone, which is all of it where the loads [have a potential](Self::have_potential).
    pub(crate) fn add_hessian(&self, share: f64, x: &[D3], d: &[D3], out: &mut [D3]) {
        for push in self.pushes(share, x) {
            scatter(out, &push.nodes, &push.product(&push.nodes.map(|n| d[n as usize])), 1.0);
        }
    }

    /// All faces under a pressure, at a state.
    pub(super) fn pushes(&self, share: f64, x: &[D3]) -> impl Iterator<Item = Push> {
        self.pushed.iter().map(move |&(nodes, kpa)| Push::new(nodes, share * kpa, nodes.map(|n| x[n as usize])))
    }

    /// Sum of the sizes of all loads, mN.
    pub(super) fn sum(&self, x: &[D3]) -> f64 {
        let size = |f: D3| norm(f);
        let pushed = self.pushed.iter().map(|(t, kpa)| kpa.abs() * size(area(t.map(|n| x[n as usize]))));
        self.dead.iter().map(|f| size(*f)).sum::<f64>() + pushed.sum::<f64>()
    }

    /// Size of the loads, mN.
    pub(crate) fn size2(&self, x: &[D3]) -> f64 {
        let dead: f64 = self.dead.iter().flatten().map(|v| v * v).sum();
        let pushed = self
            .pushed
            .iter()
            .map(|(t, kpa)| area(t.map(|n| x[n as usize])).iter().map(|v| (kpa * v / 3.0).powi(2)).sum::<f64>() * 3.0);
        dead + pushed.sum::<f64>()
    }
}

/// A face under a pressure, at a state.
pub(super) struct Push {
    pub(super) nodes: [u32; 3],
    kpa: f64,
    /// The edge opposite each corner.
    opposite: [D3; 3],
}

impl Push {
    fn new(nodes: [u32; 3], kpa: f64, p: [D3; 3]) -> Self {
        Self { nodes, kpa, opposite: core::array::from_fn(|i| sub(p[(i + 1) % 3], p[(i + 2) % 3])) }
    }

    /// Symmetric part of the derivative, times `d`.
    pub(super) fn product(&self, d: &[D3; 3]) -> [D3; 3] {
        core::array::from_fn(|j| {
            let mut out = [0.0; 3];
            for i in (0..3).filter(|&i| i != j) {
                let change = cross(d[i], sub(self.opposite[i], self.opposite[j]));
                (0..3).for_each(|a| out[a] -= self.kpa * change[a] / 12.0);
            }
            out
        })
    }
}

/// Nodes that a rod holds, and in which components.
type HeldByRod = Vec<(u32, [bool; 3])>;

/// Prescribes the motion of the rod for all nodes inside it that nothing else holds; how many are moved otherwise.
fn hold(
    model: &Model,
    (rod, r): (usize, &EmbeddedRod),
    support: &mut [[Option<f64>; 3]],
) -> Result<(HeldByRod, usize), StaticError> {
    let ends = r.ends.map(|p| (p - model.origin).to_array());
    let reach = r.radius_mm * (1.0 + 1e-5);
    let inside = |p: &[f32; 4]| distance(ends, [p[0], p[1], p[2]].map(f64::from)) <= reach;
    let way = r.displacement_mm.to_array();
    let (mut held, mut all, mut contested) = (Vec::new(), 0, 0);
    for (i, _) in model.rest.iter().enumerate().filter(|(_, p)| inside(p)) {
        all += 1;
        contested += usize::from((0..3).any(|a| support[i][a].is_some_and(|moved| moved != way[a])));
        if support[i].iter().any(Option::is_none) {
            held.push((i as u32, support[i].map(|s| s.is_none())));
            support[i] = core::array::from_fn(|a| support[i][a].or(Some(way[a])));
        }
    }
    match (held.is_empty(), all) {
        (false, _) => Ok((held, contested)),
        (true, 0) => Err(StaticError::Rod { rod, radius_mm: r.radius_mm }),
        (true, vertices) => Err(StaticError::Taken { rod, vertices }),
    }
}

/// Faces of the pressures with normals that point into the tissue.
fn oriented(
    model: &Model,
    problem: &StaticProblem,
    number: impl Fn(u32) -> Result<u32, StaticError>,
) -> Result<Vec<([u32; 3], f64)>, StaticError> {
    let sorted = |mut t: [u32; 3]| {
        t.sort_unstable();
        t
    };
    let outer = model.membranes.faces.iter().filter(|m| m.outer == OUTSIDE);
    let surface: BTreeMap<[u32; 3], [u32; 3]> = outer.map(|m| (sorted(m.nodes), m.nodes)).collect();
    let mut pushed = Vec::new();
    for p in &problem.pressures {
        if !p.kpa.is_finite() {
            return Err(StaticError::NotFinite { what: "a pressure" });
        }
        let mut seen = BTreeSet::new();
        for face in &p.faces {
            if !seen.insert(sorted(*face)) {
                return Err(StaticError::Twice(*face));
            }
            let key = sorted([number(face[0])?, number(face[1])?, number(face[2])?]);
            let [a, b, c] = *surface.get(&key).ok_or(StaticError::Face(*face))?;
            pushed.push(([a, c, b], p.kpa));
        }
    }
    Ok(pushed)
}

pub(super) fn area([a, b, c]: [D3; 3]) -> D3 {
    cross(sub(b, a), sub(c, a)).map(|n| 0.5 * n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::{block, paper_options};
    use crate::{Mode, ModelOptions, PhysicalOptions, Pressure, Support};
    use monro_geometry::{Patient, Point, TetMesh};

    /// A block of 15 x 10 x 10 mm, pressed where `faces` says, with some nodes held in z.
    fn loads(
        faces: impl Fn(&TetMesh, Point<Patient>) -> bool,
        held: impl Fn(Point<Patient>) -> Option<f64>,
    ) -> (Loads, Elastic) {
        let mesh = block([3, 2, 2], 5.0);
        let options = ModelOptions {
            mode: Mode::Physical(PhysicalOptions::default()),
            attachments: Vec::new(),
            ..paper_options()
        };
        let model = Model::new(&mesh, &options).expect("model");
        let all = |f: &[u32; 3]| f.iter().all(|&v| faces(&mesh, mesh.vertices[v as usize]));
        let pressures = vec![Pressure { faces: mesh.boundary(|_| true).into_iter().filter(all).collect(), kpa: 0.2 }];
        let support = |(node, p): (u32, &Point<Patient>)| {
            Some(Support { node, set: 0, displacement_mm: [None, None, Some(held(*p)?)] })
        };
        let supports = (0..).zip(&mesh.vertices).filter_map(support).collect();
        let problem = StaticProblem { supports, pressures, ..StaticProblem::default() };
        let elastic = model.elastic().expect("physical mode");
        (Loads::new(&model, &elastic, &problem).expect("loads"), elastic)
    }

    #[test]
    fn pressures_have_a_potential_on_closed_surfaces_and_where_the_border_stays_in_its_plane() {
        let border = |p: Point<Patient>| p.z == 10.0 && (p.x % 15.0 == 0.0 || p.y % 10.0 == 0.0);
        let top = |_: &TetMesh, p: Point<Patient>| p.z == 10.0;
        let has = |(loads, elastic): (Loads, Elastic)| loads.have_potential(&elastic);
        assert!(has(loads(|_, _| true, |_| None)), "closed");
        assert!(!has(loads(top, |_| None)), "free");
        assert!(has(loads(top, |p| border(p).then_some(0.0))), "guided");
        assert!(!has(loads(top, |p| border(p).then_some(0.2 * p.x))), "guided into another plane");
    }

    #[test]
    fn the_whole_derivative_of_a_pressure_agrees_with_finite_differences() {
        let (loads, elastic) = loads(|_, p| p.z == 10.0 || p.x == 15.0, |_| None);
        let noise = |k: f64| move |i: usize| (i as f64 * k).sin();
        let field = |k: f64, s: f64| -> Vec<D3> {
            (0..elastic.rest.len()).map(|i| core::array::from_fn(|a| s * noise(k)(3 * i + a))).collect()
        };
        let moved = |x: &[D3], d: &[D3], s: f64| -> Vec<D3> {
            x.iter().zip(d).map(|(x, d)| core::array::from_fn(|a| x[a] + s * d[a])).collect()
        };
        let (x, d) = (moved(&elastic.rest, &field(1.7, 1.0), 1.0), field(2.3, 1.0));
        let gradient = |s: f64| {
            let mut g = vec![[0.0; 3]; x.len()];
            loads.add(0.7, &moved(&x, &d, s), &mut g);
            g
        };
        let mut product = vec![[0.0; 3]; x.len()];
        loads.add_derivative(0.7, &x, &d, &mut product);
        let (up, down) = (gradient(1e-4), gradient(-1e-4));
        for i in 0..x.len() {
            for a in 0..3 {
                let change = (up[i][a] - down[i][a]) / 2e-4;
                assert!((change - product[i][a]).abs() < 1e-7, "{change} for {}", product[i][a]);
            }
        }
    }
}
