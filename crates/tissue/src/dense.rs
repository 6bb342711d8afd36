//! A symmetric dense matrix of which the first unknowns are eliminated: `L D L^T`, without pivoting.
//!
//! No pivoting is needed where the matrix is quasidefinite (Vanderbei 1995), as that of displacements and pressures is as long as
//! the tissue is stable; where it is not, pivots of the wrong sign tell.

use crate::fast::take_product;

/// Columns that are eliminated before the rest hears of it.
const PANEL: usize = 48;
/// Columns of the rest that hear of it at once: nothing above the diagonal is needed.
const STRIP: usize = 128;

/// Eliminates the first `own` unknowns of a matrix of `size` columns, of which the lower triangle is given column by column.
/// The columns eliminated then hold `D` on the diagonal and `L` below, the rest what is left for the others. How many pivots are
/// negative; `None` where one is zero or no number.
pub(crate) fn eliminate(a: &mut [f64], size: usize, own: usize) -> Option<usize> {
    let mut negative = 0;
    let mut scaled = vec![0.0; PANEL * size];
    for first in (0..own).step_by(PANEL) {
        let last = own.min(first + PANEL);
        for j in first..last {
            negative += usize::from(pivot(a, size, (first, j))? < 0.0);
        }
        spread(a, size, (first, last), &mut scaled);
    }
    Some(negative)
}

/// Eliminates unknown `j`, of which the columns before `first` are accounted for.
fn pivot(a: &mut [f64], size: usize, (first, j): (usize, usize)) -> Option<f64> {
    let (before, column) = a.split_at_mut(j * size);
    let column = &mut column[j..size];
    for k in first..j {
        let other = &before[k * size..(k + 1) * size];
        let factor = other[k] * other[j];
        column.iter_mut().zip(&other[j..]).for_each(|(c, o)| *c -= factor * o);
    }
    let pivot = column[0];
    let inverse = 1.0 / pivot;
    if !(inverse.is_finite() && pivot.is_finite()) {
        return None;
    }
    column[1..].iter_mut().for_each(|c| *c *= inverse);
    Some(pivot)
}

/// Takes what the columns from `first` to `last` are to the rest off the rest.
fn spread(a: &mut [f64], size: usize, (first, last): (usize, usize), scaled: &mut [f64]) {
    let width = last - first;
    let (panel, rest) = a.split_at_mut(last * size);
    let panel = &panel[first * size..];
    for (row, scaled) in (last..size).zip(scaled.chunks_exact_mut(width)) {
        (0..width).for_each(|k| scaled[k] = panel[k * size + first + k] * panel[k * size + row]);
    }
    for from in (last..size).step_by(STRIP) {
        let to = size.min(from + STRIP);
        let right = &scaled[(from - last) * width..(to - last) * width];
        let (sizes, apart) = ((size - from, width, to - from), size);
        take_product(sizes, (&panel[from..], right), (&mut rest[(from - last) * size + from..], apart));
    }
}

/// Takes what the unknowns eliminated are to the others off these, in a right side, and divides by the pivots; `columns` are
/// those that [`eliminate`] has left of them.
pub(crate) fn forward(columns: &[f64], x: &mut [f64]) {
    let size = x.len().max(1);
    for (j, column) in columns.chunks_exact(size).enumerate() {
        let (own, rest) = x.split_at_mut(j + 1);
        let value = own[j];
        rest.iter_mut().zip(&column[j + 1..]).for_each(|(r, l)| *r -= l * value);
    }
    for (j, column) in columns.chunks_exact(size).enumerate() {
        x[j] /= column[j];
    }
}

/// Solves for the unknowns eliminated, with the others known, after [`forward`].
pub(crate) fn backward(columns: &[f64], x: &mut [f64]) {
    for (j, column) in columns.chunks_exact(x.len().max(1)).enumerate().rev() {
        let (own, rest) = x.split_at_mut(j + 1);
        own[j] -= rest.iter().zip(&column[j + 1..]).map(|(r, l)| r * l).sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quasidefinite: the first `positive` unknowns are, the others negative.
    fn matrix(size: usize, positive: usize) -> Vec<f64> {
        let noise = |i: usize, j: usize| ((i * 7919 + j * 104_729) % 1000) as f64 / 500.0 - 1.0;
        let mut a = vec![0.0; size * size];
        for j in 0..size {
            for i in j..size {
                let same = (i < positive) == (j < positive);
                let diagonal = if i == j { 2.0 * size as f64 } else { 0.0 };
                let value = if same { diagonal + noise(i, j) } else { 3.0 * noise(i, j) };
                a[j * size + i] = if same && i >= positive { -value } else { value };
            }
        }
        a
    }

    fn entry(a: &[f64], size: usize, i: usize, j: usize) -> f64 {
        a[i.min(j) * size + i.max(j)]
    }

    #[test]
    fn what_was_eliminated_and_what_is_left_give_the_matrix_again() {
        for (size, own, positive) in [(1, 1, 1), (5, 3, 4), (60, 50, 40), (190, 97, 150), (150, 150, 100)] {
            let a = matrix(size, positive);
            let mut f = a.clone();
            assert_eq!(eliminate(&mut f, size, own), Some(own - own.min(positive)));
            let lower = |i: usize, k: usize| if i == k { 1.0 } else { f[k * size + i] };
            for j in 0..size {
                for i in j..size {
                    let both: f64 = (0..own.min(j + 1)).map(|k| lower(i, k) * f[k * size + k] * lower(j, k)).sum();
                    let left = if j >= own { f[j * size + i] } else { 0.0 };
                    let error = (both + left - entry(&a, size, i, j)).abs();
                    assert!(error < 1e-10 * size as f64, "{size} {own}: {error} at {i} {j}");
                }
            }
        }
    }

    #[test]
    fn a_pivot_of_zero_is_no_factor() {
        assert_eq!(eliminate(&mut [0.0, 1.0, 1.0, 0.0], 2, 2), None);
        assert_eq!(eliminate(&mut [f64::NAN], 1, 1), None);
    }
}
