//! Where labels are thin: a lattice sees nothing thinner than its cells.

use super::fields::LabelFields;
use crate::surface::distance::squared_distance;
use monro_geometry::{Grid, Volume};
use rayon::prelude::*;

/// Part of the thickness an edge may have. A ball of radius 0.56 a always holds a point of the body-centred lattice of
/// cell edge a; with 0.8 no thin part can be lost, but rough labels are full of small ridges that would take the elements.
const EDGE_PER_THICKNESS: f64 = 1.0;
/// Growth of the distance per mm towards a neighbour above which a cell belongs to the neighbour's ball.
const COVERED: f32 = 0.5;
/// No thin place.
pub(super) const THICK: f32 = 1e3;

/// For each cell of `grid` the longest edge that the thin places of the labels in `fine` allow, grown by `growth` mm a mm
/// away from them.
pub(super) fn thickness_cap(fields: &LabelFields, fine: &[usize], growth: f64, grid: &Grid) -> Vec<f32> {
    let mut cap = vec![THICK; grid.len()];
    for &l in fine {
        if let Some(part) = fields.parts.get(l) {
            mark_thin(part.volume(), fields.step, grid, &mut cap);
        }
    }
    if cap.iter().any(|&c| c < THICK) {
        spread(&mut cap, grid.dims(), grid.spacing()[0], growth);
    }
    cap
}

/// Medial cells by the maximal-ball test: no neighbour's inscribed ball holds theirs.
fn mark_thin(field: &Volume<f32>, step: f64, grid: &Grid, cap: &mut [f32]) {
    let dims = field.grid().dims();
    let outside: Vec<bool> = field.data().iter().map(|&v| v < 0.5).collect();
    let mut d = squared_distance(&outside, dims, [step; 3]);
    d.par_iter_mut().for_each(|x| *x = x.sqrt());
    for k in 1..dims[2] - 1 {
        for j in 1..dims[1] - 1 {
            for i in 1..dims[0] - 1 {
                let at = field.grid().index(i, j, k);
                if d[at] > 0.0 && is_medial(&d, dims, at, step as f32) {
                    let edge = (EDGE_PER_THICKNESS * (2.0 * f64::from(d[at]) - step)) as f32;
                    if let Some([x, y, z]) = grid.containing(field.grid().centre(i, j, k)) {
                        let cell = &mut cap[grid.index(x, y, z)];
                        *cell = cell.min(edge);
                    }
                }
            }
        }
    }
}

fn is_medial(d: &[f32], dims: [usize; 3], at: usize, step: f32) -> bool {
    (0..27usize).filter(|&n| n != 13).all(|n| {
        let shift = [n % 3, n / 3 % 3, n / 9];
        let other = at + shift[0] + dims[0] * (shift[1] + dims[1] * shift[2]) - (1 + dims[0] * (1 + dims[1]));
        let length = (shift.iter().filter(|&&s| s != 1).count() as f32).sqrt() * step;
        d[other] - d[at] < COVERED * length
    })
}

/// Two sweeps over the rows of the array, each cell bounded by the neighbours already passed, `growth` more a mm.
pub(super) fn spread(cap: &mut [f32], dims: [usize; 3], step: f64, growth: f64) {
    let rise = [1.0f64, 2.0, 3.0].map(|n| (n.sqrt() * step * growth) as f32);
    let inner: Vec<[usize; 2]> = (1..dims[2] - 1).flat_map(|k| (1..dims[1] - 1).map(move |j| [j, k])).collect();
    let mut bound = vec![0f32; dims[0]];
    for backwards in [false, true] {
        let side = if backwards { 1 } else { -1 };
        // Rows passed before this one: how far off in y and z.
        let passed = [[-1, side], [0, side], [1, side], [side, 0]];
        for at in 0..inner.len() {
            let [j, k] = inner[if backwards { inner.len() - 1 - at } else { at }];
            bound.fill(f32::INFINITY);
            for [dj, dk] in passed {
                let first = dims[0] * (j.wrapping_add_signed(dj) + dims[1] * k.wrapping_add_signed(dk));
                let across = usize::from(dj != 0) + usize::from(dk != 0);
                lower(&mut bound, &cap[first..first + dims[0]], rise[across - 1], rise[across]);
            }
            let first = dims[0] * (j + dims[1] * k);
            sweep(&mut cap[first..first + dims[0]], &bound, rise[0], backwards);
        }
    }
}

/// Bounds the cells of a row by those of another, straight across and askew.
fn lower(bound: &mut [f32], row: &[f32], straight: f32, askew: f32) {
    let n = row.len();
    bound.iter_mut().zip(row).for_each(|(b, &r)| *b = b.min(r + straight));
    bound[1..].iter_mut().zip(row).for_each(|(b, &r)| *b = b.min(r + askew));
    bound[..n - 1].iter_mut().zip(&row[1..]).for_each(|(b, &r)| *b = b.min(r + askew));
}

/// Along a row, each cell bounded by the one before.
fn sweep(row: &mut [f32], bound: &[f32], rise: f32, backwards: bool) {
    let n = row.len();
    for i in 1..n - 1 {
        let (at, before) = if backwards { (n - 1 - i, n - i) } else { (i, i - 1) };
        row[at] = row[at].min(bound[at]).min(row[before] + rise);
    }
}
