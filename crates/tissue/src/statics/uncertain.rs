//! Which elements a static solution is least certain in: where its gradient jumps from element to element.
//!
//! The gradient of the displacement, smoothed over the nodes of a region, is nearer to the truth than that of each element;
//! what they differ by tells an element's error (Zienkiewicz and Zhu 1987).

use super::bisect::P;
use monro_geometry::{Patient, TetMesh, Vector, deformation_gradient, volume_ratio};
use std::collections::BTreeMap;

/// Share of all errors' squares that is worth finer elements in one round.
const WORTH: f64 = 0.9;

/// Errors whose squares together are less than this part of those of the gradients are none: a motion that is even throughout.
const EVEN: f64 = 1e-8;

/// Elements pressed to less than this share of their volume are left as they are: at a sharp edge of what is driven the true
/// gradient has no bound, and smaller elements there turn inside out.
const CRUSHED: f64 = 0.5;

/// Rows of the displacement's gradient.
type Gradient = [P; 3];

/// The elements with the largest errors, at most so many, and no more than have nearly all of the error; none where the
/// gradient is even. `stiffness` is that of a label.
pub(super) fn worst(
    mesh: &TetMesh,
    moved: &[Vector<Patient>],
    stiffness: impl Fn(u16) -> f64,
    most: usize,
) -> Vec<bool> {
    let (errors, all) = errors(mesh, moved, stiffness);
    if errors.iter().sum::<f64>() <= EVEN * all {
        return vec![false; errors.len()];
    }
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|&a, &b| errors[b].total_cmp(&errors[a]).then(a.cmp(&b)));
    let (mut left, mut out) = (WORTH * errors.iter().sum::<f64>(), vec![false; errors.len()]);
    for t in order.into_iter().take(most) {
        if left <= 0.0 {
            break;
        }
        left -= errors[t];
        out[t] = true;
    }
    out
}

/// Square of the error of each element in energy, but for a factor, and with the same factor the sum of those of the gradients.
fn errors(mesh: &TetMesh, moved: &[Vector<Patient>], stiffness: impl Fn(u16) -> f64) -> (Vec<f64>, f64) {
    let of: Vec<(Gradient, f64)> =
        (0..mesh.tets.len()).map(|t| (mesh.displacement_gradient(t, moved), mesh.volume(t))).collect();
    let mut smooth = BTreeMap::<(u16, u32), (Gradient, f64)>::new();
    for ((tet, &label), (g, volume)) in mesh.tets.iter().zip(&mesh.labels).zip(&of) {
        for &v in tet {
            let sum = smooth.entry((label, v)).or_insert(([[0.0; 3]; 3], 0.0));
            sum.0.as_flattened_mut().iter_mut().zip(g.as_flattened()).for_each(|(s, g)| *s += volume * g);
            sum.1 += volume;
        }
    }
    let one = |((tet, &label), (g, volume)): ((&[u32; 4], &u16), &(Gradient, f64))| {
        let apart = |v: &u32| {
            let (sum, all) = &smooth[&(label, *v)];
            sum.as_flattened().iter().zip(g.as_flattened()).map(|(s, g)| (s / all - g).powi(2)).sum::<f64>()
        };
        if volume_ratio(deformation_gradient(*g)) < CRUSHED {
            0.0
        } else {
            stiffness(label) * volume * tet.iter().map(apart).sum::<f64>()
        }
    };
    let size = |g: &Gradient| g.as_flattened().iter().map(|v| v * v).sum::<f64>();
    let all = mesh.labels.iter().zip(&of).map(|(&label, (g, volume))| 4.0 * stiffness(label) * volume * size(g)).sum();
    (mesh.tets.iter().zip(&mesh.labels).zip(&of).map(one).collect(), all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn an_even_gradient_has_no_error() {
        let mesh = block([3, 3, 3], 2.0);
        let field = |x: P| [0.1 * x[0] - 0.2 * x[1], 0.3 * x[2], 0.05 * x[0] + 0.4 * x[1]];
        let moved: Vec<_> = mesh.vertices.iter().map(|p| Vector::from_array(field(p.to_array()))).collect();
        let (errors, all) = errors(&mesh, &moved, |_| 1.0);
        assert!(errors.iter().all(|&e| e < 1e-20) && all > 1.0);
        // A patch test was solved on four times the elements, in nine times the time.
        assert!(!worst(&mesh, &moved, |_| 1.0, usize::MAX).contains(&true));
    }

    #[test]
    fn the_worst_elements_are_those_where_the_gradient_changes() {
        let mesh = block([8, 2, 2], 1.0);
        // A kink at x = 2.
        let moved: Vec<_> = mesh.vertices.iter().map(|p| Vector::new(0.0, 0.0, (p.x - 2.0).max(0.0))).collect();
        let found = worst(&mesh, &moved, |_| 1.0, usize::MAX);
        let middle = |t: usize| mesh.corners(t).iter().map(|p| p.x).sum::<f64>() / 4.0;
        assert!(found.iter().any(|&f| f));
        assert!((0..found.len()).filter(|&t| found[t]).all(|t| (middle(t) - 2.0).abs() < 1.0));
        assert_eq!(worst(&mesh, &moved, |_| 1.0, 3).iter().filter(|&&f| f).count(), 3);
    }
}
