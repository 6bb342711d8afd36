//! The factors of a matrix by fronts (Duff and Reid 1983): each part of the tree is a dense matrix, to which its elements and what
//! is left of the parts below it add.

use super::tree::Tree;
use crate::dense::{backward, eliminate, forward};
use std::sync::atomic::{AtomicBool, Ordering};

/// A component that is held has no unknown.
pub(super) const HELD: u32 = u32::MAX;

/// Work below which no second thread is worth its start, multiplications.
const SHARED: f64 = 1e7;

/// What an element, a face or a vertex adds: unknowns and the entries between them, row by row.
pub(super) struct Piece {
    pub(super) unknowns: Vec<u32>,
    pub(super) values: Vec<f64>,
}

/// The unknowns of each point, and the parts in which they go.
pub(super) struct Plan {
    pub(super) tree: Tree,
    /// Unknowns of each point, or [`HELD`].
    pub(super) slots: Vec<[u32; 4]>,
    pub(super) unknowns: usize,
    /// Multiplications of each part with all below it.
    work: Vec<f64>,
    /// Numbers that the factors keep.
    pub(super) entries: f64,
}

/// An eliminated part.
struct Front {
    own: usize,
    /// Its unknowns, then those of its border.
    unknowns: Vec<u32>,
    columns: Vec<f64>,
}

/// What a part leaves to those after it: the lower triangle, column by column.
struct Left {
    unknowns: Vec<u32>,
    values: Vec<f64>,
}

/// The factors.
pub(super) struct Factors {
    fronts: Vec<Front>,
    pub(super) negative: usize,
}

/// What a thread has found, and where it notes the places of unknowns.
struct Bench {
    fronts: Vec<Front>,
    negative: usize,
    place: Vec<u32>,
}

impl Plan {
    pub(super) fn new(tree: Tree, slots: Vec<[u32; 4]>) -> Self {
        let unknowns = slots.iter().flatten().filter(|&&s| s != HELD).count();
        let mut plan = Self { tree, slots, unknowns, work: Vec::new(), entries: 0.0 };
        for part in 0..plan.tree.parts.len() {
            let (own, border) = plan.unknowns_of(part);
            let (own, all) = (own.len() as f64, (own.len() + border.len()) as f64);
            let below: f64 = plan.tree.parts[part].below.iter().map(|&b| plan.work[b]).sum();
            plan.work.push(below + own * all * all);
            plan.entries += own * all;
        }
        plan
    }

    /// Multiplications of a factorisation.
    pub(super) fn work(&self) -> f64 {
        self.work.last().copied().unwrap_or_default()
    }

    fn unknowns_of(&self, part: usize) -> (Vec<u32>, Vec<u32>) {
        let part = &self.tree.parts[part];
        let of = |points: &[u32]| {
            let all = points.iter().flat_map(|&p| self.slots[p as usize]);
            all.filter(|&s| s != HELD).collect::<Vec<u32>>()
        };
        (of(&part.own), of(&part.border))
    }

    /// Factors the sum of pieces: those of an element by its number, and those of each part. `None` where a pivot is zero, or it
    /// is not to go on: that is asked before each part.
    pub(super) fn factor(&self, pieces: Pieces<'_>, goes_on: &mut dyn FnMut() -> bool) -> Option<Factors> {
        let mut bench = Bench::new(self.unknowns);
        self.front(self.tree.parts.len().checked_sub(1)?, pieces, &mut bench, goes_on)?;
        Some(Factors { fronts: bench.fronts, negative: bench.negative })
    }

    fn front(
        &self,
        number: usize,
        pieces: Pieces<'_>,
        bench: &mut Bench,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<Left> {
        if !goes_on() {
            return None;
        }
        let below = self.below(number, pieces, bench, goes_on)?;
        let (mut unknowns, border) = self.unknowns_of(number);
        let own = unknowns.len();
        unknowns.extend(&border);
        let size = unknowns.len();
        (0..).zip(&unknowns).for_each(|(i, &u)| bench.place[u as usize] = i);
        let mut a = vec![0.0; size * size];
        for &e in &self.tree.parts[number].elements {
            pieces.0(e).add(&bench.place, &mut a, size);
        }
        pieces.1[number].iter().for_each(|p| p.add(&bench.place, &mut a, size));
        below.iter().for_each(|b| b.add(&bench.place, &mut a, size));
        bench.negative += eliminate(&mut a, size, own)?;
        let values = (own..size).flat_map(|j| a[j * size + j..(j + 1) * size].iter().copied()).collect();
        a.truncate(own * size);
        a.shrink_to_fit();
        bench.fronts.push(Front { own, unknowns, columns: a });
        Some(Left { unknowns: border, values })
    }

    /// What the parts below leave, two at a time on two threads where they are large.
    fn below(
        &self,
        number: usize,
        pieces: Pieces<'_>,
        bench: &mut Bench,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Left>> {
        let below = &self.tree.parts[number].below;
        let pair = <[usize; 2]>::try_from(below.as_slice()).ok();
        let Some([one, other]) = pair.filter(|p| p.iter().all(|&b| self.work[b] >= SHARED)) else {
            return below.iter().map(|&b| self.front(b, pieces, bench, goes_on)).collect();
        };
        let (mut second, stopped) = (Bench::new(self.unknowns), AtomicBool::new(false));
        let (left, right) = std::thread::scope(|scope| {
            let there = scope.spawn(|| {
                let mut goes_on = || !stopped.load(Ordering::Relaxed);
                self.front(other, pieces, &mut second, &mut goes_on)
            });
            let here = self.front(one, pieces, bench, goes_on);
            stopped.store(here.is_none(), Ordering::Relaxed);
            (here, there.join().ok().flatten())
        });
        bench.fronts.append(&mut second.fronts);
        bench.negative += second.negative;
        Some(vec![left?, right?])
    }
}

impl Bench {
    fn new(unknowns: usize) -> Self {
        Self { fronts: Vec::new(), negative: 0, place: vec![0; unknowns] }
    }
}

/// The pieces of each element, and those of each part.
pub(super) type Pieces<'a> = (&'a (dyn Fn(u32) -> Piece + Sync), &'a [Vec<Piece>]);

/// Where the entry between two unknowns lies in the lower triangle.
fn lower(place: &[u32], size: usize, u: u32, v: u32) -> usize {
    let (i, j) = (place[u as usize] as usize, place[v as usize] as usize);
    i.min(j) * size + i.max(j)
}

impl Piece {
    fn add(&self, place: &[u32], a: &mut [f64], size: usize) {
        let n = self.unknowns.len();
        for (i, &u) in self.unknowns.iter().enumerate().filter(|(_, u)| **u != HELD) {
            for (j, &v) in self.unknowns[..=i].iter().enumerate().filter(|(_, v)| **v != HELD) {
                a[lower(place, size, u, v)] += self.values[i * n + j];
            }
        }
    }
}

impl Left {
    fn add(&self, place: &[u32], a: &mut [f64], size: usize) {
        let mut value = self.values.iter();
        for (j, &u) in self.unknowns.iter().enumerate() {
            for (&v, value) in self.unknowns[j..].iter().zip(&mut value) {
                a[lower(place, size, u, v)] += value;
            }
        }
    }
}

impl Factors {
    /// Solves for a right side, in its place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let mut local = Vec::new();
        for front in &self.fronts {
            front.forward(x, &mut local);
        }
        for front in self.fronts.iter().rev() {
            front.backward(x, &mut local);
        }
    }
}

impl Front {
    fn gather(&self, x: &[f64], local: &mut Vec<f64>) {
        local.clear();
        local.extend(self.unknowns.iter().map(|&u| x[u as usize]));
    }

    fn forward(&self, x: &mut [f64], local: &mut Vec<f64>) {
        self.gather(x, local);
        forward(&self.columns, local);
        self.unknowns.iter().zip(&*local).for_each(|(&u, v)| x[u as usize] = *v);
    }

    fn backward(&self, x: &mut [f64], local: &mut Vec<f64>) {
        self.gather(x, local);
        backward(&self.columns, local);
        self.unknowns[..self.own].iter().zip(&*local).for_each(|(&u, v)| x[u as usize] = *v);
    }
}
