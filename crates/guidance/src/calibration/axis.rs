//! Axis calibration: the direction of a straight shaft in its tool's frame.

use crate::linear::{mat3, vec3};
use crate::serial::independent;
use monro_geometry::{Point, Rigid, Tool, Tracker, Vector};
use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

/// Why an axis calibration was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum AxisError {
    /// Too few poses.
    #[error("{found} valid poses; turn the tool about its shaft until there are at least {needed}")]
    TooFew {
        /// Poses given.
        found: usize,
        /// Poses needed.
        needed: usize,
    },
    /// The tool was hardly turned.
    #[error(
        "the tool's turns about its shaft spread by {found:.0} degrees (root mean square), at least {needed:.0} are \
         needed: turn it evenly by 70 degrees or more"
    )]
    TooLittleMotion {
        /// Root mean square turn about the mean, degrees.
        found: f64,
        /// Needed, degrees.
        needed: f64,
    },
    /// The shaft itself moved.
    #[error(
        "the shaft wobbled by {found:.1} degrees while it was turned, {allowed:.1} are allowed: hold it in a guide"
    )]
    Wobble {
        /// Root mean square wobble, degrees.
        found: f64,
        /// Allowed, degrees.
        allowed: f64,
    },
    /// The tip is not on the line that the tool was turned about.
    #[error(
        "the tip lies {found:.0} mm beside the line about which the tool was turned, {allowed:.0} mm are allowed: is it this \
         tool's tip, and was the tool turned about its own shaft?"
    )]
    BesideShaft {
        /// Distance from the line, mm.
        found: f64,
        /// Allowed, mm.
        allowed: f64,
    },
    /// Nothing tells which end of the shaft the tip is.
    #[error(
        "the tip lies {found:.1} mm from the origin of the tool's frame along the shaft, at least {needed:.0} mm are needed \
         to tell which way the shaft points: give a point of it at the hub (--hub, or \"hub_mm\"), or put the origin of the \
         tool there in the tracker's software"
    )]
    NoSense {
        /// Distance along the shaft, mm.
        found: f64,
        /// Needed, mm.
        needed: f64,
    },
    /// Tip and hub coincide.
    #[error("tip and hub are {0:.1} mm apart; two points at least 20 mm apart are needed for a direction")]
    TooClose(f64),
}

/// A calibrated axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisCalibration {
    /// Unit vector from the hub towards the tip, in the tool's frame.
    pub axis: Vector<Tool>,
    /// Root mean square angle between the axis in single poses and its mean, rad.
    pub wobble: f64,
    /// Standard deviation of the axis, rad.
    pub sigma: f64,
}

const POSES: usize = 30;
const LEAST_TURN_DEGREES: f64 = 20.0;
const MOST_WOBBLE_DEGREES: f64 = 3.0;
/// From the hub to the tip, along the axis, mm: ten times what tips are uncertain by at most, and more than a tilt of the axis
/// makes of markers 100 mm beside the shaft.
const LEAST_ALONG_MM: f64 = 10.0;

/// Of the tip from the line about which the tool was turned, mm: bent shafts and what a guide gives way by are less.
const MOST_BESIDE_MM: f64 = 8.0;
/// A line is one that its points stray from by no more than this (root mean square), mm: a tool that was carried about while
/// it was turned has none.
const MOST_STRAY_MM: f64 = 2.0;

/// Distance of a point of the tool from the line that is at rest while the tool turns about `axis` (and slides along it), mm;
/// `None` where there is none. A point `p` of the line is where `R p + t` across the axis in the tracker's frame stays what it is:
/// least squares of its two coordinates across the axis.
fn distance_from_line(poses: &[Rigid<Tracker, Tool>], axis: &Vector3<f64>, point: &Vector3<f64>) -> Option<f64> {
    let n = poses.len() as f64;
    let parts = || poses.iter().map(|m| (mat3(&m.rotation()), vec3(m.translation().to_array())));
    let (turn, place) = parts().fold((Matrix3::zeros(), Vector3::zeros()), |s, m| (s.0 + m.0 / n, s.1 + m.1 / n));
    let outer = (turn * axis).normalize();
    let across = Matrix3::identity() - outer * outer.transpose();
    let (mut normal, mut right) = (axis * axis.transpose(), Vector3::zeros());
    for (r, t) in parts() {
        let (a, b) = (across * (r - turn), across * (t - place));
        normal += a.transpose() * a / n;
        right -= a.transpose() * b / n;
    }
    let line = normal.try_inverse()? * right;
    let stray = parts().map(|(r, t)| (across * ((r - turn) * line + t - place)).norm_squared()).sum::<f64>() / n;
    let off = point - line;
    (stray.sqrt() <= MOST_STRAY_MM).then(|| (off - axis * axis.dot(&off)).norm())
}

/// How each pose points the shaft elsewhere than all do on average.
fn strays(poses: &[Rigid<Tracker, Tool>], mean: &Matrix3<f64>, axis: &Vector3<f64>) -> Vec<Vector3<f64>> {
    poses.iter().map(|m| (mat3(&m.rotation()) - mean) * axis).collect()
}

/// The axis of a shaft that was turned about itself in a fixed guide: the direction that the mean rotation shrinks least.
/// `tip` (of the pivot calibration) and a point nearer to the hub tell which of its two senses leads to the tip; the origin
/// of the tool's frame serves where the tracker's software puts it among the markers.
///
/// # Errors
/// When the poses are too few, turn too little, the shaft moved, or the two points do not tell its sense.
pub fn calibrate_axis(
    tracker_from_tool: &[Rigid<Tracker, Tool>],
    (hub, tip): (Point<Tool>, Point<Tool>),
) -> Result<AxisCalibration, AxisError> {
    let n = tracker_from_tool.len();
    if n < POSES {
        return Err(AxisError::TooFew { found: n, needed: POSES });
    }
    let mean = tracker_from_tool.iter().map(|m| mat3(&m.rotation())).sum::<Matrix3<f64>>() / n as f64;
    let eigen = (mean.transpose() * mean).symmetric_eigen();
    let order = eigen.eigenvalues.imax();
    let shrink = |k: usize| (1.0 - eigen.eigenvalues[k]).clamp(0.0, 1.0).sqrt().asin();
    let turn = (0..3).filter(|&k| k != order).map(shrink).fold(f64::INFINITY, f64::min);
    let wobble = shrink(order);
    if turn.to_degrees() < LEAST_TURN_DEGREES {
        return Err(AxisError::TooLittleMotion { found: turn.to_degrees(), needed: LEAST_TURN_DEGREES });
    }
    if wobble.to_degrees() > MOST_WOBBLE_DEGREES {
        return Err(AxisError::Wobble { found: wobble.to_degrees(), allowed: MOST_WOBBLE_DEGREES });
    }
    let axis = eigen.eigenvectors.column(order).into_owned();
    let beside = distance_from_line(tracker_from_tool, &axis, &vec3(tip.to_array()));
    if let Some(found) = beside.filter(|d| *d > MOST_BESIDE_MM) {
        return Err(AxisError::BesideShaft { found, allowed: MOST_BESIDE_MM });
    }
    let along = axis.dot(&vec3((tip - hub).to_array()));
    if along.is_nan() || along.abs() < LEAST_ALONG_MM {
        return Err(AxisError::NoSense { found: along.abs(), needed: LEAST_ALONG_MM });
    }
    let sigma = wobble / independent(&strays(tracker_from_tool, &mean, &axis)).sqrt() / turn.sin();
    Ok(AxisCalibration { axis: Vector::from_array((axis * along.signum()).into()), wobble, sigma })
}

/// The axis through two calibrated points of the shaft.
///
/// # Errors
/// When they are less than 20 mm apart.
pub fn axis_through(hub: Point<Tool>, tip: Point<Tool>) -> Result<Vector<Tool>, AxisError> {
    let length = hub.distance(tip);
    if length < 20.0 {
        return Err(AxisError::TooClose(length));
    }
    (tip - hub).normalized().ok_or(AxisError::TooClose(length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::serial::tests::Lasting;

    const TIP: Point<Tool> = Point::new(5.0, 0.0, -100.0);
    const ENDS: (Point<Tool>, Point<Tool>) = (Point::ORIGIN, TIP);

    /// Turned about `axis` by up to `turn` rad, with `noise` rad of random rotation on top.
    fn turned(axis: Vector<Tool>, turn: f64, noise: f64, seed: u64) -> Vec<Rigid<Tracker, Tool>> {
        let mut random = Random::new(seed);
        let tilt =
            Rigid::<Tracker, Tool>::from_axis_angle(Vector::new(0.2, 1.0, 0.4), 0.8, Vector::ZERO).expect("axis");
        (0..200)
            .map(|_| {
                let own = Rigid::<Tool, Tool>::from_axis_angle(axis, random.between(0.0, turn), Vector::ZERO);
                let d = Vector::from_array(random.direction());
                let shake = Rigid::<Tool, Tool>::from_axis_angle(d, noise * random.normal(), Vector::ZERO);
                tilt.after(&own.expect("axis").after(&shake.expect("axis")))
            })
            .collect()
    }

    #[test]
    fn the_axis_is_found_and_points_to_the_tip() {
        let true_axis = Vector::new(0.05, 0.0, -1.0);
        let exact = calibrate_axis(&turned(true_axis, 5.0, 0.0, 1), ENDS).expect("axis");
        assert!(exact.axis.angle(true_axis) < 1e-7);
        let noisy = calibrate_axis(&turned(true_axis, 5.0, 0.01, 2), ENDS).expect("axis");
        assert!(noisy.axis.angle(true_axis) < 4.0 * 0.01 / 200f64.sqrt(), "{}", noisy.axis.angle(true_axis));
        assert!((0.004..0.012).contains(&noisy.wobble) && noisy.sigma < 0.001);
    }

    #[test]
    fn a_tool_whose_origin_is_its_tip_had_an_axis_that_noise_turned_round() {
        for (axis, seed) in [([0.0, 0.0, -1.0], 5), ([0.0, 0.0, 1.0], 6), ([1.0, 0.0, 0.0], 7)] {
            let (axis, poses) = (Vector::from_array(axis), turned(Vector::from_array(axis), 5.0, 0.01, seed));
            let tip = Point::new(0.03, -0.04, 0.05);
            let refused = calibrate_axis(&poses, (Point::ORIGIN, tip));
            assert!(matches!(refused, Err(AxisError::NoSense { found, .. }) if found < 0.1), "{refused:?}");
            let found = calibrate_axis(&poses, (tip - axis * 150.0, tip)).expect("axis");
            assert!(found.axis.angle(axis) < 0.01, "{:?}", found.axis);
        }
    }

    #[test]
    fn the_tip_of_another_tool_was_taken_for_that_of_the_shaft() {
        let (axis, mut random) = (Vector::new(0.1, 0.2, -1.0), Random::new(9));
        // The shaft runs beside the markers, through `through`; the guide stands somewhere and lets it slide.
        let through = Vector::new(30.0, -20.0, -60.0);
        let moved = |m: Rigid<Tracker, Tool>| {
            let slide = m.vector(axis) * random.between(-5.0, 5.0) + m.vector(through) * -1.0;
            let shake = Vector::from_array(random.direction()) * 0.1;
            Rigid::from_quaternion(m.quaternion_wxyz(), Vector::new(100.0, 50.0, -900.0) + slide + shake).expect("pose")
        };
        let poses: Vec<_> = turned(axis, 4.0, 0.002, 8).into_iter().map(moved).collect();
        let unit = axis.normalized().expect("unit");
        let on = Point::ORIGIN + through + unit * 50.0;
        let hub = Point::ORIGIN + through - unit * 100.0;
        let found = calibrate_axis(&poses, (hub, on)).expect("on the shaft");
        assert!(found.axis.angle(axis) < 0.005, "{:?}", found.axis);
        let beside = on + Vector::new(25.0, 0.0, 2.5);
        match calibrate_axis(&poses, (hub, beside)) {
            Err(AxisError::BesideShaft { found, .. }) => {
                let off = beside - on;
                let expected = (off - unit * off.dot(unit)).norm();
                assert!((found - expected).abs() < 0.3, "{found} {expected}");
            }
            other => panic!("{other:?}"),
        }
    }

    /// Five seconds of turning at 60 Hz, each pose shaken by `shake` rad, `likeness` of it that of the pose before.
    fn shaken(axis: Vector<Tool>, shake: f64, likeness: f64, random: &mut Random) -> Vec<Rigid<Tracker, Tool>> {
        let (mut error, speed) = (Lasting::new(likeness), random.between(1.0, 3.0));
        let pose = |i: u32| {
            let own =
                Rigid::<Tool, Tool>::from_axis_angle(axis, 1.2 * (speed * f64::from(i) / 60.0).sin(), Vector::ZERO);
            let off = Vector::from_array(error.next(random)) * shake;
            let shake = Rigid::<Tracker, Tool>::from_axis_angle(off, off.norm(), Vector::ZERO);
            shake.expect("axis").after(&own.expect("axis"))
        };
        (0..300).map(pose).collect()
    }

    /// What a hand or a guide gives way by lasts for a while: axes were ten times as uncertain as they said.
    #[test]
    fn errors_that_last_make_the_axis_as_uncertain_as_it_is() {
        let (axis, mut random) = (Vector::new(0.05, 0.0, -1.0), Random::new(11));
        for likeness in [0.0, 0.8, 0.95] {
            let (mut actual, mut predicted) = (0.0, 0.0);
            for _ in 0..100 {
                let found = calibrate_axis(&shaken(axis, 0.01, likeness, &mut random), ENDS).expect("axis");
                actual += found.axis.angle(axis).powi(2);
                predicted += found.sigma.powi(2);
            }
            let ratio = (predicted / actual).sqrt();
            println!("likeness {likeness}: predicted / actual {ratio:.2}");
            assert!((0.75..1.3).contains(&ratio), "likeness {likeness}: predicted / actual {ratio}");
        }
    }

    #[test]
    fn little_turning_and_much_wobble_are_refused() {
        let axis = Vector::new(0.0, 0.0, -1.0);
        assert!(matches!(calibrate_axis(&turned(axis, 0.3, 0.0, 3), ENDS), Err(AxisError::TooLittleMotion { .. })));
        assert!(matches!(calibrate_axis(&turned(axis, 5.0, 0.2, 4), ENDS), Err(AxisError::Wobble { .. })));
        assert!(matches!(calibrate_axis(&[], ENDS), Err(AxisError::TooFew { .. })));
    }

    #[test]
    fn two_points_make_an_axis_unless_too_close() {
        let a = axis_through(Point::new(0.0, 0.0, 20.0), Point::new(0.0, 0.0, -80.0)).expect("axis");
        assert!((a - Vector::new(0.0, 0.0, -1.0)).norm() < 1e-12);
        assert_eq!(axis_through(TIP, TIP), Err(AxisError::TooClose(0.0)));
    }
}
