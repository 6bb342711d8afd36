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

/// Two sweeps over the array, each cell bounded by the neighbours already passed.
fn spread(cap: &mut [f32], dims: [usize; 3], step: f64, growth: f64) {
    let rise = |n: usize| {
        let s = [n % 3, n / 3 % 3, n / 9];
        ((s.iter().filter(|&&s| s != 1).count() as f64).sqrt() * step * growth) as f32
    };
    let rises: [f32; 27] = std::array::from_fn(rise);
    let mut visit = |at: usize, half: std::ops::Range<usize>| {
        let (i, j, k) = (at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1]));
        if [(i, dims[0]), (j, dims[1]), (k, dims[2])].iter().any(|&(x, n)| x == 0 || x + 1 == n) {
            return;
        }
        let base = at - (1 + dims[0] * (1 + dims[1]));
        let mut low = cap[at];
        for n in half {
            let other = base + n % 3 + dims[0] * (n / 3 % 3 + dims[1] * (n / 9));
            low = low.min(cap[other] + rises[n]);
        }
        cap[at] = low;
    };
    let count = dims.iter().product();
    (0..count).for_each(|at| visit(at, 0..13));
    (0..count).rev().for_each(|at| visit(at, 14..27));
}
