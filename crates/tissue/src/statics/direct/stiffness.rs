//! What elements, faces and vertices add to the matrix of displacements and pressures.
//!
//! The stiffness of a patch's volume, `k/V g g^T` over all vertices of a patch, would fill the matrix; with the patch's pressure
//! as an unknown of its own it is `[0 g; g^T -V/k]` between neighbours only. Left out is the small share of the shear that is
//! averaged over patches: with it vertices two edges apart would have to do with each other.

use super::factor::{HELD, Piece};
use crate::physical::elastic::{Elastic, Tangent, gradient_change, volume_gradient};
use monro_geometry::d3::{D3, dot};

/// A unit along a component of a corner.
fn unit<const N: usize>(corner: usize, component: usize) -> [D3; N] {
    let mut d = [[0.0; 3]; N];
    d[corner][component] = 1.0;
    d
}

/// Entries between the components of three vertices of which products are known.
pub(super) fn face(nodes: [u32; 3], slots: &[[u32; 4]], product: impl Fn(&[D3; 3]) -> [D3; 3]) -> Piece {
    let unknowns = nodes.iter().flat_map(|&n| slots[n as usize][..3].iter().copied()).collect();
    let columns = (0..9).flat_map(|k| product(&unit(k / 3, k % 3)).into_iter().flatten());
    Piece { unknowns, values: columns.collect() }
}

/// The pressure of a patch by itself.
pub(super) fn patch(elastic: &Elastic, patch: usize, slots: &[[u32; 4]]) -> Piece {
    let give = -elastic.patch_volume[patch] / elastic.patch_bulk[patch];
    Piece { unknowns: vec![slots[patch][3]], values: vec![give] }
}

/// An element: the displacements of its corners and the pressures of their patches.
pub(super) fn element(elastic: &Elastic, (x, tangent): (&[D3], &Tangent), t: usize, slots: &[[u32; 4]]) -> Piece {
    const N: usize = 16;
    let (tet, patch) = (&elastic.tets[t], &elastic.patch[t]);
    let rest = volume_gradient(tet.map(|n| elastic.rest[n as usize])).1;
    let (at, g) = (tet.map(|n| x[n as usize]), &tangent.gradient[t]);
    let (mu, volume, pressure) = (elastic.mu[t], elastic.volume[t], tangent.pressure[t]);
    let mut values = vec![0.0; N * N];
    for (j, b) in (0..4).flat_map(|j| (0..3).map(move |b| (j, b))) {
        let turned = gradient_change(at, unit(j, b));
        let stiff = elastic.bulk[t] / volume * g[j][b];
        for i in 0..4 {
            let row = (4 * j + b) * N + 4 * i;
            (0..3).for_each(|a| values[row + a] = pressure * turned[i][a] + stiff * g[i][a]);
            values[row + b] += mu * dot(rest[i], rest[j]) / volume;
            // Each patch has a quarter of the element.
            values[row + 3] = g[j][b] / 4.0;
            values[(4 * i + 3) * N + 4 * j + b] = g[j][b] / 4.0;
        }
    }
    let of = |k: usize| if k % 4 == 3 { slots[patch[k / 4] as usize][3] } else { slots[tet[k / 4] as usize][k % 4] };
    Piece { unknowns: (0..N).map(of).collect(), values }
}

/// Numbers of the unknowns: the displacements of each node that nothing holds, and the pressure of each patch. Patches come
/// after each other as nodes do: the first of a node has the node's number.
pub(super) fn slots(elastic: &Elastic, free: impl Fn(usize, usize) -> bool) -> Vec<[u32; 4]> {
    let mut next = 0;
    let mut number = |is: bool| {
        next += u32::from(is);
        if is { next - 1 } else { HELD }
    };
    let nodes = elastic.rest.len();
    let one = |p: usize| core::array::from_fn(|c| number(c == 3 || (p < nodes && free(p, c))));
    (0..elastic.patch_volume.len()).map(one).collect()
}

/// Points of each element, and where each point lies: nodes, and patches beyond the first of a node.
pub(super) fn points(elastic: &Elastic) -> (Vec<D3>, Vec<Vec<u32>>) {
    let nodes = elastic.rest.len() as u32;
    let mut at = elastic.rest.clone();
    at.resize(elastic.patch_volume.len(), [0.0; 3]);
    let of = |(tet, patch): (&[u32; 4], &[u32; 4])| {
        tet.iter().zip(patch).for_each(|(&n, &p)| at[p as usize] = elastic.rest[n as usize]);
        tet.iter().copied().chain(patch.iter().copied().filter(|&p| p >= nodes)).collect()
    };
    let elements = elastic.tets.iter().zip(&elastic.patch).map(of).collect();
    (at, elements)
}
