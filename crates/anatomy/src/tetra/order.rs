//! In which order the labels are cut off.
//!
//! A label is cut off from all that come after it at once. A layer between two others so gets both its surfaces in one go,
//! where an edge of the lattice that crosses it has both ends on the same side; cut off from one end of a stack to the other,
//! each layer has one surface left. So labels with few neighbours left come first.

/// A neighbour counts from this part of all that a label shares with those left: rims of layers do not.
const COUNTS: f64 = 0.1;

/// The order in which to cut off all labels but the last, given how much surface each shares with each, in whatever unit.
/// Labels with as many neighbours stay in the order that they have.
pub(super) fn cutting_order(shared: &[Vec<usize>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..shared.len()).collect();
    let mut order = Vec::new();
    while let Some((_, next)) = left
        .split_last()
        .map(|(_, parts)| parts)
        .and_then(|parts| parts.iter().map(|&l| (neighbours(&shared[l], &left), l)).min())
    {
        left.retain(|&l| l != next);
        order.push(next);
    }
    order
}

/// Of how many of the labels left one has a part worth counting.
fn neighbours(shared: &[usize], left: &[usize]) -> usize {
    let all: usize = left.iter().map(|&l| shared[l]).sum();
    left.iter().filter(|&&l| shared[l] as f64 > COUNTS * all as f64).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Labels that share a surface of the size given.
    fn table(count: usize, pairs: &[(usize, usize, usize)]) -> Vec<Vec<usize>> {
        let mut shared = vec![vec![0; count]; count];
        for &(a, b, size) in pairs {
            (shared[a][b], shared[b][a]) = (size, size);
        }
        shared
    }

    #[test]
    fn a_stack_is_cut_from_its_ends_to_the_label_that_remains() {
        // 0 1 2 5 3 4 from below, 5 the last; rims share a little with all.
        let rims = (0..6).flat_map(|a| (0..a).map(move |b| (a, b, 3)));
        let layers = [(0, 1, 90), (1, 2, 100), (2, 5, 110), (5, 3, 100), (3, 4, 90)];
        let pairs: Vec<_> = rims.chain(layers).collect();
        assert_eq!(cutting_order(&table(6, &pairs)), [0, 1, 2, 4, 3]);
    }

    #[test]
    fn labels_within_another_keep_their_order() {
        assert_eq!(cutting_order(&table(4, &[(0, 3, 500), (1, 3, 400), (2, 3, 300), (0, 2, 9), (1, 2, 9)])), [0, 1, 2]);
        assert_eq!(cutting_order(&table(3, &[])), [0, 1]);
        assert!(cutting_order(&table(1, &[])).is_empty());
        assert!(cutting_order(&[]).is_empty());
    }

    #[test]
    fn a_sheet_between_two_halves_waits_for_one_of_them() {
        // A falx (0) between left (1) and right (2), which remains.
        assert_eq!(cutting_order(&table(3, &[(0, 1, 100), (0, 2, 100), (1, 2, 5)])), [1, 0]);
    }
}
