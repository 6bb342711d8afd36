//! Where spheres and tissue overlap in the end: contact acts at points of the surface, and what it lets through is no answer.

use super::{Overlap, SphereContact, StaticError, StaticSolution};
use crate::Model;
use crate::membrane::OUTSIDE;
use crate::physical::elastic::Elastic;
use monro_geometry::d3::D3;
use monro_geometry::{Point, nearest_on_triangle};

/// How far the tissue may reach into a sphere, over its radius: more than flat faces do between vertices on the sphere.
const REACH: f64 = 0.1;

/// A sphere in the end.
pub(super) struct Sphere {
    pub(super) centre: D3,
    /// Held vertices inside it, and how deep the deepest is, mm.
    pub(super) firm: (usize, f64),
}

/// Overlaps of a deformed body and the spheres that pressed on it.
pub(super) fn all(
    model: &Model,
    (elastic, x): (&Elastic, &[D3]),
    (contacts, spheres): (&[SphereContact], &[Sphere]),
    held: impl Fn(u32) -> bool,
) -> Vec<Overlap> {
    let outer = model.membranes.faces.iter().filter(|m| m.outer == OUTSIDE).map(|m| m.nodes);
    let free: Vec<[D3; 3]> = outer.filter(|f| !f.iter().any(|&n| held(n))).map(|f| f.map(|n| x[n as usize])).collect();
    let one = |(sphere, (c, s)): (usize, (&SphereContact, &Sphere))| {
        let centre_inside = super::refine::holder(x, &elastic.tets, s.centre).is_some();
        let near = free.iter().map(|f| apart(s.centre, *f)).fold(f64::INFINITY, f64::min);
        let depth_mm = (c.radius_mm - near).max(0.0);
        let passed = centre_inside || depth_mm > REACH * c.radius_mm;
        let found = Overlap { sphere, passed, centre_inside, depth_mm, held: s.firm.0, held_mm: s.firm.1 };
        (passed || found.held > 0).then_some(found)
    };
    contacts.iter().zip(spheres).enumerate().filter_map(one).collect()
}

/// Refuses a sphere that meets only what is held: nothing there can give way to it.
pub(super) fn refuse(solved: &StaticSolution) -> Result<(), StaticError> {
    let only = |o: &&Overlap| o.held > 0 && solved.share >= 1.0 && solved.contacts[o.sphere].norm() == 0.0;
    let refused = |o: &Overlap| StaticError::OnlyHeld { sphere: o.sphere, vertices: o.held, depth_mm: o.held_mm };
    solved.overlaps.iter().find(only).map_or(Ok(()), |o| Err(refused(o)))
}

/// Distance of a point from a triangle, mm.
pub(super) fn apart(p: D3, face: [D3; 3]) -> f64 {
    let p = Point::from_array(p);
    p.distance(nearest_on_triangle(p, face.map(Point::from_array)))
}
