//! Synthetic truth, noise, and what must be refused.

use super::*;
use crate::Random;
use monro_geometry::{Point, Rigid, Tracker, Vector};

fn true_camera() -> Camera<Tracker> {
    let lens = Lens {
        focal: [1400.0, 1380.0],
        centre: [980.0, 530.0],
        radial: [-0.21, 0.07, 0.0],
        tangential: [0.0012, -0.0008],
    };
    let camera_from =
        Rigid::from_axis_angle(Vector::new(1.0, 0.2, -0.1), 1.8, Vector::new(40.0, -30.0, 20.0)).expect("axis");
    Camera { lens, camera_from }
}

/// Corners of boards of 7 by 5 squares (30 mm), tilted and at distances from 400 to 1000 mm, all over the picture.
fn corners(camera: &Camera<Tracker>, noise: f64, seed: u64) -> Vec<Correspondence<Tracker>> {
    let mut random = Random::new(seed);
    let mut all = Vec::new();
    for _ in 0..14 {
        let depth = random.between(400.0, 1000.0);
        let at = Vector::new(random.between(-0.45, 0.45) * depth, random.between(-0.25, 0.25) * depth, depth);
        let tilt = Vector::from_array(random.direction());
        let board = Rigid::<CameraFrame, Tracker>::from_axis_angle(tilt, random.between(-0.6, 0.6), at).expect("axis");
        for (i, j) in (0..7).flat_map(|i| (0..5).map(move |j| (i, j))) {
            let p = board.point(Point::new(30.0 * f64::from(i) - 90.0, 30.0 * f64::from(j) - 60.0, 0.0));
            let Some(pixel) = camera.lens.project(p) else { continue };
            if (0.0..1920.0).contains(&pixel[0]) && (0.0..1080.0).contains(&pixel[1]) {
                let pixel = [pixel[0] + noise * random.normal(), pixel[1] + noise * random.normal()];
                all.push(Correspondence { point: camera.camera_from.inverse().point(p), pixel });
            }
        }
    }
    all
}

#[test]
fn exact_corners_give_the_exact_camera() {
    let camera = true_camera();
    let c = calibrate_camera(&corners(&camera, 0.0, 1), &CameraOptions::new(1920, 1080)).expect("camera");
    assert!(c.residual < 1e-6, "{}", c.residual);
    let found = c.camera.lens;
    assert!((found.focal[0] - 1400.0).abs() < 1e-3 && (found.focal[1] - 1380.0).abs() < 1e-3);
    assert!((found.radial[0] + 0.21).abs() < 1e-5 && (found.tangential[0] - 0.0012).abs() < 1e-6);
    assert!(c.camera.camera_from.after(&camera.camera_from.inverse()).angle() < 1e-6);
}

#[test]
fn noisy_corners_give_the_camera_within_its_stated_error() {
    let camera = true_camera();
    let n = 10;
    for seed in 2..2 + n {
        let c = calibrate_camera(&corners(&camera, 0.3, seed), &CameraOptions::new(1920, 1080)).expect("camera");
        // 0.3 pixels in each of two directions.
        assert!((0.35..0.50).contains(&c.residual), "{}", c.residual);
        for a in 0..2 {
            let (off, sigma) = (c.camera.lens.focal[a] - camera.lens.focal[a], c.focal_sigma[a]);
            assert!(off.abs() < 4.0 * sigma && sigma < 5.0, "seed {seed}: {off} {sigma}");
        }
    }
}

#[test]
fn a_single_board_few_corners_and_a_corner_of_the_picture_are_refused() {
    let camera = true_camera();
    let all = corners(&camera, 0.1, 3);
    let options = CameraOptions::new(1920, 1080);
    let lax = CameraOptions { coverage: 0.0, ..options };
    assert_eq!(calibrate_camera(&all[..20], &lax), Err(CameraError::Undetermined));
    let mut random = Random::new(33);
    let mut tracked = all[..20].to_vec();
    tracked.iter_mut().for_each(|c| c.point += Vector::from_array(random.normal3()) * 0.3);
    assert_eq!(calibrate_camera(&tracked, &lax), Err(CameraError::Undetermined));
    assert!(matches!(calibrate_camera(&all[..5], &options), Err(CameraError::TooFew { .. })));
    let left: Vec<_> = all.iter().copied().filter(|c| c.pixel[0] < 500.0).collect();
    assert!(matches!(calibrate_camera(&left, &options), Err(CameraError::Coverage { .. })));
    let mut shuffled = all.clone();
    let n = shuffled.len();
    for i in 0..n {
        shuffled[i].pixel = all[(i + 7) % n].pixel;
    }
    let e = calibrate_camera(&shuffled, &options).expect_err("wrong order");
    assert!(matches!(e, CameraError::Residual { .. } | CameraError::Undetermined), "{e}");
    let mut broken = all;
    broken[4].pixel[0] = f64::NAN;
    assert_eq!(calibrate_camera(&broken, &options), Err(CameraError::NotFinite(4)));
}

/// Twelve alignments were refused, and the same twelve three times over gave an eye 20 mm off without a word.
#[test]
fn a_line_that_comes_again_is_refused_with_both_places() {
    let all = corners(&true_camera(), 0.1, 6);
    let again = [&all[..], &all[7..8]].concat();
    let repeated = CameraError::Repeated { first: 7, second: all.len() };
    assert_eq!(calibrate_camera(&again, &CameraOptions::new(1920, 1080)), Err(repeated.clone()));
    assert_eq!(calibrate_display(&again, 5.0), Err(repeated));
}

/// Metres, rows counted upwards and pixels of another picture used to be calibrated, or refused for another reason.
#[test]
fn metres_mirrored_pictures_and_wrong_sizes_are_told_so() {
    let mut camera = true_camera();
    (camera.lens.radial, camera.lens.tangential) = ([0.0; 3], [0.0; 2]);
    let (all, options) = (corners(&camera, 0.1, 6), CameraOptions::new(1920, 1080));
    let metres: Vec<_> = all
        .iter()
        .map(|c| Correspondence { point: Point::from_array(c.point.to_array().map(|v| v / 1000.0)), ..*c })
        .collect();
    assert!(matches!(calibrate_camera(&metres, &options), Err(CameraError::Unit(_))));
    assert!(matches!(calibrate_display(&metres, 5.0), Err(CameraError::Unit(_))));
    let upwards: Vec<_> =
        all.iter().map(|c| Correspondence { pixel: [c.pixel[0], 1080.0 - c.pixel[1]], ..*c }).collect();
    assert_eq!(calibrate_camera(&upwards, &options), Err(CameraError::Behind));
    assert_eq!(calibrate_display(&upwards[..60], 5.0), Err(CameraError::Behind));
    assert!(matches!(calibrate_camera(&all, &CameraOptions::new(640, 480)), Err(CameraError::Outside { .. })));
}

#[test]
fn the_display_knows_how_well_it_is_known_and_a_corner_of_it_is_refused() {
    let mut camera = true_camera();
    (camera.lens.radial, camera.lens.tangential) = ([0.0; 3], [0.0; 2]);
    let (mut off, mut sigma) = (0.0, 0.0);
    for seed in 0..10 {
        let noisy: Vec<_> = corners(&camera, 1.0, seed).into_iter().step_by(7).collect();
        let d = calibrate_display(&noisy, 6.0).expect("display");
        off += (d.intrinsics[2] - camera.lens.centre[0]).powi(2);
        sigma += d.intrinsics_sigma[2].powi(2);
    }
    assert!((0.4..2.5).contains(&(sigma / off).sqrt()), "told {sigma}, was {off}");
    let near = |c: &Correspondence<_>| (c.pixel[0] - 960.0).abs() < 150.0 && (c.pixel[1] - 540.0).abs() < 100.0;
    let corner: Vec<_> = corners(&camera, 2.0, 8).into_iter().filter(near).take(20).collect();
    let e = calibrate_display(&corner, 10.0).expect_err("a small part");
    assert!(matches!(e, CameraError::Uncertain { .. } | CameraError::Undetermined), "{e}");
}

#[test]
fn the_display_frame_looks_along_minus_z_with_y_up() {
    let camera = true_camera();
    let ahead = camera.camera_from.inverse().point(Point::new(1.0, 2.0, 100.0));
    assert!(camera.display_from().point(ahead).distance(Point::new(1.0, -2.0, -100.0)) < 1e-9);
    assert!(camera.project(camera.camera_from.inverse().point(Point::new(0.0, 0.0, -5.0))).is_none());
}

#[test]
fn alignments_calibrate_a_see_through_display() {
    let mut camera = true_camera();
    (camera.lens.radial, camera.lens.tangential) = ([0.0; 3], [0.0; 2]);
    let exact = corners(&camera, 0.0, 4);
    let few: Vec<_> = exact.iter().copied().step_by(23).collect();
    let d = calibrate_display(&few, 1.0).expect("display");
    assert!(d.residual < 1e-6 && (d.intrinsics[0] - 1400.0).abs() < 1e-3);
    let eye = d.display_from.inverse().point(Point::ORIGIN);
    assert!(eye.distance(camera.camera_from.inverse().point(Point::ORIGIN)) < 1e-3);
    // A head is held still to some two pixels.
    let noisy: Vec<_> = corners(&camera, 2.0, 5).into_iter().step_by(11).collect();
    let d = calibrate_display(&noisy, 6.0).expect("display");
    let worst = exact
        .iter()
        .filter_map(|c| d.project(c.point).map(|p| (p[0] - c.pixel[0]).hypot(p[1] - c.pixel[1])))
        .fold(0.0, f64::max);
    assert!(worst < 12.0, "{worst}");
    assert!(matches!(calibrate_display(&noisy, 0.1), Err(CameraError::Residual { .. })));
    assert!(matches!(calibrate_display(&few[..6], 1.0), Err(CameraError::TooFew { found: 6, needed: 12 })));
}
