//! Moving single points: inside freely, on a surface along it, on a line where three labels meet along that.

use super::super::quality::quality_beside;
use super::mask::Mask;
use super::work::Work;
use monro_geometry::d3::{D3, add, cross, distance, dot, norm, scale, sub};

/// Moves uphill at most, elements that are looked at together, and how much better than the worst they may be.
const ASCENTS: usize = 5;
const ACTIVE: usize = 10;
const SAME: f64 = 0.04;
/// Lengths of the moves, in edges.
const STEPS: [f64; 3] = [0.2, 0.08, 0.03];
/// A slope of less than this for an edge's length leads nowhere.
const FLAT: f64 = 0.02;
/// Steps in the search for the shortest vector in a hull at most, and the part of its square that it may be off by. One
/// hull in twenty wants more steps; meshes whose directions are all that exact are not better, nor quicker made.
const HULL_STEPS: usize = 8;
const HULL_GAP: f64 = 1e-2;
/// Steps along the axes, in edges.
const AXIAL: [f64; 4] = [0.3, 0.12, 0.05, 0.02];

/// What a point may do.
pub(super) enum Freedom {
    Free,
    /// On the surface between a label and another or the outside.
    Surface(Pair),
    /// On the line where two surfaces meet.
    Line(Pair, Pair),
    Fixed,
}

impl Freedom {
    /// Of a point, or of an edge, where these labels meet.
    pub(super) fn of(mask: Mask) -> Self {
        match (mask.labels().count(), mask.is_outside(), mask.lowest()) {
            (1, false, _) => Self::Free,
            (1, true, [Some(a), ..]) => Self::Surface((a, None)),
            (2, false, [Some(a), b, _]) => Self::Surface((a, b)),
            (2, true, [Some(a), b, _]) => Self::Line((a, None), (a, b)),
            (3, false, [Some(a), b, c]) => Self::Line((a, b), (a, c)),
            _ => Self::Fixed,
        }
    }
}

/// Directions in which a point may go: all, across a normal, or along a line.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Along {
    All,
    Plane(D3),
    Line(D3),
}

impl Along {
    /// The part of a vector in these directions.
    fn part(self, g: D3) -> D3 {
        match self {
            Self::All => g,
            Self::Plane(n) => sub(g, scale(n, dot(g, n))),
            Self::Line(n) => scale(n, dot(g, n)),
        }
    }
}

/// A label and what lies behind its surface (`None`: the outside).
pub(super) type Pair = (u8, Option<u8>);

impl Work<'_> {
    pub(super) fn freedom(&self, v: u32) -> Freedom {
        Freedom::of(self.masks[v as usize])
    }

    /// The nearest point of a surface by Newton steps; `None` where the field is flat or the surface further off than
    /// `reach`.
    pub(super) fn project(&self, pair: Pair, mut p: D3, reach: f64) -> Option<D3> {
        let start = p;
        for _ in 0..4 {
            let (value, g) = self.fields.between(pair.0, pair.1, p);
            if value.abs() < 2e-3 {
                return Some(p);
            }
            let g2 = dot(g, g);
            if g2 < 1e-6 {
                return None;
            }
            // A step may not exceed a cell: the field is steep only near its surface.
            let step = (-value / g2).clamp(-self.fields.step / g2.sqrt(), self.fields.step / g2.sqrt());
            p = add(p, scale(g, step));
            if distance(p, start) > reach {
                return None;
            }
        }
        (self.fields.between(pair.0, pair.1, p).0.abs() < 2e-2).then_some(p)
    }

    /// The nearest place to `p` where the point `v` may be: on its surface, lifted off it as far as its label's volume
    /// asks, or within the work's tolerance of that.
    pub(super) fn constrain(&self, v: u32, freedom: &Freedom, p: D3, edge: f64) -> Option<D3> {
        if matches!(freedom, Freedom::Free) {
            return Some(p);
        }
        let loose = self.loose * edge;
        let place = self.own_place(v, freedom, p, 0.5 * edge);
        // Where the field does not tell the place, as it does not where surfaces were mended, the point's own serves.
        let place = place.or((loose > 0.0).then_some(self.points[v as usize]))?;
        let off = sub(p, place);
        let length = norm(off);
        Some(if length <= loose { p } else { add(place, scale(off, loose / length)) })
    }

    /// The nearest place to `p`, and within `reach` of it, of the surface or line that the point `v` is on.
    pub(super) fn own_place(&self, v: u32, freedom: &Freedom, p: D3, reach: f64) -> Option<D3> {
        match *freedom {
            Freedom::Free | Freedom::Fixed => None,
            Freedom::Surface(pair) => self.project(pair, p, reach).map(|q| self.lifted(v, pair, q)),
            Freedom::Line(one, two) => self.on_line(one, two, p, reach),
        }
    }

    fn lifted(&self, v: u32, pair: Pair, p: D3) -> D3 {
        let lift = self.lift[v as usize];
        if lift == 0.0 {
            return p;
        }
        add(p, scale(unit(self.fields.between(pair.0, pair.1, p).1), lift))
    }

    /// The nearest point of the line where two surfaces meet, by Newton steps of the least length.
    fn on_line(&self, one: Pair, two: Pair, start: D3, reach: f64) -> Option<D3> {
        let mut p = start;
        for _ in 0..8 {
            let ((f, u), (g, w)) = (self.fields.between(one.0, one.1, p), self.fields.between(two.0, two.1, p));
            if f.abs().max(g.abs()) < 5e-3 {
                return Some(p);
            }
            let (uu, ww, uw) = (dot(u, u), dot(w, w), dot(u, w));
            let det = uu * ww - uw * uw;
            // Surfaces that hardly cross have no line to speak of.
            if det < 1e-2 * uu * ww || det < 1e-12 {
                return None;
            }
            let step = add(scale(u, (uw * g - ww * f) / det), scale(w, (uw * f - uu * g) / det));
            let length = norm(step);
            p = add(p, scale(step, (self.fields.step / length).min(1.0)));
            if distance(p, start) > reach {
                return None;
            }
        }
        None
    }

    /// Moves a point to where its worst element is better: to the middle of its star, then uphill.
    pub(super) fn relax(&mut self, v: u32) -> bool {
        let freedom = self.freedom(v);
        if matches!(freedom, Freedom::Fixed) && self.loose == 0.0 {
            return false;
        }
        let mut best = self.worst_first(v);
        let start = best;
        let (middle, edge) = self.middle(v);
        if self.try_place(v, &freedom, middle, edge, &mut best) {
            self.try_place(v, &freedom, self.middle(v).0, edge, &mut best);
        }
        self.climb(v, &freedom, edge, &mut best);
        if self.loose > 0.0 && best <= start {
            self.try_axes(v, &freedom, edge, &mut best);
        }
        best > start
    }

    /// Moves uphill: where the point may leave its surface, along it first.
    fn climb(&mut self, v: u32, freedom: &Freedom, edge: f64, best: &mut f64) {
        let (mut first, mut along) = (0, self.along(v, freedom));
        for _ in 0..ASCENTS {
            let uphill = self.uphill(v, along, *best, edge);
            let from = self.points[v as usize];
            let step = |i: usize, d: D3| add(from, scale(d, STEPS[i] * edge));
            let gone =
                uphill.and_then(|d| (first..STEPS.len()).find(|&i| self.try_place(v, freedom, step(i, d), edge, best)));
            match gone {
                Some(i) => first = i,
                None if along != Along::All && self.loose > 0.0 => (along, first) = (Along::All, 0),
                None => break,
            }
        }
    }

    fn along(&self, v: u32, freedom: &Freedom) -> Along {
        let normal = |pair: &Pair| unit(self.fields.between(pair.0, pair.1, self.points[v as usize]).1);
        match freedom {
            Freedom::Free | Freedom::Fixed => Along::All,
            Freedom::Surface(pair) => Along::Plane(normal(pair)),
            Freedom::Line(one, two) => Along::Line(unit(cross(normal(one), normal(two)))),
        }
    }

    /// Tries steps along the axes, for the last resorts: the worst elements may want opposite things.
    fn try_axes(&mut self, v: u32, freedom: &Freedom, edge: f64, best: &mut f64) {
        for step in AXIAL {
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    let mut target = self.points[v as usize];
                    target[axis] += side * step * edge;
                    self.try_place(v, freedom, target, edge, best);
                }
            }
        }
    }

    /// The direction in which the worst elements around a point get better together: the shortest vector in the hull of
    /// their slopes. `None` where there is none to speak of.
    fn uphill(&self, v: u32, along: Along, worst: f64, edge: f64) -> Option<D3> {
        let mut slopes = [[0.0; 3]; ACTIVE];
        let mut count = 0;
        for &t in &self.stars[v as usize] {
            if count < ACTIVE && self.quality[t as usize] < worst + SAME {
                slopes[count] = along.part(self.slope(t, v, edge));
                count += 1;
            }
        }
        let d = shortest_in_hull(&slopes[..count], HULL_STEPS);
        let length = norm(d);
        (length * edge > FLAT).then(|| scale(d, 1.0 / length))
    }

    /// Change of an element's quality with the place of one of its points, per mm.
    fn slope(&self, t: u32, v: u32, edge: f64) -> D3 {
        let tet = self.tets[t as usize];
        let corners = self.corners(tet);
        let k = tet.iter().position(|&x| x == v).unwrap_or(0);
        let h = 1e-4 * edge;
        quality_beside(corners, k, h).map(|q| (q - self.quality[t as usize]) / h)
    }

    /// Volume-weighted mean of the star's centroids (half a step of optimal Delaunay smoothing), and a mean edge.
    pub(super) fn middle(&self, v: u32) -> (D3, f64) {
        let (mut sum, mut weight, mut edge) = ([0.0; 3], 0.0, 0.0);
        let p = self.points[v as usize];
        let star = &self.stars[v as usize];
        for &t in star {
            let c = self.corners(self.tets[t as usize]);
            let w = monro_geometry::d3::volume6(c).max(0.0);
            let centroid = scale(add(add(c[0], c[1]), add(c[2], c[3])), 0.25);
            sum = add(sum, scale(centroid, w));
            weight += w;
            edge += c.iter().map(|&q| distance(p, q)).sum::<f64>() / 3.0;
        }
        let middle = if weight > 0.0 { scale(sum, 1.0 / weight) } else { p };
        // The mean of centroids has a quarter of the point itself in it: 4/3 undoes that.
        (add(p, scale(sub(middle, p), 4.0 / 3.0)), edge / star.len().max(1) as f64)
    }

    fn try_place(&mut self, v: u32, freedom: &Freedom, target: D3, edge: f64, best: &mut f64) -> bool {
        let Some(target) = self.constrain(v, freedom, target, edge) else { return false };
        if !self.try_move(v, target, *best + 1e-6) {
            return false;
        }
        *best = self.worst_first(v);
        true
    }

    /// The worst quality around a point, whose element is put first in the point's star: a move that does not help is then
    /// mostly refused after one look.
    fn worst_first(&mut self, v: u32) -> f64 {
        let star = &mut self.stars[v as usize];
        let mut worst = (f64::INFINITY, 0);
        for (i, &t) in star.iter().enumerate() {
            if self.quality[t as usize] < worst.0 {
                worst = (self.quality[t as usize], i);
            }
        }
        if worst.1 > 0 {
            star.swap(0, worst.1);
        }
        worst.0
    }

    /// Whether a surface edge `new` lies about as close to its surface as `old`: the sag of its middle may be as large
    /// as that of the old one, or a twentieth of its length.
    pub(super) fn edge_fits(&self, new: [u32; 2], old: [u32; 2], pair: Pair) -> bool {
        let ends = |e: [u32; 2]| e.map(|v| self.points[v as usize]);
        let sag = |e: [u32; 2]| {
            let [a, b] = ends(e);
            self.sag(pair, scale(add(a, b), 0.5), 0.5 * distance(a, b))
        };
        let [a, b] = ends(new);
        let allowed = 0.05 * distance(a, b);
        let found = sag(new);
        found <= allowed || found <= sag(old)
    }

    /// Distance of a point to a surface, infinite beyond `reach`.
    pub(super) fn sag(&self, pair: Pair, p: D3, reach: f64) -> f64 {
        self.project(pair, p, reach).map_or(f64::INFINITY, |q| distance(p, q))
    }
}

/// About the point nearest to the origin in the hull of some vectors, by `steps` of Gilbert's at most.
fn shortest_in_hull(all: &[D3], steps: usize) -> D3 {
    let Some(&first) = all.first() else { return [0.0; 3] };
    let mut x = first;
    for _ in 0..steps {
        let Some(&s) = all.iter().min_by(|a, b| dot(**a, x).total_cmp(&dot(**b, x))) else { break };
        let towards = sub(s, x);
        let gap = -dot(towards, x);
        if gap <= HULL_GAP * dot(x, x) {
            break;
        }
        x = add(x, scale(towards, (gap / dot(towards, towards)).min(1.0)));
    }
    x
}

fn unit(a: D3) -> D3 {
    let n = norm(a);
    if n > 0.0 { scale(a, 1.0 / n) } else { [1.0, 0.0, 0.0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_shortest_vector_in_a_hull_makes_acute_angles_with_all(
            all in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 1..6),
            shift in 1.1..3.0f64,
        ) {
            // All on one side of a plane, so that the hull does not hold the origin.
            let all: Vec<D3> = all.into_iter().map(|[x, y, z]| [x + shift, y, z]).collect();
            // Gilbert's gap after k steps is 4 D^2 / k at most, D^2 < 12 the square of the hull's diameter: these steps are
            // enough for the allowed part of the least square there is, 0.1^2.
            let x = shortest_in_hull(&all, 500_000);
            prop_assert!(all.iter().all(|&s| dot(s, x) > 0.0), "{x:?} {all:?}");
            // It stops where no vector is shorter along it by more than the gap.
            let least = (1.0 - HULL_GAP) * (1.0 - HULL_GAP) * dot(x, x);
            prop_assert!(all.iter().all(|&s| least <= dot(s, s)), "{x:?} {all:?}");
            // Where the steps run out before, more of them never made it longer.
            let few = shortest_in_hull(&all, HULL_STEPS);
            prop_assert!(dot(x, x) <= dot(few, few) && dot(few, few) <= dot(all[0], all[0]), "{few:?} {all:?}");
        }
    }
}
