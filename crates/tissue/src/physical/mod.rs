//! Physical mode: an elastic solid with moduli.
//!
//! Each substep minimises the energy of implicit Euler, `m/(2 h^2) |x - x~|^2 + E(x)`, vertex by vertex (vertex block
//! descent, Chen et al. 2024). With this energy (see [`elastic`]) each vertex's own problem is exactly quadratic, so its
//! 3x3 solve is its exact minimum, and no step of less than twice its length can raise the energy (over-relaxation, half as
//! far again and in calm tissue more, carries smooth motion further; not at [`slivers`]). The large volumetric modulus would
//! make that crawl; it is carried by a nodal pressure instead, updated between sweeps (Uzawa; more often near what moves
//! fast, [`near`]) and kept from step to step, whose fixed point is the same equilibrium. Where inertia outweighs what the sweeps
//! carry of it, its long waves are solved for ([`waves`]).

mod around;
pub(crate) mod descent;
mod differences;
mod drift;
pub(crate) mod elastic;
pub(crate) mod film;
mod grid;
mod near;
mod pressure;
pub(crate) mod products;
mod region;
pub(crate) mod rhythm;
mod rings;
mod slivers;
mod streams;
mod strips;
mod sweep;
mod touch;
mod waves;

use crate::membrane::Membranes;
use crate::model::Region;
use crate::slabs::Slabs;
use descent::Descent;
use elastic::Elastic;

/// Constants of physical mode.
#[derive(Debug, Clone)]
pub(crate) struct PhysicalModel {
    pub(crate) descent: Descent,
    /// Share of the shear that is averaged over nodes.
    pub(crate) nodal_shear: f64,
}

impl PhysicalModel {
    pub(crate) fn new(
        (rest, mass): (&[[f32; 4]], &[f32]),
        (tets, membranes): (&[[u32; 4]], &Membranes),
        (region, regions): (&[u8], &[Region]),
        slabs: &Slabs,
        nodal_shear: f64,
    ) -> Self {
        let elastic = Elastic::new(rest, (tets, membranes), (region, regions), nodal_shear);
        let descent = Descent::new(&elastic, rest, mass, (region, regions), slabs);
        Self { descent, nodal_shear }
    }
}
