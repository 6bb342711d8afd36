//! The outside of the head: scalp, face with brow and nose, ears, neck; and the eyes.

use super::shapes::{At, at, capsule, ellipse, ellipsoid, folded, join, without};

/// What differs between one head's soft tissue and another's.
#[derive(Debug, Clone, Copy)]
pub(super) struct SkinShape {
    /// Thickness of the scalp over the vertex, mm.
    pub(super) scalp: f64,
    /// How far the bridge of the nose stands out, as a factor.
    pub(super) nose: f64,
}

impl SkinShape {
    /// Distance to the skin; `skull` is the distance to the skull's outer face at `p`.
    pub(super) fn distance(&self, p: At, skull: f64) -> f64 {
        let q = folded(p);
        let vault = skull - self.scalp - temporalis(q);
        if q.z > 20.0 {
            return vault;
        }
        let neck = ellipse([q.x, q.y - 26.0], [55.0, 62.0]).max(q.z + 45.0);
        let head = join(vault, neck, 30.0);
        if q.y > 60.0 {
            return head;
        }
        let ear = ellipsoid(q, at(69.0 + 0.4 * (q.y - 21.0), 21.0, -42.0), [5.0, 13.0, 25.0]);
        join(join(head, self.face(q), 10.0), ear, 4.0)
    }

    fn face(&self, q: At) -> f64 {
        let n = self.nose;
        // The jaw is narrower than the cheekbones.
        let taper = 1.0 + 0.22 * ((-62.0 - q.z) / 45.0).clamp(0.0, 1.2);
        let face = ellipsoid(at(q.x * taper, q.y, q.z), at(0.0, -34.0, -76.0), [61.0, 52.0, 66.0]);
        let cheek = ellipsoid(q, at(34.0, -60.0, -70.0), [20.0, 18.0, 15.0]);
        let brow = ellipsoid(q, at(0.0, -60.0, -21.0), [43.0, 25.5, 22.0]);
        let socket = ellipsoid(q, at(33.0, -92.0, -46.0), [15.0, 18.0, 10.0]);
        let lids = ellipsoid(q, at(31.0, -61.5, -47.0), [14.5, 15.0, 12.5]);
        let bridge = capsule(q, (at(0.0, -77.0, -53.0), 6.5), (at(0.0, -86.0 - 11.0 * n, -77.0), 8.0));
        let wing = ellipsoid(q, at(9.0, -84.0 - 5.0 * n, -80.0), [8.0, 12.0, 7.5]);
        let mouth = ellipsoid(q, at(0.0, -70.0, -101.0), [24.0, 21.0, 11.0]);
        let front = join(without(join(join(face, cheek, 10.0), brow, 8.0), socket, 8.0), lids, 3.0);
        join(join(front, mouth, 8.0), join(bridge, wing, 4.0), 7.0)
    }
}

/// The temporal muscle thickens the soft tissue at the temples (folded point).
fn temporalis(q: At) -> f64 {
    let (y, z) = ((q.y + 18.0) / 42.0, (q.z + 8.0) / 36.0);
    let bump = (1.0 - y * y - z * z).max(0.0);
    6.0 * bump * ((q.x - 35.0) / 20.0).clamp(0.0, 1.0)
}

/// Thickness of the fat under the skin, mm (folded point): thin on the vault, thick on cheek and neck.
pub(super) fn fat_thickness(q: At) -> f64 {
    2.4 + 3.2 * ((-q.z - 25.0) / 40.0).clamp(0.0, 1.0)
}

/// Parts of an eye (folded point): ball, lens, optic nerve and muscles.
pub(super) fn eye(q: At) -> [f64; 3] {
    let ball = q.distance(at(31.0, -60.0, -47.0)) - 12.0;
    let lens = ellipsoid(q, at(31.0, -69.5, -47.0), [4.5, 2.0, 4.5]);
    let nerve = capsule(q, (at(30.0, -50.0, -47.0), 2.0), (at(13.0, -28.0, -37.0), 2.0));
    let lateral = capsule(q, (at(43.0, -60.0, -47.0), 1.8), (at(16.0, -31.0, -38.0), 1.5));
    let medial = capsule(q, (at(19.5, -58.0, -47.0), 1.8), (at(12.0, -32.0, -38.0), 1.5));
    [ball, lens, nerve.min(lateral).min(medial)]
}

/// Shell of the scanner's head rest behind the head (folded point).
pub(super) fn head_rest(q: At) -> f64 {
    let outer = ellipse([q.x, q.y - 24.0], [102.0, 100.0]);
    outer.max(-outer - 4.0).max(48.0 - q.y)
}
