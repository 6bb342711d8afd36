//! Putting what lies far from its surface there, and letting its neighbours get out of the way.
//!
//! A point that a repair or a last resort has left off its surface is mostly held by neighbours that would each have to
//! move a little; so is the middle of an edge that cuts a corner. Here it is moved first, whatever becomes of the elements,
//! then these are bettered, and all is taken back where they do not become good.

use super::RESORT;
use super::split::Sag;
use super::work::Work;
use monro_geometry::d3::{D3, add, scale, sub};

/// Points further off than this part of a cell of the fields, and than that part of the mean edge around them, are moved;
const FAR_POINT: [f64; 2] = [0.5, 0.15];
/// edges are split whose middle is further off than this part of a cell, and than that part of their length.
const FAR_MIDDLE: [f64; 2] = [0.7, 0.2];
/// Parts of the way, the first with good elements in the end; those for new points.
const WAYS: [f64; 4] = [1.0, 0.6, 0.3, 0.15];
const NEW_WAYS: [f64; 3] = [1.0, 0.6, 0.3];
/// Rounds of bettering what is around at most; one that gains less than this is the last.
const ROUNDS: usize = 10;
const GAIN: f64 = 0.01;

/// Points around a place.
struct Patch {
    /// Of the elements that change.
    near: Vec<u32>,
    /// These and their neighbours, and where they were.
    points: Vec<u32>,
    before: Vec<D3>,
    /// Elements may become as bad as this.
    floor: f64,
}

impl Work<'_> {
    /// Moves far points to their surfaces, the farthest first.
    pub(super) fn pull_points(&mut self) {
        let mut points: Vec<(f64, u32)> = (0..self.points.len() as u32)
            .filter(|&v| self.masks[v as usize].count() > 1 && !self.stars[v as usize].is_empty())
            .filter_map(|v| {
                let off = self.off(v)?;
                (off.way > (FAR_POINT[0] * self.fields.step).max(FAR_POINT[1] * off.edge)).then_some((off.way, v))
            })
            .collect();
        points.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        for (_, v) in points {
            // One before may have moved it.
            if let Some(off) = self.off(v) {
                let _pulled = WAYS.into_iter().any(|way| self.pull_point(v, off.place, way));
            }
        }
    }

    /// Splits edges that cut a corner of their surface, the worst first, with the new point there.
    pub(super) fn pull_middles(&mut self) {
        let mut edges = Vec::new();
        self.each_sag(|sag| {
            if sag.off > (FAR_MIDDLE[0] * self.fields.step).max(FAR_MIDDLE[1] * sag.length) {
                edges.push(sag);
            }
        });
        edges.sort_by(|x, y| y.off.total_cmp(&x.off).then(x.ends.cmp(&y.ends)));
        for sag in &edges {
            let _pulled = NEW_WAYS.into_iter().any(|way| self.pull_middle(sag, way));
        }
    }

    fn pull_point(&mut self, v: u32, place: D3, way: f64) -> bool {
        let patch = self.patch(&[v]);
        let from = self.points[v as usize];
        self.put(v, add(from, scale(sub(place, from), way)));
        self.settle(&patch)
    }

    fn pull_middle(&mut self, sag: &Sag, way: f64) -> bool {
        let Some(ring) = self.ring_on_surface(sag.ends) else { return false };
        let tets = &ring.tets[..ring.len];
        let old: Vec<([u32; 4], u8)> = tets.iter().map(|&t| (self.tets[t as usize], self.labels[t as usize])).collect();
        let mut patch = self.patch(&sag.ends);
        let new = self.add_point_on(&ring, add(sag.middle, scale(sub(sag.target, sag.middle), way)));
        self.apply_split(&ring, new);
        patch.near.push(new);
        if self.settle(&patch) {
            return true;
        }
        while let Some(&t) = self.stars[new as usize].first() {
            self.remove(t);
        }
        self.drop_last_point();
        old.into_iter().for_each(|(tet, label)| {
            self.insert(tet, label);
        });
        false
    }

    /// What may move when some points do.
    fn patch(&self, centre: &[u32]) -> Patch {
        let near = self.with_neighbours(centre);
        let points = self.with_neighbours(&near);
        let before = points.iter().map(|&w| self.points[w as usize]).collect();
        let floor = points.iter().map(|&w| self.worst_around(w)).fold(RESORT, f64::min);
        Patch { near, points, before, floor }
    }

    fn with_neighbours(&self, points: &[u32]) -> Vec<u32> {
        let around = points.iter().flat_map(|&v| self.stars[v as usize].iter());
        let mut all: Vec<u32> = around.flat_map(|&t| self.tets[t as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Betters the bad elements of a patch; where they do not become good enough, all its points go back.
    fn settle(&mut self, patch: &Patch) -> bool {
        let mut last = f64::NEG_INFINITY;
        for _ in 0..ROUNDS {
            for &w in patch.near.iter().chain(&patch.points) {
                if self.worst_around(w) < patch.floor {
                    self.relax(w);
                }
            }
            // A new point shares each of its elements with these.
            let worst = patch.points.iter().map(|&w| self.worst_around(w)).fold(f64::INFINITY, f64::min);
            if worst >= patch.floor {
                return true;
            }
            if worst < last + GAIN {
                break;
            }
            last = worst;
        }
        patch.points.iter().zip(&patch.before).for_each(|(&w, &p)| self.put(w, p));
        false
    }

    /// Puts a point somewhere, whatever becomes of its elements.
    fn put(&mut self, v: u32, p: D3) {
        self.points[v as usize] = p;
        for i in 0..self.stars[v as usize].len() {
            let t = self.stars[v as usize][i] as usize;
            self.quality[t] = self.worth(self.tets[t]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tetra::MeshOptions;
    use crate::tetra::fields::LabelFields;
    use crate::tetra::size::SizeField;
    use crate::tetra::start::to_count;
    use monro_geometry::d3::distance;
    use monro_geometry::{Grid, Volume};

    /// A ball of 12 mm in voxels of 1 mm.
    fn ball() -> (LabelFields, MeshOptions) {
        let grid = Grid::axis_aligned([32; 3], [1.0; 3], [-15.5; 3]).expect("grid");
        let inside = |at: usize| {
            let [i, j, k] = grid.voxel(at);
            u8::from(grid.centre(i, j, k).to_array().iter().map(|x| x * x).sum::<f64>() < 144.0)
        };
        let labels = Volume::new(grid, (0..grid.len()).map(inside).collect()).expect("count");
        (LabelFields::new(&labels, &[1]).expect("a ball"), MeshOptions::new(&[1], &[], 3000))
    }

    fn work<'a>(fields: &'a LabelFields, options: &MeshOptions) -> Work<'a> {
        let size = SizeField::new(fields, &[], options).expect("size");
        let mut work = Work::new(to_count(fields, &size, options.elements, 1.0).expect("elements").raw, fields);
        work.improve();
        work
    }

    /// Elements that are there, in order, with the places of their corners.
    fn elements(work: &Work<'_>) -> Vec<([u32; 4], [D3; 4], f64)> {
        let alive = (0..work.tets.len()).filter(|&t| work.is_alive(t as u32));
        let mut all: Vec<_> = alive.map(|t| (work.tets[t], work.corners(work.tets[t]), work.quality[t])).collect();
        all.sort_by_key(|e| e.0);
        all
    }

    #[test]
    fn a_point_that_its_neighbours_held_off_its_surface_stayed_there() {
        let (fields, options) = ball();
        let mut work = work(&fields, &options);
        let outer = |work: &Work<'_>| -> Vec<u32> {
            (0..work.points.len() as u32)
                .filter(|&v| work.masks[v as usize].count() > 1 && !work.stars[v as usize].is_empty())
                .collect()
        };
        let worst = work.quality.iter().zip(&work.labels).filter(|q| *q.1 != super::super::work::DEAD);
        let worst = worst.map(|q| *q.0).fold(RESORT, f64::min);
        // Some 0.9 mm inwards, a point and all that are around it on the surface.
        let dent: Vec<u32> = {
            let first = outer(&work)[0];
            work.with_neighbours(&[first]).into_iter().filter(|&w| work.masks[w as usize].count() > 1).collect()
        };
        for &v in &dent {
            let p = work.points[v as usize];
            work.put(v, scale(p, 1.0 - 0.9 / distance(p, [0.0; 3])));
        }
        let far =
            |work: &Work<'_>| outer(work).iter().filter_map(|&v| work.off(v)).map(|off| off.way).fold(0.0, f64::max);
        assert!(far(&work) > 0.8, "{}", far(&work));
        work.pull_points();
        assert!(far(&work) < 0.6, "{}", far(&work));
        let after = outer(&work).iter().map(|&v| work.worst_around(v)).fold(f64::INFINITY, f64::min);
        assert!(after >= worst - 1e-12, "{after} {worst}");
    }

    #[test]
    fn what_cannot_be_pulled_leaves_the_mesh_as_it_was() {
        let (fields, options) = ball();
        let mut work = work(&fields, &options);
        let mut edges = Vec::new();
        work.each_sag(|sag| edges.push(sag));
        let mut refused = 0;
        for sag in edges.iter().step_by(10) {
            let (before, points) = (elements(&work), work.points.len());
            if !work.pull_middle(sag, 1.0) {
                refused += 1;
                assert_eq!((elements(&work), work.points.len()), (before, points));
            }
        }
        assert!(refused > 0, "{refused} of {}", edges.len());
        let before = elements(&work);
        let mut patch = work.patch(&edges[0].ends);
        patch.floor = 2.0;
        work.put(edges[0].ends[0], [0.0, 0.0, 200.0]);
        assert!(!work.settle(&patch));
        assert_eq!(elements(&work), before);
    }
}
