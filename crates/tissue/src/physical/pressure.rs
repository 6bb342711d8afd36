//! The nodal pressures: an augmented Lagrangian of the volume of each patch.

use super::around::Element;
use super::elastic::{ELEMENT_BULK, Elastic};
use crate::fast::{Kernel, Lanes, Numbers, Pool, Row, Sums, WIDTH, widest};
use crate::model::Region;
use crate::volumes::Volumes;
use crate::{bytes, slabs};
use core::sync::atomic::{AtomicU64, Ordering};

/// Volumetric stiffness that the sweeps carry themselves, over the shear modulus; the rest is the pressure's.
/// With over-relaxed sweeps more than with plain ones, where 2 was best.
const PENALTY: f64 = 4.0;

/// The number of the next model.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// Constants of elements and patches.
#[derive(Debug, Clone)]
pub(super) struct Pressures {
    /// Different for each model.
    id: u64,
    /// Of each region: shear modulus, and what the sweeps carry of its volumetric stiffness, kPa.
    regions: Vec<[f64; 2]>,
    /// Number of elements, and the few whose patches do not all have the numbers of their corners, with their patches.
    tets: usize,
    walls: Vec<(u32, [u32; 4])>,
    /// Of each patch over its elements.
    around: Sums,
    /// Of each patch: what the sweeps carry of its volumetric stiffness over 24 times its volume, kPa/mm3, and the share
    /// `k / (k + r)` of the multiplier's step, 0 where the sweeps carry all.
    rate: Vec<f32>,
    share: Vec<f32>,
    /// Patches of fluid regions, with what the sweeps carry of their volumetric stiffness, kPa.
    fluid: Vec<(u32, f32)>,
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

/// What elements are without any pressure.
#[derive(Debug, Clone, Default)]
pub(super) struct Still {
    /// The model that it is for, and the damping time over the time step.
    of: Option<(u64, f32)>,
    /// Each element, and one more that is nothing.
    pub(super) elements: Vec<Element>,
    /// Of each region: the share of an element's second derivative that is the sweeps' own volumetric stiffness.
    carried: Vec<f32>,
}

impl Still {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.elements) + bytes::of(&self.carried)
    }
}

impl Pressures {
    pub(super) fn new(elastic: &Elastic, region: &[u8], regions: &[Region]) -> Self {
        let patches = elastic.patch_volume.len();
        let bulk = |r: &Region| r.material.lame_kpa() + (1.0 - ELEMENT_BULK) * r.material.shear_kpa();
        let carried = |r: &Region| (PENALTY * r.material.shear_kpa()).min(bulk(r));
        let moduli: Vec<[f64; 2]> = regions.iter().map(|r| [r.material.shear_kpa(), carried(r)]).collect();
        let (mut patch_penalty, mut is_fluid) = (vec![0.0; patches], vec![false; patches]);
        for (corners, &r) in elastic.patch.iter().zip(region) {
            corners.iter().for_each(|&p| patch_penalty[p as usize] = moduli[r as usize][1]);
            corners.iter().for_each(|&p| is_fluid[p as usize] = regions[r as usize].material.fluid);
        }
        let (start, around) = of_patches(&elastic.patch, patches);
        let patch_cuts = slabs::even_cuts(patches);
        let wall = (0..).zip(elastic.patch.iter().zip(&elastic.tets));
        Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            regions: moduli,
            tets: elastic.tets.len(),
            walls: wall.filter(|(_, (patches, corners))| patches != corners).map(|(t, (p, _))| (t, *p)).collect(),
            around: Sums::new(&start, &around, &patch_cuts),
            rate: patch_penalty.iter().zip(&elastic.patch_volume).map(|(r, v)| (r / (24.0 * v)) as f32).collect(),
            // What is left for the multiplier is `k - r`, so its share is `(k - r) / k`.
            share: patch_penalty.iter().zip(&elastic.patch_bulk).map(|(r, k)| ((k - r) / k) as f32).collect(),
            fluid: (0..).zip(is_fluid).zip(&patch_penalty).filter(|f| f.0.1).map(|f| (f.0.0, *f.1 as f32)).collect(),
            row_cuts: slabs::even_cuts(elastic.tets.len().div_ceil(WIDTH)),
            patch_cuts,
        }
    }

    /// Number of elements.
    pub(super) fn elements(&self) -> usize {
        self.tets
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        let patches = bytes::of(&self.rate) + bytes::of(&self.share);
        patches + self.around.bytes() + bytes::of(&self.walls) + bytes::of(&self.fluid)
    }

    /// Number of patches.
    pub(super) fn len(&self) -> usize {
        self.rate.len()
    }

    /// Sets what elements are without any pressure; `damping` is the damping time over the time step. Done once for each:
    /// nothing of it changes with the positions.
    pub(super) fn still(&self, of: Tissue<'_>, damping: f32, still: &mut Still, pool: &Pool) {
        if still.of == Some((self.id, damping)) {
            return;
        }
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
        still.of = Some((self.id, damping));
        still.carried = regions.iter().map(|r| r.2).collect();
        still.elements.resize(self.tets + 1, [0.0; 2]);
        still.elements[self.tets] = [0.0; 2];
        let six = of.volumes.six_rest().as_flattened();
        let cuts = self.element_cuts();
        pool.each_part(&mut still.elements, &cuts, &mut [(); slabs::PIECES], &|i, elements, ()| {
            let own = cuts[i]..cuts[i + 1];
            for ((element, &r), six) in elements.iter_mut().zip(&of.region[own.clone()]).zip(&six[own]) {
                let (start, rise, _) = regions[r as usize];
                *element = [start, rise / six];
            }
        });
    }

    /// Growth of all elements at the current positions, and their pressures with it. With `advance` the nodal pressures
    /// take the next step of the multiplier method, `p <- (p + r (J - 1)) / (1 + r / k)`, at rest in itself when
    /// `p = k (J - 1)`. `fluid_kpa` is the fluid's own pressure: as the solid's it acts through the volumes of elements, so
    /// it follows them within a sweep and the two cancel where they meet. After the last sweep nobody asks for the elements.
    pub(super) fn update(
        &self,
        (of, positions): (Tissue<'_>, &[[f32; 4]]),
        (nodal, growth): (&mut [f32], &mut Vec<Row>),
        elements: Option<(&Still, &mut Vec<Element>)>,
        total: &mut Vec<f32>,
        (advance, fluid_kpa, pool): (bool, f32, &Pool),
    ) {
        of.volumes.measure(positions, growth, pool);
        total.resize(self.len(), 0.0);
        // Each piece has its part of the nodal pressures and, as its slot, the same part of the totals.
        let mut totals = slabs::split(total, &self.patch_cuts);
        pool.each_part(nodal, &self.patch_cuts, &mut totals, &|i, nodal, total| {
            let (first, end) = (self.patch_cuts[i], self.patch_cuts[i + 1]);
            let (rate, share) = (&self.rate[first..end], &self.share[first..end]);
            self.around.of_piece(i, growth.as_flattened(), |k, sum| {
                let step = rate[k] * sum;
                if advance {
                    nodal[k] = (nodal[k] + step) * share[k];
                }
                total[k] = nodal[k] + step;
            });
        });
        let Some((still, elements)) = elements else { return };
        if fluid_kpa != 0.0 {
            self.add_fluid(fluid_kpa, nodal, total);
        }
        elements.resize(self.tets + 1, [0.0; 2]);
        pool.each_part(elements, &self.element_cuts(), &mut [(); slabs::PIECES], &|i, elements, ()| {
            self.spread(&Spread { of, total, growth, still, first: self.row_cuts[i] }, elements);
        });
    }

    /// Adds the fluid's pressure to its patches; no suction where nothing is left to drain, which would draw elements ever
    /// further inside out.
    fn add_fluid(&self, kpa: f32, nodal: &[f32], total: &mut [f32]) {
        for &(p, carried) in &self.fluid {
            let p = p as usize;
            // What is no multiplier yet is the stiffness times the growth.
            let left = 1.0 + (total[p] - nodal[p]) / carried;
            if kpa > 0.0 || left > 0.0 {
                total[p] -= kpa;
            }
        }
    }

    /// Pressures of the elements from row `first` on.
    fn spread(&self, spread: &Spread<'_>, elements: &mut [Element]) {
        widest(Rows { spread, elements });
        let first = spread.first * WIDTH;
        let end = first + elements.len();
        let from = self.walls.partition_point(|w| (w.0 as usize) < first);
        for &(t, patches) in self.walls[from..].iter().take_while(|w| (w.0 as usize) < end) {
            let t = t as usize;
            let [a, b, c, d] = patches.map(|p| spread.total[p as usize]);
            let [start, rise] = spread.still.elements[t];
            let carried = spread.still.carried[spread.of.region[t] as usize];
            let growth = spread.growth.as_flattened()[t];
            elements[t - first][0] = start + (((a + b) + (c + d)) * MEAN - growth * (rise * carried));
        }
    }

    /// Pieces of elements for threads.
    fn element_cuts(&self) -> Vec<usize> {
        self.row_cuts.iter().map(|r| (r * WIDTH).min(self.tets)).collect()
    }
}

/// Share of a patch's pressure in the derivative of an element's energy by six times its volume.
const MEAN: f32 = 1.0 / 24.0;

/// What elements' derivatives follow from.
struct Spread<'a> {
    of: Tissue<'a>,
    total: &'a [f32],
    growth: &'a [Row],
    still: &'a Still,
    /// Row that the elements begin with.
    first: usize,
}

/// Elements' derivatives from the pressures of their corners.
struct Rows<'a> {
    spread: &'a Spread<'a>,
    elements: &'a mut [Element],
}

impl Kernel for Rows<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let corners = self.spread.of.volumes.corners().numbers(self.spread.total);
        let still = &self.spread.still.elements[self.spread.first * WIDTH..][..self.elements.len()];
        let ((rows, rest), (still, last)) = (self.elements.as_chunks_mut::<WIDTH>(), still.as_chunks::<WIDTH>());
        for (k, (row, still)) in rows.iter_mut().zip(still).enumerate() {
            *row = self.spread.row::<V>(&corners, k, still);
        }
        if !rest.is_empty() {
            let mut padded = [[0.0; 2]; WIDTH];
            padded[..last.len()].copy_from_slice(last);
            let row = self.spread.row::<V>(&corners, rows.len(), &padded);
            rest.copy_from_slice(&row[..rest.len()]);
        }
    }
}

impl Spread<'_> {
    /// Sixteen elements, `k` rows on.
    #[inline(always)]
    fn row<V: Lanes>(&self, corners: &Numbers<'_, 4, u32>, k: usize, still: &[Element; WIDTH]) -> [Element; WIDTH] {
        let row = self.first + k;
        let regions = &self.of.region[row * WIDTH..self.of.region.len().min((row + 1) * WIDTH)];
        let carried = |&r: &u8| self.still.carried[r as usize];
        let alike = regions.iter().all(|&r| r == regions[0]);
        let mut out = *still;
        for lane in (0..WIDTH).step_by(V::N) {
            let carried = if alike {
                V::splat(carried(&regions[0]))
            } else {
                V::load(&core::array::from_fn(|l| regions.get(l).map_or(0.0, carried)), lane)
            };
            let (a, b): (V, V) = (corners.gather(row, 0, lane), corners.gather(row, 1, lane));
            let (c, d): (V, V) = (corners.gather(row, 2, lane), corners.gather(row, 3, lane));
            let [start, rise] = V::load_pairs(still, lane);
            // The mean of its patches, less what the element's own change from now on will add again.
            let slope =
                start + (((a + b) + (c + d)) * V::splat(MEAN) - V::load(&self.growth[row], lane) * (rise * carried));
            V::store_pairs([slope, rise], &mut out, lane);
        }
        out
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
