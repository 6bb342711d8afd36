//! Whether an equilibrium is one in which a body stays, and the way on from one in which it does not.
//!
//! Newton's method finds states in balance, whether the energy has a minimum there or not: a bar that is pressed end to end is in
//! balance straight, too, beyond the force at which it bends aside. A coarse mesh, which is too stiff, leads there on the finer one.

use super::linear::Unsolved;
use super::loads::spread;
use super::newton::{Point, Problem, inner, longest, shifted};
use monro_geometry::d3::{D3, axpy, dot};

/// So often the way is gone on from a state in which the body does not stay.
const ESCAPES: usize = 3;
/// Part of the right side to which the system that shows soft directions is solved.
const SHOWN: f64 = 3e-2;
/// Products that looking for one may take at least, and over those that the state took.
const LOOKED: u32 = 600;
const TIMES: u32 = 2;
/// A direction has no stiffness where the energy falls along it by more than this part of what its elements bear one by one;
/// less is rounding, as of a body that spheres leave free to turn.
const FALLS: f64 = 1e-9;
/// The first step along such a direction, sizes of the body.
const STEP: f64 = 1e-3;
/// Shortest step over that, and longest, as powers of two.
const SHORTER: i32 = -20;
const LONGER: i32 = 8;
/// Waves of the right side, and how many of them there are at most along the body.
const WAVES: usize = 12;
const ALONG: f64 = 4.0;
/// Part of it that has no pattern, so that no symmetry is left.
const NOISE: f64 = 0.1;

impl Problem<'_> {
    /// From a state in balance to one in which the body stays, and whether that was found: otherwise it is the first one. What
    /// has no energy (friction, pressures on open surfaces) is taken as it is.
    pub(super) fn stable(&mut self, at: Point) -> (Point, bool) {
        if self.open || self.spheres.rub() {
            return (at, true);
        }
        let Some(way) = self.soft(&at) else { return (at, true) };
        let spheres = self.spheres.clone();
        match self.left(&at, way) {
            Some(there) => (there, true),
            None => {
                self.spheres = spheres;
                (at, false)
            }
        }
    }

    /// The state in which the body stays that is come to from `from`, which it leaves along `way`.
    fn left(&mut self, from: &Point, mut way: Vec<D3>) -> Option<Point> {
        let mut at = self.slid(from, &way)?;
        for _ in 0..ESCAPES {
            let settled = self.converge(&mut at, self.tolerance(), u32::MAX);
            if !settled || !self.in_balance(&at) || self.lost(&at.x) || self.elastic.turned(&at.x).next().is_some() {
                return None;
            }
            match self.soft(&at) {
                Some(other) => way = other,
                None => return Some(at),
            }
            at = self.slid(&at, &way)?;
        }
        None
    }

    /// A direction along which the energy falls on both sides. It shows where forces of long waves are borne by conjugate
    /// gradients, which meet every direction that such forces reach (Lanczos).
    fn soft(&mut self, at: &Point) -> Option<Vec<D3>> {
        let mut r = self.waves();
        self.mask(&mut r);
        let d = vec![[0.0; 3]; r.len()];
        self.bent = None;
        // What has not shown by then is not looked for any longer.
        let (by, patience) = (self.conditioner(at), self.products.saturating_mul(TIMES).max(LOOKED));
        let mut system = Unsolved { d, r, left: 1.0, goal: SHOWN * SHOWN, furthest: f64::INFINITY };
        self.conjugate(at, &by, &mut system, patience);
        let way = self.bent.take()?;
        let mut force = Vec::new();
        self.product(at, &way, &mut force);
        let borne: f64 = way.iter().enumerate().map(|(i, p)| self.elastic.near.diagonal(i) * dot(*p, *p)).sum();
        (inner(&way, &force) < -FALLS * borne).then_some(way)
    }

    /// Forces in long waves of all directions, the same every time.
    fn waves(&self) -> Vec<D3> {
        let (rest, size) = (&self.elastic.rest, self.size());
        let three = |i: usize| [spread(i), spread(i + 1), spread(i + 2)];
        let wave = |k: usize| (three(7 * k + 1).map(|n| 2.0 * ALONG * n), spread(7 * k + 4), three(7 * k + 5));
        let waves: Vec<_> = (0..WAVES).map(wave).collect();
        let moved = |i: usize, x: &D3| {
            let rough = three(3 * i).map(|v| NOISE * v);
            waves.iter().fold(rough, |sum, (number, phase, way)| {
                let turns = dot(*number, *x) / size + phase;
                axpy(sum, (core::f64::consts::TAU * turns).sin(), *way)
            })
        };
        let force = |(i, x): (usize, &D3)| moved(i, x).map(|v| self.elastic.near.diagonal(i) * v);
        rest.iter().enumerate().map(force).collect()
    }

    /// Along a direction as far as the energy falls, by steps of doubled length.
    fn slid(&self, at: &Point, way: &[D3]) -> Option<Point> {
        let unit = STEP * self.size() / longest(way);
        let step = |power: i32| {
            let next = self.evaluate(shifted(&at.x, way, unit * f64::from(power).exp2()));
            (self.gained(at, &next), next)
        };
        let falls = |power: i32| Some((power, step(power))).filter(|(_, (gained, _))| *gained > 0.0);
        let (first, mut best) = (SHORTER..=0).rev().find_map(falls)?;
        for power in first + 1..=LONGER {
            let further = step(power);
            if further.0.is_nan() || further.0 <= best.0 {
                break;
            }
            best = further;
        }
        Some(best.1)
    }
}
