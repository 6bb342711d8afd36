//! Thin elastic membranes (pia, ependyma, a capsule) on the walls of regions: triangles with a stiffness in their plane and
//! none against bending.
//!
//! Per area at rest and times the thickness, `W = mu/2 (tr C - 2) - mu (J - 1) + kappa/2 (J - 1)^2` with the in-plane
//! deformation's `C`, the ratio of areas `J`, `mu = E / (2 (1 + nu))` and `kappa = mu (1 + nu) / (1 - nu)`: the solid's own
//! energy in two dimensions, which for small strains is plane stress. Its first term is quadratic, with half the cotangents
//! of the angles at rest as weights (Pinkall and Polthier 1993); all else acts through the area. Out of its plane the two
//! cancel at rest: a slack membrane resists there only by what it is stretched.

use super::elastic::add_outer;
use crate::bytes;
use crate::material::ThinMembrane;
use crate::membrane::{Membrane, Membranes, OUTSIDE};
use crate::model::Region;
use crate::vec3::{V3, xyz};
use monro_geometry::d3::{D3, cross, dot, norm, sub};

/// A triangle below this share of its area at rest has no plane to act in.
const COLLAPSED: f64 = 1e-9;

/// A triangle of a membrane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Film {
    pub(crate) nodes: [u32; 3],
    /// Area at rest, mm2.
    area: f64,
    /// Half the cotangents of the angles at rest.
    half_cot: [f64; 3],
    /// Shear modulus and modulus of the area, times the thickness, mN/mm.
    shear: f64,
    bulk: f64,
}

/// The membranes of a model that have a stiffness. A wall to a fluid has that of the fluid; between two solids the stiffer
/// one counts; between two fluids there is none.
pub(crate) fn films(membranes: &Membranes, regions: &[Region], rest: &[D3]) -> Vec<Film> {
    let with = membranes.faces.iter().filter_map(|face| Some((face, stiff(face, regions)?)));
    with.map(|(face, of)| Film::new(face.nodes, rest, &of)).collect()
}

fn stiff(face: &Membrane, regions: &[Region]) -> Option<ThinMembrane> {
    let inner = &regions[face.inner as usize].material;
    if face.outer == OUTSIDE {
        return inner.membrane;
    }
    let outer = &regions[face.outer as usize].material;
    let tension = |m: &ThinMembrane| m.young_kpa * m.thickness_mm;
    match (inner.fluid, outer.fluid) {
        (true, true) => None,
        (true, false) => inner.membrane,
        (false, true) => outer.membrane,
        (false, false) => {
            [inner.membrane, outer.membrane].into_iter().flatten().max_by(|a, b| tension(a).total_cmp(&tension(b)))
        }
    }
}

/// Area of a triangle with its normal and its derivative by each corner.
struct Area {
    area: f64,
    normal: D3,
    by: [D3; 3],
}

/// The edge opposite each corner, all the same way round.
fn edges(x: &[D3; 3]) -> [D3; 3] {
    [sub(x[2], x[1]), sub(x[0], x[2]), sub(x[1], x[0])]
}

impl Area {
    /// `None` where it is no more than `least`.
    fn of(x: &[D3; 3], least: f64) -> Option<Self> {
        let n = cross(sub(x[1], x[0]), sub(x[2], x[0]));
        let twice = norm(n);
        let normal = n.map(|v| v / twice);
        let by = edges(x).map(|e| cross(normal, e).map(|v| 0.5 * v));
        (0.5 * twice > least).then_some(Self { area: 0.5 * twice, normal, by })
    }
}

impl Film {
    fn new(nodes: [u32; 3], rest: &[D3], of: &ThinMembrane) -> Self {
        let x = nodes.map(|n| rest[n as usize]);
        let n = cross(sub(x[1], x[0]), sub(x[2], x[0]));
        let area = 0.5 * norm(n);
        let e = edges(&x);
        let half_cot = core::array::from_fn(|k| -dot(e[(k + 1) % 3], e[(k + 2) % 3]) / (4.0 * area));
        let shear = of.young_kpa / (2.0 * (1.0 + of.poisson)) * of.thickness_mm;
        Self { nodes, area, half_cot, shear, bulk: shear * (1.0 + of.poisson) / (1.0 - of.poisson) }
    }

    /// Derivative of the energy by the area, besides the quadratic term, mN/mm.
    fn slope(&self, area: f64) -> f64 {
        self.bulk * (area / self.area - 1.0) - self.shear
    }

    /// The quadratic term's gradient by corner `i`.
    fn pull(&self, x: &[D3; 3], i: usize) -> D3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (to_j, to_k) = (sub(x[i], x[j]), sub(x[i], x[k]));
        core::array::from_fn(|a| self.shear * (self.half_cot[k] * to_j[a] + self.half_cot[j] * to_k[a]))
    }

    /// Gradient of the energy by corner `i`, mN.
    fn gradient_at(&self, x: &[D3; 3], i: usize) -> D3 {
        let mut g = self.pull(x, i);
        if let Some(at) = Area::of(x, COLLAPSED * self.area) {
            let slope = self.slope(at.area);
            (0..3).for_each(|a| g[a] += slope * at.by[i][a]);
        }
        g
    }

    /// Energy, mN mm, and its gradient by the corners, mN.
    pub(super) fn gradient(&self, x: &[D3; 3]) -> (f64, [D3; 3]) {
        let e = edges(x);
        let squares: f64 = (0..3).map(|k| self.half_cot[k] * dot(e[k], e[k])).sum();
        let area = Area::of(x, 0.0).map_or(0.0, |a| a.area);
        let dilation = area / self.area - 1.0;
        let energy = self.shear * (0.5 * squares - area) + 0.5 * self.bulk * self.area * dilation * dilation;
        (energy, core::array::from_fn(|i| self.gradient_at(x, i)))
    }

    /// Product of the Hessian with `d`.
    pub(crate) fn product(&self, x: &[D3; 3], d: &[D3; 3]) -> [D3; 3] {
        let mut out: [D3; 3] = core::array::from_fn(|i| self.pull(d, i));
        let Some(at) = Area::of(x, COLLAPSED * self.area) else { return out };
        let (slope, rate) = (self.slope(at.area), (0..3).map(|i| dot(at.by[i], d[i])).sum::<f64>());
        let (u, v, du, dv) = (sub(x[1], x[0]), sub(x[2], x[0]), sub(d[1], d[0]), sub(d[2], d[0]));
        let (p, q) = (cross(du, v), cross(u, dv));
        let turn: D3 = core::array::from_fn(|a| p[a] + q[a]);
        let along = dot(turn, at.normal);
        let turned: D3 = core::array::from_fn(|a| (turn[a] - along * at.normal[a]) / (2.0 * at.area));
        let (e, de) = (edges(x), edges(d));
        for i in 0..3 {
            let (p, q) = (cross(turned, e[i]), cross(at.normal, de[i]));
            let change = self.bulk / self.area * rate;
            (0..3).for_each(|a| out[i][a] += change * at.by[i][a] + 0.5 * slope * (p[a] + q[a]));
        }
        out
    }

    /// The Hessian's diagonal block of corner `i` (xx, yy, zz, xy, xz, yz), without what a compressed triangle would give way
    /// out of its plane: never negative.
    pub(super) fn block(&self, x: &[D3; 3], i: usize) -> [f64; 6] {
        let pull = self.shear * (self.half_cot[(i + 1) % 3] + self.half_cot[(i + 2) % 3]);
        let mut h = [pull, pull, pull, 0.0, 0.0, 0.0];
        if let Some(at) = Area::of(x, COLLAPSED * self.area) {
            add_outer(&mut h, self.bulk / self.area, at.by[i]);
            let e = edges(x)[i];
            add_outer(&mut h, (self.slope(at.area) * dot(e, e) / (4.0 * at.area)).max(-pull), at.normal);
        }
        h
    }
}

fn wide(p: [f32; 4]) -> D3 {
    xyz(p).map(f64::from)
}

/// The triangles around each vertex, for the sweeps; all empty where no membrane has a stiffness.
#[derive(Debug, Clone, Default)]
pub(super) struct FilmsAround {
    films: Vec<Film>,
    /// First entry of each vertex and one more, and the entries: triangle, corner, and force there at rest (rounding), mN.
    first: Vec<u32>,
    around: Vec<(u32, u8, D3)>,
}

impl FilmsAround {
    /// Keeps the triangles with a vertex that can move.
    pub(super) fn new(films: &[Film], rest: &[[f32; 4]]) -> Self {
        let free = |n: &u32| rest[*n as usize][3] > 0.0;
        let films: Vec<Film> = films.iter().filter(|f| f.nodes.iter().any(free)).copied().collect();
        if films.is_empty() {
            return Self::default();
        }
        let corners = films.iter().zip(0u32..).flat_map(|(f, t)| (0..3u8).map(move |i| (f.nodes[i as usize], t, i)));
        let mut all: Vec<(u32, u32, u8)> = corners.filter(|c| free(&c.0)).collect();
        all.sort_unstable();
        let first = (0..=rest.len() as u32).map(|v| all.partition_point(|c| c.0 < v) as u32).collect();
        let at_rest = |t: u32, i: u8| {
            let film = &films[t as usize];
            film.gradient_at(&film.nodes.map(|n| wide(rest[n as usize])), i as usize)
        };
        let around = all.into_iter().map(|(_, t, i)| (t, i, at_rest(t, i))).collect();
        Self { films, first, around }
    }

    /// Whether any acts on vertex `v`.
    #[inline(always)]
    pub(super) fn on(&self, v: u32) -> bool {
        !self.first.is_empty() && self.first[v as usize] < self.first[v as usize + 1]
    }

    /// Whether there is any.
    #[inline(always)]
    pub(super) fn any(&self) -> bool {
        !self.films.is_empty()
    }

    /// Adds what they do to vertex `v`, less what they do at rest, so that rest stays rest to the last bit. `vertices` begin
    /// with the vertex `start`.
    pub(super) fn act(&self, v: u32, (vertices, start): (&[[f32; 4]], usize), to: (&mut V3, &mut [f32; 6])) {
        let (mut force, mut block) = ([0.0; 3], [0.0; 6]);
        for &(t, i, then) in &self.around[self.first[v as usize] as usize..self.first[v as usize + 1] as usize] {
            let film = &self.films[t as usize];
            let x = film.nodes.map(|n| wide(vertices[n as usize - start]));
            let now = film.gradient_at(&x, i as usize);
            (0..3).for_each(|a| force[a] += now[a] - then[a]);
            block.iter_mut().zip(film.block(&x, i as usize)).for_each(|(b, h)| *b += h);
        }
        to.0.iter_mut().zip(force).for_each(|(g, f)| *g += f as f32);
        to.1.iter_mut().zip(block).for_each(|(h, b)| *h += b as f32);
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.films) + bytes::of(&self.first) + bytes::of(&self.around)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PIA: ThinMembrane = ThinMembrane { young_kpa: 1200.0, poisson: 0.4, thickness_mm: 0.02 };

    fn film(x: [D3; 3]) -> Film {
        Film::new([0, 1, 2], &x, &PIA)
    }

    #[test]
    fn a_strip_pulled_with_free_sides_has_its_youngs_modulus() {
        let rest = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [1.0, 2.0, 0.0]];
        let f = film(rest);
        let strain = 1e-5;
        let pulled = rest.map(|p| [p[0] * (1.0 + strain), p[1] * (1.0 - PIA.poisson * strain), 0.0]);
        let energy = f.gradient(&pulled).0;
        let expected = 0.5 * PIA.young_kpa * PIA.thickness_mm * strain * strain * f.area;
        // The energy's next term is of third order.
        assert!((energy / expected - 1.0).abs() < 10.0 * strain, "{energy} {expected}");
    }

    proptest! {
        #[test]
        fn forces_and_hessian_of_a_triangle_agree_with_finite_differences(
            c in prop::array::uniform18(-1.0..1.0f64), lift in -0.5..0.5f64,
        ) {
            let rest = [[0.0, 0.0, 0.0], [3.0, 0.2, 0.0], [1.0 + 0.5 * lift, 2.5, 0.3]];
            let f = film(rest);
            let x: [D3; 3] = core::array::from_fn(|i| core::array::from_fn(|a| rest[i][a] + 0.4 * c[3 * i + a]));
            let d: [D3; 3] = core::array::from_fn(|i| core::array::from_fn(|a| c[9 + 3 * i + a]));
            let moved = |s: f64| core::array::from_fn(|i| core::array::from_fn(|a| x[i][a] + s * d[i][a]));
            let h = 1e-5;
            let ((up, gu), (down, gd)) = (f.gradient(&moved(h)), f.gradient(&moved(-h)));
            let slope: f64 = f.gradient(&x).1.iter().zip(&d).map(|(g, d)| dot(*g, *d)).sum();
            prop_assert!(((up - down) / (2.0 * h) - slope).abs() < 1e-6 * (f.shear + slope.abs()));
            let product = f.product(&x, &d);
            for i in 0..3 {
                for a in 0..3 {
                    let change = (gu[i][a] - gd[i][a]) / (2.0 * h);
                    prop_assert!((change - product[i][a]).abs() < 1e-5 * f.bulk, "{change} {}", product[i][a]);
                }
            }
        }

        #[test]
        fn a_triangle_carried_along_and_turned_keeps_its_peace(c in prop::array::uniform6(-3.0..3.0f64)) {
            let rest = [[0.0, 0.0, 0.0], [3.0, 0.2, 0.0], [1.0, 2.5, 0.3]];
            let f = film(rest);
            let (sin, cos) = c[0].sin_cos();
            let turned = rest.map(|p| [cos * p[0] - sin * p[1] + c[3], sin * p[0] + cos * p[1] + c[4], p[2] + c[5]]);
            let (energy, forces) = f.gradient(&turned);
            prop_assert!(energy.abs() < 1e-11 && forces.iter().flatten().all(|v| v.abs() < 1e-11), "{energy}");
        }

        #[test]
        fn the_block_of_a_stretched_triangle_is_its_hessians(c in prop::array::uniform12(-1.0..1.0f64)) {
            let rest = [[0.0, 0.0, 0.0], [3.0, 0.2, 0.0], [1.0, 2.5, 0.3]];
            let f = film(rest);
            let x: [D3; 3] = core::array::from_fn(|i| core::array::from_fn(|a| 1.5 * rest[i][a] + 0.3 * c[3 * i + a]));
            let v = [c[9], c[10], c[11]];
            for i in 0..3 {
                let mut d = [[0.0; 3]; 3];
                d[i] = v;
                let b = f.block(&x, i);
                let bv = [
                    b[0] * v[0] + b[3] * v[1] + b[4] * v[2],
                    b[3] * v[0] + b[1] * v[1] + b[5] * v[2],
                    b[4] * v[0] + b[5] * v[1] + b[2] * v[2],
                ];
                let exact = f.product(&x, &d)[i];
                prop_assert!((0..3).all(|a| (bv[a] - exact[a]).abs() < 1e-9 * f.bulk), "{bv:?} {exact:?}");
            }
        }
    }
}
