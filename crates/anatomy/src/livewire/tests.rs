//! Whole sessions on images whose edges are known.

use super::*;
use monro_geometry::{Grid, Volume};
use proptest::prelude::*;

/// Repeatable noise of unit variance (sum of twelve uniforms).
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A dark ellipse (5 HU) in brain (35 HU), each pixel the mean of its area (8 x 8 samples), plus noise.
fn ellipse(size: usize, centre: [f64; 2], axes: [f64; 2], noise_hu: f64) -> SliceImage {
    let mut noise = Noise(7);
    let inside = |x: f64, y: f64| ((x - centre[0]) / axes[0]).powi(2) + ((y - centre[1]) / axes[1]).powi(2) < 1.0;
    let mut data = Vec::new();
    for y in 0..size {
        for x in 0..size {
            let sub = |s: usize| (s as f64 + 0.5) / 8.0 - 0.5;
            let hits = (0..64).filter(|s| inside(x as f64 + sub(s % 8), y as f64 + sub(s / 8))).count();
            data.push((35.0 - 30.0 * hits as f64 / 64.0 + noise_hu * noise.normal()) as f32);
        }
    }
    SliceImage::new(size, size, [0.45, 0.45], data).expect("image")
}

fn on_ellipse(centre: [f64; 2], axes: [f64; 2], turn: f64) -> [f64; 2] {
    let (sin, cos) = (turn * core::f64::consts::TAU).sin_cos();
    [centre[0] + axes[0] * cos, centre[1] + axes[1] * sin]
}

fn draw(image: SliceImage, clicks: &[[f64; 2]]) -> Livewire {
    let mut wire = Livewire::new(image, LivewireOptions::default()).expect("wire");
    for &click in clicks {
        wire.click(click).expect("click");
    }
    wire.close().expect("close");
    wire
}

/// Mean and largest distance (pixels) from points of a contour to a finely sampled ellipse.
fn error(contour: &Contour, centre: [f64; 2], axes: [f64; 2]) -> (f64, f64) {
    let truth = Contour { points: (0..2000).map(|n| on_ellipse(centre, axes, f64::from(n) / 2000.0)).collect() };
    let all: Vec<f64> = contour.points.iter().map(|&p| truth.distance(p)).collect();
    (all.iter().sum::<f64>() / all.len() as f64, all.iter().copied().fold(0.0, f64::max))
}

#[test]
fn a_noiseless_circle_is_found_to_a_twentieth_of_a_pixel_at_any_radius() {
    for radius in [6.0, 10.0, 25.0] {
        let (centre, axes) = ([40.3, 39.6], [radius, radius]);
        let clicks = [0.1, 0.45, 0.8].map(|t| on_ellipse(centre, axes, t));
        let contour = draw(ellipse(80, centre, axes, 0.0), &clicks).contour().expect("contour");
        let (mean, most) = error(&contour, centre, axes);
        // Second order of the curvature shift at radius 6: (sigma / R)^2 sigma / 2 = 0.024 pixels, plus the grid.
        assert!(mean < 0.05 && most < 0.15, "radius {radius}: {mean} {most}");
        let area = contour.signed_area().abs() / (core::f64::consts::PI * radius * radius);
        assert!((area - 1.0).abs() < 0.1 / radius, "radius {radius}: area {area}");
    }
}

#[test]
fn a_noisy_ellipse_from_inexact_clicks_is_within_half_a_pixel() {
    let (centre, axes) = ([64.2, 63.1], [38.0, 19.0]);
    let clicks = [0.02, 0.36, 0.7].map(|t| {
        let p = on_ellipse(centre, axes, t);
        [p[0] + 1.3, p[1] - 0.9]
    });
    let contour = draw(ellipse(128, centre, axes, 9.0), &clicks).contour().expect("contour");
    let (mean, most) = error(&contour, centre, axes);
    assert!(mean < 0.3 && most < 1.5, "{mean} {most}");
}

#[test]
fn two_clicks_close_around_the_other_side() {
    let (centre, axes) = ([64.0, 64.0], [30.0, 22.0]);
    let clicks = [0.0, 0.5].map(|t| on_ellipse(centre, axes, t));
    let contour = draw(ellipse(128, centre, axes, 4.0), &clicks).contour().expect("contour");
    assert!(error(&contour, centre, axes).0 < 0.3);
    let filled = fill(&[contour], 128, 128).count() as f64;
    assert!((filled / (core::f64::consts::PI * 30.0 * 22.0) - 1.0).abs() < 0.03, "{filled}");
}

#[test]
fn the_wire_is_the_same_in_both_directions_in_cost() {
    let image = ellipse(64, [31.0, 33.0], [20.0, 14.0], 6.0);
    let features = features::Features::new(&image, &FeatureOptions::default()).expect("features");
    let links = links::Links::new(&features, &training::Training::untrained(), &Weights::default());
    for p in 0..links.cost.len() {
        for d in (0..8).filter(|&d| links.cost[p][d] > 0) {
            assert_eq!(links.cost[p][d], links.cost[links.step(p, d)][d ^ 4]);
        }
    }
}

#[test]
fn undo_takes_back_single_anchors_and_gives_back_the_same_wire() {
    let (centre, axes) = ([64.0, 64.0], [38.0, 19.0]);
    let mouse = on_ellipse(centre, axes, 0.8);
    let mut wire = Livewire::new(ellipse(128, centre, axes, 9.0), LivewireOptions::default()).expect("wire");
    let mut seen = Vec::new();
    for t in [0.0, 0.3, 0.6] {
        wire.click(on_ellipse(centre, axes, t)).expect("click");
        seen.push((wire.hover(mouse, 0.0).expect("hover"), wire.fixed()));
    }
    wire.close().expect("close");
    let contour = wire.contour().expect("contour");
    assert!(matches!(wire.hover(mouse, 0.0), Err(LivewireError::Closed)));
    while let Some((hover, fixed)) = seen.pop() {
        assert!(wire.undo());
        assert_eq!((wire.hover(mouse, 0.0).expect("hover"), wire.fixed()), (hover, fixed));
    }
    assert!(wire.undo() && !wire.undo() && wire.anchors().is_empty());
    assert!(matches!(wire.hover(mouse, 0.0), Err(LivewireError::NotStarted)));
    while wire.redo() {}
    assert_eq!(wire.contour().expect("contour"), contour);
}

#[test]
fn an_anchor_moves_with_both_its_wires_and_moving_can_be_undone() {
    let (centre, axes) = ([64.0, 64.0], [38.0, 19.0]);
    let mut wire = draw(ellipse(128, centre, axes, 4.0), &[0.0, 0.3, 0.6].map(|t| on_ellipse(centre, axes, t)));
    let before = wire.fixed();
    let moved = wire.move_anchor(0, on_ellipse(centre, axes, 0.9)).expect("move");
    assert_eq!(wire.anchors()[0], moved);
    assert!(wire.fixed().contains(&moved.pixel));
    assert!(error(&wire.contour().expect("contour"), centre, axes).0 < 0.3);
    assert!(wire.undo());
    assert_eq!(wire.fixed(), before);
    assert!(matches!(wire.move_anchor(3, [1.0, 1.0]), Err(LivewireError::NoAnchor { index: 3, count: 3 })));
}

#[test]
fn a_stable_wire_cools_into_an_anchor_that_undo_takes_back() {
    let (centre, axes) = ([64.0, 64.0], [40.0, 30.0]);
    let options = LivewireOptions { cooling: Some(Cooling::default()), ..LivewireOptions::default() };
    let mut wire = Livewire::new(ellipse(128, centre, axes, 2.0), options).expect("wire");
    wire.click(on_ellipse(centre, axes, 0.0)).expect("click");
    for n in 0..60 {
        wire.hover(on_ellipse(centre, axes, 0.2 + 0.002 * f64::from(n)), 0.05 * f64::from(n)).expect("hover");
    }
    let cooled = wire.anchors().iter().filter(|a| a.origin == Origin::Cooled).count();
    assert!(cooled >= 1, "{:?}", wire.anchors());
    let count = wire.anchors().len();
    assert!(wire.undo());
    assert_eq!(wire.anchors().len(), count - 1);
}

#[test]
fn training_keeps_the_wire_on_a_weak_edge_beside_a_strong_one() {
    // A weak edge (row 30, 12 HU) eight pixels above a strong one (row 38, 60 HU).
    let data: Vec<f32> = (0..100 * 64)
        .map(|n| match n / 100 {
            0..30 => 8.0,
            30..38 => 20.0,
            _ => 80.0,
        })
        .collect();
    let image = SliceImage::new(100, 64, [1.0, 1.0], data).expect("image");
    let options = LivewireOptions { snap_radius: 1.5, ..LivewireOptions::default() };
    let strayed = |training_pixels: usize| {
        let options = LivewireOptions { training_pixels, ..options };
        let mut wire = Livewire::new(image.clone(), options).expect("wire");
        wire.click([2.0, 30.0]).expect("click");
        wire.click([22.0, 30.0]).expect("click");
        let path = wire.hover([97.0, 30.0], 0.0).expect("hover");
        path.iter().filter(|p| p[1].abs_diff(30) > 2).count()
    };
    assert!(strayed(0) > 30, "without training the wire should jump: {}", strayed(0));
    assert_eq!(strayed(64), 0);
}

#[test]
fn the_contour_is_carried_to_the_next_slice_and_fits_there() {
    let (centre, axes) = ([64.0, 64.0], [34.0, 20.0]);
    let wire = draw(ellipse(128, centre, axes, 5.0), &[0.0, 0.3, 0.6].map(|t| on_ellipse(centre, axes, t)));
    let smaller = [32.0, 18.5];
    let next = wire.carry_to(ellipse(128, [64.8, 64.0], smaller, 5.0)).expect("carry");
    assert!(error(&next.contour().expect("contour"), [64.8, 64.0], smaller).0 < 0.3);
    let other = SliceImage::new(3, 3, [1.0, 1.0], vec![0.0; 9]).expect("image");
    assert!(matches!(wire.carry_to(other), Err(LivewireError::MaskSize { .. })));
}

#[test]
fn a_click_on_slices_of_thick_planes_was_drawn_to_an_edge_eight_millimetres_away() {
    // Fluid above row 20 and left of column 30, on pixels of 0.4 x 2 mm: four pixels reach 1.6 mm or 8 mm.
    let data = (0..60 * 40).map(|n| if n / 60 < 20 || n % 60 < 30 { 5.0 } else { 32.0 }).collect();
    let image = SliceImage::new(60, 40, [0.4, 2.0], data).expect("image");
    let mut wire = Livewire::new(image, LivewireOptions::default()).expect("wire");
    for at in [[50.0, 23.0], [50.3, 17.4], [28.0, 30.0], [33.2, 30.4]] {
        let [x, y] = wire.snap(at).expect("inside").map(|v| v as f64);
        let off = (0.4 * (x - at[0])).hypot(2.0 * (y - at[1]));
        assert!(off <= 1.6, "{at:?} goes to ({x}, {y}), {off} mm away");
    }
    // Along the thin side the edge is within reach.
    let [x, _] = wire.snap([33.0, 30.0]).expect("inside");
    assert!(x < 32, "{x}");
    for at in [[50.0, 20.0], [30.0, 30.0], [40.0, 30.0]] {
        wire.click(at).expect("click");
    }
    let [x, y] = wire.anchors()[0].pixel.map(|v| v as f64);
    assert!(wire.would_close([x + 3.0, y]) && wire.would_close([x, y + 0.5]));
    assert!(!wire.would_close([x, y + 2.0]) && !wire.would_close([x + 5.0, y]));
    // Without a snap, the first pixel itself closes.
    let image = SliceImage::new(9, 9, [0.4, 2.0], vec![5.0; 81]).expect("image");
    let mut wire = Livewire::new(image, LivewireOptions { snap_radius: 0.0, ..Default::default() }).expect("wire");
    for at in [[1.0, 1.0], [7.0, 7.0]] {
        wire.click(at).expect("click");
    }
    assert!(wire.would_close([1.4, 1.4]) && !wire.would_close([1.0, 1.6]));
}

#[test]
fn one_pixel_flat_and_line_images_work_as_far_as_they_can() {
    for (w, h) in [(1, 1), (1, 9), (9, 1), (2, 2)] {
        let image = SliceImage::new(w, h, [1.0, 2.0], vec![5.0; w * h]).expect("image");
        let mut wire = Livewire::new(image, LivewireOptions::default()).expect("wire");
        wire.click([0.0, 0.0]).expect("click");
        let path = wire.hover([(w - 1) as f64, (h - 1) as f64], 0.0).expect("hover");
        assert_eq!(path.len(), w.max(h));
        wire.click([(w - 1) as f64, (h - 1) as f64]).expect("click");
        assert!(wire.close().and_then(|()| wire.contour().map(|_| ())).is_err());
    }
}

#[test]
fn bad_images_and_clicks_are_refused_by_name() {
    let image = |data: Vec<f32>| SliceImage::new(2, 2, [1.0, 1.0], data);
    assert!(matches!(image(vec![0.0; 3]), Err(LivewireError::Size { values: 3, .. })));
    let nan = image(vec![0.0, f32::NAN, 0.0, f32::INFINITY]);
    assert_eq!(nan, Err(LivewireError::NotFinite { count: 2, column: 1, row: 0 }));
    assert!(matches!(SliceImage::new(1, 1, [0.0, 1.0], vec![0.0]), Err(LivewireError::Option { .. })));
    assert!(matches!(SliceImage::new(0, 0, [1.0, 1.0], vec![]), Err(LivewireError::Size { .. })));
    let mut wire = Livewire::new(image(vec![0.0; 4]).expect("image"), LivewireOptions::default()).expect("wire");
    assert!(matches!(wire.close(), Err(LivewireError::NotStarted)));
    for p in [[-1.0, 0.0], [0.0, 1.5], [f64::NAN, 0.0], [f64::INFINITY, 0.0]] {
        assert!(matches!(wire.click(p), Err(LivewireError::Outside { .. })), "{p:?}");
    }
    let flat = LivewireOptions {
        weights: Weights { length: 0.0, gradient: f64::NAN, ..Weights::default() },
        ..LivewireOptions::default()
    };
    assert!(Livewire::new(image(vec![0.0; 4]).expect("image"), flat).is_err());
}

#[test]
fn slices_of_all_three_directions_come_out() {
    let grid = Grid::axis_aligned([4, 5, 6], [0.5, 1.0, 2.0], [0.0; 3]).expect("grid");
    let volume = Volume::new(grid, (0..120).collect::<Vec<i16>>()).expect("volume");
    for axis in Axis::ALL {
        let slice = SliceImage::of(&volume, axis, 2).expect("slice");
        let [c, r] = axis.in_plane();
        assert_eq!([slice.width(), slice.height()], [grid.dims()[c], grid.dims()[r]]);
        assert_eq!(slice.spacing(), [grid.spacing()[c], grid.spacing()[r]]);
        let [i, j, k] = axis.voxel(2, 1, 3);
        assert!((slice.data()[3 * slice.width() + 1] - f32::from(volume.at(i, j, k))).abs() < 1e-6);
        let last = grid.dims()[axis.number()] - 1;
        assert_eq!(SliceImage::of(&volume, axis, 9), Err(LivewireError::Slice { index: 9, last }));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Any order of clicks, moves, undo and redo on noise neither panics nor loses the way back.
    #[test]
    fn random_sessions_can_always_be_undone_to_nothing(
        steps in proptest::collection::vec((0u8..6, 0.0..24.0f64, 0.0..20.0f64), 1..25),
    ) {
        let mut noise = Noise(3);
        let data = (0..24 * 20).map(|_| (40.0 + 15.0 * noise.normal()) as f32).collect();
        let image = SliceImage::new(24, 20, [0.7, 1.1], data).expect("image");
        let mut wire = Livewire::new(image, LivewireOptions::default()).expect("wire");
        for (step, x, y) in steps {
            match step {
                0 | 1 => drop(wire.click([x, y])),
                2 => drop(wire.hover([x, y], x)),
                3 => drop(wire.move_anchor(y as usize % 4, [x, y])),
                4 => drop(wire.close()),
                _ => drop(wire.undo()),
            }
            for pair in wire.fixed().windows(2) {
                prop_assert!(pair[0][0].abs_diff(pair[1][0]) <= 1 && pair[0][1].abs_diff(pair[1][1]) <= 1);
            }
            drop(wire.contour());
        }
        while wire.undo() {}
        prop_assert!(wire.anchors().is_empty() && wire.fixed().is_empty());
    }
}
