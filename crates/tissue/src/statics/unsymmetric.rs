//! Newton steps where loads have no potential: a pressure that follows an open surface.
//!
//! Its derivative is not symmetric, and its symmetric part alone makes a bar buckle under the Euler force of a dead load that
//! under a pressure that turns along does not. There is no energy that a step could lower: steps are whole ones, and motion and load
//! grow in shorter steps where those do not settle.

use super::linear::{Conditioner, Unsolved};
use super::newton::{Point, Problem, inner, longest, shift, shifted};
use monro_geometry::d3::D3;

/// Most iterations for one Newton step.
const MOST: u32 = 4000;
/// Halvings of a Newton step that turns elements inside out.
const HALVINGS: u32 = 8;

impl Problem<'_> {
    /// Solves the Newton system by the stabilised biconjugate gradients (van der Vorst 1992), preconditioned, on from where it is.
    /// Ends where they break down, with the best there was. Whether `patience` products were not enough.
    pub(super) fn biconjugate(&mut self, at: &Point, by: &Conditioner, system: &mut Unsolved, patience: u32) -> bool {
        let Unsolved { d, r, left, goal, .. } = system;
        let shadow = r.clone();
        let whole = inner(r, r) / *left;
        let most = MOST.min(patience.div_ceil(2));
        let (mut p, mut v) = (vec![[0.0; 3]; r.len()], vec![[0.0; 3]; r.len()]);
        let (mut y, mut z, mut t) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rho, mut alpha, mut omega) = (1.0, 1.0, 1.0);
        let mut best = (f64::INFINITY, d.clone(), r.clone());
        for _ in 0..most {
            let now = inner(r, r);
            if now < best.0 {
                best.0 = now;
                best.1.clone_from(d);
                best.2.clone_from(r);
            }
            if now <= whole * *goal || !now.is_finite() || self.spent() {
                break;
            }
            let next = inner(&shadow, r);
            let beta = next / rho * (alpha / omega);
            let both = p.iter_mut().zip(&v).zip(&*r);
            both.for_each(|((p, v), r)| (0..3).for_each(|a| p[a] = r[a] + beta * (p[a] - omega * v[a])));
            self.conditioned_product(at, by, &p, (&mut y, &mut v));
            let along = inner(&shadow, &v);
            if next == 0.0 || along == 0.0 {
                break;
            }
            (rho, alpha) = (next, next / along);
            shift(r, &v, -alpha);
            self.conditioned_product(at, by, r, (&mut z, &mut t));
            let square = inner(&t, &t);
            omega = if square > 0.0 { inner(&t, r) / square } else { 0.0 };
            shift(d, &y, alpha);
            shift(d, &z, omega);
            shift(r, &t, -omega);
            if omega == 0.0 {
                break;
            }
        }
        (*d, *r) = (best.1, best.2);
        *left = best.0 / whole;
        *left > *goal && patience < u32::MAX && !self.spent()
    }

    /// The preconditioned `p`, and the product of the Hessian with it.
    fn conditioned_product(&mut self, at: &Point, by: &Conditioner, p: &[D3], (y, v): (&mut Vec<D3>, &mut Vec<D3>)) {
        by.apply(p, y);
        self.mask(y);
        self.product(at, y, v);
        self.mask(v);
    }

    /// The step, no longer than a Newton step may be, or the longest of its halves that turns no element inside out, if none is yet.
    pub(super) fn stride(&self, at: &Point, d: &[D3]) -> Option<Point> {
        let was_turned = self.elastic.turned(&at.x).next().is_some();
        let mut s = (self.furthest(false) / longest(d)).min(1.0);
        for _ in 0..HALVINGS {
            let x = shifted(&at.x, d, s);
            if was_turned || self.elastic.turned(&x).next().is_none() {
                return Some(self.evaluate(x)).filter(|next| next.gradient.iter().flatten().all(|g| g.is_finite()));
            }
            s *= 0.5;
        }
        None
    }
}
