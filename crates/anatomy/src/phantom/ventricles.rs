//! The ventricles: two curved lateral tubes with frontal, occipital and temporal horns, a septum between them, the
//! foramina of Monro, the slit of the third ventricle and the start of the aqueduct.

use super::shapes::{At, Station, Tube, at, capsule, ellipse, ellipsoid, folded, join, without};
use monro_geometry::Structure;

/// What differs between one head's ventricles and another's.
#[derive(Debug, Clone, Copy)]
pub(super) struct VentricleShape {
    /// Factor on the widths of the lateral ventricles, left and right.
    pub(super) width: [f64; 2],
    /// Half the thickness of the septum, mm.
    pub(super) septum_half: f64,
    /// Half the width of the third ventricle, mm.
    pub(super) third_half: f64,
    /// Radius of the foramina of Monro, mm.
    pub(super) foramen_radius: f64,
}

/// The ventricles of one head, in its frame. The left foramen of Monro is near `(3, 0, 1)`.
#[derive(Debug, Clone)]
pub(super) struct Ventricles {
    shape: VentricleShape,
    /// Left and right tubes, both laid out on the positive side.
    main: [Tube; 2],
    temporal: [Tube; 2],
}

/// Signed distances to the three ventricles and to all of them as one.
#[derive(Debug, Clone, Copy)]
pub(super) struct VentricleDistances {
    pub(super) whole: f64,
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) third: f64,
}

impl VentricleDistances {
    /// The ventricle that holds the point, if any.
    pub(super) fn structure(self) -> Option<Structure> {
        if self.whole >= 0.0 {
            return None;
        }
        let (nearest, lateral) = if self.left <= self.right {
            (self.left, Structure::LeftLateralVentricle)
        } else {
            (self.right, Structure::RightLateralVentricle)
        };
        Some(if nearest < self.third { lateral } else { Structure::ThirdVentricle })
    }
}

/// Stations of frontal horn, body, atrium and occipital horn: x, y, z, half width across, half width the other way.
const MAIN: [[f64; 5]; 9] = [
    [10.5, -30.0, 5.0, 2.5, 4.5],
    [8.5, -22.0, 6.5, 5.5, 8.0],
    [7.5, -10.0, 8.5, 6.0, 8.5],
    [8.0, 2.0, 12.0, 6.0, 6.5],
    [11.0, 18.0, 15.5, 7.0, 5.0],
    [17.0, 33.0, 14.0, 7.0, 6.0],
    [24.0, 46.0, 7.0, 7.0, 8.5],
    [25.0, 58.0, 3.0, 4.5, 6.5],
    [23.0, 71.0, 2.0, 2.0, 3.5],
];

/// Stations of the temporal horn, from the atrium forwards.
const TEMPORAL: [[f64; 5]; 5] = [
    [26.0, 45.0, 3.0, 6.0, 7.0],
    [31.5, 37.0, -9.0, 4.5, 4.8],
    [34.5, 23.0, -19.0, 3.4, 3.2],
    [34.0, 7.0, -23.5, 2.8, 2.5],
    [31.5, -3.0, -24.5, 1.9, 1.9],
];

/// Ends of the left foramen's canal: in the floor of the lateral ventricle, and in the roof of the third.
const CANAL: [At; 2] = [at(5.2, -1.0, 5.0), at(0.6, 1.5, -2.6)];

impl Ventricles {
    pub(super) fn new(shape: VentricleShape) -> Self {
        let tube = |stations: &[[f64; 5]], width: f64| {
            let grown = |s: &[f64; 5]| {
                // A wider ventricle grows away from the septum.
                let centre = at(s[0] + (width - 1.0) * s[3] * 0.7, s[1], s[2] + (width - 1.0) * 2.0);
                Station { centre, across: s[3] * width, along: s[4] * (0.5 + 0.5 * width) }
            };
            Tube::new(&stations.iter().map(grown).collect::<Vec<_>>())
        };
        let [left, right] = shape.width;
        Self {
            shape,
            main: [tube(&MAIN, left), tube(&MAIN, right)],
            temporal: [tube(&TEMPORAL, left), tube(&TEMPORAL, right)],
        }
    }

    /// Middle of the left foramen's canal; the right one is its mirror image.
    pub(super) fn left_foramen() -> At {
        CANAL[0].lerp(CANAL[1], 0.5)
    }

    /// Signed distances, mm in the head's frame.
    pub(super) fn distances(&self, p: At) -> VentricleDistances {
        let side = usize::from(p.x < 0.0);
        let q = folded(p);
        // Far outside, the distance to a box is enough.
        let gap = (q.x - 44.0).max((q.y - 20.0).abs() - 60.0).max((q.z + 2.0).abs() - 34.0);
        if gap > 8.0 {
            return VentricleDistances { left: gap, right: gap, third: gap, whole: gap };
        }
        let canal = capsule(q, (CANAL[0], self.shape.foramen_radius), (CANAL[1], self.shape.foramen_radius));
        // The foramen's middle plane parts the canal between the lateral and the third ventricle.
        let middle = (q - Self::left_foramen()).dot(CANAL[0] - CANAL[1]) / CANAL[0].distance(CANAL[1]);
        let (lateral, third) = (self.lateral(q, side), self.third(q));
        let whole = join(join(lateral, canal, 1.0), third, 1.0);
        let parted = 0.5 * (join(lateral, canal.max(-middle), 1.0) - join(third, canal.max(middle), 1.0));
        let near = whole.max(parted);
        // The other side's ventricle cannot be nearer than the midline.
        let far = near.max(q.x + self.shape.septum_half);
        let [left, right] = if side == 0 { [near, far] } else { [far, near] };
        VentricleDistances { left, right, third: whole.max(-parted), whole }
    }

    fn lateral(&self, q: At, side: usize) -> f64 {
        let tube = join(self.main[side].distance(q), self.temporal[side].distance(q), 4.0);
        if tube > 8.0 {
            return tube;
        }
        let hollowed = without(tube, caudate_head(q) - 0.3, 2.0);
        without(hollowed, q.x - self.shape.septum_half, 1.0)
    }

    fn third(&self, q: At) -> f64 {
        let outline = ellipse([q.y - 10.0, q.z + 9.5], [14.0, 10.5]);
        let across = q.x - self.shape.third_half;
        let round = 1.2;
        let (o, a) = (outline + round, across + round);
        let slit = o.max(0.0).hypot(a.max(0.0)) + o.max(a).min(0.0) - round;
        join(slit, capsule(q, (at(0.0, 21.0, -11.5), 1.3), (at(0.0, 28.0, -19.0), 0.9)), 2.0)
    }
}

/// The head of the caudate nucleus, which hollows the outer wall of the frontal horn (folded point).
pub(super) fn caudate_head(q: At) -> f64 {
    ellipsoid(q, at(15.5, -13.0, 2.0), [6.0, 13.0, 8.0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain() -> Ventricles {
        Ventricles::new(VentricleShape { width: [1.0, 1.0], septum_half: 1.0, third_half: 2.7, foramen_radius: 2.5 })
    }

    #[test]
    fn the_horns_are_where_an_atlas_has_them() {
        let v = plain();
        for (p, s) in [
            (at(7.0, -20.0, 7.0), Some(Structure::LeftLateralVentricle)),
            (at(-7.0, -20.0, 7.0), Some(Structure::RightLateralVentricle)),
            (at(24.0, 46.0, 7.0), Some(Structure::LeftLateralVentricle)),
            (at(-34.0, 10.0, -23.0), Some(Structure::RightLateralVentricle)),
            (at(-24.0, 66.0, 2.0), Some(Structure::RightLateralVentricle)),
            (at(0.0, 10.0, -10.0), Some(Structure::ThirdVentricle)),
            (at(0.0, -15.0, 8.0), None),
            (at(15.5, -13.0, 2.0), None),
            (at(40.0, 0.0, 30.0), None),
        ] {
            assert_eq!(v.distances(p).structure(), s, "{p:?}");
        }
    }

    #[test]
    fn a_walk_through_the_foramen_goes_from_the_lateral_to_the_third_ventricle() {
        let v = plain();
        let path: Vec<_> =
            (0..=50).map(|i| v.distances(CANAL[0].lerp(CANAL[1], f64::from(i) / 50.0)).structure()).collect();
        assert!(path.iter().all(Option::is_some), "the canal is open: {path:?}");
        assert_eq!(path[0], Some(Structure::LeftLateralVentricle));
        assert_eq!(path[50], Some(Structure::ThirdVentricle));
    }
}
