//! Long waves of the pressure, which are solved for at once.
//!
//! Between sweeps the multipliers of the volume take steps of `r v`, `r` being what the sweeps carry of the volumetric
//! stiffness and `v` the growth. A wave of it with the wave number `q` is met by `r` and by its inertia; with
//! `A = r dt^2 q^2 / rho`, each step leaves `1 / (1 + A)` of what is missing. What is missing after all of them is a pressure that
//! comes late, and feeds the wave: growing by `z` in each time step of `s` such steps, it has `(1 - 1/z)^3 = 1 - (1 + A)^s`, and
//! dies out where `(1 + A)^s > 2` only. That is not so over the whole of a body that is soft for its size, nor in short time
//! steps. If one step goes a share `g` of its way, `w = 1 - 1/z` has `w^3 + (1 - g) A w + g A = 0`: at `g = A` the roots are
//! `-A` and two with `|z| = 1`, and with any smaller share the wave dies out. So
//!
//! - for all waves that are long, the pressure that takes away what is missing is found at once. What they are met by is their
//!   inertia: `dt^2 G^T M^-1 G`, the Schur complement of an inertial step (Cahouet and Chabard 1988), on functions that are
//!   linear between the points of a coarse grid. What inertia gives way by to that pressure, vertices go: the sweeps would take
//!   long to carry it on;
//! - patches take steps that the longest wave bears of which the grid knows nothing.

use super::elastic::{Elastic, volume_gradient};
use super::grid::{Grid, Place};
use crate::dense::{backward, eliminate, forward};
use crate::fast::Pool;
use crate::model::Region;
use crate::slabs::{self, PIECES};
use crate::vec3::shift;
use crate::{bytes, vec3};
use monro_geometry::d3::{D3, dot};

/// Cells of the grid along the longest side of the tissue.
const CELLS: f64 = 6.0;
/// Where `(1 + A)^s` of the longest wave is less than this, long waves are solved for; damping makes up for what is missing to
/// two (measured in docs/speed.md).
const LIVELY: f64 = 1.6;
/// Where it is less than this of the longest wave of which the grid knows nothing, patches go so much of the largest step that
/// does not feed it.
const CALM: f64 = 4.0;
const SHARE: f64 = 0.5;
/// Time steps for which the grid is solved, each for what is shorter: so many to an octave, and so many of them kept.
const STEPS: f64 = 4.0;
const KEPT: usize = 4;
/// A share of the largest softness, for points with nothing around them.
const NEXT_TO_NOTHING: f64 = 1e-9;

/// A patch in the grid.
#[derive(Debug, Clone, Copy)]
struct Spot {
    place: Place,
    /// Its volume over what the sweeps carry of its stiffness, and over what is left for the multiplier, mm3/kPa.
    carried: f32,
    left: f32,
}

/// Constants of long waves.
#[derive(Debug, Clone)]
pub(super) struct Waves {
    grid: Grid,
    /// Of each patch, if its pressure is partly a multiplier.
    spots: Vec<Option<Spot>>,
    /// Lower triangles, column by column: by how much inertia gives way to the pressure at a point in a second squared,
    /// mm3/kPa/s2, and the multipliers' own softness, mm3/kPa.
    inertia: Vec<f64>,
    softness: Vec<f64>,
    /// Of each vertex, between the starts: points, and by how much pressure there accelerates it, mm/s2/kPa.
    start: Vec<u32>,
    pushed: Vec<(u32, [f32; 3])>,
    node_cuts: Vec<usize>,
    patch_cuts: Vec<usize>,
    /// `A` of the longest wave over the square of the time step, 1/s2; of none if there is no multiplier.
    longest: Option<f64>,
}

/// What long waves are solved with.
#[derive(Debug, Clone, Default)]
pub(super) struct WaveScratch {
    /// Factors, by the number of the time step that they are for.
    factors: Vec<(i32, Vec<f64>)>,
    /// What is missing at each point, as each piece of the patches has it, mm3.
    missing: Vec<f64>,
    /// The pressures of points, kPa.
    pressure: Vec<f64>,
}

impl Waves {
    /// `carried` is what sweeps carry of the volumetric stiffness of each patch, kPa.
    pub(super) fn new(elastic: &Elastic, carried: &[f64], rest: &[[f32; 4]], regions: &[Region]) -> Self {
        let left = |p: usize| elastic.patch_bulk[p] - carried[p];
        let own: Vec<usize> = (0..carried.len()).filter(|&p| left(p) > 1e-6 * carried[p]).collect();
        let mut vertex = vec![0; carried.len()];
        for (patches, corners) in elastic.patch.iter().zip(&elastic.tets) {
            patches.iter().zip(corners).for_each(|(&p, &v)| vertex[p as usize] = v as usize);
        }
        let at: Vec<D3> = own.iter().map(|&p| elastic.rest[vertex[p]]).collect();
        let grid = Grid::around(&at, CELLS);
        let mut spots = vec![None; carried.len()];
        for (&p, &at) in own.iter().zip(&at) {
            let over = |kpa: f64| (elastic.patch_volume[p] / kpa) as f32;
            spots[p] = Some(Spot { place: grid.place(at), carried: over(carried[p]), left: over(left(p)) });
        }
        let softest = own.iter().map(|&p| carried[p]).reduce(f64::min);
        let densest = regions.iter().map(|r| r.material.density_kg_m3).fold(0.0, f64::max);
        // 1 kPa / (kg/m3) / mm2 is 1e9/s2.
        let wave = |kpa: f64| 1e9 * kpa / densest * (core::f64::consts::PI / grid.longest).powi(2);
        let mut waves = Self {
            longest: softest.map(wave),
            inertia: Vec::new(),
            softness: Vec::new(),
            start: vec![0],
            pushed: Vec::new(),
            node_cuts: slabs::even_cuts(rest.len()),
            patch_cuts: slabs::even_cuts(carried.len()),
            spots,
            grid,
        };
        if waves.longest.is_some() {
            waves.assemble(&waves.fluxes(elastic, rest.len()), rest);
        }
        waves
    }

    /// Of each vertex: what its motion adds to the volumes around points, mm2.
    fn fluxes(&self, elastic: &Elastic, vertices: usize) -> Vec<Vec<(usize, D3)>> {
        let mut fluxes: Vec<Vec<(usize, D3)>> = vec![Vec::new(); vertices];
        for (tet, patches) in elastic.tets.iter().zip(&elastic.patch) {
            let (_, gradient) = volume_gradient(tet.map(|v| elastic.rest[v as usize]));
            for spot in patches.iter().filter_map(|&p| self.spots[p as usize]) {
                for (point, weight) in self.grid.weights(spot.place) {
                    for (&v, g) in tet.iter().zip(gradient) {
                        // A quarter of an element is of each of its patches.
                        note(&mut fluxes[v as usize], point, g.map(|g| 0.25 * weight * g));
                    }
                }
            }
        }
        fluxes
    }

    /// Both matrices, and what is pushed.
    fn assemble(&mut self, fluxes: &[Vec<(usize, D3)>], rest: &[[f32; 4]]) {
        let n = self.grid.len();
        let (mut inertia, mut softness) = (vec![0.0; n * n], vec![0.0; n * n]);
        for spot in self.spots.iter().flatten() {
            add_pairs(&mut softness, n, &self.grid.weights(spot.place), |a, b| f64::from(spot.left) * a * b);
        }
        for (flux, p) in fluxes.iter().zip(rest) {
            let lightness = f64::from(p[3]);
            if lightness > 0.0 {
                add_pairs(&mut inertia, n, flux, |a, b| lightness * dot(a, b));
                let push = |&(point, g): &(usize, D3)| (point as u32, g.map(|g| (lightness * g) as f32));
                self.pushed.extend(flux.iter().map(push));
            }
            self.start.push(self.pushed.len() as u32);
        }
        (self.inertia, self.softness) = (inertia, softness);
    }

    /// Whether long waves are to be solved for in a time step, s, with so many steps of all patches.
    pub(super) fn asked(&self, dt: f32, steps: u32) -> bool {
        let bears = |a: f64| (1.0 + a * f64::from(dt).powi(2)).powf(steps.into());
        self.longest.is_some_and(|a| bears(a) < LIVELY)
    }

    /// Share of the whole step that patches may go, with so many in a time step, s.
    pub(super) fn share(&self, dt: f32, steps: u32) -> f32 {
        let Some(longest) = self.longest else { return 1.0 };
        let (a, steps) = (longest * (CELLS * f64::from(dt)).powi(2), f64::from(steps.max(1)));
        if (1.0 + a).powf(steps) >= CALM { 1.0 } else { (SHARE * a / steps).min(1.0) as f32 }
    }

    /// Takes away what is missing of long waves: adds to the pressures of patches, which have just taken a step of their own, and
    /// moves the vertices. `total` is with what the sweeps carry.
    pub(super) fn level(
        &self,
        dt: f32,
        positions: &mut [[f32; 4]],
        (nodal, total): (&mut [f32], &[f32]),
        (scratch, pool): (&mut WaveScratch, &Pool),
    ) {
        let number = (STEPS * f64::from(dt).log2()).ceil();
        let dt = (number / STEPS).exp2();
        let WaveScratch { factors, missing, pressure } = scratch;
        self.gather((nodal, total), missing, pool);
        pressure.clear();
        pressure.resize(self.grid.len(), 0.0);
        for piece in missing.chunks_exact(self.grid.len()) {
            pressure.iter_mut().zip(piece).for_each(|(p, m)| *p += m);
        }
        let factors = self.factors(factors, (number as i32, dt));
        forward(factors, pressure);
        backward(factors, pressure);
        self.press(pressure, nodal, pool);
        self.push(pressure, (dt * dt) as f32, positions, pool);
    }

    /// What is missing at each point, piece by piece of the patches.
    fn gather(&self, (nodal, total): (&[f32], &[f32]), missing: &mut Vec<f64>, pool: &Pool) {
        let n = self.grid.len();
        missing.clear();
        missing.resize(n * (self.patch_cuts.len() - 1), 0.0);
        let cuts: [usize; PIECES + 1] = core::array::from_fn(|i| n * i);
        pool.each_part(missing, &cuts[..self.patch_cuts.len()], &mut [(); PIECES], &|i, missing, ()| {
            for p in self.patch_cuts[i]..self.patch_cuts[i + 1] {
                let Some(spot) = self.spots[p] else { continue };
                let lacks = f64::from(spot.carried * (total[p] - nodal[p]) - spot.left * nodal[p]);
                self.grid.weights(spot.place).into_iter().for_each(|(point, w)| missing[point] += w * lacks);
            }
        });
    }

    /// Adds pressures of points to those of patches.
    fn press(&self, pressure: &[f64], nodal: &mut [f32], pool: &Pool) {
        pool.each_part(nodal, &self.patch_cuts, &mut [(); PIECES], &|i, nodal, ()| {
            for (nodal, spot) in nodal.iter_mut().zip(&self.spots[self.patch_cuts[i]..]) {
                let Some(spot) = spot else { continue };
                *nodal += self.grid.weights(spot.place).into_iter().map(|(i, w)| w * pressure[i]).sum::<f64>() as f32;
            }
        });
    }

    /// Moves vertices as pressures of points do in a time step, of which the square is given, s2.
    fn push(&self, pressure: &[f64], square: f32, positions: &mut [[f32; 4]], pool: &Pool) {
        pool.each_part(positions, &self.node_cuts, &mut [(); PIECES], &|i, positions, ()| {
            for (p, ends) in positions.iter_mut().zip(self.start[self.node_cuts[i]..].windows(2)) {
                let mut way = [0.0; 3];
                for &(point, push) in &self.pushed[ends[0] as usize..ends[1] as usize] {
                    way = vec3::add(way, vec3::scale(push, pressure[point as usize] as f32));
                }
                shift(p, -square, way);
            }
        });
    }

    /// Factors for a time step, told by its number.
    fn factors<'a>(&self, kept: &'a mut Vec<(i32, Vec<f64>)>, (number, dt): (i32, f64)) -> &'a [f64] {
        let at = kept.iter().position(|k| k.0 == number).unwrap_or_else(|| {
            kept.truncate(KEPT - 1);
            kept.insert(0, (number, self.solve(dt)));
            0
        });
        &kept[at].1
    }

    fn solve(&self, dt: f64) -> Vec<f64> {
        let n = self.grid.len();
        let mut a: Vec<f64> = self.inertia.iter().zip(&self.softness).map(|(m, s)| dt * dt * m + s).collect();
        let most = (0..n).map(|i| a[i * (n + 1)]).fold(0.0, f64::max);
        (0..n).for_each(|i| a[i * (n + 1)] += NEXT_TO_NOTHING * most);
        // The matrix is positive: every patch has a softness.
        let negative = eliminate(&mut a, n, n);
        debug_assert_eq!(negative, Some(0), "a softness is negative");
        a
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        let points = bytes::of(&self.inertia) + bytes::of(&self.softness);
        points + bytes::of(&self.spots) + bytes::of(&self.start) + bytes::of(&self.pushed)
    }
}

impl WaveScratch {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        let factors = self.factors.iter().map(|f| bytes::of(&f.1)).sum::<usize>();
        factors + bytes::of(&self.missing) + bytes::of(&self.pressure)
    }
}

/// Adds to what a list has at a point.
fn note(list: &mut Vec<(usize, D3)>, point: usize, more: D3) {
    match list.iter_mut().find(|l| l.0 == point) {
        Some((_, sum)) => (0..3).for_each(|a| sum[a] += more[a]),
        None => list.push((point, more)),
    }
}

/// Adds the products of all pairs of a list to a lower triangle.
fn add_pairs<T: Copy>(a: &mut [f64], size: usize, list: &[(usize, T)], product: impl Fn(T, T) -> f64) {
    for &(column, x) in list {
        for &(row, y) in list.iter().filter(|o| o.0 >= column) {
            a[column * size + row] += product(x, y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pressure::carried;
    use super::*;
    use crate::model::tests::{block, paper_options};
    use crate::vec3::xyz;
    use crate::{Material, Model};

    /// Two regions, of which one has hardly a multiplier, and one side that is held.
    fn model(held: bool) -> (Model, Elastic) {
        let mut mesh = block([7, 5, 4], 5.0);
        mesh.labels.iter_mut().skip(40).take(60).for_each(|l| *l = 5);
        let mut options = paper_options();
        options.materials.insert(4, Material { poisson: 0.499, ..Material::BRAIN });
        let mut model = Model::new(&mesh, &options).expect("model");
        model.rest.iter_mut().filter(|p| held && p[0] == 0.0).for_each(|p| p[3] = 0.0);
        let of = (&model.region[..], &model.regions[..]);
        let elastic = Elastic::new(&model.rest, (&model.tets, &model.membranes), of, 0.3);
        (model, elastic)
    }

    /// By how much each patch has grown, mm3.
    fn grown(elastic: &Elastic, at: &[[f32; 4]]) -> Vec<f64> {
        let mut grown = vec![0.0; elastic.patch_volume.len()];
        for ((tet, patches), rest) in elastic.tets.iter().zip(&elastic.patch).zip(&elastic.volume) {
            let (now, _) = volume_gradient(tet.map(|v| xyz(at[v as usize]).map(f64::from)));
            patches.iter().for_each(|&p| grown[p as usize] += (now - rest) / 4.0);
        }
        grown
    }

    /// The square of what is missing at all points, mm6, where patches have the pressures `nodal`.
    fn missing(waves: &Waves, elastic: &Elastic, at: &[[f32; 4]], nodal: &[f32]) -> f64 {
        let (grown, mut out) = (grown(elastic, at), vec![0.0; waves.grid.len()]);
        for (p, spot) in waves.spots.iter().enumerate().filter_map(|(p, s)| s.map(|s| (p, s))) {
            let lacks = grown[p] - f64::from(spot.left * nodal[p]);
            waves.grid.weights(spot.place).into_iter().for_each(|(i, w)| out[i] += w * lacks);
        }
        out.iter().map(|m| m * m).sum()
    }

    #[test]
    fn what_is_missing_of_long_waves_is_gone_after_one_step_and_no_momentum_with_it() {
        for (held, dt) in [(true, 1.0 / 60.0), (false, 1.0 / 60.0), (true, 1e-3)] {
            let (model, elastic) = model(held);
            let regions = &model.regions[..];
            let own = carried(&elastic, (&model.region, regions));
            let waves = Waves::new(&elastic, &own, &model.rest, regions);
            // Up to a hundredth of an element.
            let mut at = model.rest.clone();
            let sway = |p: [f32; 4], a: usize| 0.05 * (0.09 * p[(a + 1) % 3] + a as f32).sin() * (0.07 * p[a]).cos();
            at.iter_mut().filter(|p| p[3] > 0.0).for_each(|p| {
                let way: [f32; 3] = core::array::from_fn(|a| sway(*p, a));
                shift(p, 1.0, way);
            });
            let mut nodal: Vec<f32> = (0..own.len()).map(|p| 0.01 * (p as f32).sin()).collect();
            let before = missing(&waves, &elastic, &at, &nodal);
            let carry = |(p, grown): (usize, f64)| nodal[p] + (own[p] * grown / elastic.patch_volume[p]) as f32;
            let total: Vec<f32> = grown(&elastic, &at).into_iter().enumerate().map(carry).collect();
            let from = at.clone();
            let mut scratch = WaveScratch::default();
            waves.level(dt, &mut at, (&mut nodal, &total), (&mut scratch, &Pool::new(2)));
            let after = missing(&waves, &elastic, &at, &nodal);
            // What is left is of second order, in displacements of a hundredth of an element.
            assert!(after < 0.02f64.powi(2) * before, "held {held}, dt {dt}: {after} of {before} mm6");
            let mut momentum = [0.0; 3];
            let mut most = 0.0f64;
            for (p, q) in from.iter().zip(&at).filter(|(p, _)| p[3] > 0.0) {
                (0..3).for_each(|a| momentum[a] += f64::from((q[a] - p[a]) / p[3]));
                most += f64::from((q[0] - p[0]).abs() / p[3]);
            }
            let held_still = from.iter().zip(&at).all(|(p, q)| p[3] > 0.0 || p == q);
            assert!(held_still, "a vertex that is held has moved");
            assert!(held || momentum.iter().all(|m| m.abs() < 1e-4 * most), "{momentum:?} of {most}");
        }
    }

    #[test]
    fn long_waves_are_solved_for_in_short_steps_and_soft_bodies_only() {
        let (model, elastic) = model(true);
        let own = carried(&elastic, (&model.region, &model.regions));
        let waves = Waves::new(&elastic, &own, &model.rest, &model.regions);
        // By hand: 35 mm, 4 mu = 4.003 kPa, 1040 kg/m3; 1e9 * 4.003 / 1040 * (pi / 35)^2 = 3.10e4/s2.
        let longest = waves.longest.expect("a multiplier");
        assert!((longest / 3.10e4 - 1.0).abs() < 0.01, "{longest}");
        assert!(!waves.asked(1.0 / 60.0, 2) && waves.asked(1e-3, 2) && !waves.asked(1e-3, 40));
        assert!(waves.share(1.0 / 60.0, 2) == 1.0 && waves.share(1e-4, 2) < 0.1);
    }
}
