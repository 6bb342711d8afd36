//! Which elements share which faces.

use crate::TET_FACES;
use crate::buckets::by_point;

/// No element behind a face.
pub const NO_TET: u32 = u32::MAX;

/// The element behind the face opposite to each corner of each element, [`NO_TET`] where there is none: on
/// the boundary of the mesh.
///
/// Faces are sorted into buckets by their lowest point, which keeps each sort as small as a star. A face of more than two
/// elements counts as one of the boundary.
///
/// # Panics
/// When an element has a corner that is not below `points`.
pub fn tet_neighbours(tets: &[[u32; 4]], points: usize) -> Vec<[u32; 4]> {
    let (first, faces) = by_point((0..4 * tets.len() as u32).map(|f| (lowest_point(tets, f), f)), points);
    let mut behind = vec![[NO_TET; 4]; tets.len()];
    let mut keys: Vec<(u64, u32)> = Vec::new();
    for bucket in first.windows(2) {
        keys.clear();
        keys.extend(faces[bucket[0] as usize..bucket[1] as usize].iter().map(|&f| (upper_points(tets, f), f)));
        keys.sort_unstable();
        for pair in keys.chunk_by(|a, b| a.0 == b.0).filter(|c| c.len() == 2) {
            let [(_, f), (_, g)] = [pair[0], pair[1]];
            behind[f as usize / 4][f as usize % 4] = g / 4;
            behind[g as usize / 4][g as usize % 4] = f / 4;
        }
    }
    behind
}

/// The lowest point of a face (`4 element + corner`).
fn lowest_point(tets: &[[u32; 4]], face: u32) -> u32 {
    let t = tets[face as usize / 4];
    TET_FACES[face as usize % 4].iter().map(|&k| t[k]).min().unwrap_or(0)
}

/// The two higher points of a face as one number.
fn upper_points(tets: &[[u32; 4]], face: u32) -> u64 {
    let t = tets[face as usize / 4];
    let mut f = TET_FACES[face as usize % 4].map(|k| t[k]);
    f.sort_unstable();
    u64::from(f[1]) << 32 | u64::from(f[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_share_the_face_and_the_rim_has_none() {
        // Two tetrahedra on the face 1 2 3, and a third on the face 0 1 2.
        let tets = [[0, 1, 2, 3], [4, 1, 3, 2], [0, 2, 1, 5]];
        let n = tet_neighbours(&tets, 6);
        assert_eq!(n, [[1, NO_TET, NO_TET, 2], [0, NO_TET, NO_TET, NO_TET], [NO_TET, NO_TET, NO_TET, 0]]);
    }

    #[test]
    fn a_face_of_three_elements_or_more_is_one_of_the_boundary() {
        let on = |v: u32| [0, 1, 2, v];
        assert_eq!(tet_neighbours(&[on(3), on(4)], 7), [[NO_TET, NO_TET, NO_TET, 1], [NO_TET, NO_TET, NO_TET, 0]]);
        for count in 3..5 {
            let tets: Vec<[u32; 4]> = (3..3 + count).map(on).collect();
            assert_eq!(tet_neighbours(&tets, 7), vec![[NO_TET; 4]; tets.len()]);
        }
    }
}
