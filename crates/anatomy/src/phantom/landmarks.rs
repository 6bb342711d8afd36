//! Landmarks of a phantom, from the same shapes as its voxels.

use super::PhantomLandmarks;
use super::head::HeadModel;
use super::shapes::{At, at};
use monro_geometry::{Patient, Point, Vector};

/// Distance from the nasion to Kocher's point along the midline, and from the midline to the side, mm.
const UP: f64 = 110.0;
const SIDEWAYS: f64 = 30.0;

/// All landmarks; `monro` is the left foramen in the head's frame.
pub(super) fn find(model: &HeadModel, monro: At) -> PhantomLandmarks {
    let nasion = nasion(model);
    let midline_110mm = up_the_midline(model, nasion);
    PhantomLandmarks {
        nasion: model.patient(nasion),
        midline_110mm: model.patient(midline_110mm),
        kocher_left: model.patient(sideways(model, midline_110mm, 1.0)),
        kocher_right: model.patient(sideways(model, midline_110mm, -1.0)),
        monro_left: model.patient(monro),
        monro_right: model.patient(at(-monro.x, monro.y, monro.z)),
    }
}

/// The deepest point of the midline profile between glabella and nose: farthest from the line that touches both.
fn nasion(model: &HeadModel) -> At {
    let profile: Vec<At> = (0..=160)
        .filter_map(|i| {
            let z = -85.0 + 0.5 * f64::from(i);
            skin_on(model, at(0.0, -140.0, z), at(0.0, 0.0, z))
        })
        .collect();
    let mut deepest = (0.0, at(0.0, -80.0, -42.0));
    let mut low = 0;
    while low + 1 < profile.len() {
        // Next vertex of the convex hull, seen from the front (-y): the profile turns around it.
        let from = profile[low];
        let slope = |p: &At| (p.y - from.y) / (p.z - from.z);
        let next = (low + 1..profile.len())
            .min_by(|&a, &b| slope(&profile[a]).total_cmp(&slope(&profile[b])))
            .unwrap_or(profile.len() - 1);
        let chord = profile[next] - from;
        for p in &profile[low..next] {
            let gap = (*p - from).cross(chord).norm() / chord.norm();
            if gap > deepest.0 && p.z > -62.0 {
                deepest = (gap, *p);
            }
        }
        low = next;
    }
    deepest.1
}

/// 110 mm up the skin of the midsagittal plane.
fn up_the_midline(model: &HeadModel, nasion: At) -> At {
    let centre = At::ORIGIN;
    let from = nasion.z.atan2(-nasion.y);
    walk(model, nasion, UP, |step| {
        let angle = from + step;
        (centre, Vector::new(0.0, -angle.cos(), angle.sin()))
    })
}

/// 30 mm to a side in the plane that holds the left-right axis and the skin's normal.
fn sideways(model: &HeadModel, middle: At, side: f64) -> At {
    let h = 0.5;
    let skin = |p: At| model.skin_distance(model.patient(p));
    let gradient = |d: Vector<super::Head>| skin(middle + d * h) - skin(middle - d * h);
    let normal = Vector::new(0.0, gradient(Vector::new(0.0, 1.0, 0.0)), gradient(Vector::new(0.0, 0.0, 1.0)));
    let normal = normal / normal.norm();
    let centre = middle - normal * 70.0;
    walk(model, middle, SIDEWAYS, |step| (centre, normal * step.cos() + Vector::new(side, 0.0, 0.0) * step.sin()))
}

/// Walks a length (mm in the patient frame) over the skin; `ray` gives a centre and a direction for an angle.
fn walk(model: &HeadModel, start: At, length: f64, ray: impl Fn(f64) -> (At, Vector<super::Head>)) -> At {
    let mut here = start;
    let mut left = length;
    for i in 1..=1600 {
        let (centre, direction) = ray(f64::from(i) * 0.002);
        let Some(next) = skin_on(model, centre + direction * 160.0, centre) else { continue };
        let step = model.patient(here).distance(model.patient(next));
        if step >= left {
            return here.lerp(next, left / step);
        }
        left -= step;
        here = next;
    }
    here
}

/// The first skin on the way from outside to inside.
fn skin_on(model: &HeadModel, outside: At, inside: At) -> Option<At> {
    let skin = |t: f64| -> f64 {
        let p: Point<Patient> = model.patient(outside.lerp(inside, t));
        model.skin_distance(p)
    };
    let steps = 200;
    let entered = (1..=steps).find(|&i| skin(f64::from(i) / f64::from(steps)) < 0.0)?;
    let (mut out, mut within) = (f64::from(entered - 1) / f64::from(steps), f64::from(entered) / f64::from(steps));
    for _ in 0..40 {
        let middle = 0.5 * (out + within);
        if skin(middle) < 0.0 {
            within = middle;
        } else {
            out = middle;
        }
    }
    Some(outside.lerp(inside, 0.5 * (out + within)))
}
