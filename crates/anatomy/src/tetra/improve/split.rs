//! New points where straight edges cut the corners of a bent surface.

use super::super::size::SizeField;
use super::mask::Mask;
use super::relax::Freedom;
use super::ring::Ring;
use super::work::Work;
use monro_geometry::d3::{D3, add, distance, scale};

/// Edges are split whose middle lies further from their surface than this part of the wanted length,
const FAR: f64 = 0.2;
/// and than this part of a cell of the fields, within which these say little.
const LEAST: f64 = 0.5;
/// So many at most, as a part of the elements, in each round.
const MOST: f64 = 1e-3;
const ROUNDS: usize = 3;
/// What is made may be as bad as this: it is bettered afterwards.
const FLOOR: f64 = 0.2;
/// The new point goes this part of the way to its surface, the first with good elements.
const WAYS: [f64; 4] = [1.0, 0.8, 0.6, 0.4];

/// An edge on a surface, with how far its middle lies from that and the place there.
pub(super) struct Sag {
    pub(super) ends: [u32; 2],
    pub(super) off: f64,
    pub(super) length: f64,
    pub(super) middle: D3,
    pub(super) target: D3,
}

impl Work<'_> {
    /// Splits the edges on surfaces whose middles lie far from these, worst first.
    pub(in super::super) fn split_far(&mut self, size: &SizeField, finest: f64) {
        for _ in 0..ROUNDS {
            let mut far = self.far_edges(size, finest);
            far.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.ends.cmp(&y.1.ends)));
            far.truncate((MOST * self.count() as f64).ceil() as usize);
            let before = self.count();
            far.iter().for_each(|(_, sag)| self.split(sag));
            if self.count() == before {
                break;
            }
        }
    }

    /// Far edges, with how far their middles are over how far they may be.
    fn far_edges(&self, size: &SizeField, finest: f64) -> Vec<(f64, Sag)> {
        let mut all = Vec::new();
        self.each_sag(|sag| {
            let most = (FAR * size.edge(sag.middle, finest)).max(LEAST * self.fields.step);
            if sag.off > most {
                all.push((sag.off / most, sag));
            }
        });
        all
    }

    /// Calls `found` for each edge on a single surface whose place there can be told.
    pub(super) fn each_sag(&self, mut found: impl FnMut(Sag)) {
        let mut near: Vec<u32> = Vec::new();
        for v in (0..self.points.len() as u32).filter(|&v| self.masks[v as usize].count() > 1) {
            near.clear();
            let star = self.stars[v as usize].iter().flat_map(|&t| self.tets[t as usize]);
            near.extend(star.filter(|&w| w > v));
            near.sort_unstable();
            near.dedup();
            near.iter().filter_map(|&w| self.sag_of([v, w])).for_each(&mut found);
        }
    }

    fn sag_of(&self, ends: [u32; 2]) -> Option<Sag> {
        let [v, w] = ends.map(|v| v as usize);
        let Freedom::Surface(pair) = Freedom::of(self.masks[v] & self.masks[w]) else { return None };
        let (p, q) = (self.points[v], self.points[w]);
        let (middle, length) = (scale(add(p, q), 0.5), distance(p, q));
        let target = self.project(pair, middle, 0.5 * length)?;
        Some(Sag { ends, off: distance(middle, target), length, middle, target })
    }

    /// The elements around an edge between two labels, or a label and the outside.
    pub(super) fn ring_on_surface(&self, [a, b]: [u32; 2]) -> Option<Ring> {
        let ring = Ring::new(self, a, b)?;
        let label = |&t: &u32| self.labels[t as usize];
        let tets = &ring.tets[..ring.len];
        (!ring.closed || tets.iter().any(|t| label(t) != label(&tets[0]))).then_some(ring)
    }

    fn split(&mut self, sag: &Sag) {
        let Some(ring) = self.ring_on_surface(sag.ends) else { return };
        let tets = &ring.tets[..ring.len];
        let place = |way: f64| -> D3 { add(scale(sag.middle, 1.0 - way), scale(sag.target, way)) };
        let floor = tets.iter().map(|&t| self.quality[t as usize]).fold(FLOOR, f64::min);
        let new = self.add_point_on(&ring, sag.middle);
        for way in WAYS {
            self.points[new as usize] = place(way);
            let halves = tets.iter().flat_map(|&t| self.halves(t, sag.ends, new));
            if halves.into_iter().all(|h| self.worth(h) > floor) {
                return self.apply_split(&ring, new);
            }
        }
        self.drop_last_point();
    }

    fn halves(&self, t: u32, ends: [u32; 2], new: u32) -> [[u32; 4]; 2] {
        let tet = self.tets[t as usize];
        ends.map(|e| tet.map(|v| if v == e { new } else { v }))
    }

    /// A point for [`Work::apply_split`], without elements yet.
    pub(super) fn add_point_on(&mut self, ring: &Ring, at: D3) -> u32 {
        self.add_point(at, if ring.closed { Mask::default() } else { Mask::OUTSIDE })
    }

    /// Halves the elements around an edge at a new point.
    pub(super) fn apply_split(&mut self, ring: &Ring, new: u32) {
        for &t in &ring.tets[..ring.len] {
            let (label, halves) = (self.labels[t as usize], self.halves(t, ring.ends, new));
            self.remove(t);
            halves.into_iter().for_each(|h| {
                self.insert(h, label);
            });
        }
        self.refresh_mask(new);
    }
}
