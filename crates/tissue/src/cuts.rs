//! Where a mesh is cut into slabs, so that threads have as much to do.
//!
//! Cuts go across an order of the vertices: along one of the axes, or by layers of edges from the middle of an axis. A slab
//! must be so thick that no vertex has neighbours on both sides of it; each order is cut into more and fewer slabs of equal
//! work, and the cuts that let threads finish first win. Meshes that are fine in one place and coarse elsewhere have few
//! layers with most of the work in two of them: these are cut well along an axis or not at all.

use crate::fast::span;
use crate::slabs::{ends, lent};
use monro_geometry::by_point;

/// Vertices that a slab should have at least: below that threads wait more than they work.
const LEAST: usize = 200;
/// Numbers of slabs that are tried.
const COUNTS: [usize; 12] = [2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32, 64];
/// How much less than its share of the work a slab begins with, over the number of slabs.
const SPARE: f64 = 0.25;
/// Elements around vertices that a part costs beside its own: its last batches of vertices are not full.
const BESIDE: usize = 600;
/// Numbers of threads that the cuts are weighed for, and how much: most machines that guide have few cores to spare.
const THREADS: [(usize, usize); 3] = [(2, 4), (4, 2), (8, 1)];

/// Slab of each vertex. `held` tells which vertices never move: they are no work.
pub(crate) fn slabs(points: &[[f64; 3]], tets: &[[u32; 4]], held: &[bool]) -> Vec<u32> {
    let ring = Rings::new(points.len(), tets, held);
    let along: Vec<Vec<f64>> = (0..3).map(|a| points.iter().map(|p| p[a]).collect()).collect();
    let both_ways: Vec<Vec<f64>> = along.iter().map(|height| ring.both_ways(height)).collect();
    let ways: Vec<Way> = along.iter().chain(&both_ways).map(|height| Way::new(height, &ring)).collect();
    let mut best = (usize::MAX, &ways[0], Vec::new());
    for way in &ways {
        for count in COUNTS.into_iter().filter(|&c| c == COUNTS[0] || points.len() / c >= LEAST) {
            let cuts = way.cuts(count);
            let cost = way.cost(&cuts);
            if cost < best.0 {
                best = (cost, way, cuts);
            }
        }
    }
    let (_, way, cuts) = best;
    way.position.iter().map(|&p| cuts.partition_point(|&c| c <= p) as u32).collect()
}

/// What is around each vertex.
struct Rings {
    /// Start of each vertex's neighbours, and these in order, with repetitions: three for each element.
    start: Vec<u32>,
    near: Vec<u32>,
    /// Elements around each vertex that moves.
    work: Vec<usize>,
}

impl Rings {
    fn new(vertices: usize, tets: &[[u32; 4]], held: &[bool]) -> Self {
        let (start, near) = neighbours(vertices, tets);
        let work = |v: usize| if held[v] { 0 } else { (start[v + 1] - start[v]) as usize / 3 };
        let work = (0..vertices).map(work).collect();
        Self { start, near, work }
    }

    /// Layers on both sides of the plane with half of the work on each: edges to the nearest vertex that has neighbours
    /// across it, negative below.
    fn both_ways(&self, height: &[f64]) -> Vec<f64> {
        let order = order(height);
        let sums = order.iter().scan(0, |sum, &v| {
            *sum += self.work[v as usize];
            Some(*sum)
        });
        let half = self.work.iter().sum::<usize>() / 2;
        let middle = sums.take_while(|&s| s < half).count();
        let mut above = vec![true; order.len()];
        order[..middle].iter().for_each(|&v| above[v as usize] = false);
        // Pieces that do not reach the plane are the last layer.
        let mut layer = vec![u32::MAX; order.len()];
        let across = |&v: &u32| self.around(v as usize).any(|n| above[n] != above[v as usize]);
        let mut queue: Vec<u32> = order.iter().copied().filter(across).collect();
        queue.iter().for_each(|&v| layer[v as usize] = 1);
        let mut next = 0;
        while next < queue.len() {
            let v = queue[next] as usize;
            next += 1;
            for n in self.around(v) {
                if layer[n] == u32::MAX {
                    layer[n] = layer[v] + 1;
                    queue.push(n as u32);
                }
            }
        }
        layer.iter().zip(&above).map(|(&l, &above)| if above { f64::from(l) } else { -f64::from(l) }).collect()
    }

    /// A vertex and its neighbours.
    fn around(&self, v: usize) -> impl Iterator<Item = usize> + '_ {
        let near = &self.near[self.start[v] as usize..self.start[v + 1] as usize];
        near.iter().map(|&n| n as usize).chain([v])
    }
}

/// An order of the vertices that can be cut.
struct Way {
    /// Place of each vertex in the order.
    position: Vec<u32>,
    /// For a cut before each place: the first place where the next may be, and the work of the vertices that begin before,
    /// and of those that end before.
    next: Vec<u32>,
    work: Vec<usize>,
    ended: Vec<usize>,
}

impl Way {
    fn new(height: &[f64], rings: &Rings) -> Self {
        let vertices = height.len();
        let order = order(height);
        let mut position = vec![0u32; vertices];
        (0..).zip(&order).for_each(|(place, &v)| position[v as usize] = place);
        let (mut next, mut work) = (vec![0u32; vertices + 1], vec![0; vertices + 1]);
        let mut ended = work.clone();
        for v in 0..vertices {
            let ends = ends(rings.around(v).map(|n| position[n]));
            // Whoever begins before a cut must end before the next.
            let after = ends.0 as usize + 1;
            next[after] = next[after].max(ends.1 + 1);
            work[after] += rings.work[v];
            ended[ends.1 as usize + 1] += rings.work[v];
        }
        for place in 0..vertices {
            next[place + 1] = next[place + 1].max(next[place]);
            work[place + 1] += work[place];
            ended[place + 1] += ended[place];
        }
        Self { position, next, work, ended }
    }

    fn end(&self) -> usize {
        self.position.len()
    }

    /// Cuts into at most so many slabs of equal work, but for the last, which has somewhat more: work may go to the slab
    /// before (see [`crate::slabs::lent`]), not to the one after.
    fn cuts(&self, count: usize) -> Vec<u32> {
        let even = self.work[self.end()] as f64 / count as f64;
        let share = (even * (1.0 - SPARE / count as f64)).ceil().max(1.0) as usize;
        let (mut cuts, mut last) = (Vec::new(), 0);
        loop {
            let enough = self.work.partition_point(|&w| w < self.work[last] + share);
            let place = enough.max(self.next[last] as usize);
            // What is left must make a slab of its own.
            let left = self.work[self.end()] - self.work[place.min(self.end())];
            if 2 * left < share || self.next[place] as usize >= self.end() {
                return cuts;
            }
            cuts.push(place as u32);
            last = place;
        }
    }

    /// How long the threads take with these cuts, over all numbers of threads.
    fn cost(&self, cuts: &[u32]) -> usize {
        let ends: Vec<usize> = [0].into_iter().chain(cuts.iter().map(|&c| c as usize)).chain([self.end()]).collect();
        let begins: Vec<usize> = ends.windows(2).map(|e| self.work[e[1]] - self.work[e[0]]).collect();
        let within: Vec<usize> = ends.windows(2).map(|e| self.ended[e[1]].saturating_sub(self.work[e[0]])).collect();
        let lent = lent(&begins, &within);
        let own = |s: usize| begins[s] - lent[s] + lent.get(s + 1).copied().unwrap_or(0) + BESIDE;
        let slabs: Vec<usize> = (0..begins.len()).map(own).collect();
        let rounds = [0, 1].map(|first| slabs.iter().copied().skip(first).step_by(2).collect::<Vec<usize>>());
        let span = |threads: usize| span([&rounds[0], &rounds[1]], threads);
        THREADS.iter().map(|&(threads, much)| much * threads * span(threads)).sum()
    }
}

/// Vertices from the lowest to the highest.
fn order(height: &[f64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..height.len() as u32).collect();
    order.sort_by(|&a, &b| height[a as usize].total_cmp(&height[b as usize]).then(a.cmp(&b)));
    order
}

/// Other corners of the elements around each vertex, with repetitions.
fn neighbours(vertices: usize, tets: &[[u32; 4]]) -> (Vec<u32>, Vec<u32>) {
    let pairs = tets.iter().flat_map(|tet| tet.iter().flat_map(|&v| tet.iter().map(move |&n| (v, n))));
    by_point(pairs.filter(|(v, n)| v != n), vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;
    use crate::slabs::Slabs;
    use monro_geometry::TetMesh;

    fn cut(mesh: &TetMesh, held: &[bool]) -> Vec<u32> {
        let points: Vec<[f64; 3]> = mesh.vertices.iter().map(|p| p.to_array()).collect();
        slabs(&points, &mesh.tets, held)
    }

    /// Elements around the vertices that begin in each slab, after a check that no vertex has neighbours in three slabs.
    fn work(mesh: &TetMesh, slab: &[u32], held: &[bool]) -> Vec<usize> {
        let rings = Rings::new(slab.len(), &mesh.tets, held);
        let mut work = vec![0; *slab.iter().max().expect("vertices") as usize + 1];
        for v in 0..slab.len() {
            let ends = ends(rings.around(v).map(|n| slab[n]));
            assert!(ends.1 - ends.0 <= 1, "{v}: {ends:?}");
            work[ends.0 as usize] += rings.work[v];
        }
        work
    }

    #[test]
    fn elements_and_pairs_of_them_lie_within_two_slabs_that_follow_each_other() {
        for (cells, least) in [([40, 12, 12], 5), ([3, 2, 60], 1), ([1, 1, 1], 1)] {
            let mesh = block(cells, 2.0);
            let held = vec![false; mesh.vertices.len()];
            let work = work(&mesh, &cut(&mesh, &held), &held);
            assert!(work.len() >= least, "{work:?}");
        }
    }

    #[test]
    fn neither_of_two_threads_waits_where_most_vertices_are_held() {
        let mesh = block([48, 14, 14], 1.0);
        let held: Vec<bool> = mesh.vertices.iter().map(|p| p.x < 30.0).collect();
        let slab = cut(&mesh, &held);
        work(&mesh, &slab, &held);
        let mut order: Vec<usize> = (0..slab.len()).collect();
        order.sort_by_key(|&v| slab[v]);
        let mut place = vec![0; slab.len()];
        (0..).zip(&order).for_each(|(i, &v)| place[v] = i);
        let slabs = Slabs::new(&order.iter().map(|&v| slab[v]).collect::<Vec<_>>());
        let rings = Rings::new(slab.len(), &mesh.tets, &held);
        let ends = |v: usize| ends(rings.around(v).map(|n| place[n]));
        let items: Vec<_> = (0..slab.len()).map(|v| (ends(v).0, ends(v).1, rings.work[v])).collect();
        let mut shares = vec![0; slabs.len()];
        items.iter().zip(slabs.shares(&items)).for_each(|(item, share)| shares[share] += item.2);
        let [even, odd] = [0, 1].map(|first| shares.iter().copied().skip(first).step_by(2).collect::<Vec<_>>());
        let (span, all) = (span([&even, &odd], 2), shares.iter().sum::<usize>());
        assert!(span as f64 <= 0.53 * all as f64, "{span} of {all}: {even:?} {odd:?}");
    }

    #[test]
    fn separate_pieces_are_cut_too() {
        let mut mesh = block([20, 8, 8], 1.0);
        let (n, tets) = (mesh.vertices.len() as u32, mesh.tets.clone());
        mesh.vertices.extend_from_within(..);
        mesh.vertices[n as usize..].iter_mut().for_each(|p| p.x += 100.0);
        mesh.tets.extend(tets.iter().map(|t| t.map(|v| v + n)));
        let held = vec![false; mesh.vertices.len()];
        let work = work(&mesh, &cut(&mesh, &held), &held);
        assert!(work.len() > 3 && work.iter().all(|&w| w < tets.len() * 4), "{work:?}");
    }
}
