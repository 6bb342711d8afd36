//! The energy of physical mode in double precision: stable neo-Hookean elements with the volumetric part averaged over
//! nodes, so that near-incompressible tissue does not lock.
//!
//! `W = mu/2 (tr(F^T F) - 3) - mu (J - 1) + lam_hat/2 (J - 1)^2` with `lam_hat = lam + mu` (the reference scenes' energy).
//! Of `lam_hat`, only `ELEMENT_BULK * mu` stays in the element, enough to keep its energy positive; the rest acts on the
//! mean of `J` over each node's patch of elements of one region (Bonet and Burton 1998; regions are not mixed, so a wall
//! between soft and stiff stays sharp). A small share of the shear term acts on the patch's mean of `F` likewise (Puso and
//! Solberg 2006), which takes away most of the bending stiffness that linear tetrahedra have too much of.
//!
//! Two facts make it cheap. The term `mu/2 tr(F^T F)` is quadratic in the positions with a constant scalar matrix, the
//! Laplacian with weights `mu V b_i . b_j`. And `J` is linear in each vertex, so all the rest acts through the gradient of
//! a tetrahedron's volume, the area of the opposite face.

use super::film::{Film, films};
use crate::Material;
use crate::membrane::Membranes;
use crate::model::Region;
use crate::vec3::xyz;
use monro_geometry::d3::{D3, cross, dot, sub};

/// Volume of an element and its gradient by the corners.
type Shape = (f64, [D3; 4]);

/// Volumetric stiffness left in the element over its shear modulus. The element's energy stays positive from one third of
/// the element's share of the shear term on; a little more gave the smallest errors over the reference scenes.
pub(super) const ELEMENT_BULK: f64 = 0.35;

/// Volumetric stiffness that acts on patches, kPa.
pub(super) fn patch_kpa(material: &Material) -> f64 {
    material.lame_kpa() + (1.0 - ELEMENT_BULK) * material.shear_kpa()
}

/// Rows of a sparse symmetric matrix whose rows sum to zero, without its diagonal.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rows {
    /// Start of each row's entries, one more than rows.
    pub(crate) start: Vec<u32>,
    pub(crate) column: Vec<u32>,
    pub(crate) weight: Vec<f64>,
}

/// Constants of the energy. Lengths in mm, moduli in kPa, forces in mN, energies in mN mm.
#[derive(Debug, Clone)]
pub(crate) struct Elastic {
    pub(crate) tets: Vec<[u32; 4]>,
    /// Volume at rest, mm3.
    pub(crate) volume: Vec<f64>,
    /// Shear modulus of each element, kPa.
    pub(crate) mu: Vec<f64>,
    /// Volumetric stiffness that stays in the element, kPa.
    pub(crate) bulk: Vec<f64>,
    /// Patch of each corner of each element.
    pub(crate) patch: Vec<[u32; 4]>,
    /// Volume of each patch at rest, mm3.
    pub(crate) patch_volume: Vec<f64>,
    /// Volumetric stiffness of each patch, kPa.
    pub(crate) patch_bulk: Vec<f64>,
    /// Shear matrix of the elements, mN/mm.
    pub(crate) near: Rows,
    /// What averaging a share of the shear over patches adds to it: negative semidefinite, reaching one ring further.
    pub(crate) far: Rows,
    /// Product of the shear matrix with the positions at rest, mN.
    pub(crate) base: Vec<D3>,
    /// Positions at rest.
    pub(crate) rest: Vec<D3>,
    /// Triangles of thin membranes.
    pub(crate) films: Vec<Film>,
}

/// Derivatives at one state, for products with the Hessian.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tangent {
    /// Derivative of each element's volume by its four corners.
    pub(crate) gradient: Vec<[D3; 4]>,
    /// Derivative of the energy by each element's volume.
    pub(crate) pressure: Vec<f64>,
    /// The part of it that is the mean of what its patches have: by each patch's volume.
    pub(super) volumetric: Vec<f64>,
}

/// An element with less than this share of its volume at rest has none: what is left may be rounding.
pub const NO_VOLUME: f64 = 1e-6;

/// Signed volume and its gradient by the four corners.
pub(crate) fn volume_gradient(p: [D3; 4]) -> Shape {
    let (a, b, c) = (sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0]));
    let [g1, g2, g3] = [cross(b, c), cross(c, a), cross(a, b)].map(|g| g.map(|v| v / 6.0));
    let g0 = core::array::from_fn(|i| -(g1[i] + g2[i] + g3[i]));
    (dot(g3, c), [g0, g1, g2, g3])
}

/// Change of the volume gradient when the corners move by `d`.
#[inline(always)]
pub(crate) fn gradient_change(p: [D3; 4], d: [D3; 4]) -> [D3; 4] {
    let [a, b, c] = [1, 2, 3].map(|i| sub(p[i], p[0]));
    let [da, db, dc] = [1, 2, 3].map(|i| sub(d[i], d[0]));
    let mixed = |u: D3, dv: D3, du: D3, v: D3| -> D3 {
        let (x, y) = (cross(u, dv), cross(du, v));
        core::array::from_fn(|i| (x[i] + y[i]) / 6.0)
    };
    let (g1, g2, g3) = (mixed(b, dc, db, c), mixed(c, da, dc, a), mixed(a, db, da, b));
    let g0 = core::array::from_fn(|i| -(g1[i] + g2[i] + g3[i]));
    [g0, g1, g2, g3]
}

impl Elastic {
    pub(crate) fn new(
        rest: &[[f32; 4]],
        (tets, membranes): (&[[u32; 4]], &Membranes),
        (region, regions): (&[u8], &[Region]),
        share: f64,
    ) -> Self {
        let at: Vec<D3> = rest.iter().map(|&p| xyz(p).map(f64::from)).collect();
        let shapes: Vec<Shape> = tets.iter().map(|t| volume_gradient(t.map(|v| at[v as usize]))).collect();
        let volume: Vec<f64> = shapes.iter().map(|s| s.0).collect();
        let of = |r: u8| &regions[r as usize].material;
        let mu: Vec<f64> = region.iter().map(|&r| of(r).shear_kpa()).collect();
        let bulk = mu.iter().map(|mu| ELEMENT_BULK * mu).collect();
        let (patch, owners) = patches(tets, region, rest.len());
        let mut patch_volume = vec![0.0; owners.len()];
        for (corners, v) in patch.iter().zip(&volume) {
            corners.iter().for_each(|&p| patch_volume[p as usize] += v / 4.0);
        }
        let patch_bulk = owners.iter().map(|&r| patch_kpa(of(r))).collect();
        let mut base = vec![[0.0; 3]; rest.len()];
        for ((tet, (_, g)), mu) in tets.iter().zip(&shapes).zip(&mu) {
            scatter(&mut base, tet, g, *mu);
        }
        let near = laplacian(rest.len(), tets, &shapes, &mu);
        let far = averaging(rest.len(), (tets, &shapes, &mu), (&patch, &patch_volume), share);
        let films = films(membranes, regions, &at);
        Self {
            tets: tets.to_vec(),
            volume,
            mu,
            bulk,
            patch,
            patch_volume,
            patch_bulk,
            near,
            far,
            base,
            rest: at,
            films,
        }
    }

    /// Energy, and its gradient by each node (mN): minus the elastic force.
    pub(crate) fn gradient(&self, x: &[D3], gradient: &mut Vec<D3>, tangent: &mut Tangent) -> f64 {
        let mut energy = self.shear(x, gradient);
        tangent.gradient.clear();
        tangent.pressure.clear();
        tangent.volumetric.clear();
        tangent.volumetric.resize(self.patch_volume.len(), 0.0);
        for (t, tet) in self.tets.iter().enumerate() {
            let (v, g) = volume_gradient(tet.map(|n| x[n as usize]));
            let (rest, mu, bulk) = (self.volume[t], self.mu[t], self.bulk[t]);
            let dilation = v / rest - 1.0;
            energy += 0.5 * rest * bulk * dilation * dilation - mu * (v - rest);
            tangent.gradient.push(g);
            tangent.pressure.push(bulk * dilation - mu);
            self.patch[t].iter().for_each(|&p| tangent.volumetric[p as usize] += v / 4.0);
        }
        for (p, v) in tangent.volumetric.iter_mut().enumerate() {
            let dilation = *v / self.patch_volume[p] - 1.0;
            energy += 0.5 * self.patch_volume[p] * self.patch_bulk[p] * dilation * dilation;
            *v = self.patch_bulk[p] * dilation;
        }
        for (t, tet) in self.tets.iter().enumerate() {
            let mean = self.patch[t].iter().map(|&p| tangent.volumetric[p as usize]).sum::<f64>() / 4.0;
            tangent.pressure[t] += mean;
            scatter(gradient, tet, &tangent.gradient[t], tangent.pressure[t]);
        }
        for film in &self.films {
            let (own, g) = film.gradient(&film.nodes.map(|n| x[n as usize]));
            energy += own;
            scatter(gradient, &film.nodes, &g, 1.0);
        }
        energy
    }

    /// Shear energy of the displacement beyond the volume it makes, and its gradient.
    fn shear(&self, x: &[D3], gradient: &mut Vec<D3>) -> f64 {
        let u: Vec<D3> = x.iter().zip(&self.rest).map(|(x, r)| sub(*x, *r)).collect();
        self.stretch(&u, gradient);
        let mut energy = 0.0;
        for ((g, u), base) in gradient.iter_mut().zip(&u).zip(&self.base) {
            energy += 0.5 * dot(*u, *g) + dot(*u, *base);
            (0..3).for_each(|a| g[a] += base[a]);
        }
        energy
    }

    /// Product of the shear matrix with `d`.
    fn stretch(&self, d: &[D3], out: &mut Vec<D3>) {
        out.clear();
        out.resize(d.len(), [0.0; 3]);
        self.near.add_product(0, d, out);
        self.far.add_product(0, d, out);
    }

    /// Puts pressures of patches in place of those that follow from the volumes, for products with the Hessian.
    pub(crate) fn take_pressures(&self, tangent: &mut Tangent, pressures: &[f64]) {
        for (pressure, patch) in tangent.pressure.iter_mut().zip(&self.patch) {
            let change = patch.iter().map(|&p| pressures[p as usize] - tangent.volumetric[p as usize]).sum::<f64>();
            *pressure += change / 4.0;
        }
    }

    /// Elements that have no volume left.
    pub(crate) fn turned<'a>(&'a self, x: &'a [D3]) -> impl Iterator<Item = u32> + 'a {
        let flat = |t: &[u32; 4], rest: f64| volume_gradient(t.map(|n| x[n as usize])).0 <= NO_VOLUME * rest;
        self.tets.iter().zip(&self.volume).zip(0..).filter(move |((t, v), _)| flat(t, **v)).map(|(_, i)| i)
    }

    /// The part of the body, by volume at rest, that from one state to another has turned by more than a quarter or lost or
    /// gained half of its volume: by the trace and the determinant of the deformation between the two, 3 and 1 where nothing
    /// happened.
    pub(crate) fn leapt(&self, from: &[D3], to: &[D3]) -> f64 {
        let leaps = |tet: &[u32; 4]| {
            let (volume, gradient) = volume_gradient(tet.map(|n| from[n as usize]));
            let trace: f64 = gradient.iter().zip(tet).map(|(g, &n)| dot(*g, to[n as usize])).sum();
            let ratio = volume_gradient(tet.map(|n| to[n as usize])).0 / volume;
            trace < volume || !(0.5..2.0).contains(&ratio)
        };
        let far = self.tets.iter().zip(&self.volume).filter(|(tet, _)| leaps(tet));
        far.map(|(_, v)| v).sum::<f64>() / self.volume.iter().sum::<f64>()
    }

    /// The Hessian's diagonal 3x3 blocks, positive (the patch term replaced by its elementwise bound), as the six
    /// entries xx, yy, zz, xy, xz, yz.
    pub(crate) fn diagonal(&self, x: &[D3], tangent: &Tangent) -> Vec<[f64; 6]> {
        let mut out: Vec<[f64; 6]> = (0..self.rest.len())
            .map(|i| {
                let d = self.near.diagonal(i) + self.far.diagonal(i);
                [d, d, d, 0.0, 0.0, 0.0]
            })
            .collect();
        for (t, tet) in self.tets.iter().enumerate() {
            let patch = self.patch[t].iter().map(|&p| self.patch_bulk[p as usize]).sum::<f64>() / 16.0;
            let c = (self.bulk[t] + patch) / self.volume[t];
            for (g, &n) in tangent.gradient[t].iter().zip(tet) {
                add_outer(&mut out[n as usize], c, *g);
            }
        }
        for film in &self.films {
            let x = film.nodes.map(|n| x[n as usize]);
            for (i, &n) in film.nodes.iter().enumerate() {
                out[n as usize].iter_mut().zip(film.block(&x, i)).for_each(|(b, h)| *b += h);
            }
        }
        out
    }
}

/// Adds `k` times the product of `n` with itself to a symmetric matrix (xx, yy, zz, xy, xz, yz).
pub(super) fn add_outer(h: &mut [f64; 6], k: f64, n: D3) {
    let products = [n[0] * n[0], n[1] * n[1], n[2] * n[2], n[0] * n[1], n[0] * n[2], n[1] * n[2]];
    h.iter_mut().zip(products).for_each(|(h, p)| *h += k * p);
}

pub(crate) fn scatter<const N: usize>(out: &mut [D3], corners: &[u32; N], g: &[D3; N], factor: f64) {
    for (g, &n) in g.iter().zip(corners) {
        (0..3).for_each(|a| out[n as usize][a] += factor * g[a]);
    }
}

/// Number of the patch of each corner, and region of each patch: one patch for each node and region that meet. The first
/// of a node has the node's number, all others come after the last node.
fn patches(tets: &[[u32; 4]], region: &[u8], nodes: usize) -> (Vec<[u32; 4]>, Vec<u8>) {
    let mut owners: Vec<(u32, u8)> = tets.iter().zip(region).flat_map(|(t, &r)| t.map(|n| (n, r))).collect();
    owners.sort_unstable();
    owners.dedup();
    let mut regions = vec![0; nodes];
    let mut further = Vec::new();
    for own in owners.chunk_by(|a, b| a.0 == b.0) {
        regions[own[0].0 as usize] = own[0].1;
        further.extend_from_slice(&own[1..]);
    }
    let find = |n: u32, r: u8| match further.binary_search(&(n, r)) {
        Ok(i) => (nodes + i) as u32,
        Err(_) => n,
    };
    let patch = tets.iter().zip(region).map(|(t, &r)| t.map(|n| find(n, r))).collect();
    regions.extend(further.iter().map(|f| f.1));
    (patch, regions)
}

/// The shear matrix of the elements.
fn laplacian(nodes: usize, tets: &[[u32; 4]], shapes: &[Shape], mu: &[f64]) -> Rows {
    let mut entries: Vec<(u32, u32, f64)> = Vec::with_capacity(tets.len() * 12);
    for ((tet, (volume, g)), mu) in tets.iter().zip(shapes).zip(mu) {
        for i in 0..4 {
            for j in (0..4).filter(|&j| j != i) {
                // The gradient of a shape function is that of the volume over the volume.
                entries.push((tet[i], tet[j], mu * dot(g[i], g[j]) / volume));
            }
        }
    }
    Rows::new(nodes, entries)
}

/// `share` times the shear matrix of the patches' mean deformation less that of the elements.
fn averaging(
    nodes: usize,
    (tets, shapes, mu): (&[[u32; 4]], &[Shape], &[f64]),
    (patch, patch_volume): (&[[u32; 4]], &[f64]),
    share: f64,
) -> Rows {
    if share == 0.0 {
        return Rows::new(nodes, Vec::new());
    }
    // Mean gradient of each shape function over each patch, times the patch's volume.
    let mut mean: Vec<(u32, u32, D3, f64)> = Vec::with_capacity(tets.len() * 16);
    for (((tet, (_, g)), p), mu) in tets.iter().zip(shapes).zip(patch).zip(mu) {
        mean.extend((0..16).map(|k| (p[k / 4], tet[k % 4], g[k % 4].map(|v| v / 4.0), *mu)));
    }
    mean.sort_by_key(|m| (m.0, m.1));
    mean.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        if same {
            (0..3).for_each(|a| kept.2[a] += next.2[a]);
        }
        same
    });
    let less: Vec<f64> = mu.iter().map(|mu| -share * mu).collect();
    let element = laplacian(nodes, tets, shapes, &less);
    let mut entries: Vec<(u32, u32, f64)> = Vec::new();
    for i in 0..nodes {
        let row = element.start[i] as usize..element.start[i + 1] as usize;
        entries.extend(row.map(|k| (i as u32, element.column[k], element.weight[k])));
    }
    for row in mean.chunk_by(|a, b| a.0 == b.0) {
        for (_, i, gi, mu) in row {
            let others = row.iter().filter(|r| r.1 != *i);
            entries.extend(others.map(|r| (*i, r.1, share * mu * dot(*gi, r.2) / patch_volume[r.0 as usize])));
        }
    }
    Rows::new(nodes, entries)
}

impl Rows {
    /// Sums entries of the same place.
    fn new(rows: usize, mut entries: Vec<(u32, u32, f64)>) -> Self {
        // Stable, so that the sums come out the same on every run.
        entries.sort_by_key(|e| (e.0, e.1));
        let mut out = Self { start: vec![0; rows + 1], column: Vec::new(), weight: Vec::new() };
        for same in entries.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            out.column.push(same[0].1);
            out.weight.push(same.iter().map(|e| e.2).sum());
            out.start[same[0].0 as usize + 1] += 1;
        }
        for i in 0..rows {
            out.start[i + 1] += out.start[i];
        }
        out
    }

    /// Adds the product of the rows from `first` on with `d`.
    pub(super) fn add_product(&self, first: usize, d: &[D3], out: &mut [D3]) {
        for (i, out) in (first..).zip(out) {
            for k in self.start[i] as usize..self.start[i + 1] as usize {
                let (di, dj, w) = (d[i], d[self.column[k] as usize], self.weight[k]);
                // Rows sum to zero: differences lose no digits.
                (0..3).for_each(|a| out[a] += w * (dj[a] - di[a]));
            }
        }
    }

    /// The entry of row `i` on the diagonal.
    pub(crate) fn diagonal(&self, i: usize) -> f64 {
        -self.weight[self.start[i] as usize..self.start[i + 1] as usize].iter().sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::super::products::Products;
    use super::*;
    use crate::model::tests::block;
    use crate::{Material, Model};
    use proptest::prelude::*;

    fn elastic(poisson: f64, share: f64) -> Elastic {
        let mut mesh = block([2, 2, 1], 3.0);
        mesh.labels.iter_mut().step_by(3).for_each(|l| *l = 5);
        let model = Model::new(&mesh, &crate::model::tests::paper_options()).expect("model");
        let mut regions = model.regions.clone();
        regions[0].material = Material { poisson, ..Material::BRAIN };
        Elastic::new(&model.rest, (&model.tets, &model.membranes), (&model.region, &regions), share)
    }

    /// The reference energy of one element by its deformation gradient, all of it in the element.
    fn by_definition(e: &Elastic, x: &[D3], t: usize, lam: f64) -> f64 {
        let tet = e.tets[t].map(|n| n as usize);
        let (_, g) = volume_gradient(tet.map(|n| e.rest[n]));
        let mut f = [[0.0; 3]; 3];
        for i in 0..4 {
            for a in 0..3 {
                (0..3).for_each(|b| f[a][b] += x[tet[i]][a] * g[i][b] / e.volume[t]);
            }
        }
        let j = dot(f[0], cross(f[1], f[2]));
        let trace: f64 = f.iter().map(|r| dot(*r, *r)).sum();
        let mu = e.mu[t];
        e.volume[t] * (0.5 * mu * (trace - 3.0) - mu * (j - 1.0) + 0.5 * (lam + mu) * (j - 1.0) * (j - 1.0))
    }

    #[test]
    fn an_affine_deformation_has_the_reference_energy_whatever_the_split() {
        for share in [0.0, 0.3, 1.0] {
            let e = elastic(0.49, share);
            let f = [[1.2, 0.1, -0.05], [0.0, 0.9, 0.2], [0.1, -0.1, 1.05]];
            let x: Vec<D3> = e.rest.iter().map(|p| f.map(|r| dot(r, *p))).collect();
            let energy = e.gradient(&x, &mut Vec::new(), &mut Tangent::default());
            let lam = |t: usize| {
                if e.mu[t] > 0.5 {
                    Material { poisson: 0.49, ..Material::BRAIN }.lame_kpa()
                } else {
                    Material::VENTRICLE.lame_kpa()
                }
            };
            let expected: f64 = (0..e.tets.len()).map(|t| by_definition(&e, &x, t, lam(t))).sum();
            assert!((energy / expected - 1.0).abs() < 1e-9, "{energy} {expected}");
        }
    }

    #[test]
    fn rest_has_neither_energy_nor_force() {
        let e = elastic(0.45, 0.0);
        let mut g = Vec::new();
        let energy = e.gradient(&e.rest, &mut g, &mut Tangent::default());
        assert!(energy.abs() < 1e-9 && g.iter().flatten().all(|v| v.abs() < 1e-10), "{energy}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn forces_and_hessian_agree_with_finite_differences(seed in 0u64..1000, share in 0.0..1.0f64, size in 0.1..1.5f64) {
            let e = elastic(0.45, share);
            let noise = |i: usize, k: u64| ((i as u64 * 7919 + seed * 104_729 + k * 31) % 1000) as f64 / 500.0 - 1.0;
            let field = |k: u64, s: f64| -> Vec<D3> {
                (0..e.rest.len()).map(|i| core::array::from_fn(|a| s * noise(3 * i + a, k))).collect()
            };
            let shift = |x: &[D3], d: &[D3], s: f64| -> Vec<D3> {
                x.iter().zip(d).map(|(x, d)| core::array::from_fn(|a| x[a] + s * d[a])).collect()
            };
            let x = shift(&e.rest, &field(1, size), 1.0);
            let d = field(2, 1.0);
            let (mut g, mut tangent) = (Vec::new(), Tangent::default());
            e.gradient(&x, &mut g, &mut tangent);
            let mut hd = Vec::new();
            e.hessian((&x, &tangent), &d, &mut hd, &mut Products::new(&e, 1));
            let mut shared = Vec::new();
            e.hessian((&x, &tangent), &d, &mut shared, &mut Products::new(&e, 3));
            prop_assert_eq!(&hd, &shared);
            let h = 1e-5;
            let (mut up, mut down) = (Vec::new(), Vec::new());
            let eu = e.gradient(&shift(&x, &d, h), &mut up, &mut Tangent::default());
            let ed = e.gradient(&shift(&x, &d, -h), &mut down, &mut Tangent::default());
            let slope: f64 = g.iter().zip(&d).map(|(g, d)| dot(*g, *d)).sum();
            prop_assert!(((eu - ed) / (2.0 * h) - slope).abs() < 1e-5 * (1.0 + slope.abs()));
            let scale = hd.iter().flatten().fold(0f64, |m, v| m.max(v.abs()));
            for i in 0..x.len() {
                for a in 0..3 {
                    let change = (up[i][a] - down[i][a]) / (2.0 * h);
                    prop_assert!((change - hd[i][a]).abs() < 1e-6 * scale, "{change} {}", hd[i][a]);
                }
            }
        }
    }
}
