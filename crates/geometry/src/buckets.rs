//! Sorting what belongs to the points of a mesh.

/// Where the items of each point begin, and one end more; and all items point after point, those of one in their order.
/// `items` come with the point that each belongs to, and are gone through twice.
///
/// # Panics
/// When an item's point is not below `points`.
pub fn by_point<T: Copy + Default>(items: impl Iterator<Item = (u32, T)> + Clone, points: usize) -> (Vec<u32>, Vec<T>) {
    let mut first = vec![0u32; points + 1];
    items.clone().for_each(|(point, _)| first[point as usize + 1] += 1);
    for p in 1..first.len() {
        first[p] += first[p - 1];
    }
    let mut at = first.clone();
    let mut out = vec![T::default(); first[points] as usize];
    for (point, item) in items {
        let slot = &mut at[point as usize];
        out[*slot as usize] = item;
        *slot += 1;
    }
    (first, out)
}

/// The items in order, if that is first of all the order of the `point` that each belongs to.
///
/// Those of a point are put side by side by counting, and sorted there: a point of a mesh has few, so this takes time in
/// proportion to their number.
///
/// # Panics
/// When an item's point is not below `points`.
pub(crate) fn sorted_by_point<T: Copy + Default + Ord>(
    items: &[T],
    points: usize,
    point: impl Fn(&T) -> u32,
) -> Vec<T> {
    let (_, mut out) = by_point(items.iter().map(|i| (point(i), *i)), points);
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
