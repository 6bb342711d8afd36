//! How long edges should be where.

use super::MeshOptions;
use super::along::Along;
use super::census::{Census, blocks};
use super::fields::LabelFields;
use super::region::Region;
use super::start::{finest_for, first_guess};
use super::thickness::{Thin, spread};
use crate::surface::distance::squared_distance;
use monro_geometry::{Grid, Patient, Point, Volume};
use rayon::prelude::*;
use std::borrow::Cow;

/// Cell of the lattice on which the size is kept, mm (as all lengths here for a head: [`LabelFields::unit`]).
const STEP: f64 = 1.8;
/// Full resolution reaches this far from the fine labels and the path, mm.
pub(super) const CORE: f64 = 1.0;
/// Growth of edges away from thin places and the path, over the growth elsewhere.
const STEEPER: f64 = 2.0;
/// Edge length, mm, for which relative lengths change by the growth of lengths.
const USUAL: f64 = 3.0;

/// Distances from which the wanted edge length follows, with a free scale.
#[derive(Debug, Clone)]
pub(super) struct SizeField {
    distance: super::fields::Field,
    /// Longest edges next to thin places, if there are any.
    cap: Option<super::fields::Field>,
    /// Longest edges around the path.
    pub(super) along: Option<Along>,
    /// Thin places.
    pub(super) thin: Thin,
    /// Relative lengths of edges that densities ask for.
    scale: Option<super::fields::Field>,
    /// What lies at which distance, for estimates.
    census: Census,
    /// Where there is anything to mesh.
    region: Region,
    growth: f64,
    coarsest: f64,
    /// What stands for a millimetre, mm.
    pub(super) unit: f64,
    low: [f64; 3],
    high: [f64; 3],
}

impl SizeField {
    /// Distances to the labels numbered in `fine` (indices into the fields' labels) and to the path. Edges grow by
    /// `growth` mm a mm up to `coarsest` times the finest. With nothing to be fine about, all edges are alike.
    pub(super) fn new(fields: &LabelFields, fine: &[usize], options: &MeshOptions) -> Option<Self> {
        let &MeshOptions { path, growth, coarsest, .. } = options;
        let [low, high] = fields.union.volume().grid().bounds();
        let step = STEP * fields.unit;
        let dims: [usize; 3] = std::array::from_fn(|a| ((high[a] - low[a]) / step).ceil() as usize + 3);
        let grid = Grid::axis_aligned(dims, [step; 3], low.map(|x| x - step)).ok()?;
        let mut sites = vec![false; grid.len()];
        mark_labels(fields, fine, &grid, &mut sites);
        if let Some(path) = path {
            mark_path(path, &grid, &mut sites);
        }
        let distance = if sites.contains(&true) {
            squared_distance(&sites, dims, [step; 3]).into_iter().map(f32::sqrt).collect()
        } else {
            vec![0.0; grid.len()]
        };
        let scale = density_scale(fields, &options.density, growth, &grid);
        let blocks = blocks(&fields.union);
        let region = Region::new(&grid, blocks.iter().map(|block| block.0));
        let field =
            |of: Vec<f32>| super::fields::Field::new(Volume::new(grid, of).expect("a value of each cell of the grid"));
        let (distance, scale) = (field(distance), scale.map(field));
        let census = Census::new(fields, &blocks, |p| distance.at(p), |p| scale.as_ref().map_or(1.0, |s| s.at(p)));
        let volume = fields.volumes.iter().sum();
        let along = path.and_then(|path| Along::new(path, volume, options.elements, fields.unit, STEEPER * growth));
        let mut size = Self {
            cap: None,
            along,
            thin: Thin::none(),
            scale,
            distance,
            census,
            region,
            growth,
            coarsest,
            unit: fields.unit,
            low,
            high,
        };
        size.thin = Thin::new(fields, fine, finest_for(&size, first_guess(options.elements, fields)));
        Some(size)
    }

    /// With edges of `edge` mm around places, growing from there.
    pub(super) fn with_bounds(&self, places: &[([f64; 3], f64)]) -> Cow<'_, Self> {
        if places.is_empty() {
            return Cow::Borrowed(self);
        }
        let grid = *self.distance.volume().grid();
        let mut cap = vec![f32::MAX; grid.len()];
        for &(p, edge) in places {
            if let Some([i, j, k]) = grid.containing(Point::from_array(p)) {
                let cell = &mut cap[grid.index(i, j, k)];
                *cell = cell.min(edge as f32);
            }
        }
        spread(&mut cap, grid.dims(), grid.spacing()[0], STEEPER * self.growth);
        let cap = super::fields::Field::new(Volume::new(grid, cap).expect("a value of each cell of the grid"));
        Cow::Owned(Self { cap: Some(cap), ..self.clone() })
    }

    /// Growth of the edges, mm a mm.
    pub(super) const fn growth(&self) -> f64 {
        self.growth
    }

    /// Box of the region, mm.
    pub(super) const fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        (self.low, self.high)
    }

    /// Whether a box with `margin` mm around it holds some of the region.
    pub(super) fn is_near(&self, low: [f64; 3], high: [f64; 3], margin: f64) -> bool {
        self.region.meets(low.map(|x| x - margin), high.map(|x| x + margin))
    }

    /// Distance to what is to be fine, mm (to half a lattice cell).
    pub(super) fn distance(&self, p: [f64; 3]) -> f64 {
        self.distance.at(self.clamped(p))
    }

    /// Beyond the box the values at its rim serve: the lattice's cube is larger than the region.
    fn clamped(&self, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| p[a].clamp(self.low[a], self.high[a]))
    }

    /// Wanted edge length at `p` when the finest is `finest`.
    pub(super) fn edge(&self, p: [f64; 3], finest: f64) -> f64 {
        self.edge_and_cause(p, finest).0
    }

    /// The same, and whether it is so short because of the path.
    pub(super) fn edge_and_cause(&self, p: [f64; 3], finest: f64) -> (f64, bool) {
        let free = self.edge_off(self.distance(p), p, finest);
        match self.along.map(|along| along.edge_at(p)) {
            Some(along) if along < free => (along, true),
            _ => (free, false),
        }
    }

    /// The same but for the path, given the [`distance`](Self::distance) there.
    pub(super) fn edge_off(&self, distance: f64, p: [f64; 3], finest: f64) -> f64 {
        let p = self.clamped(p);
        let free = self.edge_at(distance, finest) * self.scale.as_ref().map_or(1.0, |s| s.at(p));
        self.cap.as_ref().map_or(free, |cap| free.min(cap.at(p)))
    }

    fn edge_at(&self, distance: f64, finest: f64) -> f64 {
        (finest + self.growth * (distance - CORE * self.unit).max(0.0)).min(finest * self.coarsest)
    }

    /// Elements that a cut lattice with this finest edge would have, at a guess.
    pub(super) fn estimate(&self, finest: f64, cell: impl Fn(f64) -> f64) -> f64 {
        self.census.estimate(|distance| cell(self.edge_at(distance, finest)))
    }
}

/// Relative lengths of edges on a lattice: the inverse cube roots of the labels' densities, shorter ones reaching into
/// longer by what `growth` allows. `None` where all are 1.
fn density_scale(fields: &LabelFields, density: &[(u16, f64)], growth: f64, grid: &Grid) -> Option<Vec<f32>> {
    let of = |label: u16| density.iter().find(|d| d.0 == label).map_or(1.0, |d| d.1.powf(-1.0 / 3.0) as f32);
    let scales: Vec<f32> = fields.labels.iter().map(|&l| of(l)).collect();
    if scales.iter().all(|&s| s == 1.0) {
        return None;
    }
    let longest = scales.iter().copied().fold(0.0, f32::max);
    let at = |at: usize| {
        let [i, j, k] = grid.voxel(at);
        fields.label_at(grid.centre(i, j, k).to_array()).map_or(longest, |l| scales[l])
    };
    let mut scale: Vec<f32> = (0..grid.len()).into_par_iter().map(at).collect();
    spread(&mut scale, grid.dims(), grid.spacing()[0], growth / (USUAL * fields.unit));
    Some(scale)
}

fn mark_labels(fields: &LabelFields, fine: &[usize], grid: &Grid, sites: &mut [bool]) {
    for &label in fine {
        let source = fields.parts.get(label).unwrap_or(&fields.union).volume();
        for (at, &value) in source.data().iter().enumerate() {
            if value >= 0.5 {
                let [i, j, k] = source.grid().voxel(at);
                let p = source.grid().centre(i, j, k);
                if label < fields.parts.len() || fields.label_at(p.to_array()) == Some(label) {
                    mark(p, grid, sites);
                }
            }
        }
    }
}

fn mark_path([from, to]: [Point<Patient>; 2], grid: &Grid, sites: &mut [bool]) {
    let steps = (from.distance(to) / (0.5 * grid.spacing()[0])).ceil().clamp(1.0, 1e4) as usize;
    for i in 0..=steps {
        mark(from.lerp(to, i as f64 / steps as f64), grid, sites);
    }
}

fn mark(p: Point<Patient>, grid: &Grid, sites: &mut [bool]) {
    if let Some([i, j, k]) = grid.containing(p) {
        sites[grid.index(i, j, k)] = true;
    }
}
