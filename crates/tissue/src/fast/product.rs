//! Products of dense matrices.

/// Takes the product of a matrix `left` of `rows` by `inner` and one of `inner` by `columns` off `out`, all column by column;
/// columns of `left` and `out` begin `apart` numbers after each other, those of `right` follow at once.
///
/// # Panics
/// Where a matrix has fewer numbers than that.
pub(crate) fn take_product(
    (rows, inner, columns): (usize, usize, usize),
    (left, right): (&[f64], &[f64]),
    (out, apart): (&mut [f64], usize),
) {
    if rows == 0 || inner == 0 || columns == 0 {
        return;
    }
    let enough = |columns: usize| (columns - 1) * apart + rows;
    assert!(apart >= rows && left.len() >= enough(inner) && out.len() >= enough(columns));
    assert!(right.len() >= inner * columns);
    // SAFETY: all three are as large as they are said to be, by what was just asserted, and `out` is borrowed by itself.
    unsafe {
        matrixmultiply::dgemm(
            rows,
            inner,
            columns,
            -1.0,
            left.as_ptr(),
            1,
            apart as isize,
            right.as_ptr(),
            1,
            inner as isize,
            1.0,
            out.as_mut_ptr(),
            1,
            apart as isize,
        );
    }
}
