//! Turns elements back that a step has turned inside out.
//!
//! Neither solver forbids an element to turn over: both pass through flat states without noticing, which is what makes them
//! robust, and where tissue is crushed a few elements can stay on the wrong side. So when a step ends with turned elements,
//! each element with less than [`LEAST`] of its volume is pushed open to that much, as a one-sided constraint on its volume
//! (equation (10) of the paper as an inequality), Gauss-Seidel over all elements that are crushed at all, until none is
//! turned or [`ROUNDS`] have passed. Pushing moves vertices along the gradient by their inverse mass, so it keeps momentum
//! and angular momentum, and where nothing is turned it does nothing.
//!
//! Lengths alone do not know on which side of its neighbours a vertex is, so in paper mode tissue can stay knotted: elements
//! remain crushed though nothing acts on them any more. Then their corners are drawn to where they are at rest.

use crate::fast::{Pool, Row};
use crate::marks::Marks;
use crate::vec3::{dot, shift, six_volume_with_gradients, sub, xyz};
use crate::volumes::{Survey, Volumes};
use crate::{State, bytes};

/// Share of its volume at rest that an element is opened to.
const LEAST: f32 = 0.02;
/// Elements below this share are watched in a round: pushing one open can turn another.
pub(crate) const CRUSHED: f32 = 0.3;
/// Passes over the watched elements in a round, and rounds at most: a round begins by choosing what to watch. Rounds are short
/// (tens of microseconds), and what they leave turned takes a frame of up to 31 substeps: with 5 of them one frame in a
/// hundred of a probe at 37,000 elements took 34 ms instead of 1.3, with 20 at most 9, with 60 at most 2.
const PASSES: u32 = 20;
const ROUNDS: u32 = 60;
/// An element is pushed by this multiple of what it lacks, since neighbours push back. With 1.3 it took three to six times
/// as many pushes.
const EAGERNESS: f32 = 1.6;

/// Memory to work in.
#[derive(Debug, Clone, Default)]
pub(crate) struct Crushed {
    /// Crushed elements, with six times their volume at rest, mm3.
    pub(crate) list: Vec<(u32, f32)>,
    /// Rows with an element around a vertex of them.
    rows: Marks,
}

impl Crushed {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.list) + self.rows.bytes()
    }
}

/// Opens turned elements, of which there are some; returns what the elements are after it. `growth` was measured, and is in
/// the end.
pub(crate) fn untangle(
    (volumes, tets): (&Volumes, &[[u32; 4]]),
    positions: &mut [[f32; 4]],
    (growth, crushed): (&mut [Row], &mut Crushed),
    pool: &Pool,
) -> Survey {
    let Crushed { list, rows } = crushed;
    volumes.smaller(CRUSHED, 0..volumes.rows(), growth, list);
    for _ in 0..ROUNDS {
        // What is turned is crushed.
        if !list.iter().any(|&(t, six_rest)| growth.as_flattened()[t as usize] <= -six_rest) {
            break;
        }
        let mut pushed = false;
        for _ in 0..PASSES {
            let opened = |n: u32, &(tet, six_rest): &(u32, f32)| {
                n + u32::from(open(&tets[tet as usize], LEAST * six_rest, positions))
            };
            if list.iter().fold(0, opened) == 0 {
                break;
            }
            pushed = true;
        }
        if !pushed {
            // All that is turned is held: another round would find it as it is.
            break;
        }
        // Elements elsewhere are as they were: what is crushed and what is turned changes around these alone.
        rows.clear(volumes.rows());
        let corners = list.iter().flat_map(|&(t, _)| tets[t as usize]);
        corners.flat_map(|v| volumes.rows_around(v)).for_each(|&r| rows.mark(r));
        rows.sort();
        volumes.measure_rows(positions, rows.list(), growth);
        volumes.smaller(CRUSHED, rows.list().iter().map(|&r| r as usize), growth, list);
    }
    volumes.measured(growth, pool)
}

/// Brings the corners of the listed elements to a stop, a share of the way to where they are at rest.
pub(crate) fn unknot(list: &[(u32, f32)], (tets, rest): (&[[u32; 4]], &[[f32; 4]]), state: &mut State, share: f32) {
    let mut nodes: Vec<u32> = list.iter().flat_map(|&(t, _)| tets[t as usize]).collect();
    nodes.sort_unstable();
    nodes.dedup();
    for n in nodes.into_iter().map(|n| n as usize).filter(|&n| rest[n][3] > 0.0) {
        let p = &mut state.positions[n];
        let way = sub(xyz(rest[n]), xyz(*p));
        shift(p, share, way);
        state.velocities[n] = [0.0; 4];
    }
}

/// Pushes one element open to six times the volume `least`; says whether it had less and could be pushed.
fn open(tet: &[u32; 4], least: f32, positions: &mut [[f32; 4]]) -> bool {
    let (six, gradients) = six_volume_with_gradients(tet.map(|v| xyz(positions[v as usize])));
    let lack = least - six;
    if lack <= 0.0 {
        return false;
    }
    let weight: f32 = tet.iter().zip(&gradients).map(|(&v, g)| positions[v as usize][3] * dot(*g, *g)).sum();
    let step = EAGERNESS * lack / weight;
    // All held, or crushed to a point: nowhere to push.
    if !step.is_finite() {
        return false;
    }
    for (&v, g) in tet.iter().zip(&gradients) {
        let p = &mut positions[v as usize];
        shift(p, step * p[3], *g);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn a_turned_element_that_is_held_is_left_and_pushes_nothing() {
        let mesh = block([4, 4, 4], 2.0);
        let held = mesh.tets[40];
        let node = |(i, v): (usize, &monro_geometry::Point<_>)| {
            [v.x as f32, v.y as f32, v.z as f32, if held.contains(&(i as u32)) { 0.0 } else { 1.0 }]
        };
        let rest: Vec<[f32; 4]> = mesh.vertices.iter().enumerate().map(node).collect();
        let (volumes, pool) = (Volumes::new(&mesh.tets, &rest), Pool::new(1));
        let (mut growth, mut crushed) = (Vec::new(), Crushed::default());
        let mut now = rest.clone();
        now.swap(held[0] as usize, held[1] as usize);
        let turned = now.clone();
        volumes.survey(&now, &mut growth, &pool);
        let after = untangle((&volumes, &mesh.tets), &mut now, (&mut growth[..], &mut crushed), &pool);
        assert!(after.inverted > 0 && held.iter().all(|&v| now[v as usize] == turned[v as usize]));
        assert!(!open(&held, 1.0, &mut now), "it has less, and there is nowhere to push");
    }

    #[test]
    fn turned_elements_are_opened_and_momentum_is_kept() {
        let mesh = block([4, 4, 4], 2.0);
        let mass = |i: usize| 1.0 + (i % 5) as f32;
        let rest: Vec<[f32; 4]> = (0..mesh.vertices.len())
            .map(|i| {
                let v = mesh.vertices[i];
                [v.x as f32, v.y as f32, v.z as f32, 1.0 / mass(i)]
            })
            .collect();
        let (volumes, pool) = (Volumes::new(&mesh.tets, &rest), Pool::new(1));
        let (mut growth, mut crushed) = (Vec::new(), Crushed::default());
        let mut now = rest.clone();
        for (i, p) in now.iter_mut().enumerate() {
            (0..3).for_each(|a| p[a] += ((i * 7919 + a * 104_729) % 1000) as f32 / 500.0 - 1.0);
        }
        let momentum = |p: &[[f32; 4]]| -> [f32; 3] {
            core::array::from_fn(|a| p.iter().enumerate().map(|(i, p)| mass(i) * p[a]).sum())
        };
        let before = volumes.survey(&now, &mut growth, &pool);
        assert!(before.inverted > 10, "{before:?}");
        let start = momentum(&now);
        let memory = (&mut growth[..], &mut crushed);
        let after = untangle((&volumes, &mesh.tets), &mut now, memory, &pool);
        assert_eq!(after.inverted, 0);
        let measured = growth.clone();
        assert_eq!((after, measured), (volumes.survey(&now, &mut growth, &pool), growth.clone()));
        for (a, b) in momentum(&now).into_iter().zip(start) {
            assert!((a - b).abs() < 1e-3 * b.abs(), "{a} {b}");
        }
    }
}
