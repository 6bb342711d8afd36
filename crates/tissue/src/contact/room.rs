//! The room that a tool takes up: what it has parted keeps its volume, and has to make way for the tool's.
//!
//! Around a straight cavity of radius `a` in what keeps its volume, what was `r` from the axis is at `sqrt(r2 + a2)`. Elements as
//! large as the cavity cannot follow that close to it: points on the axis would jump aside by `a`. So the volume is spread
//! evenly over a core, which grows by a quarter; beyond it tissue moves as if there were a cavity, within less.

use super::detect::{self, Found, Place};
use super::shaft::{across, spacing};
use super::{Anchor, Scene};
use crate::tool::Rod;
use crate::vec3::{V3, axpy, dot, scale, six_volume_with_gradients, xyz};
use crate::{Material, Model};
use core::f32::consts::{PI, TAU};

/// Radius of the core, in radii of the tool.
const CORE: f32 = 2.0;
/// Points of the core that each held point has: fewer make single elements grow to more than twice their volume.
const POINTS: usize = 16;
/// Steps of a sequence that fills a cube evenly (powers of 1 / 1.2207, the root of x^4 = x + 1; Roberts 2018).
const STEPS: [f32; 3] = [0.819_172_5, 0.671_043_6, 0.549_700_5];

/// A volume that is not tissue, in an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Room {
    pub(crate) place: Place,
    /// Unit vector along the tool.
    axis: V3,
    /// By how much the element would grow for it if nothing around it resisted, mm3.
    pub(crate) mm3: f32,
}

/// Where a piece of shaft makes room: material points around it that are in tissue.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Spread {
    places: [Option<Place>; POINTS],
}

impl Spread {
    /// Around the shaft `arc` mm behind the tip; `turn` is the number of what has been spread around it before.
    pub(super) fn around(scene: Scene<'_>, rod: &Rod, (arc, turn): (f32, usize), found: &mut Found) -> Self {
        let model = scene.model;
        let (u, v) = across(rod.back);
        let mut places = [None; POINTS];
        for (i, place) in places.iter_mut().enumerate() {
            let [area, angle, along] = STEPS.map(|step| (step * (turn * POINTS + i + 1) as f32).fract());
            let (radius, angle) = (CORE * rod.radius * area.sqrt(), TAU * angle);
            let middle = rod.at(arc + (along - 0.5) * spacing(rod));
            let at = axpy(axpy(middle, radius * angle.cos(), u), radius * angle.sin(), v);
            let tissue = |p: &Place| !model.material_of(p.tet).fluid;
            *place = detect::locate(scene, at, found).filter(tissue);
        }
        Self { places }
    }
}

/// Lists the room that what a shaft holds must make for it, where forces mean something.
pub(crate) fn take_up(model: &Model, rod: &Rod, anchors: &[Anchor], rooms: &mut Vec<Room>) {
    for a in anchors {
        // What would be outside of tissue moves none.
        let each = section(rod, a.arc) * a.length / POINTS as f32;
        let places = a.spread.places.iter().flatten();
        rooms.extend(places.map(|&place| Room {
            place,
            axis: rod.back,
            mm3: each * grows(model.material_of(place.tet)),
        }));
    }
}

/// The part of the tool's cross section, mm2, that has parted the tissue so far behind the tip: a tip that comes on does so
/// little by little.
fn section(rod: &Rod, arc: f32) -> f32 {
    let arc = arc.max(0.0);
    PI * rod.radius_at(arc).powi(2) * (arc / spacing(rod)).min(1.0)
}

/// By how much more than what takes up room in it an element must grow across the axis, since what is around it resists: of a
/// long cylinder that grows across itself alone in what is the same a part `1 / (2 (1 - nu))` is left (plane strain; Eshelby 1957,
/// doi 10.1098/rspa.1957.0133).
fn grows(material: &Material) -> f32 {
    (2.0 * (1.0 - material.poisson)) as f32
}

impl Room {
    /// Adds the forces of a growth that is none along the axis, on the corners of the element, mN: pressures alone would push out
    /// what is free there, too, as the surface where a tool comes in. Without shear strain of its own an element that is to
    /// grow by `theta` grows by a third of it along each axis; half of it across and none along the axis are, beside
    /// that, `theta (1 / 6 - n n / 2)`.
    pub(crate) fn add_forces(&self, model: &Model, positions: &[[f32; 4]], mut add_force: impl FnMut(u32, V3)) {
        let nodes = model.tets[self.place.tet as usize];
        // Over six times the volume these are the gradients of the corners' shares, too.
        let (six, gradients) = six_volume_with_gradients(nodes.map(|n| xyz(positions[n as usize])));
        // What is turned over has none.
        if six <= 0.0 {
            return;
        }
        let shear = model.material_of(self.place.tet).shear_kpa() as f32;
        for (n, gradient) in nodes.into_iter().zip(gradients) {
            let along = scale(self.axis, dot(gradient, self.axis));
            add_force(n, scale(axpy(scale(gradient, 1.0 / 6.0), -0.5, along), 2.0 * shear * self.mm3 / six));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::{block, paper_options};
    use crate::vec3::{add, cross, norm};

    #[test]
    fn forces_of_a_room_neither_push_nor_turn_and_stretch_across_the_axis_alone() {
        let model = Model::new(&block([2, 2, 2], 5.0), &paper_options()).expect("model");
        let axis = [0.6, 0.0, 0.8];
        let room = Room { place: Place { tet: 17, weights: [0.25; 4] }, axis, mm3: 3.0 };
        let (mut sum, mut turn, mut virial) = ([0.0; 3], [0.0; 3], [[0.0; 3]; 3]);
        room.add_forces(&model, &model.rest, |n, force| {
            let x = xyz(model.rest[n as usize]);
            (sum, turn) = (add(sum, force), add(turn, cross(x, force)));
            (0..3).for_each(|i| (0..3).for_each(|j| virial[i][j] += force[i] * x[j]));
        });
        assert!(norm(sum) < 1e-5 && norm(turn) < 1e-4, "{sum:?} {turn:?}");
        // Stress over volume: 2 mu times the volume times (1 / 6 - n n / 2).
        let twice = 2.0 * model.material_of(17).shear_kpa() as f32 * 3.0;
        for (i, row) in virial.iter().enumerate() {
            for (j, v) in row.iter().enumerate() {
                let wanted = twice * (if i == j { 1.0 / 6.0 } else { 0.0 } - 0.5 * axis[i] * axis[j]);
                assert!((v - wanted).abs() < 1e-4, "{i} {j}: {v} for {wanted}");
            }
        }
    }
}
