//! The linear system of a Newton step, by conjugate gradients with diagonal blocks or with the factors of a state near by.

use super::direct::{Factored, System};
use super::newton::{Point, Problem, inner, longest, shift};
use monro_geometry::d3::D3;
use std::sync::Arc;

/// A Newton system on the way to its solution.
pub(super) struct Unsolved {
    pub(super) d: Vec<D3>,
    /// What is left of the right side,
    pub(super) r: Vec<D3>,
    /// its part of the first, squared, and that at which it is enough.
    pub(super) left: f64,
    pub(super) goal: f64,
    /// How far a node may go, mm.
    pub(super) furthest: f64,
}

/// What stands for the inverse of the Hessian.
pub(super) enum Conditioner {
    /// Inverses of its diagonal blocks.
    Blocks(Vec<[f64; 6]>),
    /// Factors at a state near by.
    Factors(Arc<Factored>),
}

impl Conditioner {
    pub(super) fn apply(&self, r: &[D3], out: &mut Vec<D3>) {
        match self {
            Self::Blocks(blocks) => apply(blocks, r, out),
            Self::Factors(factored) => factored.apply(r, out),
        }
    }
}

impl Problem<'_> {
    /// Solves the Newton system by preconditioned conjugate gradients (where it has no symmetry, by biconjugate ones) to the
    /// relative residual `tolerance`. With `lift` the prescribed components move by it and the rest follows. Stops at negative
    /// curvature with what it has.
    pub(super) fn linear(&mut self, at: &Point, lift: Option<&[D3]>, tolerance: f64) -> Vec<D3> {
        let d: Vec<D3> = lift.map_or_else(|| vec![[0.0; 3]; at.x.len()], <[D3]>::to_vec);
        let mut r: Vec<D3> = at.gradient.iter().map(|g| g.map(|v| -v)).collect();
        if lift.is_some() {
            let mut hp = Vec::new();
            self.product(at, &d, &mut hp);
            shift(&mut r, &hp, -1.0);
        }
        self.mask(&mut r);
        let (left, goal) = (1.0, tolerance * tolerance);
        let mut system = Unsolved { d, r, left, goal, furthest: self.furthest(lift.is_some()) };
        let mut all_done = false;
        loop {
            let patience = if all_done { u32::MAX } else { self.direct.patience() };
            let (by, before) = (self.conditioner(at), self.products);
            let tired = if self.open {
                self.biconjugate(at, &by, &mut system, patience)
            } else {
                self.conjugate(at, &by, &mut system, patience)
            };
            self.direct.spend(self.products - before);
            if !tired {
                return system.d;
            }
            let (elastic, loads, spheres, share) = (self.elastic, self.loads, &self.spheres, self.share);
            all_done = self.direct.renew(&System { elastic, loads, spheres, share }, at, self.keep_going);
        }
    }

    /// Conjugate gradients, on from where a system is. Whether `patience` products were not enough.
    pub(super) fn conjugate(&mut self, at: &Point, by: &Conditioner, system: &mut Unsolved, patience: u32) -> bool {
        let Unsolved { d, r, left, goal, furthest } = system;
        let (mut hp, mut z) = (Vec::new(), Vec::new());
        by.apply(r, &mut z);
        self.mask(&mut z);
        let (mut p, mut rz) = (z.clone(), inner(r, &z));
        // What was left is measured anew by another conditioner.
        let whole = rz / *left;
        let most = self.products.saturating_add(patience);
        while rz > whole * *goal && rz > 0.0 && !self.spent() {
            if self.products >= most {
                *left = rz / whole;
                return true;
            }
            self.product(at, &p, &mut hp);
            self.mask(&mut hp);
            let curvature = inner(&p, &hp);
            if curvature <= 0.0 {
                self.bent = Some(p.clone());
                if d.iter().flatten().all(|&v| v == 0.0) {
                    *d = p;
                }
                break;
            }
            let alpha = rz / curvature;
            let way = longest(&p);
            if alpha * way > *furthest {
                // Nothing bears it there yet: on to where something may (Steihaug 1983).
                shift(d, &p, *furthest / way);
                break;
            }
            shift(d, &p, alpha);
            shift(r, &hp, -alpha);
            by.apply(r, &mut z);
            self.mask(&mut z);
            let next = inner(r, &z);
            p.iter_mut().zip(&z).for_each(|(p, z)| (0..3).for_each(|a| p[a] = z[a] + next / rz * p[a]));
            rz = next;
        }
        false
    }

    pub(super) fn conditioner(&self, at: &Point) -> Conditioner {
        self.direct.factored().map_or_else(|| Conditioner::Blocks(self.preconditioner(at)), Conditioner::Factors)
    }

    /// Inverses of the Hessian's diagonal blocks, prescribed components taken out.
    fn preconditioner(&self, at: &Point) -> Vec<[f64; 6]> {
        let mut blocks = self.elastic.diagonal(&at.x, &at.tangent);
        self.spheres.add_diagonal(&at.x, &mut blocks);
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
}

fn apply(blocks: &[[f64; 6]], r: &[D3], out: &mut Vec<D3>) {
    let row = |b: &[f64; 6], v: &D3| {
        [
            b[0] * v[0] + b[3] * v[1] + b[4] * v[2],
            b[3] * v[0] + b[1] * v[1] + b[5] * v[2],
            b[4] * v[0] + b[5] * v[1] + b[2] * v[2],
        ]
    };
    out.clear();
    out.extend(blocks.iter().zip(r).map(|(b, v)| row(b, v)));
}

/// Inverse of a symmetric positive definite 3x3 matrix given as xx, yy, zz, xy, xz, yz.
fn inverse([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 6] {
    let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let det = xx * cx + xy * cy + xz * cz;
    let s = 1.0 / det;
    [cx * s, (xx * zz - xz * xz) * s, (xx * yy - xy * xy) * s, cy * s, cz * s, (xy * xz - xx * yz) * s]
}
