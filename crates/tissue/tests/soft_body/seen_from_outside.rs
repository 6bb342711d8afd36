//! Forces that must not depend on who moves, nor on how coarse the mesh was that a question was asked on.

use crate::common::{block, material, nodes};
use monro_geometry::{Point, Vector};
use monro_tissue::{Finer, SphereContact, StaticOptions, StaticProblem, StaticSolution, Support, equilibrium};

/// A block of 40 x 40 x 30 mm and a sphere of 10 mm above it that move `way` towards each other: the block's base this share of
/// it, the sphere the rest.
fn pressed(way: Vector<monro_geometry::Patient>, base: f64, friction: f64) -> StaticSolution {
    let mesh = block([4, 4, 3], 10.0, |_| 4);
    let from = Point::new(19.0, 21.0, 40.2);
    let moved = (way * -base).to_array().map(Some);
    let supports = nodes(&mesh, |p| p.z == 0.0).into_iter();
    let problem = StaticProblem {
        supports: supports.map(|node| Support { node, set: 0, displacement_mm: moved }).collect(),
        contacts: vec![SphereContact { radius_mm: 10.0, friction, from, to: from + way * (1.0 - base) }],
        ..StaticProblem::default()
    };
    let solved =
        equilibrium(&mesh, &material(0.45), &problem, &StaticOptions::default(), &mut || true).expect("solved");
    assert!(solved.converged, "base {base}: {:?}, residual {:e}", solved.stop, solved.residual);
    solved
}

#[test]
fn a_block_pushed_onto_a_resting_sphere_met_a_coarse_mesh_and_no_friction() {
    let straight = (Vector::new(0.0, 0.0, -2.0), 0.0, 1e-3, &[0.5, 1.0][..]);
    let askew = (Vector::new(1.5, 0.0, -1.2), 0.3, 0.05, &[1.0][..]);
    for (way, friction, apart, bases) in [straight, askew] {
        let sphere = pressed(way, 0.0, friction);
        let wanted = sphere.contacts[0];
        assert!(wanted.z < -10.0 && (friction == 0.0 || wanted.x > 0.2 * -wanted.z), "{wanted:?}");
        for &base in bases {
            let other = pressed(way, base, friction);
            let found = other.contacts[0];
            assert!((found - wanted).norm() < apart * wanted.norm(), "friction {friction}: {found:?} for {wanted:?}");
            assert_eq!(other.tets, sphere.tets);
        }
    }
}

#[test]
fn what_two_neighbouring_sets_bear_was_shared_out_at_the_vertices_of_a_coarse_mesh() {
    let bear = |cells: usize, times: u32| {
        let mesh = block([cells; 3], 20.0 / cells as f64, |_| 4);
        let sets = [nodes(&mesh, |p| p.z == 0.0), nodes(&mesh, |p| p.x == 0.0)].into_iter().zip(0..);
        let held = |(nodes, set): (Vec<u32>, u32)| {
            nodes.into_iter().map(move |node| Support { node, set, displacement_mm: [Some(0.0); 3] })
        };
        let problem = StaticProblem {
            supports: sets.flat_map(held).collect(),
            body_force_mn_mm3: [0.0, 0.0, -1e-3],
            ..StaticProblem::default()
        };
        let options = StaticOptions { finer: Finer::Times(times), ..StaticOptions::default() };
        let solved = equilibrium(&mesh, &material(0.4), &problem, &options, &mut || true).expect("solved");
        assert_eq!(solved.reaction.len(), mesh.vertices.len());
        [solved.sets[&0], solved.sets[&1]]
    };
    // 8 mN together but for what both hold; the same 16 elements along an edge, asked on two of them or on all.
    let wanted = bear(16, 0);
    let bears = wanted[0].z + wanted[1].z;
    assert!((8.0..8.3).contains(&bears), "{bears}");
    for found in [bear(2, 3), bear(4, 2)] {
        for (f, w) in found.iter().zip(wanted) {
            assert!((*f - w).norm() < 0.02 * w.norm(), "{found:?} for {wanted:?}");
        }
    }
}
