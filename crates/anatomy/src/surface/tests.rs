use super::*;
use crate::phantom::{HeadModel, HeadOptions};
use monro_geometry::{Affine, Bvh, Grid, Matrix3, Patient, Point};
use proptest::prelude::*;

fn labels(grid: Grid, label: impl Fn(Point<Patient>) -> u8) -> Volume<u8> {
    let data = (0..grid.len()).map(|at| {
        let [i, j, k] = grid.voxel(at);
        label(grid.centre(i, j, k))
    });
    Volume::new(grid, data.collect()).expect("count")
}

/// An ellipsoid of half-axes 16, 12 and 14 mm.
fn ellipsoid(p: Point<Patient>) -> f64 {
    ((p.x / 16.0).powi(2) + (p.y / 12.0).powi(2) + (p.z / 14.0).powi(2)).sqrt()
}

fn check(surface: &Surface, volume_tolerance: f64) {
    let t = surface.topology;
    assert!(t.is_closed() && t.is_manifold() && t.is_oriented() && t.euler() == 2, "{t:?}");
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 16.0 * 12.0 * 14.0;
    let error = surface.mesh.signed_volume() / exact - 1.0;
    assert!(error.abs() < volume_tolerance, "volume error {error}");
}

#[test]
fn an_ellipsoid_in_thick_slices_is_smooth_and_whole() {
    let grid = Grid::axis_aligned([100, 80, 18], [0.4, 0.4, 2.0], [-20.0, -16.0, -17.3]).expect("grid");
    let s = label_surface(&labels(grid, |p| u8::from(ellipsoid(p) < 1.0)), |l| l == 1, &SurfaceOptions::default())
        .expect("surface");
    check(&s, 0.02);
    assert!(!s.open_at_border);
    // First-order distance (f - 1) / |grad f|; the slices are 2 mm apart.
    let distance = |p: &Point<Patient>| {
        let f = ellipsoid(*p);
        let g = [p.x / 256.0, p.y / 144.0, p.z / 196.0].map(|x| x / f);
        (f - 1.0) / (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt()
    };
    let mean = s.mesh.vertices.iter().map(|p| distance(p).abs()).sum::<f64>() / s.mesh.vertices.len() as f64;
    let worst = s.mesh.vertices.iter().map(|p| distance(p).abs()).fold(0.0, f64::max);
    assert!(mean < 0.15 && worst < 1.0, "mean {mean} worst {worst}");
}

#[test]
fn a_rotated_and_mirrored_volume_gives_the_same_body() {
    let (c, s) = (0.6, 0.8);
    let linear = Matrix3 { rows: [[-0.7 * c, 0.7 * s, 0.0], [0.7 * s, 0.7 * c, 0.0], [0.0, 0.0, 0.7]] };
    let corner = linear.apply([30.0; 3]).map(|x| -x);
    let grid = Grid::new([61; 3], Affine::new(linear, corner)).expect("grid");
    let surface =
        label_surface(&labels(grid, |p| u8::from(ellipsoid(p) < 1.0)), |l| l == 1, &SurfaceOptions::default())
            .expect("surface");
    check(&surface, 0.01);
    assert!(Bvh::new(&surface.mesh).contains(Point::ORIGIN));
}

#[test]
fn a_body_cut_by_the_scan_is_capped_and_said_to_be() {
    let grid = Grid::axis_aligned([45, 45, 20], [1.0; 3], [-22.0, -22.0, 0.0]).expect("grid");
    let s = label_surface(&labels(grid, |p| u8::from(ellipsoid(p) < 1.0)), |l| l == 1, &SurfaceOptions::default())
        .expect("surface");
    assert!(s.open_at_border && s.topology.is_closed() && s.topology.is_manifold());
    // Half the ellipsoid plus half a voxel of its largest section below the first slice.
    let half = 2.0 / 3.0 * std::f64::consts::PI * 16.0 * 12.0 * 14.0 + 0.5 * std::f64::consts::PI * 16.0 * 12.0;
    assert!((s.mesh.signed_volume() / half - 1.0).abs() < 0.01);
}

#[test]
fn smoothing_moves_a_thin_horn_towards_its_truth() {
    // A ring of 25 mm, 6 mm thick: smoothing took its surface off by more than the steps of its voxels.
    let off = |p: Point<Patient>| (p.x.hypot(p.y) - 25.0).hypot(p.z) - 3.0;
    let grid = Grid::axis_aligned([70, 70, 14], [0.9, 0.9, 1.25], [-31.2, -30.9, -8.0]).expect("grid");
    let ring = labels(grid, |p| u8::from(off(p) < 0.0));
    let mean = |smoothing| {
        let options = SurfaceOptions { smoothing, ..SurfaceOptions::default() };
        let s = label_surface(&ring, |l| l == 1, &options).expect("surface");
        let sum: f64 = s.mesh.vertices.iter().map(|&p| off(p).abs()).sum();
        sum / s.mesh.vertices.len() as f64
    };
    let (steps, smooth) = (mean(Smoothing::None), mean(Smoothing::default()));
    assert!(smooth < 0.8 * steps, "{smooth} of {steps}");
}

#[test]
fn decimation_reaches_its_target_and_stays_closed() {
    let grid = Grid::axis_aligned([60; 3], [0.7; 3], [-20.6; 3]).expect("grid");
    let options = SurfaceOptions { target_triangles: Some(800), ..SurfaceOptions::default() };
    let s = label_surface(&labels(grid, |p| u8::from(ellipsoid(p) < 1.0)), |l| l == 1, &options).expect("surface");
    check(&s, 0.02);
    assert!(s.mesh.triangles.len() <= 800);
}

#[test]
fn nothing_to_see_is_an_error_with_the_count() {
    let grid = Grid::axis_aligned([4; 3], [1.0; 3], [0.0; 3]).expect("grid");
    let none = label_surface(&labels(grid, |_| 0), |l| l == 1, &SurfaceOptions::default());
    assert_eq!(none.unwrap_err(), SurfaceError::Empty { voxels: 64 });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn random_blobs_of_any_kind_are_closed_manifolds(data in proptest::collection::vec(0..2u8, 7 * 6 * 5), thick in 1.0..4.0f64) {
        let grid = Grid::axis_aligned([7, 6, 5], [1.0, 1.0, thick], [0.0; 3]).expect("grid");
        match label_surface(&Volume::new(grid, data).unwrap(), |l| l == 1, &SurfaceOptions::default()) {
            Ok(s) => {
                s.mesh.validate().unwrap();
                prop_assert!(s.topology.is_closed() && s.topology.is_manifold() && s.topology.is_oriented());
                prop_assert_eq!(s.crossings, 0);
            }
            Err(SurfaceError::Empty { .. } | SurfaceError::TooThin { .. }) => {}
        }
    }
}

/// What passes through itself is looked for by depth: rounding of coordinates far away, and lengths in metres or microns, must
/// not look like it.
#[test]
fn surfaces_of_a_phantom_do_not_pass_through_themselves_wherever_they_are() {
    let phantom = HeadModel::new(&HeadOptions::default());
    let grid = Grid::axis_aligned([110, 110, 90], [1.0; 3], [-55.0, -60.0, -40.0]).expect("grid");
    let field = Volume::new(
        grid,
        (0..grid.len())
            .map(|at| {
                let [i, j, k] = grid.voxel(at);
                -phantom.ventricle_distance(grid.centre(i, j, k)) as f32
            })
            .collect(),
    )
    .expect("count");
    let surface = isosurface(&field, 0.0);
    assert!(surface.triangles.len() > 20_000, "{}", surface.triangles.len());
    for (scale, away) in [(1.0, 0.0), (1.0, 1e6), (1e-3, 0.0), (1e-3, 1e4), (1e3, 0.0)] {
        let place = |p: &Point<Patient>| Point::from_array(p.to_array().map(|c| c * scale + away));
        let mesh = TriangleMesh { vertices: surface.vertices.iter().map(place).collect(), ..surface.clone() };
        let found = mesh.crossings();
        assert!(
            found.pairs.is_empty(),
            "{scale}, {away}: {} pairs, first at {:?}",
            found.pairs.len(),
            mesh.crossing_place(found.pairs[0])
        );
    }
}
