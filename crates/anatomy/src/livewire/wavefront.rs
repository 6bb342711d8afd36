//! Exact shortest paths from one pixel, expanded only as far as they are asked for.

use super::links::Links;

/// One more than the largest link cost, so that all waiting distances fall into different buckets (Dial 1969).
const BUCKETS: usize = 256;
const SETTLED: u8 = 0x80;
const UNREACHED: u32 = u32::MAX;

/// Dijkstra's algorithm with Dial's circular bucket queue, stopped at a target and continued for the next one.
#[derive(Debug, Clone)]
pub(super) struct Wavefront {
    seed: usize,
    distance: Vec<u32>,
    /// Direction of the link that leads here, and whether the distance is final.
    from: Vec<u8>,
    buckets: Vec<Vec<u32>>,
    front: u32,
    waiting: usize,
}

impl Wavefront {
    /// A wave that starts at pixel `seed` and does not enter `blocked` pixels.
    pub(super) fn new(pixels: usize, seed: usize, blocked: &[u32]) -> Self {
        let mut out = Self {
            seed,
            distance: vec![UNREACHED; pixels],
            from: vec![0; pixels],
            buckets: vec![Vec::new(); BUCKETS],
            front: 0,
            waiting: 1,
        };
        for &p in blocked {
            out.from[p as usize] = SETTLED;
        }
        out.distance[seed] = 0;
        out.from[seed] = 0;
        out.buckets[0].push(seed as u32);
        out
    }

    /// Starts again elsewhere, keeping the memory.
    pub(super) fn restart(&mut self, seed: usize) {
        self.distance.fill(UNREACHED);
        self.from.fill(0);
        self.buckets.iter_mut().for_each(Vec::clear);
        (self.seed, self.front, self.waiting) = (seed, 0, 1);
        self.distance[seed] = 0;
        self.buckets[0].push(seed as u32);
    }

    /// Expands until the distance of `target` is final; false when it cannot be reached.
    pub(super) fn reach(&mut self, links: &Links, target: usize) -> bool {
        if self.from[target] & SETTLED == 0 {
            self.expand(links, usize::MAX, target);
        }
        self.from[target] & SETTLED != 0 && self.distance[target] != UNREACHED
    }

    /// Settles up to `most` pixels, or until `target` is settled; returns how many.
    pub(super) fn expand(&mut self, links: &Links, most: usize, target: usize) -> usize {
        let mut done = 0;
        while self.waiting > 0 && done < most {
            let slot = self.front as usize % BUCKETS;
            let mut bucket = core::mem::take(&mut self.buckets[slot]);
            let mut stop = false;
            while let Some(p) = bucket.pop() {
                self.waiting -= 1;
                let p = p as usize;
                if self.from[p] & SETTLED != 0 {
                    continue;
                }
                self.from[p] |= SETTLED;
                self.relax(links, p);
                done += 1;
                if p == target || done == most {
                    stop = true;
                    break;
                }
            }
            // Links cost at least 1, so nothing was added to this bucket meanwhile.
            self.buckets[slot] = bucket;
            if stop {
                break;
            }
            self.front += 1;
        }
        done
    }

    fn relax(&mut self, links: &Links, p: usize) {
        for (d, &cost) in links.cost[p].iter().enumerate() {
            if cost == 0 {
                continue;
            }
            let q = links.step(p, d);
            let through = self.front + u32::from(cost);
            if through < self.distance[q] && self.from[q] & SETTLED == 0 {
                self.distance[q] = through;
                self.from[q] = d as u8;
                self.buckets[through as usize % BUCKETS].push(q as u32);
                self.waiting += 1;
            }
        }
    }

    /// The pixels from the seed to a reached target, both included.
    pub(super) fn path(&self, links: &Links, target: usize) -> Vec<u32> {
        let mut out = vec![target as u32];
        let mut p = target;
        while p != self.seed {
            p = links.step(p, usize::from((self.from[p] & 7) ^ 4));
            out.push(p as u32);
        }
        out.reverse();
        out
    }

    /// Cost of the shortest path to a reached pixel.
    #[cfg(test)]
    pub(super) fn distance(&self, target: usize) -> u32 {
        self.distance[target]
    }
}

#[cfg(test)]
mod tests {
    use super::super::links::STEPS;
    use super::*;
    use proptest::prelude::*;

    /// Links of a random image, symmetric as those of the wire are.
    fn links(width: usize, height: usize, costs: &[u8]) -> Links {
        let mut cost = vec![[0u8; 8]; width * height];
        for p in 0..width * height {
            for d in 0..4 {
                let (x, y) = ((p % width) as isize + STEPS[d][0], (p / width) as isize + STEPS[d][1]);
                if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                    let q = (y * width as isize + x) as usize;
                    cost[p][d] = costs[(p * 4 + d) % costs.len()].max(1);
                    cost[q][d + 4] = cost[p][d];
                }
            }
        }
        Links { width, cost }
    }

    fn bellman_ford(links: &Links, seed: usize) -> Vec<u32> {
        let mut best = vec![UNREACHED; links.cost.len()];
        best[seed] = 0;
        loop {
            let mut changed = false;
            for p in 0..best.len() {
                for d in 0..8 {
                    let c = u32::from(links.cost[p][d]);
                    if c > 0 && best[p] != UNREACHED && best[p] + c < best[links.step(p, d)] {
                        best[links.step(p, d)] = best[p] + c;
                        changed = true;
                    }
                }
            }
            if !changed {
                return best;
            }
        }
    }

    proptest! {
        #[test]
        fn distances_and_paths_are_those_of_bellman_ford(
            (width, height) in (1usize..12, 1usize..12),
            costs in proptest::collection::vec(any::<u8>(), 1..200),
            picks in proptest::collection::vec(any::<proptest::sample::Index>(), 5),
        ) {
            let links = links(width, height, &costs);
            let seed = picks[0].index(width * height);
            let exact = bellman_ford(&links, seed);
            let mut wave = Wavefront::new(width * height, seed, &[]);
            for pick in &picks[1..] {
                let target = pick.index(width * height);
                prop_assert!(wave.reach(&links, target));
                prop_assert_eq!(wave.distance(target), exact[target]);
                let path = wave.path(&links, target);
                prop_assert_eq!((path[0] as usize, path[path.len() - 1] as usize), (seed, target));
                let mut sum = 0;
                for pair in path.windows(2) {
                    let d = (0..8).find(|&d| {
                        links.cost[pair[0] as usize][d] > 0 && links.step(pair[0] as usize, d) == pair[1] as usize
                    });
                    sum += u32::from(links.cost[pair[0] as usize][d.expect("a link")]);
                }
                prop_assert_eq!(sum, exact[target]);
            }
        }
    }

    #[test]
    fn blocked_pixels_are_not_entered_and_an_island_is_unreachable() {
        let links = links(5, 5, &[10]);
        let wall: Vec<u32> = (0..4).map(|y| y * 5 + 2).collect();
        let mut wave = Wavefront::new(25, 0, &wall);
        assert!(wave.reach(&links, 4));
        assert!(wave.path(&links, 4).iter().all(|p| !wall.contains(p)));
        let closed: Vec<u32> = (0..5).map(|y| y * 5 + 2).collect();
        assert!(!Wavefront::new(25, 0, &closed).reach(&links, 4));
    }

    #[test]
    fn expanding_in_slices_of_work_gives_the_same_map() {
        let links = links(9, 9, &[3, 200, 17, 255, 1]);
        let mut once = Wavefront::new(81, 40, &[]);
        once.expand(&links, usize::MAX, usize::MAX);
        let mut parts = Wavefront::new(81, 40, &[]);
        while parts.expand(&links, 7, usize::MAX) > 0 {}
        assert_eq!(once.distance, parts.distance);
    }
}
