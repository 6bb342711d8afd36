//! A factored matrix in place of many products: near-incompressible and slender bodies need thousands of conjugate gradients
//! with diagonal blocks, and some ten with the factors of a state near by.
//!
//! Whether it is worth its work is told by what was spent so far: once the products would have paid for the factors, these are
//! made (never more than twice the work of the better way), and made again where a later state needs as many products.

mod factor;
mod stiffness;
mod tree;

use super::loads::Loads;
use super::newton::Point;
use super::sphere::Spheres;
use crate::physical::elastic::Elastic;
use factor::{Factors, HELD, Piece, Plan};
use monro_geometry::d3::D3;
use std::sync::Arc;
use tree::Tree;

/// Products of a system before anything is planned.
const FIRST: u32 = 100;
/// Products that a system needs with factors near by.
const USUAL: f64 = 15.0;
/// Numbers that may be kept: 1 GB.
const MOST: f64 = 1.25e8;
/// Multiplications of a factorisation in the time of a product's work on one element,
const WORK: f64 = 350.0;
/// and numbers of the factors that are read in it.
const READ: f64 = 25.0;

/// Factors near a state, and how they were worth it so far.
#[derive(Default)]
pub(super) struct Direct {
    plan: Option<Arc<Plan>>,
    factored: Option<Arc<Factored>>,
    /// What a factorisation costs, and what a product with its factors does, in products.
    price: f64,
    each: f64,
    /// What products have cost beyond what they would have with new factors.
    spent: f64,
}

/// Factors of the matrix at a state.
pub(super) struct Factored {
    plan: Arc<Plan>,
    factors: Factors,
}

/// What a system is made of.
pub(super) struct System<'a> {
    pub(super) elastic: &'a Elastic,
    pub(super) loads: &'a Loads,
    pub(super) spheres: &'a Spheres,
    pub(super) share: f64,
}

impl Direct {
    /// The factors there are.
    pub(super) fn factored(&self) -> Option<Arc<Factored>> {
        self.factored.clone()
    }

    /// How many products a system may take before it is looked at again.
    pub(super) fn patience(&self) -> u32 {
        let left = (self.price - self.spent).max(0.0) + USUAL * self.each;
        match (&self.plan, &self.factored) {
            (None, _) => FIRST,
            (_, None) => left.min(f64::from(u32::MAX)) as u32,
            (_, Some(_)) => (left / self.each).min(f64::from(u32::MAX)) as u32,
        }
    }

    /// Takes how many products a system has taken.
    pub(super) fn spend(&mut self, products: u32) {
        let each = if self.factored.is_some() { self.each } else { 1.0 };
        self.spent += (f64::from(products) * each - USUAL * self.each).max(0.0);
    }

    /// Where a system has taken more products than it may: plans, or factors it at a state. Where it is not stable the factors of a
    /// state before stay, and another try costs more. Whether these are all that can be done for it.
    pub(super) fn renew(&mut self, system: &System<'_>, at: &Point, goes_on: &mut dyn FnMut() -> bool) -> bool {
        let Some(plan) = &self.plan else {
            self.plan(system);
            return false;
        };
        match system.factor(plan, at, goes_on) {
            Some(found) => self.factored = Some(Arc::new(found)),
            None => self.price *= 2.0,
        }
        self.spent = 0.0;
        true
    }

    fn plan(&mut self, system: &System<'_>) {
        let (plan, tets) = (system.plan(), system.elastic.tets.len() as f64);
        self.price = if plan.entries > MOST { f64::INFINITY } else { plan.work() / (WORK * tets) };
        self.each = 1.0 + plan.entries / (READ * tets);
        self.plan = Some(Arc::new(plan));
    }
}

impl Factored {
    /// The solution for a right side; nothing where a component is held.
    pub(super) fn apply(&self, right: &[D3], out: &mut Vec<D3>) {
        let mut x = vec![0.0; self.plan.unknowns];
        let slots = |n: usize| self.plan.slots[n][..3].iter().zip(0..3).filter(|(s, _)| **s != HELD);
        for (n, r) in right.iter().enumerate() {
            slots(n).for_each(|(&s, a)| x[s as usize] = r[a]);
        }
        self.factors.solve(&mut x);
        out.clear();
        out.resize(right.len(), [0.0; 3]);
        for (n, o) in out.iter_mut().enumerate() {
            slots(n).for_each(|(&s, a)| o[a] = x[s as usize]);
        }
    }
}

impl System<'_> {
    fn plan(&self) -> Plan {
        let (at, elements) = stiffness::points(self.elastic);
        let slots = stiffness::slots(self.elastic, |n, a| self.loads.support[n][a].is_none());
        Plan::new(Tree::new(&at, &elements), slots)
    }

    /// The factors at a state, if it is stable: as many pivots are negative as there are pressures.
    fn factor(&self, plan: &Arc<Plan>, at: &Point, goes_on: &mut dyn FnMut() -> bool) -> Option<Factored> {
        let element = |t: u32| stiffness::element(self.elastic, (&at.x, &at.tangent), t as usize, &plan.slots);
        let factors = plan.factor((&element, &self.more(plan, at)), goes_on)?;
        let stable = factors.negative == self.elastic.patch_volume.len();
        stable.then(|| Factored { plan: Arc::clone(plan), factors })
    }

    /// What patches, films, pressures and spheres add to each part.
    fn more(&self, plan: &Plan, at: &Point) -> Vec<Vec<Piece>> {
        let of = |part: &tree::Part| {
            part.own.iter().map(|&p| stiffness::patch(self.elastic, p as usize, &plan.slots)).collect()
        };
        let mut out: Vec<Vec<Piece>> = plan.tree.parts.iter().map(of).collect();
        let mut add = |nodes: [u32; 3], product: &dyn Fn(&[D3; 3]) -> [D3; 3]| {
            let part = nodes.iter().map(|&n| plan.tree.part_of[n as usize]).min().unwrap_or_default();
            out[part].push(stiffness::face(nodes, &plan.slots, product));
        };
        for film in &self.elastic.films {
            let x = film.nodes.map(|n| at.x[n as usize]);
            add(film.nodes, &|d| film.product(&x, d));
        }
        for push in self.loads.pushes(self.share, &at.x) {
            add(push.nodes, &|d| push.product(d));
        }
        for press in self.spheres.presses(&at.x) {
            add(press.nodes(), &|d| press.product(d));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::super::newton::inner;
    use super::*;
    use crate::model::tests::{block, paper_options};
    use crate::physical::elastic::Tangent;
    use crate::physical::products::Products;
    use crate::{Material, Mode, Model, ModelOptions, PhysicalOptions, Pressure, StaticProblem, Support, ThinMembrane};

    fn inverse(most_shear: f64) -> (f64, bool) {
        // Two regions with a wall between them and thin films, one side held, one guided, all of it under a pressure.
        let mut mesh = block([5, 4, 6], 3.0);
        let middles: Vec<f64> =
            mesh.tets.iter().map(|t| t.map(|v| mesh.vertices[v as usize].x).iter().sum::<f64>()).collect();
        mesh.labels.iter_mut().zip(middles).filter(|(_, x)| *x > 28.0).for_each(|(l, _)| *l = 5);
        let mode = Mode::Physical(PhysicalOptions { nodal_shear: 0.0 });
        let mut options = ModelOptions { mode, attachments: Vec::new(), ..paper_options() };
        let membrane = Some(ThinMembrane { young_kpa: 40.0, poisson: 0.4, thickness_mm: 0.3 });
        options.materials.insert(4, Material { membrane, ..Material::BRAIN });
        let model = Model::new(&mesh, &options).expect("model");
        let elastic = model.elastic().expect("physical mode");
        let support = |(node, z): (u32, f64)| match z {
            0.0 => Some(Support { node, set: 0, displacement_mm: [Some(0.0); 3] }),
            18.0 => Some(Support { node, set: 1, displacement_mm: [None, Some(0.0), None] }),
            _ => None,
        };
        let supports = (0..).zip(mesh.vertices.iter().map(|p| p.z)).filter_map(support).collect();
        let pressures = vec![Pressure { faces: mesh.boundary(|_| true).into_iter().collect(), kpa: 0.3 }];
        let problem = StaticProblem { supports, pressures, ..StaticProblem::default() };
        let loads = Loads::new(&model, &elastic, &problem).expect("loads");
        let spheres = Spheres::default();
        let some = |i: usize, a: usize| ((3 * i + a) as f64 * 1.7).sin();
        let x: Vec<D3> =
            (0..).zip(&elastic.rest).map(|(i, r)| core::array::from_fn(|a| r[a] + most_shear * some(i, a))).collect();
        let (mut gradient, mut tangent) = (Vec::new(), Tangent::default());
        let energy = elastic.gradient(&x, &mut gradient, &mut tangent);
        let at = Point { x, energy, gradient, tangent };
        let system = System { elastic: &elastic, loads: &loads, spheres: &spheres, share: 0.7 };
        let plan = Arc::new(system.plan());
        assert!(system.factor(&plan, &at, &mut || false).is_none(), "it is not to go on");
        let Some(factored) = system.factor(&plan, &at, &mut || true) else {
            return (f64::NAN, false);
        };
        let free = |i: usize, a: usize| if loads.support[i][a].is_none() { some(i, a + 1) } else { 0.0 };
        let right: Vec<D3> = (0..at.x.len()).map(|i| core::array::from_fn(|a| free(i, a))).collect();
        let (mut found, mut again) = (Vec::new(), Vec::new());
        factored.apply(&right, &mut found);
        elastic.hessian((&at.x, &at.tangent), &found, &mut again, &mut Products::new(&elastic, 1));
        loads.add_hessian(0.7, &at.x, &found, &mut again);
        let off: Vec<D3> = (0..right.len())
            .map(|i| {
                core::array::from_fn(|a| if loads.support[i][a].is_none() { again[i][a] - right[i][a] } else { 0.0 })
            })
            .collect();
        assert!(!elastic.films.is_empty(), "films are there to be met");
        ((inner(&off, &off) / inner(&right, &right)).sqrt(), true)
    }

    #[test]
    fn factors_undo_products_with_the_hessian_at_rest_and_deformed() {
        for shaken in [0.0, 0.02, 0.05] {
            let (error, stable) = inverse(shaken);
            assert!(stable && error < 1e-9, "{error} at {shaken} mm");
        }
        assert!(!inverse(3.0).1, "what is turned inside out is not stable");
    }
}
