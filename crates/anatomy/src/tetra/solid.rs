//! Where a label is, or nothing, for sure: most places can be told without a look at the fields.

use super::cells::Cells;
use super::fields::LabelFields;
use monro_geometry::Volume;
use monro_geometry::d3::D3;

/// The cells of a field's lattice at all eight corners of which its values are of one kind, and so everywhere between.
pub(super) struct Solid {
    cells: Cells,
    /// By the cell's first corner.
    solid: Vec<bool>,
}

impl Solid {
    /// Those in which there is nothing but label `l`. Its margins are the least of fields that are mixed from the corners in
    /// each cell: where they are positive at all eight, all these fields are so everywhere between.
    pub(super) fn new(fields: &LabelFields, l: usize) -> Self {
        Self::of(&fields.margins(l), |v| v > 0.0)
    }

    /// Those in which there is none of the labels.
    pub(super) fn outside(fields: &LabelFields) -> Self {
        Self::of(fields.union.volume(), |v| v < 0.5)
    }

    fn of(field: &Volume<f32>, is: impl Fn(f32) -> bool) -> Self {
        let cells = Cells::new(field.grid());
        let mut solid: Vec<bool> = field.data().iter().map(|&v| is(v)).collect();
        let [up, over] = cells.steps();
        // What follows a row's or a slice's end is no neighbour, but no cell begins there either.
        for step in [1, up, over] {
            for at in 0..solid.len() {
                solid[at] &= solid.get(at + step).is_some_and(|&next| next);
            }
        }
        Self { cells, solid }
    }

    /// Whether `p` is in such a cell; elsewhere it may be alike.
    pub(super) fn holds(&self, p: D3) -> bool {
        self.cells.find(p).is_some_and(|(at, _)| self.solid[at])
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
