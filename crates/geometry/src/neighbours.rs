//! Which elements share which faces.

use crate::buckets::by_point;

/// No element behind a face.
pub const NO_TET: u32 = u32::MAX;
/// Corners of the face opposite to each corner.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// The element behind the face opposite to each corner of each element, [`NO_TET`] where there is none: on
/// the boundary of the mesh.
///
/// Faces are sorted into buckets by their lowest point, so that each is looked for among those of a star. A face of more than
/// two elements counts as one of the boundary.
///
/// # Panics
/// When an element has a corner that is not below `points`.
pub fn tet_neighbours(tets: &[[u32; 4]], points: usize) -> Vec<[u32; 4]> {
    let (first, faces) = by_point((0..4 * tets.len() as u32).map(|f| (lowest_point(tets, f), f)), points);
    let mut behind = vec![[NO_TET; 4]; tets.len()];
    let mut set = |face: u32, tet: u32| behind[face as usize / 4][face as usize % 4] = tet;
    // Different faces of a star, and of each the first two that are it.
    let (mut keys, mut found): (Vec<u64>, Vec<[u32; 2]>) = (Vec::new(), Vec::new());
    for bucket in first.windows(2) {
        keys.clear();
        found.clear();
        for &f in &faces[bucket[0] as usize..bucket[1] as usize] {
            let key = upper_points(tets, f);
            let Some(at) = keys.iter().position(|&k| k == key) else {
                keys.push(key);
                found.push([f, NO_TET]);
                continue;
            };
            let [one, other] = found[at];
            if other == NO_TET {
                found[at][1] = f;
                set(one, f / 4);
                set(f, one / 4);
            } else {
                set(one, NO_TET);
                set(other, NO_TET);
            }
        }
    }
    behind
}

/// The lowest point of a face (`4 element + corner`).
fn lowest_point(tets: &[[u32; 4]], face: u32) -> u32 {
    let t = tets[face as usize / 4];
    FACES[face as usize % 4].iter().map(|&k| t[k]).min().unwrap_or(0)
}

/// The two higher points of a face as one number.
fn upper_points(tets: &[[u32; 4]], face: u32) -> u64 {
    let t = tets[face as usize / 4];
    let mut f = FACES[face as usize % 4].map(|k| t[k]);
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
