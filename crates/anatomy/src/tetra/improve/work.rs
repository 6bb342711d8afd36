//! A tetrahedral mesh that can be changed locally.

use super::super::adjacency::{FACES, OUT, neighbours};
use super::super::cut::RawMesh;
use super::super::fields::LabelFields;
use super::super::quality::{TOGETHER, quality, quality_of_all};
use super::mask::Mask;
use monro_geometry::d3::D3;

/// Elements more than in the beginning around a point that there is room for.
const ROOM: usize = 8;

/// Label of a removed element.
pub(super) const DEAD: u8 = u8::MAX;

/// Points, elements, the elements around each point, and the labels that meet at each point.
#[derive(Debug, Clone)]
pub(in super::super) struct Work<'a> {
    pub(super) points: Vec<D3>,
    pub(super) tets: Vec<[u32; 4]>,
    pub(super) labels: Vec<u8>,
    pub(super) quality: Vec<f64>,
    pub(super) stars: Vec<Vec<u32>>,
    /// Labels around each point, and the outside at the outer surface.
    pub(super) masks: Vec<Mask>,
    /// How far each point on a surface stands off it towards the higher values, mm: what the volume of its label asks.
    pub(super) lift: Vec<f64>,
    /// Points may leave their surface by this part of the mean edge around them.
    pub(super) loose: f64,
    /// Whether elements may be merged away.
    pub(super) merges: bool,
    pub(super) fields: &'a LabelFields,
    /// How far the surface that a point stands for reaches beyond it because of points merged into it, mm.
    pub(super) drift: Vec<f64>,
    scratch: Vec<f64>,
    free: Vec<u32>,
    alive: usize,
}

impl<'a> Work<'a> {
    pub(in super::super) fn new(raw: RawMesh, fields: &'a LabelFields) -> Self {
        let mut stars = empty_stars(&raw);
        let mut masks = vec![Mask::default(); raw.points.len()];
        let mut worth = Vec::with_capacity(raw.tets.len());
        for (i, (&t, &label)) in raw.tets.iter().zip(&raw.labels).enumerate() {
            worth.push(quality(raw.corners(t)));
            for v in t {
                stars[v as usize].push(i as u32);
                masks[v as usize] |= Mask::of(label);
            }
        }
        for v in outer_points(&raw) {
            masks[v as usize] |= Mask::OUTSIDE;
        }
        let alive = raw.tets.len();
        let RawMesh { points, tets, labels } = raw;
        let (lift, drift) = (vec![0.0; points.len()], vec![0.0; points.len()]);
        let (scratch, free) = (Vec::new(), Vec::new());
        Self {
            points,
            tets,
            labels,
            quality: worth,
            stars,
            masks,
            lift,
            loose: 0.0,
            merges: true,
            fields,
            drift,
            scratch,
            free,
            alive,
        }
    }

    /// The mesh without removed elements and unused points.
    pub(in super::super) fn into_raw(self) -> RawMesh {
        let alive = |t: &usize| self.labels[*t] != DEAD;
        let order: Vec<usize> = (0..self.tets.len()).filter(alive).collect();
        let mut raw = RawMesh {
            tets: order.iter().map(|&t| self.tets[t]).collect(),
            labels: order.iter().map(|&t| self.labels[t]).collect(),
            points: self.points,
        };
        super::super::cut::compact(&mut raw);
        raw
    }

    /// Elements that are left.
    pub(in super::super) const fn count(&self) -> usize {
        self.alive
    }

    pub(super) fn is_alive(&self, t: u32) -> bool {
        self.labels[t as usize] != DEAD
    }

    pub(super) fn corners(&self, t: [u32; 4]) -> [D3; 4] {
        t.map(|v| self.points[v as usize])
    }

    pub(super) fn worth(&self, t: [u32; 4]) -> f64 {
        quality(self.corners(t))
    }

    /// Worst quality around a point.
    pub(super) fn worst_around(&self, v: u32) -> f64 {
        self.stars[v as usize].iter().map(|&t| self.quality[t as usize]).fold(f64::INFINITY, f64::min)
    }

    /// The labels around a point from its elements; the outside bit is kept.
    pub(super) fn refresh_mask(&mut self, v: u32) {
        let outside = self.masks[v as usize] & Mask::OUTSIDE;
        let labels = self.stars[v as usize].iter().fold(Mask::default(), |m, &t| m | Mask::of(self.labels[t as usize]));
        if self.masks[v as usize] != outside | labels {
            self.masks[v as usize] = outside | labels;
            self.lift[v as usize] = 0.0;
        }
    }

    /// A point without elements, last in the order.
    pub(super) fn add_point(&mut self, at: D3, mask: Mask) -> u32 {
        self.points.push(at);
        self.stars.push(Vec::new());
        self.masks.push(mask);
        self.lift.push(0.0);
        self.drift.push(0.0);
        self.points.len() as u32 - 1
    }

    /// Takes back [`Work::add_point`].
    pub(super) fn drop_last_point(&mut self) {
        self.points.pop();
        self.stars.pop();
        self.masks.pop();
        self.lift.pop();
        self.drift.pop();
    }

    pub(super) fn remove(&mut self, t: u32) {
        for v in self.tets[t as usize] {
            let star = &mut self.stars[v as usize];
            if let Some(at) = star.iter().position(|&x| x == t) {
                star.swap_remove(at);
            }
        }
        self.labels[t as usize] = DEAD;
        self.free.push(t);
        self.alive -= 1;
    }

    pub(super) fn insert(&mut self, tet: [u32; 4], label: u8) -> u32 {
        let worth = self.worth(tet);
        let t = match self.free.pop() {
            Some(t) => {
                self.tets[t as usize] = tet;
                self.labels[t as usize] = label;
                self.quality[t as usize] = worth;
                t
            }
            None => {
                self.tets.push(tet);
                self.labels.push(label);
                self.quality.push(worth);
                self.tets.len() as u32 - 1
            }
        };
        tet.iter().for_each(|&v| self.stars[v as usize].push(t));
        self.alive += 1;
        t
    }

    /// Moves a point if every element around stays, or becomes, better than `floor`.
    pub(super) fn try_move(&mut self, v: u32, to: D3, floor: f64) -> bool {
        let from = std::mem::replace(&mut self.points[v as usize], to);
        let mut worths = std::mem::take(&mut self.scratch);
        let star = &self.stars[v as usize];
        let good = self.all_better(star, floor, &mut worths);
        if good {
            star.iter().zip(&worths).for_each(|(&t, &q)| self.quality[t as usize] = q);
        } else {
            self.points[v as usize] = from;
        }
        self.scratch = worths;
        good
    }

    /// Whether all of some elements are better than `floor`, and how good each is as far as they are. The first, mostly the
    /// worst, is looked at by itself.
    fn all_better(&self, tets: &[u32], floor: f64, worths: &mut Vec<f64>) -> bool {
        worths.clear();
        let Some((&first, rest)) = tets.split_first() else { return true };
        worths.push(self.worth(self.tets[first as usize]));
        let corners = |t: u32| self.corners(self.tets[t as usize]);
        worths[0] > floor
            && rest.chunks(TOGETHER).all(|some| {
                let all = quality_of_all(std::array::from_fn(|i| corners(some[i.min(some.len() - 1)])));
                worths.extend(&all[..some.len()]);
                all.iter().all(|&q| q > floor)
            })
    }

    /// Whether some element holds both points.
    pub(super) fn has_edge(&self, a: u32, b: u32) -> bool {
        self.stars[a as usize].iter().any(|&t| self.tets[t as usize].contains(&b))
    }

    /// Elements below a bar, worst first.
    pub(super) fn below(&self, bar: f64) -> Vec<u32> {
        let mut bad: Vec<u32> = self.any_below(bar).collect();
        self.sort_by_quality(&mut bad);
        bad
    }

    /// Whether more than a part of the elements is below a quality.
    pub(in super::super) fn has_more_below(&self, bar: f64, part: f64) -> bool {
        self.any_below(bar).count() as f64 > part * self.count() as f64
    }

    fn any_below(&self, bar: f64) -> impl Iterator<Item = u32> + '_ {
        (0..self.tets.len() as u32).filter(move |&t| self.is_alive(t) && self.quality[t as usize] < bar)
    }

    /// Puts the worst elements first.
    pub(super) fn sort_by_quality(&self, tets: &mut [u32]) {
        tets.sort_unstable_by(|&a, &b| self.quality[a as usize].total_cmp(&self.quality[b as usize]).then(a.cmp(&b)));
    }

    /// Elements that share a point with some, and these, in order.
    pub(super) fn around(&self, tets: &[u32]) -> Vec<u32> {
        let points = tets.iter().flat_map(|&t| self.tets[t as usize]);
        let mut near: Vec<u32> = points.flat_map(|v| self.stars[v as usize].iter().copied()).collect();
        near.sort_unstable();
        near.dedup();
        near
    }
}

/// Room for the elements around each point, and for some that come.
fn empty_stars(raw: &RawMesh) -> Vec<Vec<u32>> {
    let mut counts = vec![ROOM; raw.points.len()];
    raw.tets.iter().flatten().for_each(|&v| counts[v as usize] += 1);
    counts.into_iter().map(Vec::with_capacity).collect()
}

/// Points of faces with one element.
fn outer_points(raw: &RawMesh) -> Vec<u32> {
    let behind = neighbours(&raw.tets, raw.points.len());
    let outer = |(t, b): (&[u32; 4], &[u32; 4])| {
        let (t, b) = (*t, *b);
        (0..4).filter(move |&i| b[i] == OUT).flat_map(move |i| FACES[i].map(|k| t[k]))
    };
    raw.tets.iter().zip(&behind).flat_map(outer).collect()
}
