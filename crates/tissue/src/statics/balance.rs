//! Whether supports can bear the loads: what pushes a body along a rigid motion that nothing holds has no equilibrium.

use super::loads::Loads;
use super::{StaticError, StaticProblem};
use crate::physical::elastic::Elastic;
use monro_geometry::DisjointSets;
use monro_geometry::d3::D3;

/// A load on rigid motions over all loads that is rounding.
const ROUNDING: f64 = 1e-6;

/// Three translations and, over the size of the body, three turns.
type Rigid = [f64; 6];

/// Refuses loads that some rigid motion of a part of the body gives way to. With spheres there is no telling, for they
/// may hold it.
pub(super) fn check(
    elastic: &Elastic,
    loads: &Loads,
    problem: &StaticProblem,
    number: &[u32],
) -> Result<(), StaticError> {
    if !problem.contacts.is_empty() {
        return Ok(());
    }
    let force = loads.at_rest(&elastic.rest);
    for part in parts(elastic) {
        let (centre, size) = frame(elastic, &part);
        let row = |node: u32, axis: usize| rigid(elastic.rest[node as usize], centre, size, axis);
        let mut held: Vec<Rigid> = Vec::new();
        let (mut pushed, mut all) = ([0.0; 6], 0.0);
        for &node in &part {
            for (a, &f) in force[node as usize].iter().enumerate() {
                let r = row(node, a);
                (0..6).for_each(|k| pushed[k] += f * r[k]);
                all += f.abs();
                if held.len() < 6 && loads.support[node as usize][a].is_some() {
                    held.extend(independent(r, &held));
                }
            }
        }
        let free = without(pushed, &held);
        if free.iter().any(|v| v.abs() > ROUNDING * all) {
            let vertex = number.iter().position(|n| part.binary_search(n).is_ok()).unwrap_or_default();
            let [x, y, z, u, v, w] = free;
            let moment_mn_mm = [u, v, w].map(|m| m * size);
            return Err(StaticError::Unheld { vertex, force_mn: [x, y, z], moment_mn_mm });
        }
    }
    Ok(())
}

/// How far the component `axis` of a point moves in each rigid motion.
fn rigid(p: D3, centre: D3, size: f64, axis: usize) -> Rigid {
    let arm: D3 = core::array::from_fn(|k| (p[k] - centre[k]) / size);
    let mut row = [0.0; 6];
    row[axis] = 1.0;
    // The component `axis` of the turn about `k` is that of `e_k x arm`.
    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
    (row[3 + next], row[3 + last]) = (arm[last], -arm[next]);
    row
}

/// What is left of a row beside orthonormal ones.
fn without(mut row: Rigid, held: &[Rigid]) -> Rigid {
    for h in held {
        let along: f64 = (0..6).map(|k| h[k] * row[k]).sum();
        (0..6).for_each(|k| row[k] -= along * h[k]);
    }
    row
}

/// The direction that a row adds to orthonormal ones, if it adds one.
fn independent(row: Rigid, held: &[Rigid]) -> Option<Rigid> {
    let left = without(without(row, held), held);
    let norm = left.iter().map(|v| v * v).sum::<f64>().sqrt();
    (norm > 1e-6).then(|| left.map(|v| v / norm))
}

fn frame(elastic: &Elastic, part: &[u32]) -> (D3, f64) {
    let mean = |a: usize| part.iter().map(|&n| elastic.rest[n as usize][a]).sum::<f64>() / part.len() as f64;
    let centre: D3 = core::array::from_fn(mean);
    let far = |n: &u32| (0..3).map(|a| (elastic.rest[*n as usize][a] - centre[a]).abs()).fold(0.0, f64::max);
    (centre, part.iter().map(far).fold(f64::MIN_POSITIVE, f64::max))
}

/// Nodes of each connected part.
fn parts(elastic: &Elastic) -> Vec<Vec<u32>> {
    let mut joined = DisjointSets::new(elastic.rest.len());
    for &[a, b, c, d] in &elastic.tets {
        [b, c, d].into_iter().for_each(|n| joined.join(a, n));
    }
    let mut parts = std::collections::BTreeMap::<u32, Vec<u32>>::new();
    for n in 0..elastic.rest.len() as u32 {
        parts.entry(joined.root(n)).or_default().push(n);
    }
    parts.into_values().collect()
}
