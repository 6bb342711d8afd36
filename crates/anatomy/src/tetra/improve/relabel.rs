//! Giving a bad element on a surface to the other side of it, or to the outside.
//!
//! An element with all corners on surfaces has little to gain from moving them. On the other side of its surface it may be
//! flipped away like any other, and a flat one changes neither the shape nor the volume of the labels to speak of.

use super::super::adjacency::{EDGES, FACES};
use super::mask::Mask;
use super::work::Work;
use monro_geometry::d3::{D3, cross, distance, dot, norm, sub};

/// What is on the other side of a face.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Label(u8),
    Outside,
}

/// A part of space.
#[derive(Debug, Clone, Copy)]
enum Region {
    Of(Side),
    AllBut(Side),
}

impl Region {
    fn holds(self, side: Side) -> bool {
        match self {
            Self::Of(s) => s == side,
            Self::AllBut(s) => s != side,
        }
    }
}

impl Work<'_> {
    /// Relabels elements below `bar`, no thicker than `thin` of their longest edges, where the surfaces stay two-manifold of the
    /// same topology and the worst element around gets better by it.
    pub(super) fn relabel_worst(&mut self, bar: f64, thin: f64) {
        for t in self.below(bar) {
            if self.is_alive(t) && self.quality[t as usize] < bar {
                self.relabel(t, thin);
            }
        }
    }

    fn relabel(&mut self, t: u32, thin: f64) -> bool {
        let own = self.labels[t as usize];
        let sides = [0, 1, 2, 3].map(|i| self.behind(t, i));
        let mut others: Vec<Side> = sides.into_iter().filter(|&s| s != Side::Label(own)).collect();
        others.dedup();
        // One neighbour besides its own label.
        if others.is_empty() || others.iter().any(|&s| s != others[0]) {
            return false;
        }
        let regions = [Side::Label(own), others[0]].into_iter().flat_map(|s| [Region::Of(s), Region::AllBut(s)]);
        if !regions.into_iter().all(|r| self.meets_in_a_disk(t, r, sides)) {
            return false;
        }
        if thickness(self.corners(self.tets[t as usize]), sides.map(|s| s == others[0])) > thin {
            return false;
        }
        match others[0] {
            Side::Outside => self.drop_outer(t),
            Side::Label(to) => self.try_label(t, to),
        }
    }

    /// What lies behind the face of `t` opposite to its corner `i`.
    fn behind(&self, t: u32, i: usize) -> Side {
        let tet = self.tets[t as usize];
        let [p, q, r] = FACES[i].map(|k| tet[k]);
        let holds = |&x: &u32| x != t && [q, r].iter().all(|v| self.tets[x as usize].contains(v));
        let other = self.stars[p as usize].iter().copied().find(holds);
        other.map_or(Side::Outside, |x| Side::Label(self.labels[x as usize]))
    }

    /// Whether the rest of a region touches `t` in one to three faces and nowhere else: then the region keeps its
    /// topology with and without `t`.
    fn meets_in_a_disk(&self, t: u32, region: Region, sides: [Side; 4]) -> bool {
        let tet = self.tets[t as usize];
        let shared = || (0..4).filter(|&i| region.holds(sides[i]));
        let count = shared().count();
        let corner_in = |k: usize| shared().any(|i| i != k);
        let edge_in = |e: [usize; 2]| shared().any(|i| !e.contains(&i));
        (1..=3).contains(&count)
            && (0..4).all(|k| corner_in(k) || !self.touches(t, region, &[tet[k]]))
            && EDGES.into_iter().all(|e| edge_in(e) || !self.touches(t, region, &e.map(|k| tet[k])))
    }

    /// Whether a region without `t` holds a corner or an edge.
    fn touches(&self, t: u32, region: Region, simplex: &[u32]) -> bool {
        let around = || self.stars[simplex[0] as usize].iter().copied();
        let holds = |x: u32| simplex.iter().all(|v| self.tets[x as usize].contains(v));
        let label = |x: u32| Side::Label(self.labels[x as usize]);
        around().any(|x| x != t && region.holds(label(x)) && holds(x))
            || (region.holds(Side::Outside) && around().any(|x| holds(x) && self.opens_at(x, simplex)))
    }

    /// Whether an element has an outer face with all of a simplex.
    fn opens_at(&self, t: u32, simplex: &[u32]) -> bool {
        let tet = self.tets[t as usize];
        (0..4).any(|i| !simplex.contains(&tet[i]) && self.behind(t, i) == Side::Outside)
    }

    /// Takes away an element at the outer surface.
    fn drop_outer(&mut self, t: u32) -> bool {
        let tet = self.tets[t as usize];
        self.remove(t);
        for v in tet {
            self.masks[v as usize] |= Mask::OUTSIDE;
            self.refresh_mask(v);
        }
        true
    }

    /// Gives `t` to another label if something can then be done about it.
    fn try_label(&mut self, t: u32, to: u8) -> bool {
        let own = std::mem::replace(&mut self.labels[t as usize], to);
        let tet = self.tets[t as usize];
        let before = tet.map(|v| (self.points[v as usize], self.lift[v as usize]));
        tet.into_iter().for_each(|v| self.refresh_mask(v));
        let quality = self.quality[t as usize];
        let better = EDGES.into_iter().any(|[i, j]| self.remove_edge(tet[i], tet[j]))
            || (0..4).any(|i| self.swap_face(t, i))
            || tet.into_iter().any(|v| self.relax(v) && self.quality[t as usize] > quality);
        if !better {
            // What moved had a freedom that came of the label that is not to be.
            for (v, (place, _)) in tet.into_iter().zip(before).rev() {
                if self.points[v as usize] != place {
                    self.try_move(v, place, f64::NEG_INFINITY);
                }
            }
            self.labels[t as usize] = own;
            for (v, (_, lift)) in tet.into_iter().zip(before) {
                self.refresh_mask(v);
                self.lift[v as usize] = lift;
            }
        }
        better
    }
}

/// How far a surface moves at most where an element passes from one side of it to the other, over the element's longest edge:
/// between its faces `on` the surface, one to three, and the others. Faces are numbered by their opposite corners.
fn thickness(c: [D3; 4], on: [bool; 4]) -> f64 {
    let pick = |side: bool| (0..4).filter(|&i| on[i] == side).collect::<Vec<usize>>();
    // Between a face and its opposite corner, or between two edges.
    let across = match (&pick(true)[..], &pick(false)[..]) {
        (&[face], _) | (_, &[face]) => {
            let [p, q, r] = FACES[face].map(|k| c[k]);
            cross(sub(q, p), sub(r, p))
        }
        (&[a, b], &[d, e]) => cross(sub(c[a], c[b]), sub(c[d], c[e])),
        _ => return 0.0,
    };
    let heights = c.map(|p| dot(sub(p, c[0]), across));
    let most = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let longest = EDGES.map(|[i, j]| distance(c[i], c[j])).into_iter().fold(0.0, f64::max);
    (most - least) / (norm(across) * longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corner_of_a_cube_is_as_thick_as_its_height_or_as_its_edges_are_apart() {
        let c = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let height = 1.0 / 3f64.sqrt();
        for (on, wanted) in [
            ([true, false, false, false], height),
            ([false, true, true, true], height),
            ([true, false, true, true], 1.0),
            ([true, true, false, false], 0.5f64.sqrt()),
        ] {
            assert!((thickness(c, on) - wanted / 2f64.sqrt()).abs() < 1e-12, "{on:?}");
        }
    }
}
