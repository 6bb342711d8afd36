//! Rigid motions that supports leave free: the answer then stays where the solver began, one of many.

use monro_geometry::{TetMesh, Vector};
use monro_tissue::StaticProblem;

/// Share of the largest pivot below which a motion is free.
const FREE: f64 = 1e-9;
const NAMES: [&str; 6] =
    ["sliding along x", "sliding along y", "sliding along z", "turning about x", "turning about y", "turning about z"];

/// Says which rigid motions nothing prescribes; `None` when all are. Rods hold a body.
pub(super) fn free(mesh: &TetMesh, problem: &StaticProblem) -> Option<String> {
    if !problem.rods.is_empty() || problem.supports.is_empty() {
        return None;
    }
    let gram = gram(mesh, problem);
    let count = 6 - rank(gram);
    let largest = (0..6).map(|i| gram[i][i]).fold(0.0, f64::max);
    let axes: Vec<&str> = (0..6).filter(|&i| gram[i][i] <= FREE * largest).map(|i| NAMES[i]).collect();
    let which = if axes.is_empty() { String::new() } else { format!(" (among them {})", axes.join(", ")) };
    let so = if problem.contacts.is_empty() {
        "where the body lies in these is chance, and loads along them are borne by nothing; hold a few nodes more"
    } else {
        "only spheres that touch bear loads along them, and where these do not either, the body lies by chance; hold a few nodes more if it should not"
    };
    (count > 0).then(|| format!("the supports leave {count} of the six rigid motions of the body free{which}: {so}"))
}

/// Sums of products of what the six motions (about the middle of the body) do to what is held.
fn gram(mesh: &TetMesh, problem: &StaticProblem) -> [[f64; 6]; 6] {
    let n = mesh.vertices.len() as f64;
    let sum = mesh.vertices.iter().fold([0.0; 3], |s, p| [s[0] + p.x, s[1] + p.y, s[2] + p.z]);
    let middle = monro_geometry::Point::from_array(sum.map(|v| v / n));
    let size = mesh.vertices.iter().map(|p| p.distance(middle)).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let unit = |a: usize| Vector::from_array(core::array::from_fn(|i| f64::from(u8::from(i == a))));
    let mut gram = [[0.0; 6]; 6];
    for s in &problem.supports {
        let arm = (mesh.vertices[s.node as usize] - middle) / size;
        for axis in (0..3).filter(|&a| s.displacement_mm[a].is_some()) {
            let row: [f64; 6] = core::array::from_fn(|m| {
                let moved = if m < 3 { unit(m) } else { unit(m - 3).cross(arm) };
                moved.to_array()[axis]
            });
            gram.iter_mut().zip(row).for_each(|(g, r)| g.iter_mut().zip(row).for_each(|(v, c)| *v += r * c));
        }
    }
    gram
}

/// Rank of a symmetric matrix without negative eigenvalues, by elimination with the largest diagonal first.
fn rank(mut m: [[f64; 6]; 6]) -> usize {
    let largest = (0..6).map(|i| m[i][i]).fold(0.0, f64::max);
    let mut left: Vec<usize> = (0..6).collect();
    while let Some(at) = (0..left.len()).max_by(|&a, &b| m[left[a]][left[a]].total_cmp(&m[left[b]][left[b]])) {
        let p = left[at];
        if m[p][p] <= FREE * largest {
            break;
        }
        left.swap_remove(at);
        for &i in &left {
            let factor = m[i][p] / m[p][p];
            (0..6).for_each(|j| m[i][j] -= factor * m[p][j]);
        }
    }
    6 - left.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;
    use monro_tissue::Support;

    fn told(held: &[(u32, [bool; 3])]) -> Option<String> {
        let vertices = [[0.0; 3], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]].map(Point::from_array).to_vec();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        let one = |&(node, axes): &(u32, [bool; 3])| Support {
            node,
            set: 0,
            displacement_mm: axes.map(|held| held.then_some(0.0)),
        };
        free(&mesh, &StaticProblem { supports: held.iter().map(one).collect(), ..StaticProblem::default() })
    }

    /// A body of which only z was held slid away in x and y without a word.
    #[test]
    fn motions_that_nothing_holds_are_counted_and_named() {
        let z = [false, false, true];
        let said = told(&[(0, z), (1, z), (2, z)]).expect("slides");
        assert!(said.contains("leave 3 of") && said.contains("along x, sliding along y, turning about z"), "{said}");
        assert!(told(&[(0, [true; 3]), (1, [true; 3])]).expect("turns").contains("leave 1 of"));
        assert_eq!(told(&[(0, [true; 3]), (1, [true; 3]), (2, z)]), None);
    }
}
