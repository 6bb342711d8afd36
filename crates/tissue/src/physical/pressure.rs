//! The nodal pressures: an augmented Lagrangian of the volume of each patch.

use super::elastic::Elastic;
use super::sweep::Element;
use crate::fast::{Pool, Row};
use crate::slabs;
use crate::volumes::Volumes;

/// Constants of elements and patches.
#[derive(Debug, Clone)]
pub(super) struct Pressures {
    /// Penalty of each element over six times its volume, kPa/mm3.
    penalty: Vec<f32>,
    /// Patch of each corner of each element; elements of each patch.
    patch: Vec<[u32; 4]>,
    start: Vec<u32>,
    around: Vec<u32>,
    /// Of each patch: what the sweeps carry of its volumetric stiffness over 24 times its volume, kPa/mm3, and the share
    /// `k / (k + r)` of the multiplier's step, 0 where the sweeps carry all.
    rate: Vec<f32>,
    share: Vec<f32>,
    /// Pieces for threads: of elements and of patches.
    tet_cuts: Vec<usize>,
    patch_cuts: Vec<usize>,
}

/// What follows the positions.
#[derive(Debug, Clone, Default)]
pub(super) struct Grown {
    /// Six times the growth of each element, mm3.
    growth: Vec<Row>,
    /// Pressure of each patch, penalty included, kPa.
    total: Vec<f32>,
}

/// Volumetric stiffness that the sweeps carry themselves of an element, kPa.
fn carried(elastic: &Elastic, t: usize, over_shear: f64) -> f64 {
    (over_shear * elastic.mu[t]).min(elastic.patch_bulk[elastic.patch[t][0] as usize])
}

impl Pressures {
    /// `over_shear`: volumetric stiffness that the sweeps carry themselves, over the shear modulus.
    pub(super) fn new(elastic: &Elastic, over_shear: f64) -> Self {
        let (tets, patches) = (&elastic.tets, elastic.patch_volume.len());
        let mut patch_penalty = vec![0.0; patches];
        for (t, corners) in elastic.patch.iter().enumerate() {
            corners.iter().for_each(|&p| patch_penalty[p as usize] = carried(elastic, t, over_shear));
        }
        let (start, around) = of_patches(&elastic.patch, patches);
        Self {
            penalty: (0..tets.len())
                .map(|t| (carried(elastic, t, over_shear) / (6.0 * elastic.volume[t])) as f32)
                .collect(),
            patch: elastic.patch.clone(),
            start,
            around,
            rate: patch_penalty.iter().zip(&elastic.patch_volume).map(|(r, v)| (r / (24.0 * v)) as f32).collect(),
            // What is left for the multiplier is `k - r`, so its share is `(k - r) / k`.
            share: patch_penalty.iter().zip(&elastic.patch_bulk).map(|(r, k)| ((k - r) / k) as f32).collect(),
            tet_cuts: slabs::even_cuts(tets.len()),
            patch_cuts: slabs::even_cuts(patches),
        }
    }

    /// Number of patches.
    pub(super) fn len(&self) -> usize {
        self.rate.len()
    }

    /// What an element is at rest.
    pub(super) fn elements(elastic: &Elastic, over_shear: f64) -> Vec<Element> {
        let element = |t: usize| {
            let over = |k: f64| (k / elastic.volume[t]) as f32;
            [0.0, elastic.mu[t] as f32, over(elastic.bulk[t]), over(carried(elastic, t, over_shear))]
        };
        (0..elastic.tets.len()).map(element).collect()
    }

    /// Growth of all elements at the current positions, and their pressures with it. With `advance` the nodal pressures
    /// take the next step of the multiplier method, `p <- (p + r (J - 1)) / (1 + r / k)`, at rest in itself when
    /// `p = k (J - 1)`.
    pub(super) fn update(
        &self,
        (volumes, positions): (&Volumes, &[[f32; 4]]),
        nodal: &mut [f32],
        elements: &mut [Element],
        grown: &mut Grown,
        (advance, pool): (bool, &Pool),
    ) {
        let Grown { growth, total } = grown;
        volumes.measure(positions, growth, pool);
        total.resize(self.len(), 0.0);
        let growth = growth.as_flattened();
        // Each piece has its part of the nodal pressures and, as its slot, the same part of the totals.
        let mut totals = slabs::split(total, &self.patch_cuts);
        pool.each_part(nodal, &self.patch_cuts, &mut totals, &|i, nodal, total| {
            let first = self.patch_cuts[i];
            for (k, (nodal, total)) in nodal.iter_mut().zip(total.iter_mut()).enumerate() {
                self.step(first + k, growth, advance, nodal, total);
            }
        });
        pool.each_part(elements, &self.tet_cuts, &mut [(); slabs::PIECES], &|i, elements, ()| {
            let first = self.tet_cuts[i];
            for (k, element) in elements.iter_mut().enumerate() {
                let t = first + k;
                let [a, b, c, d] = self.patch[t];
                // The mean of its patches, less what the element's own change from now on will add again.
                let sum = (total[a as usize] + total[b as usize]) + (total[c as usize] + total[d as usize]);
                element[0] = 0.25 * sum - growth[t] * self.penalty[t] - element[1];
            }
        });
    }

    #[inline(always)]
    fn step(&self, k: usize, growth: &[f32], advance: bool, nodal: &mut f32, total: &mut f32) {
        let own = &self.around[self.start[k] as usize..self.start[k + 1] as usize];
        // Four sums at a time: one after the other would wait for each addition.
        let mut sums = [0f32; 4];
        let (fours, rest) = own.as_chunks::<4>();
        for four in fours {
            (0..4).for_each(|i| sums[i] += growth[four[i] as usize]);
        }
        rest.iter().zip(&mut sums).for_each(|(&t, sum)| *sum += growth[t as usize]);
        let step = self.rate[k] * ((sums[0] + sums[1]) + (sums[2] + sums[3]));
        if advance {
            *nodal = (*nodal + step) * self.share[k];
        }
        *total = *nodal + step;
    }
}

/// Start of each patch's elements, and those in order.
fn of_patches(patch: &[[u32; 4]], patches: usize) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; patches + 1];
    patch.iter().flatten().for_each(|&p| start[p as usize + 1] += 1);
    for p in 0..patches {
        start[p + 1] += start[p];
    }
    let (mut fill, mut around) = (start.clone(), vec![0u32; patch.len() * 4]);
    for (t, corners) in patch.iter().enumerate() {
        for &p in corners {
            around[fill[p as usize] as usize] = t as u32;
            fill[p as usize] += 1;
        }
    }
    (start, around)
}
