//! The nodal pressures: an augmented Lagrangian of the volume of each patch.

use super::around::Element;
use super::elastic::{ELEMENT_BULK, Elastic};
use crate::fast::{Kernel, Lanes, Numbers, Pool, Row, Sums, WIDTH, widest};
use crate::model::Region;
use crate::volumes::Volumes;
use crate::{bytes, slabs};

/// Volumetric stiffness that the sweeps carry themselves, over the shear modulus; the rest is the pressure's.
/// With over-relaxed sweeps more than with plain ones, where 2 was best.
const PENALTY: f64 = 4.0;

impl Grown {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.growth) + bytes::of(&self.total) + bytes::of(&self.still)
    }
}

/// Constants of elements and patches.
#[derive(Debug, Clone)]
pub(super) struct Pressures {
    /// Of each region: shear modulus, and what the sweeps carry of its volumetric stiffness, kPa.
    regions: Vec<[f64; 2]>,
    /// Number of elements, and the few whose patches do not all have the numbers of their corners, with their patches.
    tets: usize,
    walls: Vec<(u32, [u32; 4])>,
    /// Elements of each patch.
    start: Vec<u32>,
    around: Sums,
    /// Of each patch: what the sweeps carry of its volumetric stiffness over 24 times its volume, kPa/mm3, and the share
    /// `k / (k + r)` of the multiplier's step, 0 where the sweeps carry all.
    rate: Vec<f32>,
    share: Vec<f32>,
    /// Pieces for threads: of sixteen elements each, and of patches.
    row_cuts: Vec<usize>,
    patch_cuts: Vec<usize>,
}

/// The elements that pressures act in.
#[derive(Clone, Copy)]
pub(super) struct Tissue<'a> {
    pub(super) volumes: &'a Volumes,
    /// Region of each element.
    pub(super) region: &'a [u8],
}

/// What follows the positions.
#[derive(Debug, Clone, Default)]
pub(super) struct Grown {
    /// Six times the growth of each element, mm3.
    growth: Vec<Row>,
    /// Pressure of each patch, penalty included, kPa.
    total: Vec<f32>,
    /// Of each region: an element's first derivative without pressures, and the share of its second that is the sweeps'
    /// own volumetric stiffness.
    still: Vec<[f32; 2]>,
}

impl Pressures {
    pub(super) fn new(elastic: &Elastic, region: &[u8], regions: &[Region]) -> Self {
        let patches = elastic.patch_volume.len();
        let bulk = |r: &Region| r.material.lame_kpa() + (1.0 - ELEMENT_BULK) * r.material.shear_kpa();
        let carried = |r: &Region| (PENALTY * r.material.shear_kpa()).min(bulk(r));
        let regions: Vec<[f64; 2]> = regions.iter().map(|r| [r.material.shear_kpa(), carried(r)]).collect();
        let mut patch_penalty = vec![0.0; patches];
        for (corners, &r) in elastic.patch.iter().zip(region) {
            corners.iter().for_each(|&p| patch_penalty[p as usize] = regions[r as usize][1]);
        }
        let (start, around) = of_patches(&elastic.patch, patches);
        let wall = (0..).zip(elastic.patch.iter().zip(&elastic.tets));
        Self {
            regions,
            tets: elastic.tets.len(),
            walls: wall.filter(|(_, (patches, corners))| patches != corners).map(|(t, (p, _))| (t, *p)).collect(),
            start,
            around: Sums::new(around),
            rate: patch_penalty.iter().zip(&elastic.patch_volume).map(|(r, v)| (r / (24.0 * v)) as f32).collect(),
            // What is left for the multiplier is `k - r`, so its share is `(k - r) / k`.
            share: patch_penalty.iter().zip(&elastic.patch_bulk).map(|(r, k)| ((k - r) / k) as f32).collect(),
            row_cuts: slabs::even_cuts(elastic.tets.len().div_ceil(WIDTH)),
            patch_cuts: slabs::even_cuts(patches),
        }
    }

    /// Number of elements.
    pub(super) fn elements(&self) -> usize {
        self.tets
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        let patches = bytes::of(&self.start) + bytes::of(&self.rate) + bytes::of(&self.share);
        patches + self.around.bytes() + bytes::of(&self.walls)
    }

    /// Number of patches.
    pub(super) fn len(&self) -> usize {
        self.rate.len()
    }

    /// Sets what elements are without any pressure, and one more that is nothing; `damping` is the damping time over the
    /// time step.
    pub(super) fn still(
        &self,
        of: Tissue<'_>,
        damping: f32,
        elements: &mut Vec<Element>,
        grown: &mut Grown,
        pool: &Pool,
    ) {
        let more = 1.0 + f64::from(damping);
        let region = |&[mu, carried]: &[f64; 2]| {
            let own = ELEMENT_BULK * mu * more;
            // Of `-mu` and of what the growth against rest takes off the volume itself.
            (
                (-(mu * more + own + carried) / 6.0) as f32,
                ((own + carried) / 6.0) as f32,
                (carried / (own + carried)) as f32,
            )
        };
        let regions: Vec<(f32, f32, f32)> = self.regions.iter().map(region).collect();
        grown.still = regions.iter().map(|r| [r.0, r.2]).collect();
        elements.resize(self.tets + 1, [0.0; 2]);
        elements[self.tets] = [0.0; 2];
        let six = of.volumes.six_rest().as_flattened();
        let cuts = self.element_cuts();
        pool.each_part(elements, &cuts, &mut [(); slabs::PIECES], &|i, elements, ()| {
            let own = cuts[i]..cuts[i + 1];
            for ((element, &r), six) in elements.iter_mut().zip(&of.region[own.clone()]).zip(&six[own]) {
                let (still, rise, _) = regions[r as usize];
                *element = [still, rise / six];
            }
        });
    }

    /// Growth of all elements at the current positions, and their pressures with it. With `advance` the nodal pressures
    /// take the next step of the multiplier method, `p <- (p + r (J - 1)) / (1 + r / k)`, at rest in itself when
    /// `p = k (J - 1)`.
    pub(super) fn update(
        &self,
        (of, positions): (Tissue<'_>, &[[f32; 4]]),
        nodal: &mut [f32],
        elements: &mut [Element],
        grown: &mut Grown,
        (advance, pool): (bool, &Pool),
    ) {
        let Grown { growth, total, still } = grown;
        of.volumes.measure(positions, growth, pool);
        total.resize(self.len(), 0.0);
        // Each piece has its part of the nodal pressures and, as its slot, the same part of the totals.
        let mut totals = slabs::split(total, &self.patch_cuts);
        pool.each_part(nodal, &self.patch_cuts, &mut totals, &|i, nodal, total| {
            let (first, end) = (self.patch_cuts[i], self.patch_cuts[i + 1]);
            let (rate, share) = (&self.rate[first..end], &self.share[first..end]);
            self.around.each(&self.start[first..=end], growth.as_flattened(), |k, sum| {
                let step = rate[k] * sum;
                if advance {
                    nodal[k] = (nodal[k] + step) * share[k];
                }
                total[k] = nodal[k] + step;
            });
        });
        pool.each_part(elements, &self.element_cuts(), &mut [(); slabs::PIECES], &|i, elements, ()| {
            let first = self.row_cuts[i];
            widest(Spread { of, total, growth, still, first, elements });
            let end = first * WIDTH + elements.len();
            let from = self.walls.partition_point(|w| (w.0 as usize) < first * WIDTH);
            for &(t, patches) in self.walls[from..].iter().take_while(|w| (w.0 as usize) < end) {
                let element = &mut elements[t as usize - first * WIDTH];
                let [a, b, c, d] = patches.map(|p| total[p as usize]);
                let [start, carried] = still[of.region[t as usize] as usize];
                let growth = growth.as_flattened()[t as usize];
                element[0] = start + (((a + b) + (c + d)) * MEAN - growth * (element[1] * carried));
            }
        });
    }

    /// Pieces of elements for threads.
    fn element_cuts(&self) -> Vec<usize> {
        self.row_cuts.iter().map(|r| (r * WIDTH).min(self.tets)).collect()
    }
}

/// Share of a patch's pressure in the derivative of an element's energy by six times its volume.
const MEAN: f32 = 1.0 / 24.0;

/// Elements' derivatives from the pressures of their corners.
struct Spread<'a> {
    of: Tissue<'a>,
    total: &'a [f32],
    growth: &'a [Row],
    still: &'a [[f32; 2]],
    /// Row that the elements begin with.
    first: usize,
    elements: &'a mut [Element],
}

impl Kernel for Spread<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let corners = self.of.volumes.corners().numbers(self.total);
        let regions = &self.of.region[self.first * WIDTH..];
        let (rows, rest) = self.elements.as_chunks_mut::<WIDTH>();
        for (k, row) in rows.iter_mut().enumerate() {
            spread::<V>(row, &corners, (self.first + k, &self.growth[self.first + k]), (regions, k, self.still));
        }
        if !rest.is_empty() {
            let mut last = [[0.0; 2]; WIDTH];
            last[..rest.len()].copy_from_slice(rest);
            let k = rows.len();
            spread::<V>(&mut last, &corners, (self.first + k, &self.growth[self.first + k]), (regions, k, self.still));
            rest.copy_from_slice(&last[..rest.len()]);
        }
    }
}

/// Sixteen elements: row `k` of `regions`.
#[inline(always)]
fn spread<V: Lanes>(
    elements: &mut [Element; WIDTH],
    corners: &Numbers<'_, 4, u32>,
    (row, growth): (usize, &Row),
    (regions, k, still): (&[u8], usize, &[[f32; 2]]),
) {
    let regions = &regions[k * WIDTH..regions.len().min((k + 1) * WIDTH)];
    let alike = regions.iter().all(|&r| r == regions[0]);
    for lane in (0..WIDTH).step_by(V::N) {
        let [start, carried] = if alike {
            still[regions[0] as usize].map(V::splat)
        } else {
            let of = |i: usize| core::array::from_fn(|l| regions.get(l).map_or(0.0, |&r| still[r as usize][i]));
            [V::load(&of(0), lane), V::load(&of(1), lane)]
        };
        let (a, b): (V, V) = (corners.gather(row, 0, lane), corners.gather(row, 1, lane));
        let (c, d): (V, V) = (corners.gather(row, 2, lane), corners.gather(row, 3, lane));
        let [_, rise] = V::load_pairs(elements, lane);
        // The mean of its patches, less what the element's own change from now on will add again.
        let slope = start + (((a + b) + (c + d)) * V::splat(MEAN) - V::load(growth, lane) * (rise * carried));
        V::store_pairs([slope, rise], elements, lane);
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
