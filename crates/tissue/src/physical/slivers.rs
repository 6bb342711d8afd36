//! Where vertices must not go beyond their minimum.

use super::elastic::Elastic;
use crate::volumes::regular_edge;
use monro_geometry::TET_EDGES;
use monro_geometry::d3::{D3, dot, sub};

/// An element is a sliver when a regular one of its volume has edges shorter than this share of its own (their root mean
/// square). It has a fifth of the volume that it would have if it were regular.
const SLIVER: f64 = 0.58;

/// How many times as far as to its own minimum each vertex may go in a sweep: that far and no further at slivers, as far as
/// it likes elsewhere.
///
/// The volume of a sliver hardly resists, but turns over within a short way of its corners, and pressures that follow what
/// over-relaxed sweeps do to it drive them on: a block with two elements in a hundred that had a hundredth of their volume
/// was thrown by 1 to 9 mm in every frame by its own weight, a ball of flat ones by 4 mm. Now they come to rest.
pub(super) fn most_beyond(elastic: &Elastic) -> Vec<f32> {
    let mut most = vec![f32::INFINITY; elastic.rest.len()];
    for (tet, volume) in elastic.tets.iter().zip(&elastic.volume) {
        if regular_edge(*volume) < SLIVER * edge(tet.map(|n| elastic.rest[n as usize])) {
            tet.iter().for_each(|&n| most[n as usize] = 1.0);
        }
    }
    most
}

/// Root mean square of the six edges.
fn edge(p: [D3; 4]) -> f64 {
    let square = |a: usize, b: usize| dot(sub(p[a], p[b]), sub(p[a], p[b]));
    (TET_EDGES.iter().map(|&[a, b]| square(a, b)).sum::<f64>() / 6.0).sqrt()
}
