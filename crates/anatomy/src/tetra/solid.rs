//! Where a label is, or nothing, for sure: most places can be told without a look at the fields.

use super::fields::{Field, LabelFields};
use super::vec3::V3;

/// The cells of a field's lattice at all eight corners of which its values are of one kind, and so everywhere between.
pub(super) struct Solid {
    field: Field,
    /// By the cell's first corner.
    cells: Vec<bool>,
}

impl Solid {
    /// Those in which there is nothing but label `l`. Its margins are the least of fields that are mixed from the corners in
    /// each cell: where they are positive at all eight, all these fields are so everywhere between.
    pub(super) fn new(fields: &LabelFields, l: usize) -> Self {
        Self::of(Field::new(fields.margins(l)), |v| v > 0.0)
    }

    /// Those in which there is none of the labels.
    pub(super) fn outside(fields: &LabelFields) -> Self {
        Self::of(fields.union.clone(), |v| v < 0.5)
    }

    fn of(field: Field, is: impl Fn(f32) -> bool) -> Self {
        let (dims, data) = (field.volume().grid().dims(), field.volume().data());
        let mut cells: Vec<bool> = data.iter().map(|&v| is(v)).collect();
        // What follows a row's or a slice's end is no neighbour, but no cell begins there either.
        for step in [1, dims[0], dims[0] * dims[1]] {
            for at in 0..cells.len() {
                cells[at] &= cells.get(at + step).is_some_and(|&next| next);
            }
        }
        Self { field, cells }
    }

    /// Whether `p` is in such a cell; elsewhere it may be alike.
    pub(super) fn holds(&self, p: V3) -> bool {
        self.field.cell(p).is_some_and(|(at, _)| self.cells[at])
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_head::head;
    use super::*;

    #[test]
    fn a_solid_cell_has_its_label_everywhere_and_most_of_a_label_is_in_such() {
        let labels = head([1.5, 1.7, 2.2]);
        let fields = LabelFields::new(&labels.map(u16::from), &[4, 5, 6, 7]).expect("fields");
        for l in 0..4 {
            let solid = Solid::new(&fields, l);
            let (mut inside, mut held) = (0, 0);
            for at in 0..200_000u32 {
                let p = [0.1031, 0.1373, 0.1129].map(|x| (f64::from(at) * x).fract());
                let p = [p[0] * 128.0 - 64.0, p[1] * 160.0 - 80.0, p[2] * 120.0 - 60.0];
                let is_there = fields.label_at(p) == Some(l);
                assert!(is_there || !solid.holds(p), "label {} at {p:?}", fields.labels[l]);
                (inside, held) = (inside + u32::from(is_there), held + u32::from(solid.holds(p)));
            }
            assert!(held > inside / 4 && (l < 3 || 10 * held > 8 * inside), "{held} of {inside}");
        }
    }
}
