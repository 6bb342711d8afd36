//! Which labels have anything near a place, so that of many only few are asked.

use super::cells::Cells;
use super::fields::Field;
use monro_geometry::by_point;
use monro_geometry::d3::D3;

/// Cells along the edge of a block.
const BLOCK: usize = 8;

/// The fields that are not zero everywhere in each block of the lattice that all of them share.
#[derive(Debug, Clone)]
pub(super) struct Nearby {
    cells: Cells,
    /// Blocks along each axis.
    blocks: [usize; 3],
    /// Where the labels of each block begin, and one end more.
    first: Vec<u32>,
    labels: Vec<u8>,
}

impl Nearby {
    /// Of `parts`, each on a box of the lattice of `whole`.
    pub(super) fn new(whole: &Field, parts: &[Field]) -> Self {
        let grid = whole.volume().grid();
        let blocks = grid.dims().map(|n| n.div_ceil(BLOCK));
        let count = blocks.iter().product();
        let mut near: Vec<(u32, u8)> = Vec::new();
        let mut has = vec![false; count];
        for (label, part) in (0..).zip(parts) {
            has.fill(false);
            mark(part, whole.offset_of(part), blocks, &mut has);
            near.extend((0..).zip(&has).filter(|(_, has)| **has).map(|(block, _)| (block, label)));
        }
        let (first, labels) = by_point(near.into_iter(), count);
        Self { cells: *whole.cells(), blocks, first, labels }
    }

    /// The parts that may not be zero at a point, in their order.
    pub(super) fn at(&self, p: D3) -> &[u8] {
        let v = self.cells.coordinates(p);
        let [i, j, k] = std::array::from_fn(|a| (v[a] as usize / BLOCK).min(self.blocks[a] - 1));
        let block = (k * self.blocks[1] + j) * self.blocks[0] + i;
        &self.labels[self.first[block] as usize..self.first[block + 1] as usize]
    }
}

/// Marks the blocks in which a field whose first cell lies at `offset` has values other than zero: a value counts in all cells
/// that it is a corner of.
fn mark(part: &Field, offset: [isize; 3], blocks: [usize; 3], has: &mut [bool]) {
    let [nx, ny, _] = part.volume().grid().dims();
    // What rounding has put beyond the lattice counts at its end, as places there do.
    let blocks_of = |x: usize, a: usize| {
        let block = |x: isize| (x.max(0) as usize / BLOCK).min(blocks[a] - 1);
        let x = x as isize + offset[a];
        block(x - 1)..=block(x)
    };
    for (row, values) in part.volume().data().chunks(nx).enumerate() {
        let mut along: Vec<usize> = Vec::new();
        let filled = values.iter().enumerate().filter(|(_, v)| **v != 0.0);
        along.extend(filled.flat_map(|(x, _)| blocks_of(x, 0)));
        along.dedup();
        for (y, z) in blocks_of(row % ny, 1).flat_map(|y| blocks_of(row / ny, 2).map(move |z| (y, z))) {
            along.iter().for_each(|x| has[(z * blocks[1] + y) * blocks[0] + x] = true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fields::LabelFields;
    use monro_geometry::{Grid, Volume};

    /// Nine bodies one in another's lattice, of which each place has few.
    #[test]
    fn what_is_not_near_is_nowhere_there_and_few_of_many_are_near() {
        let grid = Grid::axis_aligned([44, 40, 36], [0.9, 1.0, 1.1], [-20.0, 3.0, 7.0]).expect("grid");
        let label = |at: usize| {
            let [i, j, k] = grid.voxel(at);
            if i < 2 || j > 37 { 0 } else { 1 + (i / 15 + 3 * (j / 13)) as u16 + u16::from(k > 17) * 9 }
        };
        let labels = Volume::new(grid, (0..grid.len()).map(label).collect()).expect("count");
        let fields = LabelFields::new(&labels, &(1..=18).collect::<Vec<u16>>()).expect("fields");
        let (mut asked, mut places) = (0, 0);
        for at in 0..grid.len() {
            let [i, j, k] = grid.voxel(at);
            let p = grid.centre(i, j, k).to_array();
            // In, between and beyond the voxels.
            let p = [p[0] * 1.1 + 0.31, p[1] * 1.2 - 6.17, p[2] * 1.1 - 2.03];
            let near = fields.near(p);
            assert!(near.windows(2).all(|two| two[0] < two[1]), "{near:?}");
            for (l, part) in (0..).zip(&fields.parts) {
                assert!(part.at(p) == 0.0 || near.contains(&l), "{p:?} {l} {}", part.at(p));
            }
            (asked, places) = (asked + near.len(), places + 1);
        }
        let mean = asked as f64 / f64::from(places);
        assert!(mean < 6.0, "{mean}");
    }
}
