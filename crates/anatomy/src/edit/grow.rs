//! Region growing with two guards against leaks.

use super::selection::check_grid;
use super::{EditError, Selection, grown, islands, shrunk};
use monro_geometry::{Grid, Volume};
use std::collections::VecDeque;
use std::ops::RangeInclusive;

/// Where to grow and when to stop.
#[derive(Debug, Clone, PartialEq)]
pub struct GrowthOptions {
    /// Values (HU) that belong to the region.
    pub range: RangeInclusive<i16>,
    /// Only inside this selection.
    pub within: Option<Selection>,
    /// Passages narrower than this (mm) are not entered; 0 enters all. Features thinner than this that hang on the
    /// region are lost too.
    pub neck_mm: f64,
    /// Growing stops at this volume, mm3: more is a leak.
    pub most_mm3: f64,
}

/// A grown region.
#[derive(Debug, Clone, PartialEq)]
pub struct Growth {
    /// Its voxels.
    pub selection: Selection,
    /// Where the volume limit stopped it; `None` when the region came to its own end. A stopped region is a ball
    /// around the seeds and not the structure: narrow the range or widen `neck_mm`.
    pub stopped_at: Option<[usize; 3]>,
}

/// The voxels that are reached from the seeds over faces through values in range.
///
/// The neck guard is an opening by reconstruction: voxels closer than half of `neck_mm` to the outside are left out,
/// the part that holds the seed (or is nearest to it within the region) is kept, and grown back into the region.
///
/// # Errors
/// No seed, a seed outside the volume or with a value out of range; grids that differ; guards that are not numbers.
pub fn grow(ct: &Volume<i16>, seeds: &[[usize; 3]], options: &GrowthOptions) -> Result<Growth, EditError> {
    let neck = options.neck_mm;
    super::check("neck_mm", neck, (0.0..=1000.0).contains(&neck), "between 0 and 1000 mm")?;
    super::check("most_mm3", options.most_mm3, options.most_mm3 > 0.0, "positive")?;
    let seeds = checked_seeds(ct, seeds, options)?;
    let limit = (options.most_mm3 / ct.grid().voxel_volume()).min(1e18) as usize;
    // With the neck guard on, the limit applies to what the guard leaves.
    let first_limit = if neck > 0.0 { usize::MAX } else { limit };
    let (voxels, stopped_at) = flood(ct, &seeds, options, first_limit);
    let region = Selection::from_voxels(*ct.grid(), voxels.clone());
    if neck <= 0.0 {
        return Ok(Growth { selection: region, stopped_at });
    }
    let core = shrunk(&region, neck / 2.0)?;
    // The flood's order is by distance, so the first of its voxels in the core is the nearest to the seeds.
    let Some(&start) = voxels.iter().find(|&&n| core.contains(n)) else {
        return Err(EditError::Empty { what: "the region wider than neck_mm", verb: "grow" });
    };
    let core = seed_parts(&core, &seeds, start);
    let selection = grown(&core, neck / 2.0)?.intersection(&region)?;
    let nearest: Vec<usize> = voxels.into_iter().filter(|&n| selection.contains(n)).take(limit + 1).collect();
    match nearest.get(limit).map(|&n| ct.grid().voxel(n)) {
        None => Ok(Growth { selection, stopped_at: None }),
        at => Ok(Growth { selection: Selection::from_voxels(*ct.grid(), nearest[..limit].to_vec()), stopped_at: at }),
    }
}

fn checked_seeds(ct: &Volume<i16>, seeds: &[[usize; 3]], options: &GrowthOptions) -> Result<Vec<usize>, EditError> {
    let grid = ct.grid();
    if let Some(within) = &options.within {
        check_grid(grid.dims(), within.grid().dims())?;
    }
    if seeds.is_empty() {
        return Err(EditError::Empty { what: "the list of seeds", verb: "grow" });
    }
    let check = |&voxel: &[usize; 3]| {
        let dims = grid.dims();
        if (0..3).any(|a| voxel[a] >= dims[a]) {
            return Err(EditError::Outside { voxel, dims });
        }
        let n = grid.index(voxel[0], voxel[1], voxel[2]);
        let value = ct.data()[n];
        if options.range.contains(&value) {
            Ok(n)
        } else {
            Err(EditError::Seed { voxel, value, low: *options.range.start(), high: *options.range.end() })
        }
    };
    seeds.iter().map(check).collect()
}

/// Breadth first from the seeds, up to `limit` voxels; the voxels in that order, and where the limit struck.
fn flood(ct: &Volume<i16>, seeds: &[usize], options: &GrowthOptions, limit: usize) -> (Vec<usize>, Option<[usize; 3]>) {
    let grid = ct.grid();
    let mut allowed = match &options.within {
        Some(within) => within.to_flags(),
        None => vec![true; grid.len()],
    };
    let mut waiting = VecDeque::new();
    let mut out = Vec::new();
    for &n in seeds {
        if core::mem::replace(&mut allowed[n], false) {
            waiting.push_back(n);
        }
    }
    while let Some(n) = waiting.pop_front() {
        if out.len() == limit {
            return (out, Some(grid.voxel(n)));
        }
        out.push(n);
        for q in faces(grid, n) {
            if options.range.contains(&ct.data()[q]) && core::mem::replace(&mut allowed[q], false) {
                waiting.push_back(q);
            }
        }
    }
    (out, None)
}

/// The up to six voxels across the faces of one.
fn faces(grid: &Grid, n: usize) -> impl Iterator<Item = usize> {
    let [nx, ny, _] = grid.dims();
    let (v, dims) = (grid.voxel(n), grid.dims());
    [1, nx, nx * ny].into_iter().enumerate().flat_map(move |(a, step)| {
        let down = (v[a] > 0).then(|| n - step);
        let up = (v[a] + 1 < dims[a]).then_some(n + step);
        [down, up].into_iter().flatten()
    })
}

/// The parts of the core that hold a seed, or else the part of the voxel nearest to them.
fn seed_parts(core: &Selection, seeds: &[usize], nearest: usize) -> Selection {
    let parts = islands(core);
    let holds = |part: &&Selection| seeds.iter().any(|&s| part.contains(s));
    let mut voxels: Vec<usize> = parts.iter().filter(holds).flat_map(Selection::voxels).collect();
    if voxels.is_empty() {
        voxels = parts.iter().filter(|p| p.contains(nearest)).flat_map(Selection::voxels).collect();
    }
    Selection::from_voxels(*core.grid(), voxels)
}
