//! The nodal pressures: an augmented Lagrangian of the volume of each patch.

use super::elastic::{ELEMENT_BULK, Elastic, patch_kpa};
use super::near::Near;
use crate::contact::Room;
use crate::csf::FluidPressure;
use crate::fast::{Kernel, Lanes, Numbers, Pool, Row, Sums, Take, WIDTH, ask_ahead, widest};
use crate::model::Region;
use crate::vec3::xyz;
use crate::volumes::Volumes;
use crate::{bytes, slabs};
use monro_geometry::Incidence;

/// Volumetric stiffness that the sweeps carry themselves, over the shear modulus; the rest is the pressure's.
/// With over-relaxed sweeps more than with plain ones, where 2 was best.
const PENALTY: f64 = 4.0;

/// Constants of elements and patches.
#[derive(Debug, Clone)]
pub(super) struct Pressures {
    /// Of each region: shear modulus, and what the sweeps carry of its volumetric stiffness, kPa.
    regions: Vec<[f64; 2]>,
    /// Number of elements, and the few whose patches do not all have the numbers of their corners, with their patches.
    tets: usize,
    walls: Vec<(u32, [u32; 4])>,
    /// First wall of each row of elements, and the end.
    wall_start: Vec<u32>,
    /// Of each patch over its elements.
    around: Sums,
    /// Of each patch: what the sweeps carry of its volumetric stiffness over 24 times its volume, kPa/mm3, and the share
    /// `k / (k + r)` of the multiplier's step, 0 where the sweeps carry all.
    rate: Vec<f32>,
    share: Vec<f32>,
    /// Patches of fluid regions, with their vertices and what the sweeps carry of their volumetric stiffness, kPa.
    fluid: Vec<(u32, u32, f32)>,
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

/// What is not tissue and presses on it.
#[derive(Clone, Copy)]
pub(super) struct Foreign<'a> {
    pub(super) fluid: &'a FluidPressure,
    /// As [`Pressures::list_room`] lists it.
    pub(super) room: &'a [(u32, f32)],
}

/// What tools take up of the patches around them.
#[derive(Debug, Clone, Default)]
pub(super) struct Taken {
    /// For each patch its penalty's share of the pressure, kPa.
    pub(super) list: Vec<(u32, f32)>,
    /// Memory for the sums of all patches, of which none is left.
    of_patch: Vec<f32>,
}

impl Taken {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.list) + bytes::of(&self.of_patch)
    }
}

/// Which pressures follow: all, with or without a step of their own, or those that are near, with one.
#[derive(Clone, Copy)]
pub(super) enum Which<'a> {
    All { advance: bool },
    Near(&'a Near),
}

impl Which<'_> {
    /// Whether a row of elements has one that is asked for.
    #[inline(always)]
    fn row(self, row: usize) -> bool {
        match self {
            Self::All { .. } => true,
            Self::Near(near) => near.has_row(row),
        }
    }

    /// Whether an element is asked for.
    #[inline(always)]
    fn element(self, element: usize) -> bool {
        match self {
            Self::All { .. } => true,
            Self::Near(near) => near.has_element(element),
        }
    }

    /// Whether a batch of sums is asked for.
    #[inline(always)]
    fn batch(self, batch: u32) -> bool {
        match self {
            Self::All { .. } => true,
            Self::Near(near) => near.has_batch(batch),
        }
    }

    /// Whether the pressure of a patch takes a step.
    #[inline(always)]
    fn advances(self, patch: usize) -> bool {
        match self {
            Self::All { advance } => advance,
            Self::Near(near) => near.has_patch(patch as u32),
        }
    }
}

/// What elements are without any pressure.
#[derive(Debug, Clone, Default)]
pub(super) struct Still {
    /// The damping time over the time step that it is for.
    damping: Option<f32>,
    /// Of each element, and one more that is nothing: the derivative at no volume, kPa/6, and the part of the second derivative
    /// that is the sweeps' own volumetric stiffness, kPa/mm3/36.
    elements: Vec<[f32; 2]>,
    /// Of each region: what damping has of an element's derivative at no volume, and its share of the second derivative.
    pub(super) damped: Vec<[f32; 2]>,
    /// Of each region: six times an element's second derivative times its volume at rest, and the share of it that is the
    /// sweeps' own volumetric stiffness.
    rises: Vec<[f32; 2]>,
}

impl Still {
    /// Derivative of each element at no volume (kPa/6), and one more that is nothing.
    pub(super) fn slopes(&self) -> Vec<f32> {
        self.elements.iter().map(|e| e[0]).collect()
    }

    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.elements) + bytes::of(&self.damped) + bytes::of(&self.rises)
    }
}

/// What sweeps carry of the volumetric stiffness of a region's patches, kPa.
fn carried_kpa(region: &Region) -> f64 {
    (PENALTY * region.material.shear_kpa()).min(patch_kpa(&region.material))
}

/// The same of each patch.
pub(super) fn carried(elastic: &Elastic, (region, regions): (&[u8], &[Region])) -> Vec<f64> {
    let mut out = vec![0.0; elastic.patch_volume.len()];
    for (corners, &r) in elastic.patch.iter().zip(region) {
        let kpa = carried_kpa(&regions[r as usize]);
        corners.iter().for_each(|&p| out[p as usize] = kpa);
    }
    out
}

impl Pressures {
    pub(super) fn new(elastic: &Elastic, (region, regions): (&[u8], &[Region])) -> Self {
        let patches = elastic.patch_volume.len();
        let moduli: Vec<[f64; 2]> = regions.iter().map(|r| [r.material.shear_kpa(), carried_kpa(r)]).collect();
        let (patch_penalty, mut in_fluid) = (carried(elastic, (region, regions)), vec![None; patches]);
        for ((own, corners), &r) in elastic.patch.iter().zip(&elastic.tets).zip(region) {
            if regions[r as usize].material.fluid {
                own.iter().zip(corners).for_each(|(&p, &v)| in_fluid[p as usize] = Some(v));
            }
        }
        let fluid = in_fluid.iter().zip(&patch_penalty).enumerate();
        let (start, around) = Incidence::new(&elastic.patch, patches).into_lists();
        let patch_cuts = slabs::even_cuts(patches);
        let wall = (0..).zip(elastic.patch.iter().zip(&elastic.tets));
        let walls: Vec<(u32, [u32; 4])> =
            wall.filter(|(_, (patches, corners))| patches != corners).map(|(t, (p, _))| (t, *p)).collect();
        let first = |row: usize| walls.partition_point(|w| (w.0 as usize) < row * WIDTH) as u32;
        Self {
            regions: moduli,
            tets: elastic.tets.len(),
            wall_start: (0..=elastic.tets.len().div_ceil(WIDTH)).map(first).collect(),
            walls,
            around: Sums::new(&start, &around, &patch_cuts),
            rate: patch_penalty.iter().zip(&elastic.patch_volume).map(|(r, v)| (r / (24.0 * v)) as f32).collect(),
            // What is left for the multiplier is `k - r`, so its share is `(k - r) / k`.
            share: patch_penalty.iter().zip(&elastic.patch_bulk).map(|(r, k)| ((k - r) / k) as f32).collect(),
            fluid: fluid.filter_map(|(p, (v, penalty))| v.map(|v| (p as u32, v, *penalty as f32))).collect(),
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
        patches + self.around.bytes() + bytes::of(&self.walls) + bytes::of(&self.wall_start) + bytes::of(&self.fluid)
    }

    /// Number of patches.
    pub(super) fn len(&self) -> usize {
        self.rate.len()
    }

    /// Sets what elements are without any pressure; `damping` is the damping time over the time step. Done once for each, since
    /// nothing of it changes with the positions: returns whether it was done.
    pub(super) fn still(&self, of: Tissue<'_>, damping: f32, still: &mut Still, pool: &Pool) -> bool {
        if still.damping == Some(damping) {
            return false;
        }
        still.damping = Some(damping);
        let own = |mu: f64, more: f64| ELEMENT_BULK * mu * more;
        let (damping, more) = (f64::from(damping), 1.0 + f64::from(damping));
        // Of `-mu` and of what the growth against rest takes off the volume itself.
        let slope = |mu: f64, more: f64| -(mu * more + own(mu, more));
        let rise = |&[mu, carried]: &[f64; 2]| own(mu, more) + carried;
        let slopes: Vec<f32> = self.regions.iter().map(|r| ((slope(r[0], more) - r[1]) / 6.0) as f32).collect();
        let damped = |r: &[f64; 2]| [slope(r[0], damping) / 6.0, own(r[0], damping) / rise(r)].map(|v| v as f32);
        still.rises = self.regions.iter().map(|r| [rise(r) / 6.0, r[1] / rise(r)].map(|v| v as f32)).collect();
        still.damped = self.regions.iter().map(damped).collect();
        still.elements.resize(self.tets + 1, [0.0; 2]);
        let (six, cuts) = (of.volumes.six_rest().as_flattened(), self.element_cuts());
        let rises = &still.rises;
        pool.each_part(&mut still.elements, &cuts, &mut [(); slabs::PIECES], &|i, elements, ()| {
            for (t, element) in (cuts[i]..).zip(elements) {
                let region = of.region[t] as usize;
                let [rise, carried] = rises[region];
                *element = [slopes[region], rise / six[t] * carried];
            }
        });
        true
    }

    /// Second derivative of each element by six times its volume (kPa/mm3/36), and one more that is nothing.
    pub(super) fn rises(&self, of: Tissue<'_>, still: &Still) -> Vec<f32> {
        let six = of.volumes.six_rest().as_flattened();
        let elements = of.region.iter().zip(six).map(|(&r, six)| still.rises[r as usize][0] / six);
        elements.chain([0.0]).collect()
    }

    /// Growth of elements at the current positions, and their pressures with it. With `advance` the nodal pressures
    /// take the next step of the multiplier method, `p <- (p + r (J - 1)) / (1 + r / k)`, at rest in itself when
    /// `p = k (J - 1)`, or go `share` of the way there. `fluid` is the fluid's own pressure: as the solid's it acts through the
    /// volumes of elements, so it follows them within a sweep and the two cancel where they meet. After the last sweep nobody
    /// asks for the elements.
    ///
    /// Where only what is near follows, its elements see how far they and their patches have grown, and all others keep what
    /// they have of both, since one without the other would make them soft.
    pub(super) fn update(
        &self,
        (of, positions): (Tissue<'_>, &[[f32; 4]]),
        (nodal, growth): (&mut [f32], &mut Vec<Row>),
        elements: Option<(&Still, &mut Vec<f32>)>,
        total: &mut Vec<f32>,
        share: f32,
        (which, Foreign { fluid, room }, pool): (Which<'_>, Foreign<'_>, &Pool),
    ) {
        of.volumes.measure_where(|row| which.row(row), positions, growth, pool);
        self.follow((nodal, total), growth, (which, share), pool);
        self.make_room(room, (nodal, total), (which, share));
        let Some((still, slopes)) = elements else { return };
        if !fluid.is_none() {
            self.add_fluid((fluid, positions), (nodal, total), |p| which.batch(self.around.batch_of(p)));
        }
        slopes.resize(self.tets + 1, 0.0);
        slopes[self.tets] = 0.0;
        pool.each_part(slopes, &self.element_cuts(), &mut [(); slabs::PIECES], &|i, slopes, ()| {
            self.spread(&Spread { of, total, growth, still, which, first: self.row_cuts[i] }, slopes);
        });
    }

    /// Pressures of the patches from the growth of their elements.
    fn follow(
        &self,
        (nodal, total): (&mut [f32], &mut Vec<f32>),
        growth: &[Row],
        (which, share): (Which<'_>, f32),
        pool: &Pool,
    ) {
        total.resize(self.len(), 0.0);
        // Each piece has its part of the nodal pressures and, as its slot, the same part of the totals.
        let mut totals = slabs::split(total, &self.patch_cuts);
        pool.each_part(nodal, &self.patch_cuts, &mut totals, &|i, nodal, total| {
            let steps = Steps { of: self, which, share, first: self.patch_cuts[i], nodal, total };
            self.around.of_piece(i, |batch| which.batch(batch), growth.as_flattened(), steps);
        });
    }

    /// Lists what tools take up of the patches around them.
    pub(super) fn list_room(&self, rooms: &[Room], of: Tissue<'_>, taken: &mut Taken) {
        let Taken { list, of_patch } = taken;
        list.clear();
        of_patch.resize(self.len(), 0.0);
        for Room { place, mm3, .. } in rooms {
            for (p, share) in self.patches_of(place.tet, of).into_iter().zip(place.weights) {
                let sum = &mut of_patch[p as usize];
                if *sum == 0.0 {
                    list.push((p, 0.0));
                }
                *sum += SUM_OF_VOLUME * self.rate[p as usize] * share * mm3;
            }
        }
        // One that is listed twice, as its first shares were nothing, has all of it the first time.
        list.iter_mut().for_each(|(p, less)| *less = core::mem::take(&mut of_patch[*p as usize]));
    }

    /// Patches of an element's corners.
    fn patches_of(&self, tet: u32, of: Tissue<'_>) -> [u32; 4] {
        match self.walls.binary_search_by_key(&tet, |w| w.0) {
            Ok(at) => self.walls[at].1,
            Err(_) => of.volumes.corners().row(tet as usize / WIDTH).map(|c| c[tet as usize % WIDTH]),
        }
    }

    /// Takes off what is no growth of the tissue, of the patches that are asked for, as if their elements had grown by less.
    fn make_room(
        &self,
        room: &[(u32, f32)],
        (nodal, total): (&mut [f32], &mut [f32]),
        (which, share): (Which<'_>, f32),
    ) {
        for &(p, less) in room {
            let p = p as usize;
            if which.batch(self.around.batch_of(p)) {
                let stepped = if which.advances(p) { share * less * self.share[p] } else { 0.0 };
                nodal[p] -= stepped;
                total[p] -= stepped + less;
            }
        }
    }

    /// Forgets what was near, before it is chosen anew.
    pub(super) fn clear_near(&self, near: &mut Near) {
        near.clear((self.tets, self.around.batches(), self.len()));
    }

    /// Marks what belongs to the elements and vertices that are near: all patches of these, and the sums of those.
    pub(super) fn complete_near(&self, of: Tissue<'_>, near: &mut Near) {
        near.mark_rows();
        for i in 0..near.elements().len() {
            let t = near.elements()[i] as usize;
            for corner in of.volumes.corners().row(t / WIDTH) {
                near.mark_batch(self.around.batch_of(corner[t % WIDTH] as usize));
            }
        }
        for i in 0..near.rows().len() {
            let row = near.rows()[i] as usize;
            for (t, patches) in self.walls_between(row..row + 1) {
                if !near.has_element(*t as usize) {
                    continue;
                }
                let corners = of.volumes.corners().row(*t as usize / WIDTH).map(|c| c[*t as usize % WIDTH]);
                for (corner, &patch) in corners.into_iter().zip(patches) {
                    near.mark_batch(self.around.batch_of(patch as usize));
                    if near.has_patch(corner) {
                        near.mark_patch(patch);
                    }
                }
            }
        }
    }

    /// Adds the fluid's pressure to those of its patches that are asked for; no suction where nothing is left to drain, which
    /// would draw elements ever further inside out.
    fn add_fluid(
        &self,
        (fluid, positions): (&FluidPressure, &[[f32; 4]]),
        (nodal, total): (&[f32], &mut [f32]),
        asked: impl Fn(usize) -> bool,
    ) {
        for &(p, vertex, carried) in self.fluid.iter().filter(|f| asked(f.0 as usize)) {
            let p = p as usize;
            let kpa = fluid.at(xyz(positions[vertex as usize]));
            // What is no multiplier yet is the stiffness times the growth.
            let left = 1.0 + (total[p] - nodal[p]) / carried;
            if kpa > 0.0 || left > 0.0 {
                total[p] -= kpa;
            }
        }
    }

    /// Pressures of the elements from row `first` on.
    fn spread(&self, spread: &Spread<'_>, slopes: &mut [f32]) {
        widest(Rows { spread, slopes });
        let rows = spread.first..spread.first + slopes.len().div_ceil(WIDTH);
        self.spread_walls(spread, slopes, self.walls_between(rows));
    }

    /// The walls among the elements of some rows.
    fn walls_between(&self, rows: core::ops::Range<usize>) -> &[(u32, [u32; 4])] {
        &self.walls[self.wall_start[rows.start] as usize..self.wall_start[rows.end] as usize]
    }

    /// Pressures of elements at walls; `slopes` are those from the first row on.
    fn spread_walls(&self, spread: &Spread<'_>, slopes: &mut [f32], walls: &[(u32, [u32; 4])]) {
        let first = spread.first * WIDTH;
        for &(t, patches) in walls.iter().filter(|w| spread.which.element(w.0 as usize)) {
            let t = t as usize;
            let [a, b, c, d] = patches.map(|p| spread.total[p as usize]);
            let [start, held] = spread.still.elements[t];
            let growth = spread.growth.as_flattened()[t];
            slopes[t - first] = start + (((a + b) + (c + d)) * MEAN - growth * held);
        }
    }

    /// Pieces of elements for threads.
    fn element_cuts(&self) -> Vec<usize> {
        self.row_cuts.iter().map(|r| (r * WIDTH).min(self.tets)).collect()
    }
}

/// The sum of six times the growth of a patch's elements, each of which counts for a quarter, over its own.
const SUM_OF_VOLUME: f32 = 24.0;

/// Share of a patch's pressure in the derivative of an element's energy by six times its volume.
const MEAN: f32 = 1.0 / SUM_OF_VOLUME;

/// Steps of a piece's patches.
struct Steps<'a> {
    of: &'a Pressures,
    which: Which<'a>,
    /// Of the whole step.
    share: f32,
    /// Patch that the piece begins with.
    first: usize,
    nodal: &'a mut [f32],
    /// With the penalty.
    total: &'a mut [f32],
}

impl Take for Steps<'_> {
    /// One step of a patch, whose elements have grown by `sum`.
    #[inline(always)]
    fn take(&mut self, patch: usize, sum: f32) {
        let step = self.of.rate[patch] * sum;
        let nodal = &mut self.nodal[patch - self.first];
        if self.which.advances(patch) {
            let whole = (*nodal + step) * self.of.share[patch];
            *nodal = if self.share < 1.0 { *nodal + self.share * (whole - *nodal) } else { whole };
        }
        self.total[patch - self.first] = *nodal + step;
    }
}

/// What elements' derivatives follow from.
struct Spread<'a> {
    of: Tissue<'a>,
    total: &'a [f32],
    growth: &'a [Row],
    still: &'a Still,
    which: Which<'a>,
    /// Row that the elements begin with.
    first: usize,
}

/// Elements' derivatives from the pressures of their corners.
struct Rows<'a> {
    spread: &'a Spread<'a>,
    slopes: &'a mut [f32],
}

impl Kernel for Rows<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let corners = self.spread.of.volumes.corners().numbers(self.spread.total);
        let which = self.spread.which;
        for (row, slopes) in (self.spread.first..).zip(self.slopes.chunks_mut(WIDTH)).filter(|s| which.row(s.0)) {
            corners.ask_ahead(row);
            ask_ahead(self.spread.growth, row);
            ask_ahead(self.spread.still.elements.as_chunks::<WIDTH>().0, row);
            let all = self.spread.row::<V>(&corners, row);
            // Sixteen but in the last.
            match (slopes.as_chunks_mut::<WIDTH>().0, which) {
                ([slopes], Which::All { .. }) => *slopes = all,
                _ => {
                    let own = (row * WIDTH..).zip(slopes).zip(all).filter(|s| which.element(s.0.0));
                    own.for_each(|((_, slope), new)| *slope = new);
                }
            }
        }
    }
}

impl Spread<'_> {
    /// The elements of a row; what is missing in the last one is nothing.
    #[inline(always)]
    fn row<V: Lanes>(&self, corners: &Numbers<'_, 4, u32>, row: usize) -> Row {
        let (still, mut padded) = (&self.still.elements[row * WIDTH..], [[0.0; 2]; WIDTH]);
        let still = still.first_chunk::<WIDTH>().unwrap_or_else(|| {
            padded[..still.len()].copy_from_slice(still);
            &padded
        });
        let mut out = [0.0; WIDTH];
        for lane in (0..WIDTH).step_by(V::N) {
            let (a, b): (V, V) = (corners.gather(row, 0, lane), corners.gather(row, 1, lane));
            let (c, d): (V, V) = (corners.gather(row, 2, lane), corners.gather(row, 3, lane));
            let [start, held] = V::load_pairs(still, lane);
            // The mean of its patches, less what the element's own change from now on will add again.
            let slope = start + (((a + b) + (c + d)) * V::splat(MEAN) - V::load(&self.growth[row], lane) * held);
            slope.store(&mut out, lane);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::super::elastic::Tangent;
    use super::*;
    use crate::Model;
    use crate::model::tests::{block, paper_options};
    use crate::vec3::six_volume;

    #[test]
    fn derivatives_of_elements_come_to_those_of_the_energy() {
        let mut mesh = block([4, 3, 3], 5.0);
        mesh.labels.iter_mut().skip(40).take(60).for_each(|l| *l = 5);
        let model = Model::new(&mesh, &paper_options()).expect("model");
        let (region, regions) = (&model.region[..], &model.regions[..]);
        let elastic = Elastic::new(&model.rest, (&model.tets, &model.membranes), (region, regions), 0.3);
        let (pressures, pool) = (Pressures::new(&elastic, (region, regions)), Pool::new(2));
        let of = Tissue { volumes: &model.volumes, region };
        let noise = |i: usize| 2.0 * ((i * 7919 % 1000) as f32 / 500.0 - 1.0);
        let mut positions = model.rest.clone();
        positions.iter_mut().enumerate().for_each(|(i, p)| (0..3).for_each(|a| p[a] += noise(3 * i + a)));
        let (mut still, mut growth, mut slopes, mut total) = (Still::default(), Vec::new(), Vec::new(), Vec::new());
        pressures.still(of, 0.0, &mut still, &pool);
        let rises = pressures.rises(of, &still);
        let mut nodal = vec![0.0; pressures.len()];
        for _ in 0..400 {
            let foreign = Foreign { fluid: &FluidPressure::default(), room: &[] };
            let which = (Which::All { advance: true }, foreign, &pool);
            let elements = Some((&still, &mut slopes));
            pressures.update((of, &positions), (&mut nodal, &mut growth), elements, &mut total, 1.0, which);
        }
        let at: Vec<[f64; 3]> = positions.iter().map(|p| xyz(*p).map(f64::from)).collect();
        let mut tangent = Tangent::default();
        elastic.gradient(&at, &mut Vec::new(), &mut tangent);
        for (t, tet) in model.tets.iter().enumerate() {
            let six = six_volume(tet.map(|v| xyz(positions[v as usize])));
            let (ours, energy) = (slopes[t] + rises[t] * six, tangent.pressure[t] / 6.0);
            assert!((f64::from(ours) - energy).abs() < 2e-4 * energy.abs().max(1.0), "{t}: {ours} for {energy}");
        }
    }
}
