//! Which elements lie around which points.

use crate::buckets::by_point;

/// The elements (triangles, tetrahedra) around each point, in order, in one flat list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Incidence {
    /// Where the elements of each point begin in `list`, and one end more.
    first: Vec<u32>,
    list: Vec<u32>,
}

impl Incidence {
    /// Of elements with `N` corners each, among `points` points.
    ///
    /// # Panics
    /// When an element has a corner that is not below `points`.
    pub fn new<const N: usize>(elements: &[[u32; N]], points: usize) -> Self {
        let corners = (0..).zip(elements).flat_map(|(e, element)| element.iter().map(move |&v| (v, e)));
        let (first, list) = by_point(corners, points);
        Self { first, list }
    }

    /// Where the elements of each point begin in the list, and one end more; and the list.
    pub fn into_lists(self) -> (Vec<u32>, Vec<u32>) {
        (self.first, self.list)
    }

    /// Number of points.
    pub const fn points(&self) -> usize {
        self.first.len() - 1
    }

    /// The elements around a point.
    ///
    /// # Panics
    /// When there is no such point.
    pub fn of(&self, point: usize) -> &[u32] {
        &self.list[self.first[point] as usize..self.first[point + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_point_has_its_elements_in_order() {
        let tets = [[0, 1, 2, 3], [4, 1, 3, 2], [0, 2, 1, 5]];
        let around = Incidence::new(&tets, 6);
        assert_eq!((around.points(), around.of(2), around.of(5)), (6, [0, 1, 2].as_slice(), [2].as_slice()));
    }
}
