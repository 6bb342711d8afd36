//! The drawer phantom goes through the same segmentation as a head.

use monro_anatomy::phantom::{DrawerOptions, drawer};
use monro_anatomy::segment;
use monro_geometry::{Structure, Volume};

fn dice(a: &Volume<u8>, b: &Volume<u8>, s: Structure) -> f64 {
    let is = |v: &u8| usize::from(*v == s.label());
    let both: usize = a.data().iter().zip(b.data()).map(|(x, y)| is(x) * is(y)).sum();
    let all: usize = a.data().iter().chain(b.data()).map(is).sum();
    2.0 * both as f64 / all.max(1) as f64
}

#[test]
fn the_chambers_of_the_drawer_are_found_and_told_apart() {
    let made = drawer(&DrawerOptions { spacing_mm: [1.3, 1.3, 1.5], ..DrawerOptions::default() }).expect("phantom");
    let found = segment::segment(&made.ct).expect("segmentation");
    for s in [Structure::LeftLateralVentricle, Structure::RightLateralVentricle, Structure::Brain] {
        let d = dice(&made.labels, &found.labels, s);
        // What the project asks for on real scans; the chambers' square corners are rounded off.
        assert!(d > 0.80, "{s:?}: Dice {d:.2}");
    }
}
