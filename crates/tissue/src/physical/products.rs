//! Products with the Hessian of the elastic energy, on several threads: what a static solution spends most of its time on.

use super::elastic::{Elastic, Tangent, gradient_change, scatter};
use crate::fast::Pool;
use monro_geometry::d3::{D3, dot};

/// Pieces of the elements and of the nodes, whatever the number of threads: so that sums come out the same.
const PIECES: usize = 4;

/// Threads, and memory for one product after the other.
pub(crate) struct Products {
    pool: Pool,
    tet_cuts: Vec<usize>,
    node_cuts: Vec<usize>,
    /// Growth of each element along the motion, mm3.
    growth: Vec<f64>,
    /// Change of the pressure of each patch, kPa.
    patches: Vec<f64>,
    pieces: Vec<Piece>,
}

/// What a piece of the elements adds to all patches and nodes.
#[derive(Clone)]
struct Piece {
    growth: Vec<f64>,
    force: Vec<D3>,
}

fn cuts(count: usize) -> Vec<usize> {
    (0..=PIECES).map(|i| count * i / PIECES).collect()
}

impl Products {
    pub(crate) fn new(elastic: &Elastic, threads: usize) -> Self {
        let (tets, nodes, patches) = (elastic.tets.len(), elastic.rest.len(), elastic.patch_volume.len());
        let piece = Piece { growth: vec![0.0; patches], force: vec![[0.0; 3]; nodes] };
        Self {
            pool: Pool::new(threads.min(PIECES)),
            tet_cuts: cuts(tets),
            node_cuts: cuts(nodes),
            growth: vec![0.0; tets],
            patches: vec![0.0; patches],
            pieces: vec![piece; PIECES],
        }
    }
}

impl Elastic {
    /// Product of the Hessian with `d`, at the state `x` of the tangent, mN/mm times what `d` is in.
    pub(crate) fn hessian(&self, at: (&[D3], &Tangent), d: &[D3], out: &mut Vec<D3>, with: &mut Products) {
        let Products { pool, tet_cuts, node_cuts, growth, patches, pieces } = with;
        pool.each_part(growth, tet_cuts, pieces, &|i, growth, piece| {
            self.growths(tet_cuts[i], (at.1, d), growth, &mut piece.growth);
        });
        for (p, change) in patches.iter_mut().enumerate() {
            let growth: f64 = pieces.iter().map(|piece| piece.growth[p]).sum();
            *change = growth * self.patch_bulk[p] / self.patch_volume[p];
        }
        pool.each_part(growth, tet_cuts, pieces, &|i, growth, piece| {
            self.forces(tet_cuts[i], (at, d), (growth, patches), &mut piece.force);
        });
        out.clear();
        out.resize(d.len(), [0.0; 3]);
        pool.each_part(out, node_cuts, &mut [(); PIECES], &|i, out, ()| {
            self.near.add_product(node_cuts[i], d, out);
            self.far.add_product(node_cuts[i], d, out);
            for piece in &*pieces {
                let own = &piece.force[node_cuts[i]..node_cuts[i + 1]];
                out.iter_mut().zip(own).for_each(|(o, f)| (0..3).for_each(|a| o[a] += f[a]));
            }
        });
        for film in &self.films {
            let [x, d] = [at.0, d].map(|of| film.nodes.map(|n| of[n as usize]));
            scatter(out, &film.nodes, &film.product(&x, &d), 1.0);
        }
    }

    /// Pressure of each patch after a motion by `d` as its volume grows along it, kPa: without what is of second order.
    pub(crate) fn pressures_along(&self, tangent: &Tangent, d: &[D3]) -> Vec<f64> {
        let (mut own, mut growth) = (vec![0.0; self.tets.len()], vec![0.0; self.patch_volume.len()]);
        self.growths(0, (tangent, d), &mut own, &mut growth);
        let patches = growth.iter().zip(&self.patch_volume).zip(&self.patch_bulk).zip(&tangent.volumetric);
        patches.map(|(((growth, volume), bulk), now)| now + bulk * growth / volume).collect()
    }

    /// Growth along `d` of the elements from `first` on, and what they add to their patches.
    fn growths(&self, first: usize, (tangent, d): (&Tangent, &[D3]), growth: &mut [f64], patches: &mut [f64]) {
        patches.fill(0.0);
        for (t, growth) in (first..).zip(growth) {
            let (tet, g) = (&self.tets[t], &tangent.gradient[t]);
            *growth = (0..4).map(|i| dot(g[i], d[tet[i] as usize])).sum();
            self.patch[t].iter().for_each(|&p| patches[p as usize] += *growth / 4.0);
        }
    }

    /// Change of the forces of the elements from `first` on, all but their shear, given their growth and the change of the
    /// patches' pressures.
    fn forces(
        &self,
        first: usize,
        ((x, tangent), d): ((&[D3], &Tangent), &[D3]),
        (growth, patches): (&[f64], &[f64]),
        out: &mut [D3],
    ) {
        out.fill([0.0; 3]);
        for (t, growth) in (first..).zip(growth) {
            let (tet, pressure) = (&self.tets[t], tangent.pressure[t]);
            let mean = self.patch[t].iter().map(|&p| patches[p as usize]).sum::<f64>() / 4.0;
            let change = self.bulk[t] / self.volume[t] * growth + mean;
            let turned = gradient_change(tet.map(|n| x[n as usize]), tet.map(|n| d[n as usize]));
            for ((g, h), &n) in tangent.gradient[t].iter().zip(&turned).zip(tet) {
                (0..3).for_each(|a| out[n as usize][a] += change * g[a] + pressure * h[a]);
            }
        }
    }
}
