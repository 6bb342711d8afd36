//! Newton's method with conjugate gradients and a line search.

use super::StaticOptions;
use super::loads::Loads;
use crate::physical::elastic::{D3, Elastic, Tangent, dot};

pub(crate) struct Solved {
    pub(crate) x: Vec<D3>,
    pub(crate) reaction: Vec<D3>,
    pub(crate) residual: f64,
    pub(crate) steps: u32,
    pub(crate) products: u32,
}

struct Problem<'a> {
    elastic: &'a Elastic,
    loads: &'a Loads,
    products: u32,
    most_products: u32,
}

/// A state with its derivatives.
struct Point {
    x: Vec<D3>,
    energy: f64,
    gradient: Vec<D3>,
    tangent: Tangent,
}

pub(crate) fn solve(
    elastic: &Elastic,
    loads: &Loads,
    options: &StaticOptions,
    keep_going: &mut dyn FnMut() -> bool,
) -> Solved {
    let mut problem = Problem { elastic, loads, products: 0, most_products: options.products };
    let mut at = problem.evaluate(elastic.rest.clone());
    let lift: Vec<D3> = loads.support.iter().map(|s| s.map(|v| v.unwrap_or(0.0))).collect();
    let (mut steps, mut residual) = (0, f64::INFINITY);
    if lift.iter().flatten().any(|&v| v != 0.0) {
        // The first step carries the prescribed displacements, and the tissue along by the tangent at rest.
        let d = problem.linear(&mut at, Some(&lift), 1e-3, keep_going);
        at = problem.evaluate(shifted(&at.x, &d, 1.0));
        steps += 1;
    }
    while steps < options.steps {
        residual = problem.residual(&at);
        if residual <= options.tolerance || problem.spent(keep_going) {
            break;
        }
        let forcing = (0.5 * residual.sqrt()).clamp(1e-8, 0.1);
        let d = problem.linear(&mut at, None, forcing, keep_going);
        let Some(next) = problem.search(&at, &d) else { break };
        at = next;
        steps += 1;
    }
    residual = problem.residual(&at).min(residual);
    let reaction = at.gradient.iter().zip(&loads.support);
    let reaction = reaction.map(|(g, s)| core::array::from_fn(|a| if s[a].is_some() { g[a] } else { 0.0 })).collect();
    Solved { x: at.x, reaction, residual, steps, products: problem.products }
}

fn shifted(x: &[D3], d: &[D3], s: f64) -> Vec<D3> {
    x.iter().zip(d).map(|(x, d)| core::array::from_fn(|a| x[a] + s * d[a])).collect()
}

fn inner(a: &[D3], b: &[D3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
}

impl Problem<'_> {
    fn evaluate(&self, x: Vec<D3>) -> Point {
        let (mut gradient, mut tangent) = (Vec::new(), Tangent::default());
        let mut energy = self.elastic.gradient(&x, &mut gradient, &mut tangent);
        energy += self.loads.add(&x, &self.elastic.rest, &mut gradient);
        Point { x, energy, gradient, tangent }
    }

    fn spent(&self, keep_going: &mut dyn FnMut() -> bool) -> bool {
        self.products >= self.most_products || !keep_going()
    }

    /// Keeps only the free components.
    fn mask(&self, v: &mut [D3]) {
        for (v, s) in v.iter_mut().zip(&self.loads.support) {
            (0..3).for_each(|a| {
                if s[a].is_some() {
                    v[a] = 0.0;
                }
            });
        }
    }

    /// Square of the force out of balance.
    fn out_of_balance(&self, at: &Point) -> f64 {
        let mut free = at.gradient.clone();
        self.mask(&mut free);
        inner(&free, &free)
    }

    /// Force out of balance over the size of reactions and loads.
    fn residual(&self, at: &Point) -> f64 {
        let out = self.out_of_balance(at);
        let acting = inner(&at.gradient, &at.gradient) - out + self.loads.size2(&at.x);
        if out == 0.0 { 0.0 } else { (out / acting.max(f64::MIN_POSITIVE)).sqrt() }
    }

    fn product(&mut self, at: &mut Point, d: &[D3], out: &mut Vec<D3>) {
        self.elastic.hessian(&at.x, d, &mut at.tangent, out);
        self.loads.add_hessian(&at.x, d, out);
        self.products += 1;
    }

    /// Solves the Newton system by preconditioned conjugate gradients to the relative residual `tolerance`. With `lift` the
    /// prescribed components move by it and the rest follows. Stops at negative curvature with what it has.
    fn linear(
        &mut self,
        at: &mut Point,
        lift: Option<&[D3]>,
        tolerance: f64,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Vec<D3> {
        let mut d: Vec<D3> = lift.map_or_else(|| vec![[0.0; 3]; at.x.len()], <[D3]>::to_vec);
        let mut hp = Vec::new();
        let mut r: Vec<D3> = at.gradient.iter().map(|g| g.map(|v| -v)).collect();
        if lift.is_some() {
            self.product(at, &d, &mut hp);
            r = shifted(&r, &hp, -1.0);
        }
        self.mask(&mut r);
        let blocks = self.preconditioner(at);
        let mut z = apply(&blocks, &r);
        self.mask(&mut z);
        let (mut p, mut rz) = (z.clone(), inner(&r, &z));
        let goal = rz * tolerance * tolerance;
        while rz > goal && rz > 0.0 && !self.spent(keep_going) {
            self.product(at, &p, &mut hp);
            self.mask(&mut hp);
            let curvature = inner(&p, &hp);
            if curvature <= 0.0 {
                if d.iter().flatten().all(|&v| v == 0.0) {
                    d = p;
                }
                break;
            }
            let alpha = rz / curvature;
            d = shifted(&d, &p, alpha);
            r = shifted(&r, &hp, -alpha);
            z = apply(&blocks, &r);
            self.mask(&mut z);
            let next = inner(&r, &z);
            p = shifted(&z, &p, next / rz);
            rz = next;
        }
        d
    }

    /// Inverses of the Hessian's diagonal blocks, prescribed components taken out.
    fn preconditioner(&self, at: &Point) -> Vec<[f64; 6]> {
        let mut blocks = self.elastic.diagonal(&at.tangent);
        for (b, s) in blocks.iter_mut().zip(&self.loads.support) {
            // Entries xx, yy, zz, xy, xz, yz.
            const OFF: [[usize; 2]; 3] = [[3, 4], [3, 5], [4, 5]];
            for a in 0..3 {
                if s[a].is_some() {
                    b[a] = 1.0;
                    OFF[a].iter().for_each(|&k| b[k] = 0.0);
                }
            }
        }
        blocks.iter().map(|b| inverse(*b)).collect()
    }

    /// The longest step of `1, 1/2, 1/4...` that lowers the energy enough (Armijo).
    fn search(&self, at: &Point, d: &[D3]) -> Option<Point> {
        let slope = inner(&at.gradient, d);
        let sign = if slope > 0.0 { -1.0 } else { 1.0 };
        let (mut s, before) = (1.0, self.out_of_balance(at));
        for _ in 0..40 {
            let next = self.evaluate(shifted(&at.x, d, sign * s));
            // Near the end rounding is larger than the gain in energy, and the force out of balance tells more.
            if next.energy <= at.energy - 1e-4 * s * slope.abs() || self.out_of_balance(&next) < 0.25 * before {
                return Some(next);
            }
            s *= 0.5;
        }
        None
    }
}

fn apply(blocks: &[[f64; 6]], r: &[D3]) -> Vec<D3> {
    let row = |b: &[f64; 6], v: &D3| {
        [
            b[0] * v[0] + b[3] * v[1] + b[4] * v[2],
            b[3] * v[0] + b[1] * v[1] + b[5] * v[2],
            b[4] * v[0] + b[5] * v[1] + b[2] * v[2],
        ]
    };
    blocks.iter().zip(r).map(|(b, v)| row(b, v)).collect()
}

/// Inverse of a symmetric positive definite 3x3 matrix given as xx, yy, zz, xy, xz, yz.
fn inverse([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 6] {
    let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let det = xx * cx + xy * cy + xz * cz;
    let s = 1.0 / det;
    [cx * s, (xx * zz - xz * xz) * s, (xx * yy - xy * xy) * s, cy * s, cz * s, (xy * xz - xx * yz) * s]
}
