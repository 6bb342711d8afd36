//! Sorting what belongs to the points of a mesh.

/// The items in order, if that is first of all the order of the `point` that each belongs to.
///
/// Those of a point are put side by side by counting, and sorted there: a point of a mesh has few, so this takes time in
/// proportion to their number.
///
/// # Panics
/// When an item's point is not below `points`.
pub(crate) fn sorted_by_point<T: Copy + Ord>(items: &[T], points: usize, point: impl Fn(&T) -> u32) -> Vec<T> {
    let mut at = vec![0usize; points + 1];
    items.iter().for_each(|i| at[point(i) as usize + 1] += 1);
    for p in 1..at.len() {
        at[p] += at[p - 1];
    }
    let mut out = items.to_vec();
    for item in items {
        let slot = &mut at[point(item) as usize];
        out[*slot] = *item;
        *slot += 1;
    }
    out.chunk_by_mut(|a, b| point(a) == point(b)).for_each(<[T]>::sort_unstable);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_usual_order(pairs in proptest::collection::vec((0u32..20, 0u32..5), 0..200)) {
            let mut usual = pairs.clone();
            usual.sort_unstable();
            prop_assert_eq!(sorted_by_point(&pairs, 20, |p| p.0), usual);
        }
    }
}
