//! The foramina of Monro: where a lateral ventricle opens into the third.

use super::surroundings::Surroundings;
use monro_geometry::{Patient, Point, Structure};

/// Search box around the model's foramina, mm.
const REACH: i32 = 14;
/// Lateral and third ventricle touch when closer than this, mm.
const TOUCH: i32 = 2;
/// Fewest touching samples (1 mm) that make a foramen.
const LEAST: usize = 4;
/// A foramen lies this far from the septum, or beside the third ventricle's wall where that is wider, mm.
const OFF: f64 = 3.0;
const BESIDE_WALL: f64 = 1.5;
/// A midline shift is told from here on, mm.
const SHIFT: f64 = 5.0;
/// Fewest samples at which left and right must touch to show the septum.
const LEAST_SEPTUM: usize = 10;

/// Left and right foramen.
pub(crate) fn find(surroundings: &Surroundings<'_>, findings: &mut Vec<String>) -> [Point<Patient>; 2] {
    let sides = [(1.0, Structure::LeftLateralVentricle, "left"), (-1.0, Structure::RightLateralVentricle, "right")];
    let aside = septum(surroundings);
    if aside.abs() > SHIFT {
        findings.push(format!(
            "midline shift: the septum between the ventricles stands {:.0} mm to the {} of the head's own plane of symmetry",
            aside.abs(),
            if aside > 0.0 { "left" } else { "right" }
        ));
    }
    let shift = surroundings.midsagittal.normal * aside;
    let off = OFF.max(third_width(surroundings) / 2.0 + BESIDE_WALL);
    sides.map(|(side, structure, name)| {
        let expected = surroundings.pose.place([0.0; 3]) + shift + surroundings.midsagittal.normal * (side * off);
        if let Some(found) = contact(surroundings, structure, expected) {
            // The flood meets somewhere in the foramen, the model knows only the usual place: the middle of both.
            return found.lerp(expected, 0.5);
        }
        findings.push(format!("{name} foramen of Monro: no opening into the third ventricle is labelled; estimated"));
        nearest(surroundings, structure, expected)
    })
}

/// Median width of the third ventricle behind and below the foramina, mm.
fn third_width(surroundings: &Surroundings<'_>) -> f64 {
    const FINE: f64 = 0.5;
    let left = surroundings.midsagittal.normal;
    let lines = (2..12).step_by(2).flat_map(|back| (-9..-2).step_by(2).map(move |up| (f64::from(back), f64::from(up))));
    let mut widths: Vec<f64> = lines
        .map(|(back, up)| surroundings.pose.place([0.0, back, up]))
        .map(|p| {
            let third =
                |n: &i32| surroundings.structure(p + left * (f64::from(*n) * FINE)) == Structure::ThirdVentricle;
            (-24..=24).filter(third).count() as f64 * FINE
        })
        .filter(|w| *w > 0.0)
        .collect();
    if widths.is_empty() {
        return 0.0;
    }
    let middle = widths.len() / 2;
    *widths.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// How far to the left of the model's midline the septum stands, mm: where the lateral ventricles touch each other near the
/// foramina. A midline shift moves it; 0 where they do not touch.
fn septum(surroundings: &Surroundings<'_>) -> f64 {
    let centre = surroundings.pose.place([0.0; 3]);
    let left = surroundings.midsagittal.normal;
    let is = |p: Point<Patient>, s: Structure| surroundings.structure(p) == s;
    let mut offsets: Vec<f64> = ball(REACH)
        .map(|d| shifted(centre, d))
        .filter(|p| is(*p + left, Structure::LeftLateralVentricle) && is(*p - left, Structure::RightLateralVentricle))
        .map(|p| (p - centre).dot(left))
        .collect();
    if offsets.len() < LEAST_SEPTUM {
        return 0.0;
    }
    let middle = offsets.len() / 2;
    *offsets.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Middle of the samples of a lateral ventricle that touch the third, those near the expected place counting most.
fn contact(surroundings: &Surroundings<'_>, structure: Structure, expected: Point<Patient>) -> Option<Point<Patient>> {
    let touches =
        |p: Point<Patient>| ball(TOUCH).any(|d| surroundings.structure(shifted(p, d)) == Structure::ThirdVentricle);
    let points: Vec<Point<Patient>> = ball(REACH)
        .map(|d| shifted(expected, d))
        .filter(|p| surroundings.structure(*p) == structure && touches(*p))
        .collect();
    (points.len() >= LEAST).then(|| mean(&points, |p| 1.0 / (9.0 + (p - expected).norm_squared())))
}

/// Middle of the samples of a lateral ventricle that are nearest to the expected place; that place if there are none.
fn nearest(surroundings: &Surroundings<'_>, structure: Structure, expected: Point<Patient>) -> Point<Patient> {
    let mut points: Vec<Point<Patient>> =
        ball(REACH).map(|d| shifted(expected, d)).filter(|p| surroundings.structure(*p) == structure).collect();
    points.sort_by(|a, b| a.distance(expected).total_cmp(&b.distance(expected)));
    points.truncate(20);
    if points.is_empty() { expected } else { mean(&points, |_| 1.0) }
}

fn mean(points: &[Point<Patient>], weight: impl Fn(Point<Patient>) -> f64) -> Point<Patient> {
    let total: f64 = points.iter().map(|p| weight(*p)).sum();
    let sum = points.iter().fold([0.0; 3], |s, p| {
        let (w, p) = (weight(*p), p.to_array());
        core::array::from_fn(|a| s[a] + w * p[a])
    });
    Point::from_array(sum.map(|v| v / total))
}

fn shifted(p: Point<Patient>, d: [i32; 3]) -> Point<Patient> {
    Point::new(p.x + f64::from(d[0]), p.y + f64::from(d[1]), p.z + f64::from(d[2]))
}

/// Whole offsets within a ball.
fn ball(radius: i32) -> impl Iterator<Item = [i32; 3]> {
    let side = move || -radius..=radius;
    side()
        .flat_map(move |z| side().map(move |y| (y, z)))
        .flat_map(move |(y, z)| side().map(move |x| [x, y, z]))
        .filter(move |[x, y, z]| x * x + y * y + z * z <= radius * radius)
}
