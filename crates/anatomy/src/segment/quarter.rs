//! Heads that lie turned by a quarter, or by quarters about several axes, in a scan whose header has its axes mixed up.

use super::lattice::Lattice;
use super::midplane::midplane;
use super::model::{Axes, Turned, Vault, fit};
use crate::image::{Mask, Raster};
use monro_geometry::{Patient, Plane, Point, Vector};

/// A direction along an axis of the scan (LPS), and whether against it.
type Along = (usize, bool);

/// How a head lies: where in the scan its left and its back are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Lie {
    left: Along,
    back: Along,
}

impl Lie {
    /// The eight ways in which the head's left lies along this axis of the scan, either way; for the first axis only those four
    /// that are turned by a quarter about it.
    fn beside(axis: usize) -> impl Iterator<Item = Self> {
        let backs = (0..3).filter(move |&b| b != axis && (axis, b) != (0, 1));
        let signs = [(false, false), (false, true), (true, false), (true, true)];
        backs.flat_map(move |b| signs.map(|(l, r)| Self { left: (axis, l), back: (b, r) }))
    }

    /// In words: where face and top of the head point in the scan.
    fn words(self) -> String {
        const ENDS: [[&str; 2]; 3] = [["left", "right"], ["back", "front"], ["top", "bottom"]];
        let up = unit(self.left).cross(unit(self.back)).to_array();
        let top = (0..3).max_by(|&a, &b| up[a].abs().total_cmp(&up[b].abs())).unwrap_or(2);
        let (back, reversed) = self.back;
        let face = ENDS[back][usize::from(!reversed)];
        format!("with its face to the {face} and its top to the {}", ENDS[top][usize::from(up[top] < 0.0)])
    }
}

fn unit((axis, against): Along) -> Vector<Patient> {
    let length = if against { -1.0 } else { 1.0 };
    Vector::from_array(core::array::from_fn(|a| if a == axis { length } else { 0.0 }))
}

/// How the head lies if it does so in one of the twenty ways, and how well the ventricle model then fits. `like` tells fluid,
/// `depth` that below the inner skull, `plane` the midplane of a head that lies as the scan says.
pub(super) fn by_quarters(
    (hu, space): (&Raster<f32>, &Mask),
    (like, depth): (&Raster<f32>, &Raster<f32>),
    lattice: Lattice,
    plane: &Plane<Patient>,
) -> Option<Turned> {
    let beside = |axis: usize| {
        let plane = if axis == 0 { Some(*plane) } else { plane_across(axis, (hu, space), lattice) };
        plane.into_iter().flat_map(move |plane| Lie::beside(axis).map(move |lie| (plane, lie)))
    };
    let vault = Vault::new(depth, lattice);
    let turned = |(plane, lie): (Plane<Patient>, Lie)| {
        let across = plane.normal * plane.normal.dot(unit(lie.left)).signum();
        let axes = Axes::lying(vault, &plane, (across, unit(lie.back)))?;
        Some(Turned { way: lie.words(), score: fit(like, lattice, axes).score })
    };
    (0..3).flat_map(beside).filter_map(turned).max_by(|a, b| a.score.total_cmp(&b.score))
}

/// The plane of symmetry near the one across this axis of the scan.
fn plane_across(axis: usize, (hu, space): (&Raster<f32>, &Mask), lattice: Lattice) -> Option<Plane<Patient>> {
    let swapped = |mut v: [f64; 3]| {
        v.swap(0, axis);
        v
    };
    let lattice = Lattice { origin: swapped(lattice.origin), ..lattice };
    let plane = midplane(&swap(hu, axis), &swap(space, axis), lattice)?;
    let (point, normal) = (swapped(plane.point.to_array()), swapped(plane.normal.to_array()));
    Plane::new(Point::from_array(point), Vector::from_array(normal))
}

/// The raster with its first axis and another one exchanged.
fn swap<T: Copy>(raster: &Raster<T>, axis: usize) -> Raster<T> {
    let mut dims = raster.dims;
    dims.swap(0, axis);
    let mut out = Raster { dims, data: Vec::with_capacity(raster.data.len()) };
    for n in 0..raster.data.len() {
        let mut from = out.voxel(n);
        from.swap(0, axis);
        out.data.push(raster.data[raster.index(from[0], from[1], from[2])]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_ways_to_lie_are_all_different_and_none_is_upright() {
        let all: Vec<Lie> = (0..3).flat_map(Lie::beside).collect();
        assert_eq!(all.len(), 20);
        for (i, lie) in all.iter().enumerate() {
            assert!(!all[..i].contains(lie) && lie.left.0 != lie.back.0, "{lie:?}");
            assert!((lie.left.0, lie.back.0) != (0, 1), "{lie:?}");
        }
    }

    #[test]
    fn where_face_and_top_are_follows_from_left_and_back() {
        // Left along the scan's top, back along its right: up is then along its front.
        let lie = Lie { left: (2, false), back: (0, true) };
        assert_eq!(lie.words(), "with its face to the left and its top to the front");
    }

    #[test]
    fn exchanged_axes_keep_each_value_at_its_place() {
        let raster = Raster { dims: [2, 3, 4], data: (0..24).collect() };
        let swapped = swap(&raster, 2);
        assert_eq!(swapped.dims, [4, 3, 2]);
        assert_eq!(swapped.data[swapped.index(3, 2, 1)], raster.data[raster.index(1, 2, 3)]);
        assert_eq!(swap(&swapped, 2), raster);
    }
}
