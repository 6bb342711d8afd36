//! Which elements lie around which points.

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
        let mut first = vec![0u32; points + 1];
        elements.iter().flatten().for_each(|&v| first[v as usize + 1] += 1);
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut at = first.clone();
        let mut list = vec![0; elements.len() * N];
        for (e, element) in elements.iter().enumerate() {
            for &v in element {
                list[at[v as usize] as usize] = e as u32;
                at[v as usize] += 1;
            }
        }
        Self { first, list }
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
