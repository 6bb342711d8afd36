//! Runs of voxels of one kind along a row: labels come in long ones.

use std::ops::Range;

/// Voxels looked at together: as long as all of them are of the run, no one of them is looked at.
const PIECE: usize = 32;

/// The runs of equal voxels of a row, one after the other.
pub(crate) fn runs<T: Copy + Eq>(row: &[T]) -> impl Iterator<Item = (Range<usize>, T)> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let start = from;
        let own = *row.get(start)?;
        let pieces = row[start..].chunks_exact(PIECE);
        let whole = pieces.take_while(|piece| piece.iter().fold(true, |all, &v| all & (v == own))).count();
        from = start + whole * PIECE;
        from += row[from..].iter().take_while(|&&v| v == own).count();
        Some((start..from, own))
    })
}

/// The runs of voxels that `keep` accepts.
pub(crate) fn kept<T: Copy + Eq>(row: &[T], keep: impl Fn(T) -> bool) -> impl Iterator<Item = Range<usize>> {
    let mut all = runs(row).peekable();
    std::iter::from_fn(move || {
        let (mut own, _) = all.find(|run| keep(run.1))?;
        while let Some((more, _)) = all.next_if(|run| keep(run.1)) {
            own.end = more.end;
        }
        Some(own)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn runs_are_those_of_pairs_that_differ(lengths in proptest::collection::vec((1usize..90, 0u8..3), 0..12)) {
            let row: Vec<u8> = lengths.iter().flat_map(|&(n, v)| std::iter::repeat_n(v, n)).collect();
            let expected: Vec<u8> = row.chunk_by(|a, b| a == b).flat_map(|run| [run.len() as u8, run[0]]).collect();
            let found: Vec<(Range<usize>, u8)> = runs(&row).collect();
            prop_assert_eq!(found.iter().flat_map(|(r, v)| [r.len() as u8, *v]).collect::<Vec<_>>(), expected);
            prop_assert!(found.windows(2).all(|w| w[0].0.end == w[1].0.start));
            prop_assert_eq!(found.last().map_or(0, |r| r.0.end), row.len());
            let is_kept: Vec<bool> = row.iter().map(|&v| v > 0).collect();
            let mut by_kept = vec![false; row.len()];
            let kept: Vec<Range<usize>> = kept(&row, |v| v > 0).collect();
            kept.iter().for_each(|r| by_kept[r.clone()].fill(true));
            prop_assert_eq!(by_kept, is_kept);
            prop_assert!(kept.windows(2).all(|w| w[0].end < w[1].start));
        }
    }
}
