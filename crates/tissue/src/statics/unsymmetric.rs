//! Newton steps where loads have no potential: a pressure that follows an open surface.
//!
//! Its derivative is not symmetric, and its symmetric part alone makes a bar buckle under the Euler force of a dead load that
//! under a pressure that turns along does not. There is no energy that a step could lower: steps are whole ones, and motion and load
//! grow in shorter steps where those do not settle.

use super::newton::{Point, Problem, apply, inner, longest, shift, shifted};
use crate::physical::elastic::D3;

/// Most iterations for one Newton step.
const MOST: u32 = 4000;
/// Halvings of a Newton step that turns elements inside out.
const HALVINGS: u32 = 8;

impl Problem<'_> {
    /// Solves the Newton system by the stabilised biconjugate gradients (van der Vorst 1992), preconditioned, to the relative
    /// residual `tolerance`, from `d` on; the first residual is `r`. Ends where they break down, with the best there was.
    pub(super) fn biconjugate(&mut self, at: &Point, (mut d, mut r): (Vec<D3>, Vec<D3>), tolerance: f64) -> Vec<D3> {
        let blocks = self.preconditioner(at);
        let shadow = r.clone();
        let goal = inner(&r, &r) * tolerance * tolerance;
        let (mut p, mut v) = (vec![[0.0; 3]; r.len()], vec![[0.0; 3]; r.len()]);
        let (mut y, mut z, mut t) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rho, mut alpha, mut omega) = (1.0, 1.0, 1.0);
        let mut best = (f64::INFINITY, d.clone());
        for _ in 0..MOST {
            let left = inner(&r, &r);
            if left < best.0 {
                best.0 = left;
                best.1.clone_from(&d);
            }
            if left <= goal || !left.is_finite() || self.spent() {
                break;
            }
            let next = inner(&shadow, &r);
            let beta = next / rho * (alpha / omega);
            let both = p.iter_mut().zip(&v).zip(&r);
            both.for_each(|((p, v), r)| (0..3).for_each(|a| p[a] = r[a] + beta * (p[a] - omega * v[a])));
            self.conditioned_product(at, &blocks, &p, (&mut y, &mut v));
            let along = inner(&shadow, &v);
            if next == 0.0 || along == 0.0 {
                break;
            }
            (rho, alpha) = (next, next / along);
            shift(&mut r, &v, -alpha);
            self.conditioned_product(at, &blocks, &r, (&mut z, &mut t));
            let square = inner(&t, &t);
            omega = if square > 0.0 { inner(&t, &r) / square } else { 0.0 };
            shift(&mut d, &y, alpha);
            shift(&mut d, &z, omega);
            shift(&mut r, &t, -omega);
            if omega == 0.0 {
                break;
            }
        }
        best.1
    }

    /// The preconditioned `p`, and the product of the Hessian with it.
    fn conditioned_product(&mut self, at: &Point, blocks: &[[f64; 6]], p: &[D3], (y, v): (&mut Vec<D3>, &mut Vec<D3>)) {
        apply(blocks, p, y);
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
