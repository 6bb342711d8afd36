//! Slabs of a mesh: the parts that threads work on at the same time.
//!
//! Vertices are layered by their distance along edges from one end of the mesh, and runs of layers make slabs. Neighbours
//! are at most one layer apart, so with two layers or more in a slab everything that an element, or two elements with a
//! common edge, holds together lies in one slab or in two that follow each other. All that begins in an even slab can then
//! be done at once, slab by slab, and after it all that begins in an odd one: two rounds in a sweep, however many threads,
//! and the same result for any number of them.

use crate::fast::Plans;

/// Vertices that a slab should have at least: below that threads wait more than they work.
const LEAST: usize = 200;
/// Slabs at most.
const MOST: usize = 32;
/// Vertices of two slabs at most: places within them have 16 bits.
const FIT: usize = 1 << 16;

/// Slabs of the vertices of a model, whose order follows them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Slabs {
    /// First vertex of each slab, and at the end the number of vertices.
    pub(crate) starts: Vec<usize>,
}

/// A round of a sweep: parts that can be done at the same time.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Round {
    /// First vertex of each part, and at the end where the last one ends.
    pub(crate) cuts: Vec<usize>,
    /// Which thread begins with which part.
    pub(crate) plans: Plans,
}

/// Pieces that work without any order is cut into: enough for all threads, each worth the while.
pub(crate) const PIECES: usize = 16;

/// Cuts of `count` entries into at most [`PIECES`] equal pieces.
pub(crate) fn even_cuts(count: usize) -> Vec<usize> {
    let pieces = PIECES.min(count.div_ceil(64)).max(1);
    (0..=pieces).map(|i| count * i / pieces).collect()
}

/// The pieces of `data` between the cuts, for threads that have no other part of it.
pub(crate) fn split<'a, T>(mut data: &'a mut [T], cuts: &[usize]) -> [&'a mut [T]; PIECES] {
    core::array::from_fn(|i| {
        let length = if i + 1 < cuts.len() { cuts[i + 1] - cuts[i] } else { 0 };
        let (piece, rest) = core::mem::take(&mut data).split_at_mut(length);
        data = rest;
        piece
    })
}

/// Slab of each vertex.
pub(crate) fn of_vertices(vertices: usize, tets: &[[u32; 4]]) -> Vec<u32> {
    let layers = layers(vertices, tets);
    let mut sizes = vec![0usize; layers.iter().map(|&l| l as usize + 1).max().unwrap_or(0)];
    layers.iter().for_each(|&l| sizes[l as usize] += 1);
    let wanted = (vertices / MOST).max(LEAST);
    let (mut slab_of, mut slab, mut held, mut depth) = (Vec::with_capacity(sizes.len()), 0, 0, 0);
    for (i, &size) in sizes.iter().enumerate() {
        slab_of.push(slab);
        (held, depth) = (held + size, depth + 1);
        // What is left must make a slab of its own.
        let left: usize = sizes[i + 1..].iter().sum();
        if depth >= 2 && held >= wanted && left >= wanted && sizes.len() - i > 2 {
            (slab, held, depth) = (slab + 1, 0, 0);
        }
    }
    layers.iter().map(|&l| slab_of[l as usize]).collect()
}

/// Layer of each vertex: edges to it from the first vertex of its piece of the mesh, which lies at an end.
fn layers(vertices: usize, tets: &[[u32; 4]]) -> Vec<u32> {
    let (start, near) = neighbours(vertices, tets);
    let mut layer = vec![u32::MAX; vertices];
    let mut queue = Vec::with_capacity(vertices);
    for seed in 0..vertices {
        if layer[seed] == u32::MAX {
            // The vertex found last is far from the first: an end. Once more from there finds the other end.
            let mut end = seed as u32;
            for _ in 0..2 {
                spread(end, &start, &near, &mut layer, &mut queue);
                end = *queue.last().unwrap_or(&end);
                queue.iter().for_each(|&v| layer[v as usize] = u32::MAX);
            }
            spread(end, &start, &near, &mut layer, &mut queue);
        }
    }
    layer
}

fn spread(from: u32, start: &[u32], near: &[u32], layer: &mut [u32], queue: &mut Vec<u32>) {
    queue.clear();
    queue.push(from);
    layer[from as usize] = 0;
    let mut next = 0;
    while next < queue.len() {
        let v = queue[next] as usize;
        next += 1;
        for &n in &near[start[v] as usize..start[v + 1] as usize] {
            if layer[n as usize] == u32::MAX {
                layer[n as usize] = layer[v] + 1;
                queue.push(n);
            }
        }
    }
}

/// Other corners of the elements around each vertex, with repetitions.
fn neighbours(vertices: usize, tets: &[[u32; 4]]) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; vertices + 1];
    tets.iter().flatten().for_each(|&v| start[v as usize + 1] += 3);
    for v in 0..vertices {
        start[v + 1] += start[v];
    }
    let (mut fill, mut near) = (start.clone(), vec![0u32; tets.len() * 12]);
    for tet in tets {
        for &v in tet {
            for &n in tet.iter().filter(|&&n| n != v) {
                near[fill[v as usize] as usize] = n;
                fill[v as usize] += 1;
            }
        }
    }
    (start, near)
}

impl Slabs {
    /// From the slab of each vertex, which must not fall along the order of the vertices. Slabs too full for 16 bits make
    /// rounds of one part impossible; see [`Slabs::fit`].
    pub(crate) fn new(slab_of: &[u32]) -> Self {
        debug_assert!(slab_of.is_sorted(), "vertices are ordered by slab");
        let count = slab_of.last().map_or(0, |&s| s as usize + 1);
        let mut starts: Vec<usize> = (0..count).map(|s| slab_of.partition_point(|&o| (o as usize) < s)).collect();
        starts.push(slab_of.len());
        Self { starts }
    }

    /// Number of slabs.
    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Slab of a vertex.
    pub(crate) fn of(&self, vertex: u32) -> usize {
        self.starts.partition_point(|&s| s <= vertex as usize) - 1
    }

    /// The largest number of vertices in two slabs that follow each other, if more than fit.
    pub(crate) fn too_full(&self) -> Option<usize> {
        let pairs = (0..self.len()).map(|s| self.starts[(s + 2).min(self.len())] - self.starts[s]);
        pairs.max().filter(|&n| n > FIT)
    }

    /// The two rounds of a sweep: parts of two slabs each, from an even slab on and from an odd one.
    pub(crate) fn rounds(&self) -> [Round; 2] {
        [0, 1].map(|first| {
            let mut cuts: Vec<usize> = self.starts.iter().skip(first).step_by(2).copied().collect();
            let end = self.starts.last().copied().unwrap_or(0);
            if cuts.last().is_some_and(|&c| c < end) {
                cuts.push(end);
            }
            let weights: Vec<usize> = cuts.windows(2).map(|c| c[1] - c[0]).collect();
            Round { cuts, plans: Plans::new(&weights) }
        })
    }
}

impl Round {
    /// Number of parts.
    pub(crate) fn parts(&self) -> usize {
        self.cuts.len().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn elements_and_pairs_of_them_lie_within_two_slabs_that_follow_each_other() {
        let mesh = block([40, 12, 12], 2.0);
        let slab = of_vertices(mesh.vertices.len(), &mesh.tets);
        let count = slab.iter().max().expect("vertices") + 1;
        assert!(count > 4, "{count} slabs");
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices.len()];
        for t in &mesh.tets {
            t.iter().for_each(|&v| around[v as usize].extend(t));
        }
        for ring in around {
            let (low, high) =
                ring.iter().fold((u32::MAX, 0), |(l, h), &v| (l.min(slab[v as usize]), h.max(slab[v as usize])));
            assert!(high - low <= 1, "{low} to {high}");
        }
    }

    #[test]
    fn rounds_cover_all_slabs_in_pairs() {
        let slabs = Slabs::new(&[0, 0, 1, 2, 2, 2, 3, 4]);
        assert_eq!(slabs.starts, [0, 2, 3, 6, 7, 8]);
        let [even, odd] = slabs.rounds();
        assert_eq!((even.cuts, odd.cuts), (vec![0, 3, 7, 8], vec![2, 6, 8]));
        assert_eq!((slabs.of(0), slabs.of(2), slabs.of(7)), (0, 1, 4));
        let one = Slabs::new(&[0, 0]).rounds();
        assert_eq!((one[0].parts(), one[1].parts()), (1, 0));
    }

    #[test]
    fn separate_pieces_are_layered_each_by_itself() {
        let mut mesh = block([2, 1, 1], 1.0);
        let (n, tets) = (mesh.vertices.len() as u32, mesh.tets.clone());
        mesh.tets.extend(tets.iter().map(|t| t.map(|v| v + n)));
        let layers = layers(2 * n as usize, &mesh.tets);
        assert!(layers.iter().all(|&l| l < 4));
        assert_eq!(layers.iter().filter(|&&l| l == 0).count(), 2);
    }
}
