//! Contact of the outer surface with rigid spheres: an augmented Lagrangian on the surface's vertices.
//!
//! Between vertices the surface is guarded: the middle of each face stays out of a sphere a little smaller, so that a sphere
//! pressed deep does not slip through where the faces under it are stretched. What is held cannot give way and takes no part.
//!
//! Of each vertex with the surface area `A` around it, pressed by `p` (kPa) and reaching `g` into the sphere, the energy is
//! `A / (2 e) (max(0, p + e g)^2 - p^2)`; the pressures take the step `p <- max(0, p + e g)` until nothing reaches in any
//! more (Alart and Curnier 1991; Simo and Laursen 1992). Friction (Coulomb) holds a vertex by a spring to the place on the
//! sphere where it touched first, up to the coefficient times the pressure of the last step.

use super::StaticProblem;
use super::site::{self, Hold, Site};
use crate::Model;
use crate::physical::elastic::Elastic;
use monro_geometry::d3::{D3, axpy, dot, norm, sub};

/// What may still reach in, over the radius of the sphere,
const REACH: f64 = 1e-4;
/// and over its way: a sphere may be as good as flat.
const REACH_OF_WAY: f64 = 1e-3;

/// The middle of a face nearer to a centre than this share of the radius has been gone through.
const THROUGH: f64 = 0.8;

/// Longest step of a sphere over its radius, and of one that rubs: friction depends on the path.
const STRIDE: f64 = 0.1;
const RUBBING_STRIDE: f64 = 0.2 * STRIDE;

/// A sphere and what it does to each site.
#[derive(Debug, Clone)]
struct Sphere {
    radius: f64,
    friction: f64,
    from: D3,
    to: D3,
    centre: D3,
    /// Pressure on each site, kPa.
    pressure: Vec<f64>,
    /// Where on the sphere each site is held, from the centre.
    held: Vec<Option<D3>>,
}

/// All spheres.
#[derive(Debug, Clone, Default)]
pub(super) struct Spheres {
    sites: Vec<Site>,
    spheres: Vec<Sphere>,
}

/// How a site is touched.
#[derive(Debug, Clone, Copy)]
struct Touch {
    /// Towards the site from the centre.
    normal: D3,
    /// Pressure, kPa.
    pressure: f64,
    /// Whether friction holds the site.
    held: bool,
    /// Drift along the surface from where the site is held, mm, and its size.
    drift: D3,
    slid: f64,
    /// Largest shear traction, kPa.
    limit: f64,
}

impl Touch {
    /// Shear traction over the drift, kPa/mm.
    fn stiffness(&self, penalty: f64) -> f64 {
        match (self.held, self.slides(penalty)) {
            (false, _) => 0.0,
            (true, false) => penalty,
            (true, true) => self.limit / self.slid,
        }
    }

    fn slides(&self, penalty: f64) -> bool {
        penalty * self.slid > self.limit
    }

    /// Traction on the tissue, kPa.
    fn traction(&self, penalty: f64) -> D3 {
        axpy(self.normal.map(|n| n * self.pressure), -self.stiffness(penalty), self.drift)
    }

    /// Energy of friction over the area.
    fn friction(&self, penalty: f64) -> f64 {
        if self.slides(penalty) {
            self.limit * self.slid - 0.5 * self.limit * self.limit / penalty
        } else {
            0.5 * penalty * self.slid * self.slid
        }
    }

    /// Change of the traction's opposite when the site moves by `d`.
    fn change(&self, penalty: f64, d: D3) -> D3 {
        let along = dot(d, self.normal);
        let across = axpy(d, -along, self.normal);
        let k = self.stiffness(penalty);
        // The turning of the normal is left out: it only ever softens, and small against the tissue it would spoil the
        // conjugate gradients where a step begins deep inside the sphere.
        let mut out = axpy(self.normal.map(|n| n * along * penalty), k, across);
        if self.slides(penalty) {
            let way = self.drift.map(|v| v / self.slid);
            out = axpy(out, -k * dot(way, across), way);
        }
        out
    }
}

/// A site and how it is touched.
pub(super) struct Press<'a> {
    site: &'a Site,
    touch: Touch,
}

impl Press<'_> {
    /// Change of the force's opposite when the site moves by `d`.
    fn change(&self, d: D3) -> D3 {
        self.touch.change(self.site.penalty, d).map(|c| self.site.area * c)
    }

    /// The site's nodes: of a vertex the same three times.
    pub(super) fn nodes(&self) -> [u32; 3] {
        self.site.nodes
    }

    /// The same as [`Spheres::add_hessian`] of this site alone, between its nodes.
    pub(super) fn product(&self, d: &[D3; 3]) -> [D3; 3] {
        let share = self.site.share;
        let moved = core::array::from_fn(|a| (0..3).map(|i| share[i] * d[i][a]).sum());
        let change = self.change(moved);
        share.map(|w| change.map(|c| w * c))
    }
}

impl Sphere {
    fn touch(&self, i: usize, site: &Site, x: D3) -> Option<Touch> {
        let out = sub(x, self.centre);
        let far = norm(out);
        let pressure = self.pressure[i] + site.penalty * (site.reach * self.radius - far);
        if pressure <= 0.0 || far == 0.0 {
            return None;
        }
        let normal = out.map(|v| v / far);
        if site.firm(normal) {
            return None;
        }
        let drift = self.held[i].map_or([0.0; 3], |held| {
            let drift = sub(out, held);
            axpy(drift, -dot(drift, normal), normal)
        });
        let (held, limit) = (self.held[i].is_some(), self.friction * self.pressure[i]);
        Some(Touch { normal, pressure, held, drift, slid: norm(drift), limit })
    }

    /// What may still reach in, mm.
    fn reach(&self) -> f64 {
        let way = norm(sub(self.to, self.from));
        if way > 0.0 { (REACH * self.radius).min(REACH_OF_WAY * way) } else { REACH * self.radius }
    }

    /// Distance of a site from the sphere, less than 0 when it reaches in, mm.
    fn away(&self, site: &Site, x: &[D3]) -> f64 {
        norm(sub(site.at(x), self.centre)) - self.radius
    }

    /// How far the sphere may go in a step that has a site this far away, mm: a part of its radius in, or half of the way there.
    fn leeway(&self, away: f64) -> f64 {
        let radii = if self.friction > 0.0 { RUBBING_STRIDE } else { STRIDE };
        (radii * self.radius).max(0.5 * away)
    }

    /// Largest share of the way in which it goes no further than it may, and no site further against it, if these go on with
    /// what they moved over the share before (`speed`).
    fn stride(&self, sites: &[Site], x: &[D3], speed: &[D3]) -> f64 {
        let way = sub(self.to, self.from);
        let within = |leeway: f64, speed: f64| leeway / speed.max(f64::MIN_POSITIVE);
        let nearest = sites.iter().map(|s| self.away(s, x)).fold(f64::INFINITY, f64::min);
        let against = |s: &Site| within(self.leeway(self.away(s, x)), norm(sub(s.at(speed), way)));
        let free = sites.iter().filter(|s| !s.held());
        free.map(against).fold(within(self.leeway(nearest), norm(way)), f64::min)
    }

    /// How often a site moved as far against the sphere as it may, from `before` (and the sphere as it was then) to `x`.
    fn overshot(&self, sites: &[Site], (was, before): (&Self, &[D3]), x: &[D3]) -> f64 {
        let moved = sub(self.centre, was.centre);
        let times = |s: &Site| norm(sub(sub(s.at(x), s.at(before)), moved)) / was.leeway(was.away(s, before));
        sites.iter().filter(|s| !s.held()).map(times).fold(0.0, f64::max)
    }

    /// The next pressure of each site, and how far one reaches in or holds off, mm.
    fn next(&self, sites: &[Site], x: &[D3]) -> (Vec<f64>, f64) {
        let at = |i: usize, s: &Site| self.touch(i, s, s.at(x)).map_or(0.0, |t| t.pressure);
        let next: Vec<f64> = sites.iter().enumerate().map(|(i, s)| at(i, s)).collect();
        let gaps = next.iter().zip(&self.pressure).zip(sites).map(|((n, p), s)| (n - p).abs() / s.penalty);
        let worst = gaps.fold(0.0, f64::max);
        (next, worst)
    }

    /// After a step of the load: new sites are held where they are, sliding ones where their friction still reaches.
    fn settle(&mut self, sites: &[Site], x: &[D3]) {
        for (i, site) in sites.iter().enumerate() {
            let at = site.at(x);
            let rubs = self.friction > 0.0 && site.reach == 1.0;
            self.held[i] = self.touch(i, site, at).filter(|_| rubs).map(|t| {
                let out = sub(at, self.centre);
                let kept = if t.slides(site.penalty) { t.limit / (site.penalty * t.slid) } else { 1.0 };
                axpy(out, -kept, t.drift)
            });
        }
    }
}

impl Spheres {
    pub(super) fn new(model: &Model, elastic: &Elastic, (problem, support): (&StaticProblem, &[Hold])) -> Self {
        let sites = if problem.contacts.is_empty() { Vec::new() } else { site::all(model, elastic, support) };
        let local = |p: monro_geometry::Point<monro_geometry::Patient>| (p - model.origin).to_array();
        let spheres = problem.contacts.iter().map(|c| Sphere {
            radius: c.radius_mm,
            friction: c.friction,
            from: local(c.from),
            to: local(c.to),
            centre: local(c.from),
            pressure: vec![0.0; sites.len()],
            held: vec![None; sites.len()],
        });
        Self { spheres: spheres.collect(), sites }
    }

    /// Whether any has friction.
    pub(super) fn rub(&self) -> bool {
        self.spheres.iter().any(|s| s.friction > 0.0)
    }

    /// Puts the spheres a share of their way.
    pub(super) fn place(&mut self, share: f64) {
        for s in &mut self.spheres {
            s.centre = axpy(s.from, share, sub(s.to, s.from));
        }
    }

    /// Largest share of the way in which no sphere goes further than it may, nor the surface against it. `speed` is what each
    /// node moved in the last step over its share of the way.
    pub(super) fn stride(&self, x: &[D3], speed: &[D3]) -> f64 {
        self.spheres.iter().map(|s| s.stride(&self.sites, x, speed)).fold(1.0, f64::min)
    }

    /// How often the surface moved as far against a sphere as it may in a step, from the spheres and the state `before`.
    pub(super) fn overshot(&self, (was, before): (&Self, &[D3]), x: &[D3]) -> f64 {
        let pairs = self.spheres.iter().zip(&was.spheres);
        pairs.map(|(s, was)| s.overshot(&self.sites, (was, before), x)).fold(0.0, f64::max)
    }

    /// Radius of the smallest sphere, mm.
    pub(super) fn least_radius(&self) -> Option<f64> {
        self.spheres.iter().map(|s| s.radius).reduce(f64::min)
    }

    fn touches<'a>(&'a self, x: &'a [D3]) -> impl Iterator<Item = (usize, usize, &'a Site, Touch)> {
        self.spheres.iter().enumerate().flat_map(move |(k, s)| {
            let sites = self.sites.iter().enumerate();
            sites.filter_map(move |(i, site)| Some((k, i, site, s.touch(i, site, site.at(x))?)))
        })
    }

    /// Adds to the gradient and returns the energy.
    pub(super) fn add(&self, x: &[D3], gradient: &mut [D3]) -> f64 {
        let mut energy = 0.0;
        for (_, _, site, t) in self.touches(x) {
            energy += site.area * (0.5 * t.pressure.powi(2) / site.penalty + t.friction(site.penalty));
            let force = t.traction(site.penalty);
            site.scatter(force.map(|f| -site.area * f), gradient);
        }
        energy
    }

    pub(super) fn add_hessian(&self, x: &[D3], d: &[D3], out: &mut [D3]) {
        for press in self.presses(x) {
            press.site.scatter(press.change(press.site.at(d)), out);
        }
    }

    /// All sites that are touched.
    pub(super) fn presses<'a>(&'a self, x: &'a [D3]) -> impl Iterator<Item = Press<'a>> {
        self.touches(x).map(|(_, _, site, touch)| Press { site, touch })
    }

    /// Adds an upper bound of the diagonal blocks (xx, yy, zz, xy, xz, yz).
    pub(super) fn add_diagonal(&self, x: &[D3], blocks: &mut [[f64; 6]]) {
        for (_, _, site, t) in self.touches(x) {
            let (n, k) = (t.normal, site.area * site.penalty);
            let shear = site.area * t.stiffness(site.penalty);
            let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
            for (node, weight) in site.weights() {
                for (b, (p, q)) in blocks[node].iter_mut().zip(pairs) {
                    let unit = f64::from(u8::from(p == q));
                    *b += weight * (k * n[p] * n[q] + shear * (unit - n[p] * n[q]));
                }
            }
        }
    }

    /// Square of the forces on the sites, mN2.
    pub(super) fn size2(&self, x: &[D3]) -> f64 {
        self.touches(x)
            .map(|(_, _, s, t)| t.traction(s.penalty).iter().map(|f| (f * s.area).powi(2)).sum::<f64>())
            .sum()
    }

    /// A step of the pressures where a site still reaches in; whether one did.
    pub(super) fn augment(&mut self, x: &[D3]) -> bool {
        let next: Vec<(Vec<f64>, f64)> = self.spheres.iter().map(|s| s.next(&self.sites, x)).collect();
        let open = self.spheres.iter().zip(&next).any(|(s, n)| n.1 > s.reach());
        if open {
            // Otherwise they stay as they are, in balance with the tissue.
            self.spheres.iter_mut().zip(next).for_each(|(s, n)| s.pressure = n.0);
        }
        open
    }

    pub(super) fn settle(&mut self, x: &[D3]) {
        self.spheres.iter_mut().for_each(|s| s.settle(&self.sites, x));
    }

    /// Whether a sphere has gone through the surface: its centre lies in an element, or the middle of a free face deep in it.
    pub(super) fn through(&self, tets: &[[u32; 4]], x: &[D3]) -> bool {
        let deep = |s: &Sphere, v: &Site| {
            let out = sub(v.at(x), s.centre);
            dot(out, out) < (THROUGH * s.radius).powi(2) && !v.held()
        };
        let middles = |s: &Sphere| self.sites.iter().any(|v| v.reach < 1.0 && deep(s, v));
        self.spheres.iter().any(|s| middles(s) || super::refine::holder(x, tets, s.centre).is_some())
    }

    /// Held vertices inside each sphere, and how deep the deepest is, mm.
    pub(super) fn firm(&self, x: &[D3]) -> Vec<(usize, f64)> {
        let of = |s: &Sphere| {
            let vertices = self.sites.iter().filter(|v| v.reach == 1.0);
            let deep = vertices.filter_map(|v| {
                let out = sub(v.at(x), s.centre);
                let far = norm(out);
                let inside = s.radius - far > REACH * s.radius;
                (inside && v.firm(out.map(|o| o / far.max(f64::MIN_POSITIVE)))).then_some(s.radius - far)
            });
            deep.fold((0, 0.0), |(n, most), d| (n + 1, d.max(most)))
        };
        self.spheres.iter().map(of).collect()
    }

    pub(super) fn centres(&self) -> Vec<D3> {
        self.spheres.iter().map(|s| s.centre).collect()
    }

    /// Force of each sphere on the tissue, mN.
    pub(super) fn forces(&self, x: &[D3]) -> Vec<D3> {
        let mut out = vec![[0.0; 3]; self.spheres.len()];
        for (k, _, site, t) in self.touches(x) {
            out[k] = axpy(out[k], site.area, t.traction(site.penalty));
        }
        out
    }
}
