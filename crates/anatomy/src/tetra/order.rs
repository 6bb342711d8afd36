//! In which order the labels are cut off.
//!
//! A label is cut off from all that come after it at once. A layer between two others so gets both its surfaces in one go,
//! where an edge of the lattice that crosses it has both ends on the same side; cut off from one end of a stack to the other,
//! each layer has one surface left. So labels with one neighbour left come first, and where all have several the thickest:
//! it has room for its surfaces, and what is thin has fewer left when its turn comes.

/// A neighbour counts from this part of all that a label shares with those left: rims of layers do not.
const COUNTS: f64 = 0.1;

/// The order in which to cut off all labels but the last, given the cells of each and how many of them it shares with each.
/// Labels with one neighbour left stay in the order that they have.
pub(super) fn cutting_order(cells: &[usize], shared: &[Vec<usize>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..shared.len()).collect();
    let mut order = Vec::new();
    while left.len() > 1 {
        let parts = &left[..left.len() - 1];
        let at_end = parts.iter().copied().find(|&l| neighbours(&shared[l], &left) < 2);
        let thickness = |l: usize| cells[l] as f64 / sum(&shared[l], &left).max(1) as f64;
        let thicker = |a: usize, &b: &usize| if thickness(b) > thickness(a) { b } else { a };
        let next = at_end.unwrap_or_else(|| parts.iter().fold(parts[0], thicker));
        left.retain(|&l| l != next);
        order.push(next);
    }
    order
}

/// Of how many of the labels left one has a part worth counting.
fn neighbours(shared: &[usize], left: &[usize]) -> usize {
    let least = COUNTS * sum(shared, left) as f64;
    left.iter().filter(|&&l| shared[l] as f64 > least).count()
}

/// What one shares with all labels left.
fn sum(shared: &[usize], left: &[usize]) -> usize {
    left.iter().map(|&l| shared[l]).sum()
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
        assert_eq!(cutting_order(&[300; 6], &table(6, &pairs)), [0, 1, 2, 4, 3]);
    }

    #[test]
    fn labels_within_another_keep_their_order() {
        assert_eq!(
            cutting_order(
                &[9, 90, 900, 9000],
                &table(4, &[(0, 3, 500), (1, 3, 400), (2, 3, 300), (0, 2, 9), (1, 2, 9)])
            ),
            [0, 1, 2]
        );
        assert_eq!(cutting_order(&[1, 2, 3], &table(3, &[])), [0, 1]);
        assert!(cutting_order(&[1], &table(1, &[])).is_empty());
        assert!(cutting_order(&[], &[]).is_empty());
    }

    #[test]
    fn a_falx_waits_until_there_is_one_half_left() {
        // Skull, CSF, right, falx, tentorium and cerebellum, and left, which remains.
        let pairs: [&[(usize, usize, usize)]; 2] = [
            &[(0, 1, 9000), (1, 2, 8900), (1, 6, 8900), (1, 5, 5900), (3, 2, 4700), (3, 6, 4700), (3, 1, 900)],
            &[(3, 4, 470), (4, 2, 2900), (4, 6, 2900), (4, 5, 5500), (4, 1, 600), (2, 6, 50), (2, 5, 20), (5, 6, 20)],
        ];
        let cells = [30_000, 30_000, 90_000, 7_000, 8_000, 60_000, 90_000];
        let order = cutting_order(&cells, &table(7, &pairs.concat()));
        let place = |l: usize| order.iter().position(|&o| o == l);
        assert!(place(2) < place(3) && place(5) < place(4) && order[0] == 0, "{order:?}");
    }
}
