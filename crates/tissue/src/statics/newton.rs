//! Newton's method with conjugate gradients and a line search (where loads have an energy: see [`super::unsymmetric`]), along a path
//! of growing motion and load.

use super::direct::Direct;
use super::loads::Loads;
use super::overlap::Sphere;
use super::sphere::Spheres;
use super::{StaticOptions, Stop};
use crate::physical::elastic::{Elastic, Tangent, volume_gradient};
use crate::physical::products::Products;
use monro_geometry::d3::{D3, dot, norm, sub};

/// Tolerance on the way; only the end must be exact.
const LOOSE: f64 = 1e-2;

/// Shortest step of motion and load that is still tried for the sake of a better start.
const SHORTEST: f64 = 1.0 / 128.0;

/// Most steps of a contact's pressures.
const AUGMENTATIONS: u32 = 30;

/// Where spheres rub, so many times the steps and products may be taken: they follow the way, which is as long as it is.
const RUBBING: u32 = 10;

/// Steps with pressures of their own, at the first step that has to be cut short and at each so many further ones, and to which
/// part of the right side each is solved.
const AGAIN: u32 = 12;
const MIXED: u32 = 15;
const MIXED_FORCING: f64 = 1e-3;

/// Newton steps after which a step of motion and load counts as too long.
const PATIENCE: u32 = 40;

/// A step of motion and load in which this part of the body leaps is too long. Small elements at a tool may.
const LEAPT: f64 = 1e-3;

/// A step in which the surface moves so many times as far against a sphere as it may is too long: friction depends on the way.
const OVERSHOT: f64 = 1.5;

/// Force out of balance at a node that is rounding, over those that cancel each other there within every element at rest.
const ROUNDING: f64 = 1e-12;

/// Largest allowed ratio of the forces out of balance to the loads, over the tolerance: beside something stiff that is moved,
/// loads are small against the forces that act.
const BORNE: f64 = 10.0;

/// Largest sum of the forces out of balance over the sum of the loads that still is an answer.
const UNBORNE: f64 = 0.01;

/// No Newton step takes a node further than so many sizes of the body, or, but for what is imposed, the radius of the smallest
/// sphere.
const FURTHEST: f64 = 10.0;

/// A state further away than this many sizes of the body is lost.
const LOST: f64 = 100.0;

pub(super) struct Solved {
    pub(super) x: Vec<D3>,
    pub(super) reaction: Vec<D3>,
    /// Force of each sphere on the tissue, mN.
    pub(super) contacts: Vec<D3>,
    pub(super) spheres: Vec<Sphere>,
    /// Sum of the sizes of the loads, mN.
    pub(super) loads: f64,
    /// Sum of the forces out of balance over the sum of the loads.
    pub(super) unborne: f64,
    pub(super) residual: f64,
    /// Share of the imposed motion and of the loads that was reached.
    pub(super) share: f64,
    /// Elements left without volume.
    pub(super) turned: Vec<u32>,
    /// Whether it is in balance as a ball on a hill is: the body would not stay there.
    pub(super) unstable: bool,
    /// Whether it ended before that was known.
    pub(super) unlooked: bool,
    /// Why it ended, if not by meeting the tolerance.
    pub(super) stop: Option<Stop>,
    pub(super) steps: u32,
    pub(super) products: u32,
}

pub(super) struct Problem<'a> {
    pub(super) elastic: &'a Elastic,
    pub(super) loads: &'a Loads,
    /// Whether the loads have no potential.
    pub(super) open: bool,
    pub(super) spheres: Spheres,
    options: StaticOptions,
    pub(super) keep_going: &'a mut dyn FnMut() -> bool,
    /// Share of the loads that acts.
    pub(super) share: f64,
    steps: u32,
    pub(super) products: u32,
    stop: Option<Stop>,
    /// Square of the force out of balance at each node that is nothing but rounding, mN2.
    rounding: Vec<f64>,
    hessian: Products,
    pub(super) direct: Direct,
    /// A direction without stiffness that a system had.
    pub(super) bent: Option<Vec<D3>>,
}

/// A state with its derivatives.
#[derive(Clone)]
pub(super) struct Point {
    pub(super) x: Vec<D3>,
    /// Of the tissue and of the spheres; what the loads give is told by the way between two states only.
    pub(super) energy: f64,
    pub(super) gradient: Vec<D3>,
    pub(super) tangent: Tangent,
}

/// Solves from rest, or from `start` with the whole motion imposed at once. Friction depends on the way: where spheres rub,
/// the way is gone again from rest.
pub(super) fn solve(
    elastic: &Elastic,
    (loads, spheres): (&Loads, Spheres),
    start: Option<Vec<D3>>,
    options: &StaticOptions,
    keep_going: &mut dyn FnMut() -> bool,
) -> Solved {
    let mut options = *options;
    if spheres.rub() {
        options.steps = options.steps.saturating_mul(RUBBING);
        options.products = options.products.saturating_mul(RUBBING);
    }
    let rounding = rounding(elastic);
    let (share, stop) = (0.0, None);
    let hessian = Products::new(elastic, std::thread::available_parallelism().map_or(1, usize::from));
    let open = !loads.have_potential(elastic);
    let mut problem = Problem {
        elastic,
        loads,
        open,
        spheres,
        options,
        keep_going,
        share,
        steps: 0,
        products: 0,
        stop,
        rounding,
        hessian,
        direct: Direct::default(),
        bent: None,
    };
    let (at, share) = match start {
        Some(x) if !problem.spheres.rub() => problem.from(x),
        _ => problem.path(),
    };
    let in_balance = share >= 1.0 && problem.stop.is_none() && problem.in_balance(&at);
    let (at, stays) = if in_balance { problem.stable(at) } else { (at, true) };
    let unlooked = in_balance && stays && problem.stop.is_some();
    let residual = problem.residual(&at);
    let reaction = at.gradient.iter().zip(&loads.support);
    let reaction = reaction.map(|(g, s)| core::array::from_fn(|a| if s[a].is_some() { g[a] } else { 0.0 })).collect();
    let contacts = problem.spheres.forces(&at.x);
    let firm = problem.spheres.firm(&at.x);
    let spheres =
        problem.spheres.centres().into_iter().zip(firm).map(|(centre, firm)| Sphere { centre, firm }).collect();
    let turned = elastic.turned(&at.x).collect();
    let (unborne, loads) = (problem.unborne(&at, &contacts), problem.loads.sum(&at.x));
    let (steps, products) = (problem.steps, problem.products);
    let met = residual <= options.tolerance && share >= 1.0;
    let stop = match (met, unborne > UNBORNE) {
        (true, false) => None,
        (true, true) => Some(Stop::Unborne),
        (false, _) => problem.stop.or(Some(Stop::Stuck)),
    };
    Solved {
        x: at.x,
        reaction,
        contacts,
        spheres,
        loads,
        unborne,
        residual,
        share,
        turned,
        unstable: !stays,
        unlooked,
        stop,
        steps,
        products,
    }
}

/// Square of what rounding leaves at each node.
fn rounding(elastic: &Elastic) -> Vec<f64> {
    let mut forces = vec![0.0; elastic.rest.len()];
    for (tet, mu) in elastic.tets.iter().zip(&elastic.mu) {
        let (_, gradient) = volume_gradient(tet.map(|n| elastic.rest[n as usize]));
        for (&n, g) in tet.iter().zip(&gradient) {
            forces[n as usize] += mu * dot(*g, *g).sqrt();
        }
    }
    forces.into_iter().map(|f| (ROUNDING * f).powi(2)).collect()
}

pub(super) fn shifted(x: &[D3], d: &[D3], s: f64) -> Vec<D3> {
    let mut out = x.to_vec();
    shift(&mut out, d, s);
    out
}

pub(super) fn shift(x: &mut [D3], d: &[D3], s: f64) {
    x.iter_mut().zip(d).for_each(|(x, d)| (0..3).for_each(|a| x[a] += s * d[a]));
}

/// The largest component.
pub(super) fn longest(d: &[D3]) -> f64 {
    d.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()))
}

pub(super) fn inner(a: &[D3], b: &[D3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
}

impl Problem<'_> {
    /// Grows imposed motion and loads from nothing to all of them, in steps as long as they succeed.
    fn path(&mut self) -> (Point, f64) {
        self.spheres.place(0.0);
        let mut at = self.evaluate(self.elastic.rest.clone());
        let (mut share, mut stride) = (0.0f64, 1.0);
        let mut speed = vec![[0.0; 3]; at.x.len()];
        for _ in 0..self.options.steps {
            stride = self.spheres.stride(&at.x, &speed).min(stride);
            let next = if share + 1.001 * stride >= 1.0 { 1.0 } else { share + stride };
            let tolerance = if next == 1.0 { self.options.tolerance } else { LOOSE };
            let spheres = self.spheres.clone();
            let patient = next - share > SHORTEST;
            let reached = self.advance(&at, &spheres, (next, tolerance), patient);
            match reached {
                Some(there) => {
                    let over = |(now, before): (&D3, &D3)| sub(*now, *before).map(|d| d / (next - share));
                    speed = there.x.iter().zip(&at.x).map(over).collect();
                    (at, share, stride) = (there, next, 1.5 * stride);
                }
                None => {
                    // Forces and residual are told of the state that is kept.
                    (self.spheres, self.share) = (spheres, share);
                    stride = 0.5 * (next - share);
                }
            }
            if share == 1.0 || self.spent() {
                return (at, share);
            }
        }
        self.stop = Some(Stop::Steps);
        (at, share)
    }

    /// Solves from a state that is near: the answer on a coarser mesh.
    fn from(&mut self, start: Vec<D3>) -> (Point, f64) {
        self.share = 1.0;
        self.spheres.place(1.0);
        let mut x = start;
        for ((x, s), rest) in x.iter_mut().zip(&self.loads.support).zip(&self.elastic.rest) {
            (0..3).for_each(|a| x[a] = s[a].map_or(x[a], |v| rest[a] + v));
        }
        let mut at = self.evaluate(x);
        if !self.open && self.spheres.least_radius().is_none() {
            at = self.mixed(&at, self.options.tolerance).unwrap_or(at);
        }
        self.converge(&mut at, self.options.tolerance, u32::MAX);
        (at, 1.0)
    }

    /// The equilibrium at the share `next` of the imposed motion, on from a state and the spheres there. `None` when the step was
    /// too long.
    fn advance(
        &mut self,
        from: &Point,
        spheres: &Spheres,
        (next, tolerance): (f64, f64),
        patient: bool,
    ) -> Option<Point> {
        self.share = next;
        self.spheres.place(next);
        let overshot = |now: &Spheres, x: &[D3]| now.overshot((spheres, &from.x), x) > OVERSHOT;
        let lift: Vec<D3> = (0..from.x.len()).map(|i| self.lift(i, from.x[i], next)).collect();
        let mut at = self.evaluate(from.x.clone());
        if lift.iter().flatten().any(|&v| v != 0.0) {
            // The first step carries the prescribed displacements, and the tissue along by the tangent.
            let d = self.linear(&at, Some(&lift), 1e-2);
            at = self.evaluate(shifted(&at.x, &d, 1.0));
            self.steps += 1;
            if patient && overshot(&self.spheres, &at.x) {
                return None;
            }
        }
        let settled = self.converge(&mut at, tolerance, if patient { PATIENCE } else { u32::MAX });
        let through = self.spheres.through(&self.elastic.tets, &at.x);
        // What leaps may have come to another equilibrium than the one that this way leads to.
        let strayed = || {
            self.elastic.turned(&at.x).next().is_some()
                || self.elastic.leapt(&from.x, &at.x) > LEAPT
                || overshot(&self.spheres, &at.x)
        };
        if patient && self.stop.is_none() && (!settled || through || strayed()) {
            return None;
        }
        if through {
            self.stop = self.stop.or(Some(Stop::Through));
            return None;
        }
        if !settled && self.lost(&at.x) {
            self.stop = Some(Stop::Lost);
            return None;
        }
        if self.open && !settled {
            self.stop = self.stop.or(Some(Stop::Stuck));
            return None;
        }
        self.spheres.settle(&at.x);
        Some(at)
    }

    /// Whether a state has flown away or is no state at all.
    pub(super) fn lost(&self, x: &[D3]) -> bool {
        let far = |a: &D3, b: &D3| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
        let rest = &self.elastic.rest;
        let imposed = self.loads.support.iter().flatten().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
        let size = self.size().max(imposed);
        !x.iter().zip(rest).all(|(x, r)| far(x, r) <= LOST * size)
    }

    /// What is missing of the prescribed displacement of node `i` at the share `next`.
    fn lift(&self, i: usize, x: D3, next: f64) -> D3 {
        let rest = self.elastic.rest[i];
        core::array::from_fn(|a| self.loads.support[i][a].map_or(0.0, |v| rest[a] + next * v - x[a]))
    }

    /// Newton steps, and steps of the contact pressures between them. Whether the tolerance was met.
    pub(super) fn converge(&mut self, at: &mut Point, tolerance: f64, patience: u32) -> bool {
        let most = if tolerance < LOOSE { AUGMENTATIONS } else { 2 };
        for _ in 0..most {
            if !self.newton(at, tolerance, patience) {
                return false;
            }
            if !self.spheres.augment(&at.x) {
                return true;
            }
            *at = self.evaluate(core::mem::take(&mut at.x));
        }
        true
    }

    fn newton(&mut self, at: &mut Point, tolerance: f64, patience: u32) -> bool {
        let (mut last, mut cut) = (f64::INFINITY, 0u32);
        // Whole steps settle soon or never.
        for _ in 0..if self.open { patience.min(PATIENCE) } else { patience } {
            let residual = self.residual(at);
            let met = residual <= tolerance;
            let out = self.out_of_balance(at);
            // Within the tolerance what does not fall any more is as good as it gets.
            if met && (tolerance >= LOOSE || self.borne(at, out) || out > 0.25 * last) {
                return true;
            }
            last = if met { out } else { last };
            if self.spent() || self.steps >= self.options.steps {
                self.stop = self.stop.or(Some(Stop::Steps));
                return met;
            }
            let forcing = (0.5 * residual.sqrt()).clamp(1e-8, 0.1);
            let d = self.linear(at, None, forcing);
            let found = if self.open { self.stride(at, &d).map(|p| (p, 1.0)) } else { self.search(at, &d) };
            let Some((next, part)) = found else { return met };
            // Where steps have to be cut short others are tried in their place, now and then.
            cut += u32::from(part < 1.0);
            let other = if part < 1.0 && cut % AGAIN == 1 { self.mixed(at, tolerance) } else { None };
            *at = other.unwrap_or(next);
            self.steps += 1;
        }
        false
    }

    /// Whole Newton steps with the pressures of patches as unknowns of their own (Magisano, Leonetti and Garcea 2017): where these
    /// follow from displacements alone, a step that turns what hardly changes its volume has pressures of its second order in the
    /// next tangent, and only short ones lower the energy. `None` where that leads nowhere.
    fn mixed(&mut self, from: &Point, tolerance: f64) -> Option<Point> {
        let mut at = from.clone();
        for _ in 0..MIXED {
            self.bent = None;
            let d = self.linear(&at, None, MIXED_FORCING);
            if self.bent.is_some() || self.spent() || longest(&d) >= self.furthest(false) {
                return None;
            }
            let pressures = self.elastic.pressures_along(&at.tangent, &d);
            at = self.evaluate(shifted(&at.x, &d, 1.0));
            self.steps += 1;
            let residual = self.residual(&at);
            if !residual.is_finite() || self.elastic.turned(&at.x).next().is_some() {
                return None;
            }
            if residual <= tolerance {
                return Some(at);
            }
            self.elastic.take_pressures(&mut at.tangent, &pressures);
        }
        None
    }

    pub(super) fn evaluate(&self, x: Vec<D3>) -> Point {
        let (mut gradient, mut tangent) = (Vec::new(), Tangent::default());
        let mut energy = self.elastic.gradient(&x, &mut gradient, &mut tangent);
        self.loads.add(self.share, &x, &mut gradient);
        energy += self.spheres.add(&x, &mut gradient);
        Point { x, energy, gradient, tangent }
    }

    /// Whether products or the caller's patience have run out.
    pub(super) fn spent(&mut self) -> bool {
        if self.stop.is_none() && self.products >= self.options.products {
            self.stop = Some(Stop::Products);
        } else if self.stop.is_none() && !(self.keep_going)() {
            self.stop = Some(Stop::Asked);
        }
        self.stop.is_some()
    }

    /// Keeps only the free components.
    pub(super) fn mask(&self, v: &mut [D3]) {
        for (v, s) in v.iter_mut().zip(&self.loads.support) {
            (0..3).for_each(|a| {
                if s[a].is_some() {
                    v[a] = 0.0;
                }
            });
        }
    }

    /// Square of the force out of balance, without what is nothing but rounding.
    fn out_of_balance(&self, at: &Point) -> f64 {
        let mut free = at.gradient.clone();
        self.mask(&mut free);
        let one = |(g, rounding): (&D3, &f64)| {
            Some(dot(*g, *g)).filter(|g2| g2 > rounding || g2.is_nan()).unwrap_or_default()
        };
        free.iter().zip(&self.rounding).map(one).sum()
    }

    pub(super) const fn tolerance(&self) -> f64 {
        self.options.tolerance
    }

    /// Whether a state meets the tolerance.
    pub(super) fn in_balance(&self, at: &Point) -> bool {
        self.residual(at) <= self.tolerance()
    }

    /// Force out of balance over the size of reactions and loads, as far as these are imposed.
    fn residual(&self, at: &Point) -> f64 {
        let mut held = at.gradient.clone();
        for (g, s) in held.iter_mut().zip(&self.loads.support) {
            (0..3).filter(|&a| s[a].is_none()).for_each(|a| g[a] = 0.0);
        }
        let out = self.out_of_balance(at);
        let loads = self.share * self.share * self.loads.size2(&at.x);
        let acting = inner(&held, &held) + loads + self.spheres.size2(&at.x);
        if out == 0.0 { 0.0 } else { (out / acting.max(f64::MIN_POSITIVE)).sqrt() }
    }

    /// Whether a force out of balance (its square) is small also against the loads alone.
    fn borne(&self, at: &Point, out: f64) -> bool {
        let loads = self.loads.size2(&at.x) + self.spheres.size2(&at.x);
        loads == 0.0 || out <= loads * (BORNE * self.options.tolerance).powi(2)
    }

    /// Sum of the forces out of balance over the sum of the loads and the forces of spheres.
    fn unborne(&self, at: &Point, contacts: &[D3]) -> f64 {
        let mut free = at.gradient.clone();
        self.mask(&mut free);
        let sum: D3 = core::array::from_fn(|a| free.iter().map(|g| g[a]).sum());
        let pushed: f64 = contacts.iter().map(|f| dot(*f, *f).sqrt()).sum();
        let loads = self.loads.sum(&at.x) + pushed;
        if loads > 0.0 { norm(sum) / loads } else { 0.0 }
    }

    pub(super) fn product(&mut self, at: &Point, d: &[D3], out: &mut Vec<D3>) {
        self.elastic.hessian((&at.x, &at.tangent), d, out, &mut self.hessian);
        if self.open {
            self.loads.add_derivative(self.share, &at.x, d, out);
        } else {
            self.loads.add_hessian(self.share, &at.x, d, out);
        }
        self.spheres.add_hessian(&at.x, d, out);
        self.products += 1;
    }

    /// Size of the body, mm.
    pub(super) fn size(&self) -> f64 {
        let rest = &self.elastic.rest;
        rest.iter().map(|p| longest(&[sub(*p, rest[0])])).fold(0.0, f64::max)
    }

    /// How far a Newton step may take a node, mm: on to a sphere, not through it, unless it is carried along.
    pub(super) fn furthest(&self, carried: bool) -> f64 {
        let size = self.size();
        let radius = self.spheres.least_radius().filter(|_| !carried);
        radius.map_or(FURTHEST * size, |radius| radius.min(FURTHEST * size))
    }

    /// What the energy falls by from one state to another.
    pub(super) fn gained(&self, at: &Point, next: &Point) -> f64 {
        self.loads.work(self.share, &at.x, &next.x) + at.energy - next.energy
    }

    /// The longest step of `1, 1/2, 1/4...` that lowers the energy enough (Armijo), and which part of the whole one it is.
    fn search(&self, at: &Point, d: &[D3]) -> Option<(Point, f64)> {
        let slope = inner(&at.gradient, d);
        let sign = if slope > 0.0 { -1.0 } else { 1.0 };
        let (mut s, before) = (1.0, self.out_of_balance(at));
        for _ in 0..40 {
            let next = self.evaluate(shifted(&at.x, d, sign * s));
            // Near the end rounding is larger than the gain in energy, and the force out of balance tells more.
            let gained = self.gained(at, &next);
            if gained >= 1e-4 * s * slope.abs() || self.out_of_balance(&next) < 0.25 * before {
                return Some((next, s));
            }
            s *= 0.5;
        }
        None
    }
}
