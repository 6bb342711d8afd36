//! Labels as coarse regions, where there are too few elements for their own surfaces.

use super::cut::RawMesh;
use super::fields::LabelFields;
use super::voxels::SPECK;
use monro_geometry::d3::{D3, add, scale, volume6};
use rayon::prelude::*;

/// Points along an edge of the lattice of samples in an element.
const SAMPLES: usize = 10;
/// Beyond this part of the inner labels' volume lost before it is restored, their surfaces are given up. Chords alone take
/// a sixth at a few thousand elements; what has lost a third is not there any more, and would only be blown up.
const LOST: f64 = 0.35;

/// One label by itself is given more: a round one whose edges are three quarters of its radius, as thin ones beside it leave it,
/// loses four tenths by its chords and gets them back.
const GONE: f64 = 0.45;

/// What made a mesh give up the surfaces of its inner labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lost {
    /// All of them together.
    Inner,
    /// One of them, by its index.
    Label(usize),
}

/// Mean volume of `count` elements, mm3.
fn mean(count: usize, fields: &LabelFields) -> f64 {
    fields.volumes.iter().sum::<f64>() / count.max(1) as f64
}

/// Whether a mesh of `count` elements has lost its inner labels, by their volumes before they were restored.
pub(super) fn lost(found: &[f64], count: usize, fields: &LabelFields) -> Option<Lost> {
    let inner = fields.parts.len();
    // Specks are lost however many elements there are: the fields may not hold them.
    let held = |l: usize| !fields.specks[l] && fields.volumes[l] > SPECK * fields.step.powi(3);
    let sum = |volumes: &[f64]| (0..inner).filter(|&l| held(l)).map(|l| volumes[l]).sum::<f64>();
    let wanted = sum(&fields.volumes);
    // What is smaller than two elements is lost at any rate.
    let is_lost = inner > 0 && wanted > 2.0 * mean(count, fields) && sum(found) < (1.0 - LOST) * wanted;
    is_lost.then_some(Lost::Inner)
}

/// A label with the volume of so many elements
const MANY: f64 = 50.0;
/// whose own volume could not be restored to this part is not represented by its surface.
const OFF: f64 = 0.1;

/// Labels that miss their volumes are worth giving up the surfaces of all others for where they are more than this part of the inner
/// ones together: of an atlas one in a thousand is not, and is told.
const WORTH: f64 = 0.05;

/// A label of which a mesh of `count` elements has lost most though it should have many of them, by its volumes when it has just
/// been coarsened: so much is not made good again, and improving such a mesh takes longer than all the rest.
pub(super) fn gone(coarsened: &[f64], count: usize, fields: &LabelFields) -> Option<Lost> {
    of_many(coarsened, count, fields, |part| part < 1.0 - GONE).next().map(Lost::Label)
}

/// Of the labels with many elements whose volumes a mesh of `count` elements misses the one that is furthest off, where these are
/// much together.
pub(super) fn off(restored: &[f64], count: usize, fields: &LabelFields) -> Option<Lost> {
    let wrong: Vec<usize> = of_many(restored, count, fields, |part| (part - 1.0).abs() > OFF).collect();
    let inner: f64 = fields.volumes[..fields.parts.len()].iter().sum();
    let is_much = wrong.iter().map(|&l| fields.volumes[l]).sum::<f64>() > WORTH * inner;
    let miss = |l: usize| (restored[l] / fields.volumes[l] - 1.0).abs();
    let furthest = wrong.into_iter().max_by(|&a, &b| miss(a).total_cmp(&miss(b)));
    furthest.filter(|_| is_much).map(Lost::Label)
}

/// The labels that should have many of `count` elements and have a part of their volume that `is_wrong`; none where there is one
/// label alone. Specks have what they have.
fn of_many(
    volumes: &[f64],
    count: usize,
    fields: &LabelFields,
    is_wrong: impl Fn(f64) -> bool,
) -> impl Iterator<Item = usize> {
    let labels = if fields.parts.is_empty() { 0 } else { volumes.len() };
    (0..labels).filter(move |&l| has_many(l, count, fields) && is_wrong(volumes[l] / fields.volumes[l]))
}

/// Whether a label should have many of `count` elements.
pub(super) fn has_many(label: usize, count: usize, fields: &LabelFields) -> bool {
    !fields.specks[label] && fields.volumes[label] > MANY * mean(count, fields)
}

/// Gives each inner label the elements that hold most of it, as many as have its volume together, and at least one. Such a
/// region may touch itself in edges and points.
pub(super) fn label_regions(mesh: &mut RawMesh, fields: &LabelFields) {
    let weights: Vec<[f64; 4]> = weights().collect();
    let shares: Vec<Vec<f32>> = mesh.tets.par_iter().map(|&t| shares(mesh.corners(t), &weights, fields)).collect();
    let rest = fields.parts.len();
    mesh.labels.fill(rest as u8);
    let mut order: Vec<usize> = (0..rest).collect();
    order.sort_by(|&a, &b| fields.volumes[a].total_cmp(&fields.volumes[b]));
    for l in order {
        let free = |t: &usize| usize::from(mesh.labels[*t]) == rest && shares[*t][l] > 0.0;
        let mut most: Vec<usize> = (0..mesh.tets.len()).filter(free).collect();
        most.sort_by(|&a, &b| shares[b][l].total_cmp(&shares[a][l]).then(a.cmp(&b)));
        let mut missing = fields.volumes[l];
        for (i, t) in most.into_iter().enumerate() {
            let volume = volume6(mesh.corners(mesh.tets[t])) / 6.0;
            if i > 0 && missing < 0.5 * volume {
                break;
            }
            missing -= volume;
            mesh.labels[t] = l as u8;
        }
    }
    for (label, shares) in mesh.labels.iter_mut().zip(&shares) {
        *label = present(usize::from(*label), shares, rest) as u8;
    }
}

/// The label of an element that nobody has claimed is the rest only where there is some of it, or nothing at all: else it lay
/// far from its own, in the midst of others.
fn present(label: usize, shares: &[f32], rest: usize) -> usize {
    if label != rest || shares[rest] > 0.0 {
        return label;
    }
    let most = (0..rest).fold(rest, |best, l| if shares[l] > shares[best] { l } else { best });
    debug_assert!(shares.len() > rest, "a share for each label");
    most
}

/// Whether an element holds some of a label.
pub(super) fn holds(corners: [D3; 4], label: u8, fields: &LabelFields) -> bool {
    let own = fields.parts.get(usize::from(label));
    // What has nothing at a point is not the most of it: most points are answered by one field.
    let may_be = |p| own.is_none_or(|own| own.at(p) > 0.0);
    let mut points = weights().map(|w| inside(corners, &w));
    points.any(|p| may_be(p) && fields.label_at(p) == Some(usize::from(label)))
}

fn inside(corners: [D3; 4], weights: &[f64; 4]) -> D3 {
    corners.iter().zip(weights).fold([0.0; 3], |sum, (&c, &w)| add(sum, scale(c, w)))
}

/// The part of each label in an element, by sampling.
fn shares(corners: [D3; 4], weights: &[[f64; 4]], fields: &LabelFields) -> Vec<f32> {
    let mut counts = vec![0f32; fields.labels.len()];
    for w in weights {
        if let Some(l) = fields.label_at(inside(corners, w)) {
            counts[l] += 1.0;
        }
    }
    counts.iter_mut().for_each(|c| *c /= weights.len() as f32);
    counts
}

/// Barycentric weights of an even lattice of points inside a tetrahedron.
fn weights() -> impl Iterator<Item = [f64; 4]> {
    let n = SAMPLES;
    let places = (0..n).flat_map(move |i| (0..n - i).flat_map(move |j| (0..n - i - j).map(move |k| [i, j, k])));
    places.map(move |[i, j, k]| [i, j, k, n - 1 - i - j - k].map(|x| (x as f64 + 0.25) / n as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_inside_and_have_the_centroid_as_their_mean() {
        let all: Vec<[f64; 4]> = weights().collect();
        assert_eq!(all.len(), 220);
        let mean = all.iter().fold([0.0; 4], |s, w| [0, 1, 2, 3].map(|i| s[i] + w[i] / all.len() as f64));
        assert!(mean.iter().all(|m| (m - 0.25).abs() < 1e-12), "{mean:?}");
        assert!(all.iter().all(|w| (w.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    }
}
