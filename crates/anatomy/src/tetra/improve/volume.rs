//! Giving each label the volume of its voxels.
//!
//! Points on a curved surface with straight edges between them enclose too little of a convex body. Moving each point
//! along its normal by a part of its height over its neighbours makes that good where it arises: by h^2 H / 8 for edges h
//! and mean curvature H, about a quarter of that height. The part is solved for, so the volume is met and not just
//! approached.

use super::super::adjacency::FACES;
use super::bodies::Bodies;
use super::relax::{Freedom, Pair};
use super::work::{DEAD, Work};
use monro_geometry::d3::{D3, add, cross, dot, norm, scale, sub};
use std::collections::BTreeMap;

/// Largest part of the height over its neighbours that a point is moved by in one pass.
const MOST: f64 = 0.5;

/// How far a point may stand off its surface, in cells of the fields or, if that is more, in mean edges around it: at the tips
/// of horns heights say too much.
const MOST_LIFT: [f64; 2] = [0.7, 0.15];

/// Passes at most, and the part of a volume that it may be off by for another pass not to be worth it.
const PASSES: usize = 16;
const MET: f64 = 2e-4;
/// A pass that leaves more than this part of what was missing, over all labels, is the last.
const STUCK: f64 = 0.95;

/// Rounds of moving points and bettering elements, unless volumes are met to this part: of labels, and of other bodies.
const ROUNDS: usize = 5;
const ENOUGH: [f64; 2] = [2e-3, 1e-2];
/// Elements are not made worse than this by volumes in the end, and are bettered up to that between the rounds.
pub(in super::super) const GOOD: f64 = 0.47;
const RESTED: f64 = 0.52;

/// Points are moved by their heights where these are mostly of one sign: sum over sum of sizes. On a surface with as much
/// hollow as bulge, or noise finer than its points, they say nothing of what is missing, and it is moved evenly.
const BULGY: f64 = 0.85;
/// The part of its height over its neighbours by which a point stands off its surface so that the chords around it leave as much
/// on one side as on the other. Over a triangle with edges h a surface of mean curvature H rises h^2 H / 8 above them in the
/// mean, a corner h^2 H / 2 above its neighbours.
const QUARTER: f64 = 0.25;
/// Largest even shift in one pass, in cells of the fields.
const MOST_SHIFT: f64 = 0.2;

/// What restoring volumes may do.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Bounds {
    /// No element gets worse than this, or than it was.
    pub(in super::super) floor: f64,
    /// How far points may stand off their surfaces, in [`MOST_LIFT`]s: more where volumes are not met otherwise.
    pub(in super::super) lift: f64,
}

/// A surface point: its area normal, and how far it stands out over its neighbours.
#[derive(Debug, Clone, Copy)]
struct Stand {
    point: u32,
    pair: Pair,
    normal: D3,
    area: f64,
    height: f64,
}

/// What each surface is to give its lower label, mm3, so that all labels get what they lack: the evenest shifts that do. A label
/// in the middle of others is reached through these only, whatever its number. With a potential for each label, 0 outside, a
/// shift is the difference of those on its two sides.
fn shares(stands: &[Stand], lacking: &[f64]) -> Vec<(Pair, f64)> {
    let mut areas: BTreeMap<Pair, f64> = BTreeMap::new();
    stands.iter().for_each(|s| *areas.entry(s.pair).or_default() += s.area);
    let mut matrix = vec![vec![0.0; lacking.len()]; lacking.len()];
    for (&(a, b), &area) in &areas {
        let a = usize::from(a);
        matrix[a][a] += area;
        if let Some(b) = b.map(usize::from) {
            matrix[b][b] += area;
            matrix[a][b] -= area;
            matrix[b][a] -= area;
        }
    }
    let potential = solved(matrix, lacking.to_vec());
    let of = |label: u8| potential[usize::from(label)];
    areas.into_iter().map(|(pair, area)| (pair, area * (of(pair.0) - pair.1.map_or(0.0, of)))).collect()
}

/// Solves with a symmetric matrix, positive but for labels that no surface leads out of: these get a little on the diagonal.
fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
    let n = right.len();
    let little = 1e-9 * (0..n).map(|i| matrix[i][i]).fold(f64::MIN_POSITIVE, f64::max);
    for i in 0..n {
        matrix[i][i] += little;
        let pivot = matrix[i].clone();
        for j in i + 1..n {
            let factor = matrix[j][i] / pivot[i];
            if factor != 0.0 {
                matrix[j][i..].iter_mut().zip(&pivot[i..]).for_each(|(m, p)| *m -= factor * p);
                right[j] -= factor * right[i];
            }
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| matrix[i][j] * right[j]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    right
}

/// Whether the heights of a surface, their sum and the sum of their sizes, are mostly of one sign.
fn bulges([gain, all]: [f64; 2]) -> bool {
    gain.abs() >= BULGY * all
}

impl Work<'_> {
    /// [`Work::restore_volumes`], and where good elements leave points no room for it once more after bettering those.
    pub(in super::super) fn settle_volumes(&mut self, wanted: &[f64]) {
        for round in 0..ROUNDS {
            let off = self.restore_volumes(wanted, Bounds { floor: GOOD, lift: 1.5f64.powi(round as i32) });
            let (labels, others) = off.split_at(wanted.len());
            if labels.iter().all(|o| *o <= ENOUGH[0]) && others.iter().all(|o| *o <= ENOUGH[1]) {
                break;
            }
            self.pass(RESTED);
        }
    }

    /// Moves the points of each surface so that labels have the volumes `wanted` (mm3, in the order of the labels), and other bodies
    /// theirs. By what part of them each of these is off then.
    pub(in super::super) fn restore_volumes(&mut self, wanted: &[f64], bounds: Bounds) -> Vec<f64> {
        let faces = self.surface_faces();
        let bodies = self.bodies(&faces, wanted);
        let wanted: &[f64] = &bodies.wanted;
        let mut before = [f64::INFINITY; 2];
        let off = |now: &[f64]| now.iter().zip(wanted).map(|(n, w)| (n - w).abs() / w).collect::<Vec<f64>>();
        let mut now = self.body_volumes(&bodies);
        for _ in 0..PASSES {
            let off = off(&now);
            // Small ones may be off for good: the others are not to wait for them.
            let is_minor = |l: usize| bodies.is_minor(l, &self.fields.specks);
            let sums = [off.iter().sum(), (0..off.len()).filter(|&l| !is_minor(l)).map(|l| off[l]).sum::<f64>()];
            if off.iter().all(|o| *o <= MET) || (0..2).all(|i| sums[i] > STUCK * before[i]) {
                break;
            }
            before = sums;
            let stands = self.stands(&faces, &bodies);
            let lacking: Vec<f64> = wanted.iter().zip(&now).map(|(w, n)| w - n).collect();
            for (pair, gain) in shares(&stands, &lacking) {
                let smaller = pair.1.map_or(f64::INFINITY, |b| wanted[usize::from(b)]).min(wanted[usize::from(pair.0)]);
                if gain.abs() > 0.5 * MET * smaller {
                    self.inflate(&stands, pair, gain, bounds);
                }
            }
            now = self.body_volumes(&bodies);
        }
        off(&now)
    }

    /// Moves the points of surfaces with as much hollow as bulge off them by what the chords around each leave out, inwards where
    /// they are hollow: what evens out over such a surface does not within a lumen, or a sulcus. Other surfaces come by it in
    /// [`Work::restore_volumes`].
    pub(in super::super) fn round_out(&mut self, labels: usize, bounds: Bounds) {
        let faces = self.surface_faces();
        let stands = self.stands(&faces, &self.bodies(&faces, &vec![0.0; labels]));
        let mut heights: BTreeMap<Pair, [f64; 2]> = BTreeMap::new();
        for s in &stands {
            let [gain, all] = heights.entry(s.pair).or_default();
            *gain += s.area * s.height;
            *all += s.area * s.height.abs();
        }
        let is_mixed = |s: &&Stand| !bulges(heights[&s.pair]);
        for s in stands.iter().filter(is_mixed) {
            self.shift(s, QUARTER * s.height, bounds);
        }
    }

    /// Moves a point along its normal, or half as far where elements forbid the whole way.
    fn shift(&mut self, stand: &Stand, by: f64, bounds: Bounds) {
        let step = scale(stand.normal, by);
        if !self.try_shift(stand, step, bounds) {
            self.try_shift(stand, scale(step, 0.5), bounds);
        }
    }

    /// Volume of each label, mm3.
    pub(in super::super) fn volumes(&self, labels: usize) -> Vec<f64> {
        let mut v = vec![0.0; labels];
        for (&t, &l) in self.tets.iter().zip(&self.labels).filter(|(_, l)| **l != DEAD) {
            v[usize::from(l)] += monro_geometry::d3::volume6(self.corners(t)) / 6.0;
        }
        v
    }

    /// Faces between labels, or to the outside, seen from outside of the lower label, and whether to the outside.
    fn surface_faces(&self) -> Vec<([u32; 3], bool)> {
        let mut faces: Vec<([u32; 3], u8, [u32; 3])> = Vec::new();
        for (t, &label) in self.tets.iter().zip(&self.labels).filter(|(_, l)| **l != DEAD) {
            for f in FACES.map(|f| f.map(|i| t[i])) {
                // A face on a surface has no point inside a label.
                if f.iter().all(|&v| self.masks[v as usize].count() > 1) {
                    let mut key = f;
                    key.sort_unstable();
                    faces.push((key, label, f));
                }
            }
        }
        faces.sort_unstable();
        let sides = faces.chunk_by(|a, b| a.0 == b.0);
        sides.filter(|c| c.len() == 1 || c[0].1 != c[1].1).map(|c| (c[0].2, c.len() == 1)).collect()
    }

    fn stands(&self, faces: &[([u32; 3], bool)], bodies: &Bodies) -> Vec<Stand> {
        let mut sums = vec![([0.0; 3], [0.0; 3], 0.0); self.points.len()];
        for (f, _) in faces {
            let p = f.map(|v| self.points[v as usize]);
            let area = scale(cross(sub(p[1], p[0]), sub(p[2], p[0])), 0.5);
            let sum = add(add(p[0], p[1]), p[2]);
            for (i, &v) in f.iter().enumerate() {
                let s = &mut sums[v as usize];
                *s = (add(s.0, area), add(s.1, sub(sum, p[i])), s.2 + 2.0);
            }
        }
        let mut out = Vec::new();
        for (v, (area, ring, count)) in sums.into_iter().enumerate() {
            let Freedom::Surface(pair) = self.freedom(v as u32) else { continue };
            let pair = bodies.between(v as u32, pair);
            let length = norm(area);
            if count > 0.0 && length > 0.0 {
                let normal = scale(area, 1.0 / length);
                let height = dot(sub(self.points[v], scale(ring, 1.0 / count)), normal);
                out.push(Stand { point: v as u32, pair, normal, area: length / 3.0, height });
            }
        }
        out
    }

    /// Moves the points of a surface by one part of their heights, for a gain of `missing` mm3.
    fn inflate(&mut self, stands: &[Stand], pair: Pair, missing: f64, bounds: Bounds) {
        let chosen = || stands.iter().filter(|s| s.pair == pair);
        let gain: f64 = chosen().map(|s| s.area * s.height).sum();
        let area: f64 = chosen().map(|s| s.area).sum();
        let heights: f64 = chosen().map(|s| s.area * s.height.abs()).sum();
        if area <= 0.0 {
            return;
        }
        let part = (missing / gain).clamp(-MOST, MOST);
        let most = MOST_SHIFT * self.fields.step;
        let even = (missing / area).clamp(-most, most);
        let by_height = bulges([gain, heights]);
        for s in chosen() {
            self.shift(s, if by_height { part * s.height } else { even }, bounds);
        }
    }

    fn try_shift(&mut self, stand: &Stand, step: D3, bounds: Bounds) -> bool {
        let v = stand.point;
        // The normal looks out of the lower label, the field's gradient into it.
        let before = self.lift[v as usize];
        let lift = before - dot(step, stand.normal);
        let most = (MOST_LIFT[0] * self.fields.step).max(MOST_LIFT[1] * stand.area.sqrt());
        if lift.abs() > (bounds.lift * most).max(before.abs()) {
            return false;
        }
        let floor = self.worst_around(v).min(bounds.floor);
        // Not worse than the floor: a hair below it serves.
        if !self.try_move(v, add(self.points[v as usize], step), floor - 1e-9) {
            return false;
        }
        self.lift[v as usize] = lift;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_labels_lack_comes_through_those_around_them() {
        // The outside, then 2, 0 and 1 in each other; 3 has no surface at all.
        let stand = |pair, area| Stand { point: 0, pair, normal: [0.0; 3], area, height: 0.0 };
        let stands = [stand((2, None), 5.0), stand((2, None), 3.0), stand((0, Some(2)), 4.0), stand((0, Some(1)), 1.0)];
        let found = shares(&stands, &[1.0, 2.0, 4.0, 9.0]);
        let wanted = [((0, Some(1)), -2.0), ((0, Some(2)), 3.0), ((2, None), 7.0)];
        assert_eq!(found.len(), wanted.len());
        for ((pair, gain), (p, g)) in found.into_iter().zip(wanted) {
            assert!(pair == p && (gain - g).abs() < 1e-6, "{pair:?} {gain}, wanted {p:?} {g}");
        }
    }
}
