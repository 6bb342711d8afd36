//! Which elements share which faces.

/// No element behind a face.
pub const NO_TET: u32 = u32::MAX;
/// Corners of the face opposite to each corner.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// The element behind the face opposite to each corner of each element, [`NO_TET`] where there is none: on
/// the boundary of the mesh.
///
/// Faces are sorted into buckets by their lowest point, which keeps each sort as small as a star. A face of more than two
/// elements counts as one of the boundary.
///
/// # Panics
/// When an element has a corner that is not below `points`.
pub fn tet_neighbours(tets: &[[u32; 4]], points: usize) -> Vec<[u32; 4]> {
    let (first, faces) = buckets(tets, points);
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

/// Faces (`4 element + corner`) by their lowest point: where each point's begin, and the list.
fn buckets(tets: &[[u32; 4]], points: usize) -> (Vec<u32>, Vec<u32>) {
    let lowest = |t: &[u32; 4], i: usize| FACES[i].iter().map(|&k| t[k]).min().unwrap_or(0) as usize;
    let mut first = vec![0u32; points + 1];
    for t in tets {
        (0..4).for_each(|i| first[lowest(t, i) + 1] += 1);
    }
    for i in 1..first.len() {
        first[i] += first[i - 1];
    }
    let mut at = first.clone();
    let mut faces = vec![0u32; tets.len() * 4];
    for (e, t) in tets.iter().enumerate() {
        for i in 0..4 {
            let slot = &mut at[lowest(t, i)];
            faces[*slot as usize] = (4 * e + i) as u32;
            *slot += 1;
        }
    }
    (first, faces)
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
}
