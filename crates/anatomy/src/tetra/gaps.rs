//! Labels on an even grid before they are smoothed, without gaps between thick slices.
//!
//! Between thick slices each label has the shape that its own outlines in both have between them (Raya and Udupa 1990). Where
//! more than two labels meet, or their outlines are rough, these shapes leave gaps that are in none of them. The last label, which
//! has what others leave, turned up there, up to its whole distance off.

use super::fields::{Field, MARGIN};
use crate::surface::even::{Extent, resampled, thick_axis};
use monro_geometry::Volume;

/// What is missing to the field of everything kept by less than this is no gap.
const GAP: f32 = 0.02;

/// The last label is looked at in the box of the others, and so many voxels beyond.
const BEYOND: usize = 8;

/// Fields of some labels, given with their extents, beside the last one, on the lattice of the field of everything kept. What no
/// label has of this between thick slices goes to those of the two slices, in proportion to how near these are.
pub(super) fn between_slices<T: Copy + Eq + Into<u16> + Sync>(
    labels: &Volume<T>,
    union: &Field,
    (present, last): (&[(u16, Extent)], (u16, Extent)),
    step: f64,
) -> Option<Vec<Field>> {
    let thick = thick_axis(labels.grid(), step);
    let field = |(k, e): &(u16, Extent), thick| {
        Some(Field::new(resampled(labels, &|l: T| l.into() == *k, e, (step, MARGIN), thick)?.field))
    };
    let fields = |thick| present.iter().map(|p| field(p, thick)).collect::<Option<Vec<Field>>>();
    let mut shapes = fields(thick)?;
    // What is left of everything by one other label is the last one's.
    if thick.is_none() || present.len() < 2 {
        return Some(shapes);
    }
    let last = (last.0, around(present.iter().map(|p| p.1), labels.grid().dims())?);
    let mixes = fields(None)?;
    let gaps = gaps(union, (&field(&last, thick)?, &shapes), (&field(&last, None)?, &mixes));
    for (shape, mut share) in shapes.iter_mut().zip(mixes) {
        share.combine(&gaps, |part, gap| *part *= gap);
        shape.combine(&share, |own, more| *own += more);
    }
    Some(shapes)
}

/// The box of some extents, a little larger.
fn around(extents: impl Iterator<Item = Extent>, dims: [usize; 3]) -> Option<Extent> {
    let all = extents.reduce(Extent::joined)?;
    let (low, high) = (all.low.map(|x| x.saturating_sub(BEYOND)), all.high.map(|x| x + BEYOND));
    Some(Extent { low, high: [0, 1, 2].map(|a| high[a].min(dims[a] - 1)), ..all })
}

/// What the shapes leave of everything, over the sum of the mixed fields, in the box of the last label.
fn gaps(union: &Field, (last, shapes): (&Field, &[Field]), (last_mix, mixes): (&Field, &[Field])) -> Field {
    let mut left = last.clone();
    left.combine(union, |last, all| *last = all - *last);
    shapes.iter().for_each(|shape| left.combine(shape, |left, own| *left -= own));
    let mut sum = last_mix.clone();
    mixes.iter().for_each(|mix| sum.combine(mix, |sum, own| *sum += own));
    left.combine(&sum, |left, sum| *left = if *left > GAP && sum > GAP { *left / sum } else { 0.0 });
    left
}

#[cfg(test)]
mod tests {
    use super::super::fields::LabelFields;
    use monro_geometry::{Grid, Volume};

    /// Four quarters around an axis that lies elsewhere in each slice of 4 mm; the first is larger and has a piece of its own far off.
    fn quarters(at: [f64; 3]) -> u8 {
        let slice = at[2] / 4.0;
        let axis = [20.0 + 5.0 * (2.4 * slice).sin(), 20.0 + 5.0 * (1.7 * slice).cos()];
        match [at[0] > axis[0], at[1] > axis[1]] {
            _ if at[0] > 40.0 => 1,
            [false, false] => 2,
            [true, false] => 3,
            [false, true] => 4,
            [true, true] => 5,
        }
    }

    #[test]
    fn between_thick_slices_shreds_of_the_largest_label_lay_where_others_meet() {
        // Told as "50 mm apart", and as pieces that the voxels do not have.
        for thick in 0..3 {
            let turned = |p: [f64; 3]| std::array::from_fn(|a| p[(a + thick + 1) % 3]);
            let (mut dims, mut spacing) = ([80; 3], [1.0; 3]);
            (dims[(thick + 2) % 3], dims[thick], spacing[thick]) = (40, 10, 4.0);
            let grid = Grid::axis_aligned(dims, spacing, [0.0; 3]).expect("grid");
            let place = |at: usize| {
                let [i, j, k] = grid.voxel(at);
                grid.centre(i, j, k).to_array()
            };
            let data = (0..grid.len()).map(|at| quarters(turned(place(at)))).collect();
            let labels = Volume::new(grid, data).expect("count");
            let fields = LabelFields::new(&labels, &[1, 2, 3, 4, 5]).expect("fields");
            assert_eq!(fields.labels[4], 1);
            let cells = fields.union.volume().grid();
            let places = (0..cells.len()).map(|at| cells.voxel(at)).map(|[i, j, k]| cells.centre(i, j, k).to_array());
            let far = places.filter(|&p| fields.union.at(p) > 0.5 && turned(p)[0] < 30.0);
            let rest: Vec<f64> = far.map(|p| fields.rest(p)).collect();
            let most = rest.iter().copied().fold(0.0, f64::max);
            assert!(rest.len() > 10_000 && most < 0.2, "{most} of {}", rest.len());
        }
    }
}
