//! Which elements share which faces and points.

pub(super) use monro_geometry::{NO_TET as OUT, tet_neighbours as neighbours};

/// Corners of the face opposite to each corner.
pub(super) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// The elements around each point, in one flat list.
pub(super) struct Incidence {
    first: Vec<u32>,
    list: Vec<u32>,
}

impl Incidence {
    pub(super) fn new(tets: &[[u32; 4]], points: usize) -> Self {
        let mut first = vec![0u32; points + 1];
        tets.iter().flatten().for_each(|&v| first[v as usize + 1] += 1);
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut at = first.clone();
        let mut list = vec![0; tets.len() * 4];
        for (t, tet) in tets.iter().enumerate() {
            for &v in tet {
                list[at[v as usize] as usize] = t as u32;
                at[v as usize] += 1;
            }
        }
        Self { first, list }
    }

    pub(super) fn of(&self, v: u32) -> &[u32] {
        &self.list[self.first[v as usize] as usize..self.first[v as usize + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_point_has_its_elements_in_order() {
        let tets = [[0, 1, 2, 3], [4, 1, 3, 2], [0, 2, 1, 5]];
        assert_eq!(Incidence::new(&tets, 6).of(2), [0, 1, 2]);
    }
}
